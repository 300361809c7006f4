//! The program: reads the splats, starts a headset, shows them until the session ends, and writes the
//! measurements.

use std::path::Path;
#[cfg(not(target_os = "android"))]
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use engine::gpu::{Gpu, GpuOptions, Windows};
use engine::image::{self, Image, WriteOptions};
use engine::render::{self, DecodeOptions, QualityLevel, Scene, SplatKind};
use engine::{Error, Kind, Result, output};
use view::model::settings::Settings;
use view::model::state::ViewState;

use crate::arguments::{Card, HeadsetArguments};
use crate::headset::openxr::{OpenXr, OpenXrOptions};
use crate::headset::simulated::{OFFERED, Script, Simulated, rest};
use crate::headset::{Description, Headset};
use crate::inputs::{self, Content};
use crate::keeping::Keeper;
use crate::loading;
use crate::memory;
#[cfg(not(target_os = "android"))]
use crate::mirror::Opened;
use crate::onlooker::Onlooker;
use crate::pointing::PickData;
use crate::start::Start;
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

/// What a session shows, with its first view and its quality levels.
pub(crate) struct Prepared {
    content: Content,
    start: Start,
    levels: Vec<QualityLevel>,
}

/// Reads what is shown. Checks everything that can be checked before there is a device.
pub(crate) fn prepare(arguments: &HeadsetArguments) -> Result<Prepared> {
    for path in [&arguments.report, &arguments.picture].into_iter().flatten() {
        output::check_writable(path, arguments.force)?;
    }
    if let Some(session) = &arguments.session {
        ViewState::check_name(session)?;
        output::check_writable(session, true)?;
    }
    let (content, start) = inputs::read(&arguments.wanted())?;
    let levels = levels(arguments, &content)?;
    Ok(Prepared { content, start, levels })
}

/// Runs a session until it ends or `stop` is set. `windows` are those with which the device must be booted so
/// that `onlooker` can draw; `onlooker` creates the onlooker that is shown what the eyes see, if there is
/// one.
pub(crate) fn session(
    arguments: &HeadsetArguments,
    prepared: Prepared,
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
            blend: arguments.background().choose(&OFFERED, false)?.blend,
            hands: rest,
            ..script
        };
        let mut headset = Simulated::new(&gpu, script)?;
        show(arguments, &gpu, prepared, &mut headset, onlooker, stop)
    } else {
        let options = OpenXrOptions {
            background: arguments.background(),
            rate_hz: arguments.rate,
            resolution: Some(arguments.resolution),
        };
        let (gpu, mut headset) = OpenXr::start(&gpu_options, &options)?;
        show(arguments, &gpu, prepared, &mut headset, onlooker, stop)
    }
}

/// Returns the quality levels of what is shown.
fn levels(arguments: &HeadsetArguments, content: &Content) -> Result<Vec<QualityLevel>> {
    let levels = match content {
        Content::Splats(splats) => render::quality_levels(SplatKind::of(&splats.set)).to_vec(),
        // A volume is marched as the decoded field of splats for a grid is.
        Content::Volume(_) => render::quality_levels(SplatKind::Grid)
            .iter()
            .map(|level| QualityLevel { mode: render::OF_VOLUMES, ..*level })
            .collect(),
    };
    match arguments.level {
        Some(level) if level >= levels.len() => {
            Err(Error::new(Kind::Usage, "VGS-XR-022", format!("--level {level}"))
                .help(format!("quality levels of what is shown are 0 to {}", levels.len() - 1)))
        }
        _ => Ok(levels),
    }
}

