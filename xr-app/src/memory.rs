//! Keeps the memory of the device within a budget of bytes: first splats are packed; then parts of a decoded field
//! are coarser, of other splats the least important ones are left out.

use engine::gpu::Gpu;
use engine::render::{FieldBudget, Precision, SplatKind};
use engine::splat::SplatSet;
use engine::{Error, Kind, Result};

/// The purposes of a decoded field's memory.
const FIELD: [&str; 2] = ["decoded field", "gradients"];
/// Part of the budget that the remaining splats, or the field, should take, by estimate, when something is given up; so
/// another round is seldom needed.
const MARGIN: f64 = 0.95;

/// What a budget leaves of a scene.
pub struct Kept<'a> {
    /// Splats, the most important ones if some are left out.
    pub set: &'a SplatSet,
    /// Precision of the splats.
    pub precision: Precision,
    /// [`engine::render::DecodeOptions::budget`].
    pub field: Option<FieldBudget>,
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
    let mut precision = Precision::Full;
    // For the field: its budget, and what there was with it.
    let mut field: Option<(FieldBudget, f64)> = None;
    loop {
        let count = set.splats.len();
        let given_up = if count < all {
            Some(format!(
                "{count} of {all} splats fit into the memory budget; the least important are left out"
            ))
        } else if field.is_some() {
            Some("parts of the field are coarser, to keep to the memory budget".to_owned())
        } else if precision == Precision::Packed {
            Some("splats are packed, to keep to the memory budget".to_owned())
        } else {
            None
        };
        let made = make(&Kept {
            set: &set,
            precision,
            field: field.map(|(budget, _)| budget),
            given_up: given_up.clone(),
        })?;
        let Some(budget) = budget_mib.map(bytes) else { return Ok(made) };
        let used = used(gpu);
        if used <= budget {
            if let Some(given_up) = given_up {
                eprintln!("note: {given_up}");
            }
            return Ok(made);
        }
        let of_field = FIELD.iter().filter_map(|&purpose| gpu.memory_by_purpose().get(purpose).copied());
        let of_field = of_field.sum::<u64>() as f64;
        drop(made);
        gpu.wait_idle()?;
        let fewer = (set.splats.len() as f64 * (budget / used).min(1.0) * MARGIN) as usize;
        // What everything else leaves of the budget; less than before, if that was too much.
        let room = (budget - (used - of_field)).min(of_field) * MARGIN;
        match kind {
            _ if precision == Precision::Full && kind != SplatKind::Coloured => precision = Precision::Packed,
            // A splat less would be a hole in what is shown. The wearer may look from anywhere.
            SplatKind::Grid if room > 0.0 && field.is_none_or(|(_, before)| used < before) => {
                field = Some((FieldBudget { bytes: room as u64, camera: None }, used));
            }
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
