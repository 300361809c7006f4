//! `studies soak`: does for long what users do for long, and tells whether memory stays as it is.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use engine::fit::{self, FitConfig};
use engine::gpu::{Call, Failure, Fault, Gpu, GpuOptions};
use engine::render::{Camera, ClipPlane, Look, MODES, Renderer, Scene, Settings, VolumeSource};
use engine::splat;
use engine::transfer::preset;
use engine::volume::phantom::Phantom;
use engine::volume::{ReadOptions, Roi, Volume, nifti};
use engine::{Error, Kind, Result, output};
use glam::DVec3;

/// Error code of a lost device.
const LOST: &str = "VGS-GPU-012";
/// Part of the cycles, from the first on, that do not count, since caches fill meanwhile.
const WARM_UP: f64 = 0.25;
/// Growth up to which memory is flat, as a part of it.
const FLAT: f64 = 0.02;
/// A device is lost within so many cycles.
const LIFE: u64 = 6;

/// Whether memory stays as it is for as long as a program runs.
#[derive(Args)]
#[command(after_help = "\
A cycle fits a phantom, writes splats and volume to files and opens them, renders them in every mode and in several \
sizes, and changes transfer function and clip planes between. Within every six cycles the device is lost, at a \
submission that chance picks, and another one takes its place. After a cycle nothing but the device is left; then \
resident memory (as Linux tells it) and device memory are written down.

Memory is flat if no device memory is in use after any cycle, and if the line through the last three quarters of the \
cycles rises by less than 2 % of the resident memory, twice its standard error added.

Example:
  studies soak --minutes 60 --out soak.csv")]
pub struct SoakArguments {
    /// Time that it goes on
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// File for a row of each cycle (CSV)
    #[arg(long, value_name = "FILE", default_value = "soak.csv")]
    out: PathBuf,
    /// Edges of the phantoms, voxels, one after the other
    #[arg(long, value_delimiter = ',', default_values_t = [24, 32])]
    sizes: Vec<usize>,
    /// Iterations of a fit
    #[arg(long, default_value_t = 30)]
    iterations: u32,
    /// Replaces the file
    #[arg(long)]
    force: bool,
}

/// Repeats cycles until the time is over, and prints the verdict.
///
/// # Errors
/// [`Kind::Internal`] if memory grows; any error of a cycle but the loss of the device.
pub fn run(options: &GpuOptions, a: &SoakArguments) -> Result<()> {
    if a.sizes.is_empty() {
        return Err(Error::new(Kind::Usage, "VGS-BEN-060", "--sizes needs at least one size"));
    }
    output::check_writable(&a.out, a.force)?;
    let failed = |e: io::Error| Error::io(&a.out, "writing", &e);
    let mut rows = File::create(&a.out).map_err(failed)?;
    writeln!(rows, "cycle,seconds,resident_bytes,device_bytes,losses").map_err(failed)?;
    let folder = tempfile::tempdir().map_err(failed)?;

    let (begin, time) = (Instant::now(), Duration::from_secs_f64(a.minutes * 60.0));
    let (mut resident, mut left, mut losses) = (Vec::new(), 0, 0u64);
    // The first cycle counts submissions.
    let (mut gpu, mut fault) = boot(options, u64::MAX)?;
    let mut submissions = 0;
    while resident.is_empty() || begin.elapsed() < time {
        let cycle = resident.len();
        if let Err(error) = go_round(&gpu, a, cycle, folder.path()) {
            if error.code != LOST {
                return Err(error);
            }
            losses += 1;
            drop(gpu);
            (gpu, fault) = boot(options, chance(losses) % (submissions * LIFE))?;
            continue;
        }
        if cycle == 0 {
            submissions = fault.calls();
            drop(gpu);
            (gpu, fault) = boot(options, chance(0) % (submissions * LIFE))?;
        }
        gpu.wait_idle()?;
        let device: u64 = gpu.memory_by_purpose().values().sum();
        let host = resident_bytes()?;
        let seconds = begin.elapsed().as_secs_f64();
        writeln!(rows, "{cycle},{seconds:.1},{host},{device},{losses}").map_err(failed)?;
        resident.push(host as f64);
        left = left.max(device);
    }
    verdict(&resident, left, losses, begin.elapsed())
}

/// Boots a device that is lost at a submission.
fn boot(options: &GpuOptions, lost_at: u64) -> Result<(Gpu, Fault)> {
    let fault = Fault::new(Call::Submit, lost_at, Failure::Lost);
    let gpu = Gpu::new(&GpuOptions { fault: Some(fault.clone()), ..options.clone() })?;
    Ok((gpu, fault))
}

