//! `studies bake`: how near baked splats come to the pictures of the fits that they are made of.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;
use engine::bake::{Options, bake, pictures};
use engine::gpu::Gpu;
use engine::image::psnr;
use engine::render::{Look, Scene};
use engine::splat::{self, ReadOptions, SplatSet};
use engine::transfer::{FixedTo, Light};
use engine::{Result, output, transfer};
use glam::DVec3;

use crate::images::views_of;

/// The transfer functions.
const FUNCTIONS: [&str; 3] = ["CT-Bones-Steep", "CT-Soft-Tissue", "CT-Bone"];

/// Views that are not trained.
const HELD_OUT: usize = 8;

/// The lights: none, the usual one where a viewer in front has it and where it stays, one at the viewer, and the usual one,
/// which turns with the camera.
fn lights() -> [(&'static str, Option<Light>); 4] {
    let mut stays = Light::default();
    stays.fix(FixedTo::Patient, [DVec3::NEG_X, DVec3::Z, DVec3::Y]);
    let (camera, head) = (Some(Light::default()), Some(Light::HEAD));
    [("none", None), ("patient", Some(stays)), ("headlight", head), ("camera", camera)]
}

/// How near baked splats come to the pictures of the fits that they are made of.
#[derive(Args)]
#[command(after_help = "\
Example:
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply
  studies bake bones.ply --out bake.csv --force")]
pub struct BakeArguments {
    /// Splats with HU
    #[arg(required = true, value_name = "SPLATS")]
    splats: Vec<PathBuf>,
    /// File for a row of each file, function and light (CSV)
    #[arg(long, value_name = "FILE", default_value = "bake.csv")]
    out: PathBuf,
    /// Steps of the optimiser
    #[arg(long, default_value_t = Options::default().iterations)]
    iterations: u32,
    /// Most splats, in those that the function shows
    #[arg(long, default_value_t = 2.0)]
    factor: f64,
    /// Replaces the file
    #[arg(long)]
    force: bool,
}

/// Bakes every file with every function and light.
///
/// # Errors
/// Those of reading, baking and writing.
pub fn run(gpu: &Gpu, arguments: &BakeArguments) -> Result<()> {
    output::check_writable(&arguments.out, arguments.force)?;
    let mut table = "case,function,light,splats_before,splats,size,psnr_before_db,psnr_db,worst_psnr_db,\
                     reported_psnr_db,iterations,pictures_s,steps_s\n"
        .to_owned();
    for path in &arguments.splats {
        let set = splat::read(path, &ReadOptions::default())?;
        let range = set.intensity_range().unwrap_or([0.0, 1.0]);
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for (function, (name_of_light, light)) in
            FUNCTIONS.iter().flat_map(|function| lights().map(|light| (function, light)))
        {
            let mut transfer = transfer::load(function, range)?;
            transfer.material.shade = light.is_some();
            let look = Look { light: light.unwrap_or_default(), ..Look::new(transfer) };
            let before = engine::render::baked(gpu, &set, &look)?.set;
            let seen = before.splats.len();
            if seen == 0 {
                continue;
            }
            let options = Options {
                iterations: arguments.iterations,
                max_splats: Some((arguments.factor * seen as f64).max(1.0) as usize),
                held_out: HELD_OUT,
                ..Options::default()
            };
            let baked = bake(gpu, &set, &look, &options, None, &mut |_| ControlFlow::Continue(()))?;
            let report = &baked.report;
            // As large as they are shown, which the report only samples.
            let scene = Scene::new(gpu, Some(&set), None, &look)?;
            let views = views_of(gpu, &scene, "decoded", (HELD_OUT, 0.5), options.shown)?;
            let wanted = views.pictures()?;
            let near = |set: &SplatSet| -> Result<Vec<f64>> {
                pictures(gpu, set, &views)?.iter().zip(&wanted).map(|(a, b)| psnr(a, b)).collect()
            };
            let (before, after) = (near(&before)?, near(&baked.set)?);
            let mean = |views: &[f64]| views.iter().sum::<f64>() / views.len() as f64;
            let row = format!(
                "{name},{function},{name_of_light},{seen},{},{},{:.2},{:.2},{:.2},{:.2},{},{:.1},{:.1}",
                baked.set.splats.len(),
                options.shown,
                mean(&before),
                mean(&after),
                after.iter().copied().fold(f64::INFINITY, f64::min),
                mean(&report.after),
                report.steps,
                report.rendering_s,
                report.training_s
            );
            println!("{row}");
            let _ = writeln!(table, "{row}");
        }
    }
    output::write_atomic(&arguments.out, arguments.force, |file| file.write_all(table.as_bytes()))
}
