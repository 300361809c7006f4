//! Measures what the visibility mask of the lenses and foveation save. Both eyes of a simulated headset are
//! rendered whole, without what round lenses hide, and foveated, in turns; the visible pixels are compared
//! with the whole pictures.

use std::path::PathBuf;

use clap::Args;
use engine::Result;
use engine::gpu::{Format, Gpu, Image};
use engine::render::{Frames, Look, QualityLevel, Scene, SplatKind, VisibilityMask, quality_levels};
use engine::splat::SplatSet;
use engine::transfer;
use glam::DVec3;
use serde::Serialize;
use xr_app::composer::Composer;
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::headset::{Blend, Eye, FrameImages, Headset as _, Pose};
use xr_app::placement::Placement;
use xr_app::sight::Sight;

use crate::cost::{measure, median};
use crate::report::{Outputs, Table};
use crate::scene::splats_by_importance;

/// What the lenses and foveation save
#[derive(Args)]
pub struct EyesArguments {
    /// The splats (PLY)
    splats: PathBuf,
    /// Numbers of splats, of which the most important are taken; all when absent
    #[arg(long, value_delimiter = ',')]
    counts: Vec<usize>,
    /// Edges of the eyes' pictures, pixels
    #[arg(long, value_delimiter = ',', default_values_t = [512, 1024])]
    sizes: Vec<u32>,
    /// Parts of foveation
    #[arg(long, value_delimiter = ',', default_values_t = [0.5])]
    parts: Vec<f64>,
    /// Quality levels
    #[arg(long, value_delimiter = ',', default_values_t = [0, 2])]
    levels: Vec<usize>,
    /// Frames of each kind
    #[arg(long, default_value_t = 5)]
    frames: usize,
    /// From the head to the patient's middle, metres
    #[arg(long, default_value_t = 0.6)]
    distance: f64,
    /// Transfer function
    #[arg(long, default_value = "CT-Bone")]
    tf: String,
    #[command(flatten)]
    outputs: Outputs,
}

/// Result of one way to render the eyes.
#[derive(Serialize)]
struct EyesResult {
    splats: usize,
    size: u32,
    level: usize,
    way: String,
    /// Median time of a frame, ms: CPU time on a CPU driver, device time on a GPU.
    ms: f64,
    /// `ms` as a part of the time of whole pictures.
    part: f64,
    /// PSNR of the pixels that no lens hides against the whole pictures, dB; `None` if they are equal.
    psnr: Option<f64>,
}

/// Compares the ways to render the eyes for each number of splats, size and quality level, and writes the
/// table.
pub fn run(gpu: &Gpu, arguments: &EyesArguments) -> Result<()> {
    let set = splats_by_importance(&arguments.splats)?;
    let mut found = Vec::new();
    let all = [set.splats.len()];
    for &count in if arguments.counts.is_empty() { &all[..] } else { &arguments.counts } {
        let mut part = set.clone();
        part.truncate(count);
        for &size in &arguments.sizes {
            for &level in &arguments.levels {
                found.extend(compare(
                    gpu,
                    &part,
                    size,
                    level.min(quality_levels(SplatKind::of(&set)).len() - 1),
                    arguments,
                )?);
            }
        }
    }
    let title = format!(
        "Two eyes of a simulated headset {} m before {}, {}, medians of {} frames in turns; {} ({})",
        arguments.distance,
        arguments.splats.file_name().unwrap_or_default().display(),
        arguments.tf,
        arguments.frames,
        gpu.description().name,
        gpu.description().driver
    );
    let columns =
        vec!["splats", "an eye", "level", "rendered", "a frame / ms", "part", "PSNR of what is seen / dB"];
    let row = |f: &EyesResult| {
        vec![
            f.splats.to_string(),
            format!("{0}²", f.size),
            format!("{}, {}", f.level, quality_levels(SplatKind::of(&set))[f.level].mode),
            f.way.clone(),
            format!("{:.0}", f.ms),
            format!("{:.2}", f.part),
            f.psnr.map_or("the same".to_owned(), |psnr| format!("{psnr:.1}")),
        ]
    };
    let rows = found.iter().map(row).collect();
    arguments.outputs.finish_with(&[Table { title, columns, rows }], &found)
}

/// One way to render the eyes.
struct EyesRendering {
    name: String,
    sight: Sight,
    /// True if the renderer is told what the lenses hide.
    lenses: bool,
    frames: Frames,
    composer: Composer,
    eyes: Image,
    ms: Vec<f64>,
}