/// Returns a number that looks like chance (Knuth's multiplicative hash).
fn chance(n: u64) -> u64 {
    (n + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32
}

/// Goes through a cycle.
fn go_round(gpu: &Gpu, a: &SoakArguments, cycle: usize, folder: &Path) -> Result<()> {
    let size = a.sizes[cycle % a.sizes.len()];
    let phantom = Phantom::new([size; 3], DVec3::ONE, cycle as u64 % 3);
    let (volume, splats) = (folder.join("ct.nii.gz"), folder.join("splats.ply"));
    nifti::write(&volume, &phantom.volume(), true)?;
    let volume = Volume::read(&volume, &ReadOptions::default())?;
    let roi = phantom.roi()?;
    let config = FitConfig::default().with(|c| {
        c.count.density = 0.05;
        c.iterations = a.iterations;
    });
    splat::write(
        &splats,
        &fit::run(gpu, &volume, &roi, &config, |_| std::ops::ControlFlow::Continue(()))?,
        true,
    )?;
    let set = splat::read_all(&[splats], || Ok(None))?;
    show(gpu, &set, &volume, &roi)
}

/// Renders splats and volume in every mode and in two sizes, and changes the look between.
fn show(gpu: &Gpu, set: &splat::SplatSet, volume: &Volume, roi: &Roi) -> Result<()> {
    let range = set.intensity_range().unwrap_or_default();
    let look = |name| Ok::<_, Error>(Look::new(preset(name)?.over(range)));
    let source = VolumeSource { volume, roi: Some(roi) };
    let mut scene = Scene::new(gpu, Some(set), Some(&source), &look("CT-Bone")?)?;
    let [low, high] = scene.bounds();
    let (middle, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
    for mode in &MODES {
        for (size, name) in [([96, 64], "CT-Bone"), ([160, 120], "CT-Soft-Tissue")] {
            let mut renderer = Renderer::new(gpu, mode, &scene, &Settings::new(size))?;
            for side in ["anterior", "left"] {
                let plane = ClipPlane { normal: DVec3::X, offset: middle.x - radius * 0.3 };
                let clip = if side == "left" { vec![plane] } else { vec![] };
                scene.set_look(&Look { clip, ..look(name)? })?;
                let aspect = f64::from(size[0]) / f64::from(size[1]);
                renderer.render(&scene, &[Camera::from_side(side, middle, radius, 30.0, aspect)?])?;
            }
            renderer.target.read_colour(0)?;
        }
    }
    Ok(())
}

/// Returns the resident memory of this process, bytes.
fn resident_bytes() -> Result<u64> {
    let unknown = |why: &str| {
        let message = format!("the resident memory of this process is unknown: {why}");
        Error::new(Kind::Unavailable, "VGS-BEN-061", message).help("this study needs Linux")
    };
    let status = fs::read_to_string("/proc/self/status").map_err(|e| unknown(&e.to_string()))?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    let kib = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    kib.map(|kib| kib * 1024).ok_or_else(|| unknown("it has no VmRSS"))
}

/// Prints how memory went, and fails if it grew.
fn verdict(resident: &[f64], left: u64, losses: u64, time: Duration) -> Result<()> {
    let counted = &resident[(resident.len() as f64 * WARM_UP) as usize..];
    let mean = counted.iter().sum::<f64>() / counted.len() as f64;
    let (slope, error) = line(counted);
    let mib = |bytes: f64| bytes / f64::from(1 << 20);
    println!(
        "{} cycles in {:.0} minutes, {losses} losses of the device",
        resident.len(),
        time.as_secs_f64() / 60.0
    );
    println!(
        "resident memory of the last {}: mean {:.1} MiB, {:+.4} MiB a cycle, standard error {:.4}",
        counted.len(),
        mib(mean),
        mib(slope),
        mib(error)
    );
    let growth = (slope + 2.0 * error) * counted.len() as f64 / mean;
    println!("growth at most {:.2} %; device memory after a cycle at most {left} bytes", growth * 100.0);
    if left == 0 && growth < FLAT {
        println!("memory is flat");
        return Ok(());
    }
    Err(Error::new(Kind::Internal, "VGS-BEN-062", "memory is not flat"))
}

/// Returns the slope of the line of least squares through values, by their index, and its standard error;
/// infinite for fewer than three.
fn line(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let (middle, mean) = ((n - 1.0) / 2.0, values.iter().sum::<f64>() / n);
    let at = |i: usize| i as f64 - middle;
    let spread: f64 = (0..values.len()).map(|i| at(i).powi(2)).sum();
    let slope = values.iter().enumerate().map(|(i, v)| at(i) * (v - mean)).sum::<f64>() / spread;
    let residual = values.iter().enumerate().map(|(i, v)| (v - mean - slope * at(i)).powi(2)).sum::<f64>();
    match values.len() {
        0..3 => (slope, f64::INFINITY),
        _ => (slope, (residual / (n - 2.0) / spread).sqrt()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_a_slope_and_an_error() {
        let exact: Vec<f64> = (0..10).map(|i| 7.0 + 0.5 * f64::from(i)).collect();
        let (slope, error) = line(&exact);
        assert!((slope - 0.5).abs() < 1e-12 && error < 1e-12);
        // Residuals of ±1 that are not correlated with the index: variance 8/6, spread 42.
        let noise = [1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0];
        let (slope, error) = line(&noise);
        assert!(slope.abs() < 1e-12 && (error - (8.0f64 / 6.0 / 42.0).sqrt()).abs() < 1e-12, "{error}");
        assert!(line(&[1.0, 2.0]).1.is_infinite());
    }

    #[test]
    fn growth_and_what_is_left_are_told() {
        let minute = Duration::from_secs(60);
        let flat: Vec<f64> = (0..100).map(|i| 1e8 + f64::from(i % 7) * 1e5).collect();
        verdict(&flat, 0, 3, minute).expect("flat");
        let grows: Vec<f64> = flat.iter().enumerate().map(|(i, v)| v + 4e4 * i as f64).collect();
        for (resident, left) in [(&grows, 0), (&flat, 1)] {
            assert_eq!(verdict(resident, left, 3, minute).unwrap_err().code, "VGS-BEN-062");
        }
    }

    #[test]
    fn a_short_soak_goes_through() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("soak.csv");
        let a =
            SoakArguments { minutes: 0.0, out: out.clone(), sizes: vec![12], iterations: 2, force: false };
        // One cycle has no slope.
        assert_eq!(run(&GpuOptions::default(), &a).unwrap_err().code, "VGS-BEN-062");
        let rows = fs::read_to_string(out).unwrap();
        let cells: Vec<_> = rows.lines().nth(1).expect("a row").split(',').collect();
        assert!(cells[2].parse::<u64>().unwrap() > 1 << 20 && cells[3] == "0", "{rows}");
    }
}
