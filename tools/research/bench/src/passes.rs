//! Measures the forward and backward pass of the fit on fitted splats.
//!
//! An *in-support evaluation* is a (splat, sample) pair whose squared whitened distance lies below the
//! kernel's support, at a sample that takes part: the work that no algorithm can avoid. It is counted in f64
//! on the host. *Waste* is the number of evaluations of a pass divided by that: the forward pass evaluates 8
//! samples of each cell that a splat reaches, the backward pass every lane-step of the 8 rows that run side
//! by side.

use std::path::PathBuf;

use clap::Args;
use engine::Result;
use engine::gpu::Gpu;
use engine::passes::{Gradient, Rasterizer, Storage};
use engine::splat::activation::rotation_matrix;
use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::{NO_SLOT, SAMPLES, brick_morton};
use glam::{DVec3, UVec3};
use rayon::prelude::*;

use crate::report::{Outputs, Table};
use crate::scene::{Fitted, Scene};

/// Forward and backward pass of the fit: evaluations per second, waste, and growth
#[derive(Args)]
pub struct PassesArguments {
    /// A CT to measure on, besides the phantom.
    #[arg(long, requires = "roi")]
    volume: Option<PathBuf>,
    /// Its mask.
    #[arg(long)]
    roi: Option<PathBuf>,
    /// Splats per ROI voxel of the CT.
    #[arg(long, default_value_t = 0.1)]
    density: f64,
    /// Iterations of the fit before the passes are timed.
    #[arg(long, default_value_t = 100)]
    iterations: u32,
    /// Timed runs of each pass; the median is reported.
    #[arg(long, default_value_t = 15)]
    runs: usize,
    /// Samples in 16 bits a number, as `storage = "mixed"` of a fit has them.
    #[arg(long)]
    mixed: bool,
    /// Smaller scenes.
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    outputs: Outputs,
}

/// Measures the passes of a fit on phantoms and on the given volume, and prints or writes the tables.
pub fn run(gpu: &Gpu, a: &PassesArguments) -> Result<()> {
    let d = gpu.description();
    let software = if d.kind == "CPU" { ", a software driver" } else { "" };
    let device = format!("{} ({}{software})", d.name, d.driver);
    let mut tables = Vec::new();
    if let (Some(volume), Some(roi)) = (&a.volume, &a.roi) {
        let scene = Scene::read(volume, roi)?;
        let rows = vec![measure(gpu, &scene, a.density, a)?];
        tables.push(table(format!("A CT, on {device}"), rows));
    }
    let (edge, densities, edges): (usize, &[f64], &[usize]) = if a.quick {
        (64, &[0.02, 0.1], &[48, 64])
    } else {
        (96, &[0.02, 0.05, 0.1, 0.2, 0.4], &[48, 64, 96, 128])
    };
    let scene = Scene::phantom(edge)?;
    let rows = densities.iter().map(|&density| measure(gpu, &scene, density, a)).collect::<Result<_>>()?;
    tables.push(table(format!("Growth with splats, on {device}"), rows));
    let rows = edges.iter().map(|&e| measure(gpu, &Scene::phantom(e)?, 0.05, a)).collect::<Result<_>>()?;
    tables.push(table(format!("Growth with ROI voxels, on {device}"), rows));
    a.outputs.finish(&tables)
}

/// Counts and times of one scene.
struct PassesRow {
    scene: String,
    roi_voxels: usize,
    splats: usize,
    in_support: u64,
    forward_evaluated: u64,
    backward_evaluated: u64,
    bin_ms: f64,
    forward_ms: f64,
    backward_ms: f64,
}