fn compare(
    gpu: &Gpu,
    set: &SplatSet,
    size: u32,
    level: usize,
    arguments: &EyesArguments,
) -> Result<Vec<EyesResult>> {
    let range = set.intensity_range().unwrap_or_default();
    let scene = Scene::new(gpu, Some(set), None, &Look::new(transfer::load(&arguments.tf, range)?))?;
    let head = |_: f64| (Pose::IDENTITY, true);
    let script =
        Script { eye_size: [8, 8], real_time: false, round_from: Some(0), head, ..Script::default() };
    let mut headset = Simulated::new(gpu, script)?;
    headset.poll()?;
    let timing = headset.wait()?;
    let eyes = headset.eyes(&timing)?.eyes;
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    let before = Placement::before(&Pose::IDENTITY, centre, 0.0);
    let placement = Placement { position: DVec3::NEG_Z * arguments.distance, ..before };
    let shown = &quality_levels(SplatKind::of(set))[level..=level];
    let mut ways = vec![
        EyesRendering::new(gpu, &scene, size, shown, (None, false))?,
        EyesRendering::new(gpu, &scene, size, shown, (None, true))?,
    ];
    for &part in &arguments.parts {
        ways.push(EyesRendering::new(gpu, &scene, size, shown, (Some(part), false))?);
        ways.push(EyesRendering::new(gpu, &scene, size, shown, (Some(part), true))?);
    }
    // The first frames size the buffers and find out where straight ahead is.
    for turn in 0..arguments.frames + 3 {
        for way in &mut ways {
            let (cost, _) = measure(gpu, || way.frame(gpu, &scene, &placement, &headset, &eyes))?;
            if turn >= 3 {
                way.ms.push(cost.of_device(gpu.description().kind == "CPU"));
            }
        }
    }
    let masks = [0, 1].map(|eye| VisibilityMask::of(&eyes[eye].fov, &headset.lenses()[eye]));
    let whole = ways[0].eyes.read::<[u8; 4]>()?;
    let full = median(&ways[0].ms).unwrap_or(f64::NAN);
    let found = ways.iter().map(|way| -> Result<EyesResult> {
        let ms = median(&way.ms).unwrap_or(f64::NAN);
        Ok(EyesResult {
            splats: set.splats.len(),
            size,
            level,
            way: way.name.clone(),
            ms,
            part: ms / full,
            psnr: psnr(&whole, &way.eyes.read::<[u8; 4]>()?, size as usize, &masks),
        })
    });
    found.collect()
}

impl EyesRendering {
    fn new(
        gpu: &Gpu,
        scene: &Scene,
        size: u32,
        levels: &[QualityLevel],
        (foveation, lenses): (Option<f64>, bool),
    ) -> Result<Self> {
        let name = foveation.map_or_else(|| "whole".to_owned(), |part| format!("foveated, {part}"));
        let sight = Sight::new([size; 2], foveation, lenses);
        let (format, background) = (Format::Rgba8, [0.0; 3]);
        Ok(EyesRendering {
            name: name + if lenses { ", less lenses" } else { "" },
            lenses,
            frames: Frames::new(gpu, scene, &sight.settings(false), levels)?,
            composer: Composer::new(gpu, format, false, Blend::Opaque, background, sight.insets().is_some())?,
            eyes: gpu.picture("both eyes", "pictures", format, sight.eye_size(), 2)?,
            sight,
            ms: Vec::new(),
        })
    }

    fn frame(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        placement: &Placement,
        headset: &Simulated,
        eyes: &[Eye; 2],
    ) -> Result<()> {
        self.sight.aim();
        let mut frame = self.frames.begin(scene, 0)?;
        let mut images = FrameImages { colour: &mut self.eyes, depth: None };
        let (insets, range) = (self.sight.insets(), placement.depth_range());
        self.composer.compose(
            &mut frame.recorder,
            &self.frames.target,
            frame.size,
            range,
            insets,
            None,
            &mut images,
        );
        let nothing = Default::default();
        let lenses = if self.lenses { headset.lenses() } else { &nothing };
        if let Some(masks) = self.sight.update(lenses, eyes) {
            self.frames.set_visibility_masks(masks);
        }
        let ticket = self.frames.submit(frame, scene, &self.sight.cameras(placement, eyes))?;
        gpu.wait(ticket)?;
        self.frames.finished()?;
        Ok(())
    }
}

/// Returns the PSNR of the pixels of both eyes outside the visibility masks, dB; `None` if they are equal.
fn psnr(whole: &[[u8; 4]], other: &[[u8; 4]], size: usize, masks: &[VisibilityMask; 2]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for (at, (a, b)) in whole.iter().zip(other).enumerate() {
        let (eye, y, x) = (at / (size * size), at / size % size, at % size);
        if !masks[eye].at([x * 64 / size, y * 64 / size]) {
            let square = |channel: usize| ((f64::from(a[channel]) - f64::from(b[channel])) / 255.0).powi(2);
            sum += (0..3).map(square).sum::<f64>();
            count += 3;
        }
    }
    (sum > 0.0).then(|| -10.0 * (sum / f64::from(count)).log10())
}
