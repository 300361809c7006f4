//! The n-th failure of a headset session: whichever call of the driver fails, the session ends with an error of
//! the documented kind, and nothing is left of it.
#![forbid(unsafe_code)]

mod support;

use std::sync::atomic::AtomicBool;

use engine::gpu::{Call, Failure, Fault, Gpu, GpuOptions, MessageLog};
use engine::{Kind, Result};
use support::{options, script, try_scene};
use xr_app::headset::simulated::Simulated;
use xr_app::viewer::{Options, Viewer};

/// Runs a session of a few frames, with its panel, on a device with a fault.
fn session(fault: &Fault, messages: &MessageLog) -> Result<()> {
    let gpu = Gpu::new(&GpuOptions {
        validation: true,
        fault: Some(fault.clone()),
        messages: messages.clone(),
        ..GpuOptions::default()
    })?;
    let done = show(&gpu);
    let left = gpu.memory_by_purpose();
    assert!(left.values().all(|&bytes| bytes == 0), "left: {left:?}");
    done
}

fn show(gpu: &Gpu) -> Result<()> {
    let mut headset = Simulated::new(gpu, script(4))?;
    let options = Options { panel: true, ..options() };
    let mut viewer = Viewer::new(gpu, try_scene(gpu)?, &headset, options)?;
    viewer.run(&mut headset, &AtomicBool::new(false))
}

#[test]
fn a_session_ends_with_an_error_whatever_fails() {
    for (call, failure, kind, codes, stride) in [
        (Call::Submit, Failure::Lost, Kind::Temporary, &["VGS-GPU-012"][..], 11),
        (Call::Wait, Failure::Lost, Kind::Temporary, &["VGS-GPU-012"], 23),
        (Call::Memory, Failure::DeviceMemory, Kind::Temporary, &["VGS-GPU-024"], 15),
        (Call::Object, Failure::HostMemory, Kind::HostMemory, &["VGS-GPU-011"], 71),
    ] {
        let (fault, messages) = (Fault::new(call, u64::MAX, failure), MessageLog::default());
        session(&fault, &messages).expect("nothing fails");
        assert_eq!(messages.all(), Vec::<String>::new());
        let calls = fault.calls();
        println!("{calls} of {call:?}");
        assert!(calls > 8, "{calls} of {call:?}");
        let mut refused = 0;
        for n in (1..=calls).step_by(stride) {
            let (fault, messages) = (Fault::new(call, n, failure), MessageLog::default());
            let what = format!("{call:?} {n} of {calls}");
            match session(&fault, &messages) {
                Err(error) => {
                    let is_right = error.kind == kind && codes.contains(&error.code);
                    assert!(is_right, "{what}: {}: {error}", error.code);
                    refused += 1;
                }
                // Memory that the host writes is taken from elsewhere.
                Ok(()) => assert_eq!(call, Call::Memory, "{what}: no error"),
            }
            assert_eq!(messages.all(), Vec::<String>::new(), "{what}");
        }
        assert!(2 * refused > calls as usize / stride, "{refused} errors in {calls} calls of {call:?}");
    }
}
