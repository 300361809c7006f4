//! Fits splats to the bone of a CT: `cargo run --release --example fit -- CT.nii.gz OUT.ply`. Without arguments it fits a
//! synthetic CT and writes `phantom.ply`.

use std::ops::ControlFlow;
use std::path::PathBuf;

use engine::fit::{self, FitConfig};
use engine::gpu::{Gpu, GpuOptions};
use engine::splat;
use engine::volume::phantom::Phantom;
use engine::volume::{ReadOptions, Roi, Volume};
use glam::DVec3;

fn main() -> engine::Result<()> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let volume = match paths.next() {
        Some(ct) => Volume::read(&ct, &ReadOptions::default())?,
        None => Phantom::new([48; 3], DVec3::ONE, 1).volume(),
    };
    let bone = Roi::from_threshold(&volume, 226.0, 3071.0)?;

    let gpu = Gpu::new(&GpuOptions::default())?;
    let config = FitConfig::default().with(|c| {
        c.count.density = 0.05;
        c.iterations = 200;
    });
    let splats = fit::run(&gpu, &volume, &bone, &config, |progress| {
        eprintln!("iteration {}: {:.1} dB", progress.iteration, progress.psnr_db);
        ControlFlow::Continue(())
    })?;

    let output = paths.next().unwrap_or_else(|| "phantom.ply".into());
    splat::write(&output, &splats, true)?;
    println!(
        "{}: {} splats, intensities {:?} HU",
        output.display(),
        splats.splats.len(),
        splats.intensity_range()
    );
    Ok(())
}
