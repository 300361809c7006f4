//! Keeps the memory of the device within a budget of bytes: first splats are packed, then the least important
//! ones are left out.

use engine::gpu::Gpu;
use engine::render::Precision;
use engine::splat::SplatSet;
use engine::{Error, Kind, Result};

/// Part of the budget that the remaining splats should take, by estimate, when splats are left out; so
/// another round is seldom needed.
const MARGIN: f64 = 0.95;

/// Creates something from a set, with `make`, that takes at most `budget_mib` MiB of device memory, and
/// prints a note if splats were packed or left out. The memory is measured, not estimated: if it is too
/// large, `make` is called again with a smaller set. The set begins with the splats that matter most.
pub fn within<T>(
    gpu: &Gpu,
    budget_mib: Option<f64>,
    mut set: SplatSet,
    mut make: impl FnMut(&SplatSet, Precision) -> Result<T>,
) -> Result<T> {
    let Some(budget) = budget_mib.map(|mib| mib * f64::from(1 << 20)) else {
        return make(&set, Precision::Full);
    };
    let all = set.splats.len();
    let mut precision = Precision::Full;
    loop {
        let made = make(&set, precision)?;
        let used = gpu.memory_by_purpose().values().sum::<u64>() as f64;
        if used <= budget {
            let count = set.splats.len();
            match precision {
                _ if count < all => {
                    eprintln!(
                        "note: {count} of {all} splats fit into the memory budget; the least important are left out"
                    );
                }
                Precision::Packed => eprintln!("note: splats are packed, to keep to the memory budget"),
                Precision::Full => {}
            }
            return Ok(made);
        }
        drop(made);
        gpu.wait_idle()?;
        if precision == Precision::Full && set.colours.is_none() {
            precision = Precision::Packed;
            continue;
        }
        let fewer = (set.splats.len() as f64 * (budget / used).min(1.0) * MARGIN) as usize;
        if fewer == 0 || set.splats.len() == 1 {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-XR-024",
                format!(
                    "{:.0} MiB are needed without any splat; the budget is {:.0}",
                    used / 1048576.0,
                    budget / 1048576.0
                ),
            )
            .help("choose a larger --memory-budget, or a smaller --resolution"));
        }
        set.truncate(fewer);
    }
}
