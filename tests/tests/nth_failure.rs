//! The n-th failure: whichever call of the driver fails, a fit and a frame of each mode end with an error of the
//! documented kind, nothing is left of them, and the device is as good as before unless it is lost.
#![forbid(unsafe_code)]

use std::ops::ControlFlow;

use engine::fit::{self, FitConfig};
use engine::gpu::{Call, Failure, Fault, Gpu, GpuOptions, MessageLog};
use engine::render::{MODES, Renderer, Scene, Settings, VolumeSource};
use engine::splat::{Kernel, Splat};
use engine::{Kind, Result};
use vgs_tests::Device;
use vgs_tests::device::{assert_silent, with_validation};
use vgs_tests::fitting::Case;
use vgs_tests::rendering;

/// Something that is done on a device; the bits of its result.
type Work<'a> = dyn Fn(&Gpu) -> Result<Vec<u8>> + 'a;

/// Environment variable: set to 1, every call fails in turn, and none is left out.
const EVERY: &str = "VGS_EVERY_FAILURE";

/// Never reached by a count.
const NEVER: u64 = u64::MAX;

fn fit() -> impl Fn(&Gpu) -> Result<Vec<u8>> {
    let config = FitConfig::default().with(|c| {
        c.count.density = 0.1;
        c.iterations = 3;
        c.subset.size = 16;
    });
    let case = Case::ball(12, 4.0, config);
    move |gpu| {
        let set = fit::run(gpu, &case.volume, &case.roi, &case.config, |_| ControlFlow::Continue(()))?;
        Ok(bytemuck::cast_slice::<Splat, u8>(&set.splats).to_vec())
    }
}

fn frame(mode: &'static str) -> impl Fn(&Gpu) -> Result<Vec<u8>> {
    let set = rendering::set(40, Kernel::Compact);
    let case = Case::phantom([12; 3], 1);
    let look = rendering::look("CT-Bone", true);
    move |gpu| {
        let row = engine::render::mode(mode)?;
        let source = VolumeSource { volume: &case.volume, roi: Some(&case.roi) };
        let scene =
            Scene::new(gpu, row.of_splats.then_some(&set), (!row.of_splats).then_some(&source), &look)?;
        let settings = Settings { size: [24, 16], ..rendering::settings() };
        let mut renderer = Renderer::new(gpu, row, &scene, &settings)?;
        renderer.render(&scene, &[rendering::camera(&scene)])?;
        Ok(bytemuck::cast_slice::<[f32; 4], u8>(&renderer.target.read_colour(0)?).to_vec())
    }
}

/// Checks that work in which a call failed ended with an error of the documented kind. Memory that the host
/// writes is taken from elsewhere if there is none where it would be best; then all is well, and this returns
/// false.
fn is_refused(done: Result<Vec<u8>>, good: &[u8], call: Call, failure: Failure, what: &str) -> bool {
    let error = match done {
        Err(error) => error,
        Ok(found) => {
            assert!(call == Call::Memory && found == good, "{what}: no error");
            return false;
        }
    };
    let kind = if failure == Failure::HostMemory { Kind::HostMemory } else { Kind::Temporary };
    let codes: &[&str] = match failure {
        Failure::DeviceMemory => &["VGS-GPU-010", "VGS-GPU-024"],
        Failure::HostMemory => &["VGS-GPU-011"],
        _ => &["VGS-GPU-012"],
    };
    assert!(
        error.kind == kind && codes.contains(&error.code),
        "{what}: {:?} {}: {error}",
        error.kind,
        error.code
    );
    true
}

/// Returns the numbers of the calls that fail: every `stride`-th.
fn those_that_fail(calls: u64, stride: usize) -> std::iter::StepBy<std::ops::RangeInclusive<u64>> {
    let every = std::env::var_os(EVERY).is_some_and(|v| v == "1");
    (1..=calls).step_by(if every { 1 } else { stride })
}

/// Checks that nothing is left of what a device has held.
fn assert_empty(gpu: &Gpu, what: &str) {
    let left = gpu.memory_by_purpose();
    assert!(left.values().all(|&bytes| bytes == 0), "{what}: left {left:?}");
}

