//! The program: reads the splats, starts a headset, shows them until the session ends, and writes the
//! measurements.

use std::path::Path;
#[cfg(not(target_os = "android"))]
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use engine::gpu::{Gpu, GpuOptions, Windows};
use engine::image::{self, Image, WriteOptions};
use engine::render::{self, Look, QualityLevel, Scene, SplatKind};
use engine::splat::{self, SplatSet};
use engine::{Error, Kind, Result, output, transfer};

use crate::arguments::HeadsetArguments;
use crate::headset::openxr::{OpenXr, OpenXrOptions};
use crate::headset::simulated::{Script, Simulated, rest};
use crate::headset::{Description, Headset};
use crate::memory;
#[cfg(not(target_os = "android"))]
use crate::mirror::Opened;
use crate::onlooker::Onlooker;
use crate::pointing::PickData;
use crate::statistics::SessionReport;
use crate::viewer::{Options, Viewer};

/// Runs the program, until the session ends or a signal ends it.
#[cfg(not(target_os = "android"))]
pub fn run(arguments: &HeadsetArguments) -> Result<()> {
    let prepared = prepare(arguments)?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second signal ends the program at once.
        let registered = signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)));
        registered.map_err(|e| Error::new(Kind::Internal, "VGS-XR-021", format!("signals: {e}")))?;
    }
    let window = arguments.mirror.map(Opened::new).transpose()?;
    let windows = window.as_ref().map(Opened::windows).transpose()?;
    session(arguments, prepared, windows, &stop, |gpu, about| {
        let mirror = window.map(|window| window.show(gpu, about.format, about.eye_size)).transpose()?;
        Ok(mirror.map(|mirror| Box::new(mirror) as Box<dyn Onlooker>))
    })
}

/// Returns the splats and their quality levels. Checks everything that can be checked before there is a
/// device.
pub(crate) fn prepare(arguments: &HeadsetArguments) -> Result<(SplatSet, Vec<QualityLevel>)> {
    for path in [&arguments.report, &arguments.picture].into_iter().flatten() {
        output::check_writable(path, arguments.force)?;
    }
    let set = splat::read_all(&arguments.splats, || Ok(None))?;
    let levels = levels(arguments, &set)?;
    Ok((set, levels))
}

/// Runs a session until it ends or `stop` is set. `windows` are those with which the device must be booted so
/// that `onlooker` can draw; `onlooker` creates the onlooker that is shown what the eyes see, if there is
/// one.
pub(crate) fn session(
    arguments: &HeadsetArguments,
    (set, levels): (SplatSet, Vec<QualityLevel>),
    windows: Option<Windows>,
    stop: &AtomicBool,
    onlooker: impl FnOnce(&Gpu, &Description) -> Result<Option<Box<dyn Onlooker>>>,
) -> Result<()> {
    let gpu_options = GpuOptions {
        device: arguments.device.clone(),
        validation: arguments.validation,
        windows,
        fault: arguments.fault.clone(),
        ..GpuOptions::default()
    };
    if arguments.simulated {
        let gpu = Gpu::new(&gpu_options)?;
        let script = Script::default();
        let script = Script {
            eye_size: script.eye_size.map(|n| ((f64::from(n) * arguments.resolution).round() as u32).max(1)),
            rate_hz: arguments.rate.unwrap_or(script.rate_hz),
            blend: arguments.blend.map_or(script.blend, Into::into),
            hands: rest,
            ..script
        };
        let mut headset = Simulated::new(&gpu, script)?;
        show(arguments, &gpu, set, levels, &mut headset, onlooker, stop)
    } else {
        let options = OpenXrOptions {
            blend: arguments.blend.map(Into::into),
            rate_hz: arguments.rate,
            resolution: Some(arguments.resolution),
        };
        let (gpu, mut headset) = OpenXr::start(&gpu_options, &options)?;
        show(arguments, &gpu, set, levels, &mut headset, onlooker, stop)
    }
}

/// Returns the quality levels of a set's splats.
fn levels(arguments: &HeadsetArguments, set: &SplatSet) -> Result<Vec<QualityLevel>> {
    let levels = render::quality_levels(SplatKind::of(set));
    match arguments.level {
        Some(level) if level >= levels.len() => {
            Err(Error::new(Kind::Usage, "VGS-XR-022", format!("--level {level}"))
                .help(format!("quality levels of these splats are 0 to {}", levels.len() - 1)))
        }
        _ => Ok(levels.to_vec()),
    }
}

