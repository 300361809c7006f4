//! Keeps the memory of the device within a budget of bytes: first splats are packed; then a decoded field has
//! coarser voxels, of other splats the least important ones are left out.

use engine::gpu::Gpu;
use engine::render::{Precision, SplatKind};
use engine::splat::SplatSet;
use engine::{Error, Kind, Result};

/// Part of the budget that the remaining splats should take, by estimate, when splats are left out; so
/// another round is seldom needed.
const MARGIN: f64 = 0.95;
/// The coarsest voxels of a decoded field.
const COARSEST: f64 = 16.0;

/// What a budget leaves of a scene.
pub struct Kept<'a> {
    /// Splats, the most important ones if some are left out.
    pub set: &'a SplatSet,
    /// Precision of the splats.
    pub precision: Precision,
    /// [`engine::render::DecodeOptions::pitch`].
    pub pitch: f64,
    /// What was given up, in words.
    pub given_up: Option<String>,
}

/// Creates something from a set, with `make`, that takes at most `budget_mib` MiB of device memory, and
/// prints a note of what was given up. The memory is measured, not estimated: if it is too large, `make` is
/// called again with less. The set begins with the splats that matter most.
pub fn within<T>(
    gpu: &Gpu,
    budget_mib: Option<f64>,
    mut set: SplatSet,
    mut make: impl FnMut(&Kept<'_>) -> Result<T>,
) -> Result<T> {
    let (all, kind) = (set.splats.len(), SplatKind::of(&set));
    let (mut precision, mut pitch) = (Precision::Full, 1.0);
    loop {
        let count = set.splats.len();
        let given_up = if count < all {
            Some(format!(
                "{count} of {all} splats fit into the memory budget; the least important are left out"
            ))
        } else if pitch > 1.0 {
            Some(format!("to keep to the memory budget, {pitch}³ voxels are shown as one"))
        } else if precision == Precision::Packed {
            Some("splats are packed, to keep to the memory budget".to_owned())
        } else {
            None
        };
        let made = make(&Kept { set: &set, precision, pitch, given_up: given_up.clone() })?;
        let Some(budget) = budget_mib.map(bytes) else { return Ok(made) };
        let used = used(gpu);
        if used <= budget {
            if let Some(given_up) = given_up {
                eprintln!("note: {given_up}");
            }
            return Ok(made);
        }
        drop(made);
        gpu.wait_idle()?;
        let fewer = (set.splats.len() as f64 * (budget / used).min(1.0) * MARGIN) as usize;
        match kind {
            _ if precision == Precision::Full && kind != SplatKind::Coloured => precision = Precision::Packed,
            // A splat less would be a hole in what is shown.
            SplatKind::Grid if pitch < COARSEST => pitch *= 2.0,
            SplatKind::Field | SplatKind::Coloured if fewer > 0 && set.splats.len() > 1 => {
                set.truncate(fewer)
            }
            _ => {
                return Err(too_much(used, budget));
            }
        }
    }
}

/// Checks that what there is on the device is within a budget, MiB, where nothing can be given up.
///
/// # Errors
/// [`Kind::Unavailable`] if it is not.
pub fn check(gpu: &Gpu, budget_mib: Option<f64>) -> Result<()> {
    let Some(budget) = budget_mib.map(bytes) else { return Ok(()) };
    let used = used(gpu);
    if used <= budget { Ok(()) } else { Err(too_much(used, budget)) }
}

fn bytes(mib: f64) -> f64 {
    mib * f64::from(1 << 20)
}

fn used(gpu: &Gpu) -> f64 {
    gpu.memory_by_purpose().values().sum::<u64>() as f64
}

fn too_much(used: f64, budget: f64) -> Error {
    let [used, budget] = [used, budget].map(|of| of / bytes(1.0));
    let message = format!("{used:.0} MiB are needed at the least; the budget is {budget:.0}");
    Error::new(Kind::Unavailable, "VGS-XR-024", message)
        .help("choose a larger --memory-budget, or a smaller --resolution")
}