/// Lets calls of a kind fail in turn, every `stride`-th, on one device, which must be as good as before after
/// each. Returns the number of calls.
fn on_one_device(call: Call, failure: Failure, stride: usize, name: &str, work: &Work<'_>) -> u64 {
    let fault = Fault::new(call, NEVER, failure);
    let gpu = Device::boot_with(GpuOptions { fault: Some(fault.clone()), ..GpuOptions::default() });
    let good = work(&gpu).expect("nothing fails");
    fault.begin_anew(NEVER);
    assert!(work(&gpu).expect("nothing fails") == good, "{name}: the same again");
    let calls = fault.calls();
    let mut refused = 0;
    for n in those_that_fail(calls, stride) {
        let what = format!("{name}: {call:?} {n} of {calls}");
        fault.begin_anew(n);
        let done = work(&gpu);
        // On a busy machine long passes are cut into more or fewer submissions.
        if fault.calls() >= n {
            refused += usize::from(is_refused(done, &good, call, failure, &what));
        }
        assert_empty(&gpu, &what);
    }
    fault.begin_anew(NEVER);
    assert!(work(&gpu).expect("nothing fails") == good, "{name}: as good as before");
    assert!(2 * refused > calls as usize / stride, "{name}: {refused} errors in {calls} calls of {call:?}");
    calls
}

/// Lets calls of a kind fail in turn, every `stride`-th, each on a device of its own, from its creation on.
/// Returns the number of calls.
fn on_new_devices(call: Call, failure: Failure, stride: usize, name: &str, work: &Work<'_>) -> u64 {
    let attempt = |n| {
        let (fault, messages) = (Fault::new(call, n, failure), MessageLog::default());
        let options =
            GpuOptions { fault: Some(fault.clone()), messages: messages.clone(), ..GpuOptions::default() };
        let done = Gpu::new(&with_validation(options)).and_then(|gpu| {
            let done = work(&gpu);
            assert_empty(&gpu, name);
            done
        });
        // The device is gone, and the layers have told what was left of it.
        assert_silent(&messages);
        (done, fault.calls())
    };
    let (done, calls) = attempt(NEVER);
    let good = done.expect("nothing fails");
    for n in those_that_fail(calls, stride) {
        let what = format!("{name}: {call:?} {n} of {calls}");
        let (done, reached) = attempt(n);
        if reached >= n {
            is_refused(done, &good, call, failure, &what);
        }
    }
    calls
}

/// Does `test` with a fit and with a frame of each mode.
fn with_each(mut test: impl FnMut(&str, &Work<'_>)) {
    test("fit", &fit());
    for mode in &MODES {
        test(mode.name, &frame(mode.name));
    }
}

#[test]
fn device_memory_runs_out() {
    with_each(|name, work| {
        let stride = if name == "fit" { 1 } else { 4 };
        let calls = on_one_device(Call::Memory, Failure::DeviceMemory, stride, name, work);
        println!("{name}: {calls} allocations");
        assert!(calls > 10, "{name}: {calls} allocations");
    });
}

#[test]
fn host_memory_runs_out() {
    with_each(|name, work| {
        let calls = on_one_device(Call::Object, Failure::HostMemory, 11, name, work);
        println!("{name}: {calls} objects");
        assert!(calls > 30, "{name}: {calls} objects");
        on_one_device(Call::Memory, Failure::HostMemory, 17, name, work);
        on_one_device(Call::Submit, Failure::HostMemory, 17, name, work);
    });
}

#[test]
fn a_device_fails_while_it_starts() {
    with_each(|name, work| {
        let calls = on_new_devices(Call::Object, Failure::HostMemory, 31, name, work);
        println!("{name}: {calls} objects from the start on");
    });
    let nothing = |_: &Gpu| Ok(vec![]);
    assert!(on_new_devices(Call::Object, Failure::HostMemory, 1, "boot", &nothing) >= 3);
}

#[test]
fn a_device_is_lost() {
    with_each(|name, work| {
        for call in [Call::Submit, Call::Wait] {
            let calls = on_new_devices(call, Failure::Lost, 11, name, work);
            println!("{name}: {calls} of {call:?}");
            // An upload is submitted and not waited for: there are more submissions than waits.
            let least = if call == Call::Submit { 5 } else { 2 };
            assert!(calls > least, "{name}: {calls} of {call:?}");
        }
    });
}
