//! What the program is told on its command line, and what it does with that.

use std::path::{Path, PathBuf};
#[cfg(not(target_os = "android"))]
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Parser, ValueEnum};
use engine::gpu::{Gpu, GpuOptions, Windows};
use engine::image::{self, Image, WriteOptions};
use engine::render::{self, Look, Rung, Scene, SplatKind};
use engine::splat::{self, SplatSet};
use engine::{Error, Kind, Result, output, transfer};

use crate::headset::openxr::{OpenXr, OpenXrOptions};
use crate::headset::simulated::{Script, Simulated};
use crate::headset::{Blend, Description, Headset};
use crate::memory;
#[cfg(not(target_os = "android"))]
use crate::mirror::{Opened, Shown};
use crate::onlooker::Onlooker;
use crate::pointing::Known;
use crate::statistics::Report;
use crate::viewer::{Options, Viewer};

/// Shows splats in a headset, through OpenXR
#[derive(Parser, Debug)]
#[command(name = "vgs-xr", version, after_help = EXAMPLES)]
pub struct Arguments {
    /// The splats (PLY); several files become one scene
    #[arg(required = true)]
    pub splats: Vec<PathBuf>,
    /// Transfer function: a preset, a file, or window:WIDTH,LEVEL
    #[arg(long, value_name = "PRESET|FILE", default_value = "CT-Bone")]
    pub tf: String,
    /// The same without a headset: poses and clock follow a script
    #[arg(long)]
    pub simulated: bool,
    /// Ends after so many frames
    #[arg(long, value_name = "N")]
    pub frames: Option<u64>,
    /// What is behind the picture: the headset's first choice by default
    #[arg(long, value_enum)]
    pub blend: Option<Behind>,
    /// Frames a second, where the headset leaves the choice
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Edges of the eyes' pictures, as a part of what the headset recommends
    #[arg(long, value_name = "PART", default_value_t = 1.0, value_parser = part)]
    pub resolution: f64,
    /// Renders all that the eyes see at fewer pixels and its middle at all of them, in pictures whose edges are such a part of
    /// the eyes': 0.5 renders less than half of the pixels
    #[arg(long, value_name = "PART", value_parser = inset)]
    pub foveation: Option<f64>,
    /// Device time that a frame may take; 9/10 of the display's period by default
    #[arg(long, value_name = "MS", value_parser = positive)]
    pub budget: Option<f64>,
    /// Stays on a rung of the ladder of qualities, 0 the best, instead of keeping to the budget
    #[arg(long, value_name = "N")]
    pub rung: Option<usize>,
    /// Device memory that may be used, MiB: splats are packed, and if need be only the most important ones are shown
    #[arg(long, value_name = "MIB", value_parser = positive)]
    pub memory_budget: Option<f64>,
    /// Shows the panel from the start
    #[arg(long)]
    pub panel: bool,
    /// Shows what the eyes see in a window, too
    #[cfg(not(target_os = "android"))]
    #[arg(long, value_name = "EYES", value_enum, num_args = 0..=1, require_equals = true, default_missing_value = "both")]
    pub mirror: Option<Shown>,
    /// Writes what was measured (JSON)
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Writes what the left and the right eye saw last, side by side
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// Replaces files
    #[arg(long)]
    pub force: bool,
    /// Device by index or part of its name, for --simulated; a headset is bound to its own
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Turns on the validation layers of Vulkan, and fails if they have anything to say
    #[arg(long)]
    pub validation: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs-xr bones.ply
  vgs-xr body.ply --tf CT-Soft-Tissue --blend alpha
  vgs-xr bones.ply --simulated --frames 300 --report session.json --picture eyes.png
  tools/monado cargo run -p vgs-xr -- bones.ply --frames 200

Hands: grab with one to move, with both to scale and turn. Right thumbstick: up and down the level, sideways the
width of the window. First button: next preset (right), last preset (left). Second button: a cutting plane in the
hand (right), everything back (left). Thumbstick pressed: the panel, on which the trigger clicks; with its button
Measure the trigger places ends of distances where the ray meets the patient.

For looking, not for diagnosis.";

/// What is behind the picture.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Behind {
    /// A background
    Opaque,
    /// The room, to which the picture is added
    Additive,
    /// The room, where the picture is transparent
    Alpha,
}

impl From<Behind> for Blend {
    fn from(behind: Behind) -> Self {
        match behind {
            Behind::Opaque => Blend::Opaque,
            Behind::Additive => Blend::Additive,
            Behind::Alpha => Blend::Alpha,
        }
    }
}

fn part(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is needed")?;
    if (0.05..=2.0).contains(&value) { Ok(value) } else { Err("0.05 to 2".into()) }
}

fn inset(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is needed")?;
    if (0.1..=0.9).contains(&value) { Ok(value) } else { Err("0.1 to 0.9".into()) }
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is needed")?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("a number above 0 is needed".into()) }
}