fn table(title: String, rows: Vec<PassesRow>) -> Table {
    let rate = |evaluations: u64, ms: f64| format!("{:.0}", evaluations as f64 / ms * 1e-3);
    let waste =
        |evaluated: u64, r: &PassesRow| format!("{:.2}", evaluated as f64 / r.in_support.max(1) as f64);
    Table {
        title,
        columns: vec![
            "scene",
            "ROI voxels",
            "splats",
            "in-support evaluations a pass, M",
            "binning, ms",
            "forward, ms",
            "forward, M in-support/s",
            "forward waste",
            "backward, ms",
            "backward, M in-support/s",
            "backward waste",
        ],
        rows: rows
            .iter()
            .map(|r| {
                vec![
                    r.scene.clone(),
                    r.roi_voxels.to_string(),
                    r.splats.to_string(),
                    format!("{:.2}", r.in_support as f64 * 1e-6),
                    format!("{:.2}", r.bin_ms),
                    format!("{:.2}", r.forward_ms),
                    rate(r.in_support, r.forward_ms),
                    waste(r.forward_evaluated, r),
                    format!("{:.2}", r.backward_ms),
                    rate(r.in_support, r.backward_ms),
                    waste(r.backward_evaluated, r),
                ]
            })
            .collect(),
    }
}