fn show(
    arguments: &HeadsetArguments,
    gpu: &Gpu,
    Prepared { content, start, levels }: Prepared,
    headset: &mut dyn Headset,
    onlooker: impl FnOnce(&Gpu, &Description) -> Result<Option<Box<dyn Onlooker>>>,
    stop: &AtomicBool,
) -> Result<()> {
    let look = start.state.look(&start.numbers)?;
    let content = match content {
        Content::Splats(splats) => Content::Splats(inputs::left(splats, &start.state.deleted)?),
        volume => volume,
    };
    let options = Options {
        level: arguments.level,
        levels,
        budget_ms: arguments.budget,
        background: start.state.background.as_vec3().to_array(),
        frames: arguments.frames,
        panel: arguments.panel,
        foveation: arguments.foveation,
        decoding: start.state.decoding(),
        given_up: None,
        card: match arguments.card {
            Some(when) => when == Card::Always,
            None => !arguments.simulated && !settings().headset_card_seen,
        },
        start: Some(start),
    };
    let keeper = options
        .start
        .as_ref()
        .map(|start| Keeper::new(arguments.session.as_deref(), &arguments.files, &start.state));
    announce(headset);
    // What shows that it loads takes memory, too: where that is limited, nothing else is on the device.
    let over = match arguments.memory_budget {
        Some(_) => false,
        None => loading::show(gpu, headset, options.background)?,
    };
    let mut viewer = match content {
        // Memory budgets keep the first splats, which are the most important ones.
        Content::Splats(splats) => memory::within(gpu, arguments.memory_budget, splats.set, |kept| {
            let scene = Scene::with_precision(gpu, Some(kept.set), None, &look, kept.precision)?;
            let decoding = DecodeOptions { budget: kept.field, ..options.decoding };
            let options = Options { decoding, given_up: kept.given_up.clone(), ..options.clone() };
            let mut viewer = Viewer::new(gpu, scene, headset, options)?;
            viewer.set_pick_data(PickData::of(kept.set));
            Ok(viewer)
        })?,
        Content::Volume(volume) => {
            let shown = volume.shown(options.decoding.edges);
            let scene = Scene::new(gpu, None, Some(&volume.source(&shown)), &look)?;
            let mut viewer = Viewer::new(gpu, scene, headset, options)?;
            memory::check(gpu, arguments.memory_budget)?;
            viewer.set_volume(volume);
            viewer
        }
    };
    if let Some(onlooker) = onlooker(gpu, headset.description())? {
        viewer.add_onlooker(onlooker);
    }
    keeper.into_iter().for_each(|keeper| viewer.set_keeper(keeper));
    viewer.begin(over);
    let ended = viewer.run(headset, stop);
    // What was made is kept, and the measurements are reported, however the session ended.
    let kept = viewer.finish_keeping();
    if let Ok(Some(path)) = &kept {
        println!("outputs are in {}", path.display());
    }
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
    let [_, card_seen] = viewer.pointing().card();
    if card_seen {
        remember_card(Settings::place().as_deref());
    }
    ended?;
    kept?;
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

/// Returns the user's settings; those of the first start if they cannot be read.
fn settings() -> Settings {
    Settings::read(Settings::place()).unwrap_or_default()
}

/// Remembers in the settings at a place that the card was seen. If that fails, it is shown once more.
fn remember_card(place: Option<&Path>) {
    let written = Settings::read(place.map(Path::to_owned)).and_then(|mut settings| {
        let seen = std::mem::replace(&mut settings.headset_card_seen, true);
        if seen { Ok(()) } else { settings.write() }
    });
    if let Err(e) = written {
        eprintln!("note: the card of what hands do will be shown again: {e}");
    }
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
    if report.late > 0 {
        println!(
            "motion to photon of {} frames is unknown: they were late for the time at which they were to be seen",
            report.late
        );
    }
    println!("scale {:.2}; 1 is real size", report.scale);
    for (purpose, bytes) in &report.device_bytes {
        println!("device memory for {purpose}: {:.1} MB", *bytes as f64 * 1e-6);
    }
}

/// Writes what both eyes saw last, side by side, over black, or transparent where the room is seen.
fn write_picture(path: &Path, viewer: &mut Viewer, force: bool) -> Result<()> {
    let eyes = viewer.picture()?;
    let [width, height, _] = eyes.size().map(|n| n as usize);
    let texels = eyes.read::<[u8; 4]>()?;
    let eye = |at: usize| texels[at * width * height..][..width * height].chunks(width);
    let rows = eye(0).zip(eye(1)).flat_map(|(left, right)| left.iter().chain(right));
    let pixels = rows.map(|texel| texel.map(|byte| f32::from(byte) / 255.0)).collect();
    let both = Image { size: [2 * width, height], pixels };
    let background = (!viewer.is_transparent()).then_some([0.0; 3]);
    image::write(path, &both, None, &WriteOptions { background, force, ..WriteOptions::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_card_is_remembered_beside_what_else_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = folder.path().join("vgs").join("view.toml");
        let settings = || Settings::read(Some(place.clone())).expect("settings");
        let mut viewers = settings();
        viewers.notice_seen = true;
        viewers.write().expect("the viewer's");
        remember_card(Some(&place));
        assert!(settings().headset_card_seen && settings().notice_seen);
        std::fs::write(&place, "colour = 3").expect("written");
        remember_card(Some(&place));
        assert_eq!(std::fs::read_to_string(&place).expect("text"), "colour = 3", "what is no settings stays");
        remember_card(None);
    }
}