/// Runs the program, until the session ends or a signal ends it.
#[cfg(not(target_os = "android"))]
pub fn run(arguments: &Arguments) -> Result<()> {
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

/// What there is to show, and the rungs on which it can be; everything that can be wrong before there is a device.
pub(crate) fn prepare(arguments: &Arguments) -> Result<(SplatSet, Vec<Rung>)> {
    for path in [&arguments.report, &arguments.picture].into_iter().flatten() {
        output::check_writable(path, arguments.force)?;
    }
    let set = splat::read_all(&arguments.splats, || Ok(None))?;
    let rungs = rungs(arguments, &set)?;
    Ok((set, rungs))
}

/// A session, until it ends or `stop` is set. `windows` is what the device must know to draw in that of `onlooker`, which makes
/// who is shown what the eyes see, if anybody is.
pub(crate) fn session(
    arguments: &Arguments,
    (set, rungs): (SplatSet, Vec<Rung>),
    windows: Option<Windows>,
    stop: &AtomicBool,
    onlooker: impl FnOnce(&Gpu, &Description) -> Result<Option<Box<dyn Onlooker>>>,
) -> Result<()> {
    let gpu_options = GpuOptions {
        device: arguments.device.clone(),
        validation: arguments.validation,
        windows,
        ..GpuOptions::default()
    };
    if arguments.simulated {
        let gpu = Gpu::new(&gpu_options)?;
        let script = Script::default();
        let script = Script {
            eye_size: script.eye_size.map(|n| ((f64::from(n) * arguments.resolution).round() as u32).max(1)),
            rate_hz: arguments.rate.unwrap_or(script.rate_hz),
            blend: arguments.blend.map_or(script.blend, Into::into),
            ..script
        };
        let mut headset = Simulated::new(&gpu, script)?;
        show(arguments, &gpu, set, rungs, &mut headset, onlooker, stop)
    } else {
        let options = OpenXrOptions {
            blend: arguments.blend.map(Into::into),
            rate_hz: arguments.rate,
            resolution: Some(arguments.resolution),
        };
        let (gpu, mut headset) = OpenXr::start(&gpu_options, &options)?;
        show(arguments, &gpu, set, rungs, &mut headset, onlooker, stop)
    }
}

impl Arguments {
    /// Those of a program that has no command line: all splats (PLY) of a folder, in the order of their names, and the defaults.
    ///
    /// # Errors
    /// [`Kind::Missing`] where there are no splats.
    pub fn of_folder(folder: &Path) -> Result<Self> {
        let files =
            std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let mut splats: Vec<PathBuf> = files
            .filter(|path| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("ply")))
            .collect();
        splats.sort();
        let words = std::iter::once(PathBuf::from("vgs-xr")).chain(splats);
        Self::try_parse_from(words).map_err(|_| {
            Error::new(Kind::Missing, "VGS-XR-026", "there are no splats")
                .file(folder)
                .help("copy a PLY into this folder")
        })
    }
}

/// The rungs of such splats.
fn rungs(arguments: &Arguments, set: &SplatSet) -> Result<Vec<Rung>> {
    let rungs = render::rungs(SplatKind::of(set));
    match arguments.rung {
        Some(rung) if rung >= rungs.len() => {
            Err(Error::new(Kind::Usage, "VGS-XR-022", format!("--rung {rung}"))
                .help(format!("rungs of these splats are 0 to {}", rungs.len() - 1)))
        }
        _ => Ok(rungs.to_vec()),
    }
}

fn show(
    arguments: &Arguments,
    gpu: &Gpu,
    mut set: SplatSet,
    rungs: Vec<Rung>,
    headset: &mut dyn Headset,
    onlooker: impl FnOnce(&Gpu, &Description) -> Result<Option<Box<dyn Onlooker>>>,
    stop: &AtomicBool,
) -> Result<()> {
    let range = set.intensity_range().unwrap_or_default();
    let look = Look::new(transfer::load(&arguments.tf, range)?);
    // Memory budgets keep the first splats.
    set.order_by_importance();
    let options = Options {
        rung: arguments.rung,
        rungs,
        budget_ms: arguments.budget,
        background: [0.0; 3],
        frames: arguments.frames,
        panel: arguments.panel,
        foveation: arguments.foveation,
    };
    let mut viewer = memory::within(gpu, arguments.memory_budget, set, |set, precision| {
        let scene = Scene::with_precision(gpu, Some(set), None, &look, precision)?;
        let mut viewer = Viewer::new(gpu, scene, headset, options.clone())?;
        viewer.know(Known::of(set));
        Ok(viewer)
    })?;
    if let Some(onlooker) = onlooker(gpu, headset.description())? {
        viewer.look_on(onlooker);
    }
    announce(headset);
    let ended = viewer.run(headset, stop);
    // What was measured is worth keeping however it ended.
    let report = viewer.report(headset);
    print(&report);
    if let Some([shown, skipped]) = viewer.looked_on() {
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

fn print(report: &Report) {
    println!(
        "{} frames, {} missed, {} over the budget, {} changes of quality",
        report.frames, report.missed, report.over_budget, report.rung_changes
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

/// What both eyes saw last, side by side, over black.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_sound() {
        use clap::CommandFactory as _;
        Arguments::command().debug_assert();
    }

    #[test]
    fn a_folder_gives_its_splats_by_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let none = Arguments::of_folder(folder.path()).expect_err("no splats");
        assert_eq!((none.kind, none.code), (Kind::Missing, "VGS-XR-026"));
        for name in ["b.ply", "-a.PLY", "notes.txt", "ply"] {
            std::fs::write(folder.path().join(name), "").expect("a file");
        }
        let found = Arguments::of_folder(folder.path()).expect("splats");
        assert_eq!(found.splats, ["-a.PLY", "b.ply"].map(|name| folder.path().join(name)));
        assert_eq!((found.tf.as_str(), found.simulated, found.frames), ("CT-Bone", false, None));
        assert!(Arguments::of_folder(&folder.path().join("none")).is_err(), "a folder that is not there");
    }
}
