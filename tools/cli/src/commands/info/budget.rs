//! Measures where bytes and milliseconds go when splats are rendered (`vgs info --budget`).

use std::collections::BTreeMap;
use std::path::Path;

use clap::Args;
use engine::gpu::Gpu;
use engine::image::psnr;
use engine::render::{Camera, FOV_DEGREES, Look, Renderer, Scene, Settings, mode};
use engine::splat::{self, ReadOptions};
use engine::{Result, transfer};
use serde::Serialize;

use crate::shared::figures::bytes;
use crate::shared::flags::{DeviceArguments, Size};

/// Number of timed frames of each kind; they take turns, so that other load of the machine affects both
/// alike.
const FRAMES: usize = 5;
/// Share of a frame below which passes are listed together.
const SMALL_SHARE: f64 = 0.01;

/// Settings of the frame that is measured.
#[derive(Args, Debug)]
#[command(next_help_heading = "Budget")]
pub struct BudgetArguments {
    /// Renders the splats from the front, and tells where bytes and milliseconds go and what it saves to
    /// leave out what the transfer function cannot show
    #[arg(long)]
    pub budget: bool,
    /// Transfer function, as `vgs render` takes it [default: CT-Bone, or MR-Default without HU]
    #[arg(long, value_name = "PRESET|FILE")]
    tf: Option<String>,
    /// Mode of `vgs render`
    #[arg(long, default_value = "slab")]
    mode: String,
    /// Width and height of the picture, pixels
    #[arg(long, value_name = "WxH", default_value = "1024")]
    size: Size,
    #[command(flatten)]
    device: DeviceArguments,
}

/// Device time of a frame: the median of all timed frames.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameTime {
    /// Number of splats that are rendered.
    splats: usize,
    /// Time of all passes, ms.
    ms: f64,
    /// Time of each pass, ms.
    passes: BTreeMap<String, f64>,
}

impl FrameTime {
    /// Returns the frame with the median time; `frames` are the times of the passes of each frame, ms.
    fn middle(splats: usize, frames: Vec<BTreeMap<String, f64>>) -> Self {
        let mut frames: Vec<(f64, _)> =
            frames.into_iter().map(|passes| (passes.values().sum::<f64>(), passes)).collect();
        frames.sort_by(|a, b| a.0.total_cmp(&b.0));
        let middle = frames.len() / 2;
        let (ms, passes) = frames.into_iter().nth(middle).unwrap_or_default();
        FrameTime { splats, ms, passes }
    }
}

/// Memory and frame times of rendering splats. The names are part of the interface.
#[derive(Clone, Debug, Serialize)]
pub struct FrameBudget {
    device: String,
    mode: String,
    transfer_function: String,
    size: [u32; 2],
    /// Device memory with the scene and its renderer, by purpose, bytes.
    memory: BTreeMap<&'static str, u64>,
    /// Frame with only the splats that the transfer function can show.
    shown: FrameTime,
    /// Frame with all splats.
    all: FrameTime,
    /// PSNR between the pictures of both frames.
    psnr_db: f64,
}