fn show(
    arguments: &HeadsetArguments,
    gpu: &Gpu,
    mut set: SplatSet,
    levels: Vec<QualityLevel>,
    headset: &mut dyn Headset,
    onlooker: impl FnOnce(&Gpu, &Description) -> Result<Option<Box<dyn Onlooker>>>,
    stop: &AtomicBool,
) -> Result<()> {
    let range = set.intensity_range().unwrap_or_default();
    let look = Look::new(transfer::load(&arguments.tf, range)?);
    // Memory budgets keep the first splats.
    set.order_by_importance();
    let options = Options {
        level: arguments.level,
        levels,
        budget_ms: arguments.budget,
        background: [0.0; 3],
        frames: arguments.frames,
        panel: arguments.panel,
        foveation: arguments.foveation,
        pitch: 1.0,
        given_up: None,
        card: false,
        view: None,
    };
    let mut viewer = memory::within(gpu, arguments.memory_budget, set, |kept| {
        let scene = Scene::with_precision(gpu, Some(kept.set), None, &look, kept.precision)?;
        let options = Options { pitch: kept.pitch, given_up: kept.given_up.clone(), ..options.clone() };
        let mut viewer = Viewer::new(gpu, scene, headset, options)?;
        viewer.set_pick_data(PickData::of(kept.set));
        Ok(viewer)
    })?;
    if let Some(onlooker) = onlooker(gpu, headset.description())? {
        viewer.add_onlooker(onlooker);
    }
    announce(headset);
    let ended = viewer.run(headset, stop);
    // The measurements are reported however the session ended.
    let report = viewer.report(headset);
    print(&report);
    if let Some([shown, skipped]) = viewer.onlooker_counts() {
        println!("the window showed {shown} frames and had no picture for {skipped}");
    }
    if let Some(path) = &arguments.report {
        output::write_atomic(path, arguments.force, |w| {
            serde_json::to_writer_pretty(w, &report).map_err(Into::into)
        })?;
    }
    if let Some(path) = &arguments.picture {
        write_picture(path, &mut viewer, arguments.force)?;
    }
    ended?;
    let messages = gpu.validation_messages();
    if messages.is_empty() {
        return Ok(());
    }
    Err(Error::new(
        Kind::Internal,
        "VGS-XR-023",
        format!("the validation layers have {} messages:\n{}", messages.len(), messages.join("\n")),
    ))
}

fn announce(headset: &dyn Headset) {
    let about = headset.description();
    let [width, height] = about.eye_size;
    println!(
        "{} on {}: {width}x{height} pixels an eye, {:?} background",
        about.system, about.runtime, about.blend
    );
}

fn print(report: &SessionReport) {
    println!(
        "{} frames, {} missed, {} over the budget, {} changes of quality",
        report.frames, report.missed, report.over_budget, report.level_changes
    );
    for (what, found) in [("device time", report.gpu_ms), ("motion to photon", report.latency_ms)] {
        if let Some(d) = found {
            println!(
                "{what} / ms: 5 % {:.1}, median {:.1}, 95 % {:.1}, 99 % {:.1}, most {:.1}",
                d.p5, d.median, d.p95, d.p99, d.most
            );
        }
    }
    println!("scale {:.2}; 1 is real size", report.scale);
    for (purpose, bytes) in &report.device_bytes {
        println!("device memory for {purpose}: {:.1} MB", *bytes as f64 * 1e-6);
    }
}

/// Writes what both eyes saw last, side by side, over black.
fn write_picture(path: &Path, viewer: &mut Viewer, force: bool) -> Result<()> {
    let eyes = viewer.picture()?;
    let [width, height, _] = eyes.size().map(|n| n as usize);
    let texels = eyes.read::<[u8; 4]>()?;
    let eye = |at: usize| texels[at * width * height..][..width * height].chunks(width);
    let rows = eye(0).zip(eye(1)).flat_map(|(left, right)| left.iter().chain(right));
    let pixels = rows.map(|texel| texel.map(|byte| f32::from(byte) / 255.0)).collect();
    let both = Image { size: [2 * width, height], pixels };
    image::write(path, &both, None, &WriteOptions { background: Some([0.0; 3]), force })
}