fn measure(gpu: &Gpu, scene: &Scene, density: f64, a: &PassesArguments) -> Result<PassesRow> {
    let fitted = scene.fitted(gpu, density, a.iterations)?;
    let Fitted { config, splats, bricks } = &fitted;
    let offset = [0.1, 0.2, -0.3];
    let storage = if a.mixed { Storage::Mixed } else { Storage::Full };
    let mut rasterizer =
        Rasterizer::with_storage(gpu, config.kernel, config.epsilon, bricks, splats.len(), storage)?;
    let mut gradient = Gradient::new(gpu, config.kernel, splats.len(), storage)?;
    let device_splats = gpu.upload("splats", "splats", splats)?;
    // The result is checked first: the device's Σw at a few samples against a plain sum.
    let got = rasterizer.rasterize(&device_splats, offset)?;
    check(&got.iter().map(|r| r.weight).collect::<Vec<_>>(), &fitted, offset);
    let mut forward_evaluated = 0;
    let mut times = [Vec::new(), Vec::new(), Vec::new()];
    for run in 0..a.runs + 3 {
        gpu.take_profile();
        for chunk in 0..rasterizer.grid.chunks() {
            let mut recorder = gpu.record()?;
            rasterizer.record(&mut recorder, &device_splats, chunk, offset)?;
            gradient.gather(
                &mut recorder,
                &rasterizer.grid,
                &rasterizer.bins.footprints,
                &rasterizer.reconstructions, // any adjoints will do
                chunk,
                offset,
            )?;
            let ticket = recorder.submit()?;
            gpu.wait(ticket)?;
            if run == 0 {
                forward_evaluated += evaluated_forward(&rasterizer, chunk)?;
            }
        }
        if run < 3 {
            continue; // warm-up
        }
        let mut ms = [0.0; 3];
        for (name, time) in gpu.take_profile() {
            let which = match name.as_str() {
                "splat_to_volume" => 1,
                "splat_to_volume_grad" => 2,
                _ => 0,
            };
            ms[which] += time.total_ms;
        }
        times.iter_mut().zip(ms).for_each(|(t, ms)| t.push(ms));
    }
    let [bin_ms, forward_ms, backward_ms] = times.map(median);
    let counted = count(&fitted, offset);
    Ok(PassesRow {
        scene: scene.name.clone(),
        roi_voxels: scene.roi.voxel_count(),
        splats: splats.len(),
        in_support: counted.in_support,
        forward_evaluated,
        backward_evaluated: counted.row_steps,
        bin_ms,
        forward_ms,
        backward_ms,
    })
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Counts the samples that the forward pass evaluates: 8 for each bit in the cell masks of the slots of the
/// chunk.
fn evaluated_forward(rasterizer: &Rasterizer, chunk: usize) -> Result<u64> {
    let masks = rasterizer.bins.cell_masks.read()?;
    let starts = rasterizer.bins.starts().read()?;
    let mut bits = 0u64;
    for slot in 0..rasterizer.grid.chunk(chunk).len() {
        let (start, end) = (starts[slot] as usize, starts[slot + 1] as usize);
        let first = (start / 32 + slot) * 64;
        let words = (end - start).div_ceil(32) * 64;
        bits += masks[first..first + words].iter().map(|w| u64::from(w.count_ones())).sum::<u64>();
    }
    Ok(bits * 8)
}

/// Returns the offset `d` from the mean, whitened along the splat's own axes, in f64.
fn whitened(splat: &Splat, d: DVec3) -> DVec3 {
    let scale = glam::Vec3::from_array(splat.log_scale).as_dvec3().exp();
    rotation_matrix(splat.rotation).transpose() * d / scale
}

struct Counted {
    in_support: u64,
    row_steps: u64,
}

/// Counts on the host, splat by splat, the samples in support and the steps of the rows that
/// `splat_to_volume_grad` walks.
fn count(fitted: &Fitted, offset: [f32; 3]) -> Counted {
    let Fitted { config, splats, bricks } = fitted;
    let (in_support, row_steps) = splats
        .par_iter()
        .map(|splat| {
            let mut in_support = 0u64;
            let mut lengths = Vec::new();
            for_rows(splat, config.kernel, bricks, offset, |active, length| {
                in_support += active;
                lengths.push(length);
            });
            // Eight rows run side by side for as long as the longest of them.
            let steps: u64 = lengths.chunks(8).map(|rows| rows.iter().copied().max().unwrap_or(0) * 8).sum();
            (in_support, steps)
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Counted { in_support, row_steps }
}

/// Calls `row(samples in support that take part, samples in support)` for each row of the splat's box.
fn for_rows(splat: &Splat, kernel: Kernel, bricks: &Bricks, offset: [f32; 3], mut row: impl FnMut(u64, u64)) {
    let mean = glam::Vec3::from_array(splat.mean).as_dvec3() - glam::Vec3::from_array(offset).as_dvec3();
    let scale = glam::Vec3::from_array(splat.log_scale).as_dvec3().exp();
    let axes = rotation_matrix(splat.rotation);
    let extent: DVec3 = (0..3).map(|k| (axes.col(k) * scale[k]).powf(2.0)).sum::<DVec3>().map(f64::sqrt)
        * kernel.support_q().sqrt();
    let top = (bricks.grid * 8).as_dvec3() - 1.0;
    let first = (mean - extent).ceil().clamp(DVec3::ZERO, top + 1.0).as_uvec3();
    let last = (mean + extent).floor().clamp(DVec3::NEG_ONE, top).as_ivec3();
    for z in first.z as i32..=last.z {
        for y in first.y as i32..=last.y {
            let (mut active, mut length) = (0, 0);
            for x in first.x as i32..=last.x {
                let d = glam::IVec3::new(x, y, z).as_dvec3() - mean;
                if whitened(splat, d).length_squared() < kernel.support_q() {
                    length += 1;
                    let v = UVec3::new(x as u32, y as u32, z as u32);
                    let b = v / 8;
                    let slot = bricks.slots[((b.z * bricks.grid.y + b.y) * bricks.grid.x + b.x) as usize];
                    active +=
                        u64::from(slot != NO_SLOT && bricks.is_active(slot as usize, brick_morton(v % 8)));
                }
            }
            row(active, length);
        }
    }
}

/// Compares the device's Σw at some samples with a plain f64 sum over all splats.
///
/// # Panics
///
/// Panics if they differ.
fn check(weights: &[f32], fitted: &Fitted, offset: [f32; 3]) {
    let Fitted { config, splats, bricks } = fitted;
    let shift = glam::Vec3::from_array(offset).as_dvec3();
    for slot in (0..bricks.len()).step_by(bricks.len().div_ceil(16)) {
        let Some(morton) = (0..SAMPLES).find(|&m| bricks.is_active(slot, m)) else { continue };
        let x = (bricks.voxel(slot, morton) - bricks.origin).as_dvec3() + shift;
        let expected: f64 = splats
            .par_iter()
            .map(|s| {
                let d = x - glam::Vec3::from_array(s.mean).as_dvec3();
                let opacity = 1.0 / (1.0 + f64::from(-s.opacity_logit).exp());
                let peak = config.kernel.peak(s.log_scale.map(f64::from));
                opacity * peak * config.kernel.value(whitened(s, d).length_squared())
            })
            .sum();
        let got = f64::from(weights[slot * SAMPLES + morton]);
        assert!(
            (got - expected).abs() < 1e-3 * expected.max(0.01),
            "the forward pass is wrong: Σw = {got} at sample {morton} of slot {slot}, {expected} expected"
        );
    }
}