/// Renders the splats of a file and measures where bytes and milliseconds go.
pub fn measure(path: &Path, arguments: &BudgetArguments) -> Result<FrameBudget> {
    let row = mode(&arguments.mode)?;
    let set = splat::read(path, &ReadOptions::default())?;
    let range = set.intensity_range().unwrap_or([0.0, 1.0]);
    let name = arguments.tf.as_deref().unwrap_or(transfer::first(set.unit));
    let look = Look::new(transfer::load(name, range)?);
    let gpu = arguments.device.boot()?;
    let settings = Settings::new(arguments.size.0);
    let (mut stages, mut memory) = (Vec::new(), None);
    for lists_all in [false, true] {
        let mut scene = Scene::new(&gpu, Some(&set), None, &look)?;
        if lists_all {
            scene.list_all()?;
        }
        let mut renderer = Renderer::new(&gpu, row, &scene, &settings)?;
        let camera = camera(&scene, &settings)?;
        // The first frame creates kernels and sizes buffers.
        renderer.render(&scene, &[camera])?;
        memory.get_or_insert_with(|| gpu.memory_by_purpose());
        stages.push((scene, renderer, camera));
    }
    gpu.take_profile();
    let mut passes = [Vec::new(), Vec::new()];
    for _ in 0..FRAMES {
        for ((scene, renderer, camera), passes) in stages.iter_mut().zip(&mut passes) {
            renderer.render(scene, &[*camera])?;
            passes.push(gpu.take_profile().into_iter().map(|(name, time)| (name, time.total_ms)).collect());
        }
    }
    let count = |at: usize| stages[at].0.splats.as_ref().map_or(Ok(0), |splats| splats.active_count());
    let [shown, all] = passes;
    let (shown, all) = (FrameTime::middle(count(0)?, shown), FrameTime::middle(count(1)?, all));
    let psnr_db = psnr(&picture(&stages[0].1)?, &picture(&stages[1].1)?)?;
    Ok(FrameBudget {
        device: device(&gpu),
        mode: row.name.to_owned(),
        transfer_function: look.transfer.name,
        size: settings.size,
        memory: memory.unwrap_or_default(),
        shown,
        all,
        psnr_db,
    })
}

/// Returns a camera in front of the scene that sees all of it.
fn camera(scene: &Scene, settings: &Settings) -> Result<Camera> {
    let [low, high] = scene.bounds();
    let aspect = f64::from(settings.size[0]) / f64::from(settings.size[1]);
    Camera::from_side("anterior", (low + high) * 0.5, (high - low).length() * 0.5, FOV_DEGREES, aspect)
}

fn device(gpu: &Gpu) -> String {
    let chosen = gpu.description();
    format!("{} ({})", chosen.name, chosen.driver)
}

fn picture(renderer: &Renderer) -> Result<engine::image::Image> {
    let size = renderer.target.size().map(|n| n as usize);
    Ok(engine::image::Image { size, pixels: renderer.target.read_colour(0)? }.over([0.0; 3]))
}

impl FrameBudget {
    /// Returns rows of name and value, for people.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let [width, height] = self.size;
        let FrameBudget { shown, all, .. } = self;
        let mut lines = vec![
            (
                "budget",
                format!("mode {}, {}, {width} x {height}, from the front", self.mode, self.transfer_function),
            ),
            ("on", self.device.clone()),
            (
                "can be seen",
                format!(
                    "{} of {} splats; with all of them a frame takes {:.1} ms, and its picture differs by {}",
                    shown.splats,
                    all.splats,
                    all.ms,
                    if self.psnr_db.is_infinite() {
                        "nothing".into()
                    } else {
                        format!("{:.1} dB PSNR", self.psnr_db)
                    },
                ),
            ),
            ("frame", format!("{:.1} ms of the device", shown.ms)),
        ];
        let mut passes: Vec<_> = shown.passes.iter().collect();
        passes.sort_by(|a, b| b.1.total_cmp(a.1));
        let (large, small): (Vec<_>, Vec<_>) =
            passes.into_iter().partition(|(_, ms)| **ms >= SMALL_SHARE * shown.ms);
        lines.extend(large.iter().map(|(name, ms)| ("", format!("{ms:>9.2} ms  {name}"))));
        if !small.is_empty() {
            let rest: f64 = small.iter().map(|(_, ms)| **ms).sum();
            lines.push(("", format!("{rest:>9.2} ms  {} others", small.len())));
        }
        lines.push(("memory", format!("{} of the device", bytes(self.memory.values().sum()))));
        let mut purposes: Vec<_> = self.memory.iter().filter(|(_, n)| **n > 0).collect();
        purposes.sort_by(|a, b| b.1.cmp(a.1));
        lines.extend(purposes.iter().map(|(purpose, n)| ("", format!("{:>12}  {purpose}", bytes(**n)))));
        lines
    }
}
