//! The set that a fit makes: rounded where its file rounds, measured, and fitted again with another number of splats
//! where it misses its goal or is too large.

use engine::Result;
use engine::fidelity::evaluate_decoded;
use engine::fit::Outcome;
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::gpu::Gpu;
use engine::splat::{self, Form, Splat, SplatSet};

use super::count::text;
use super::prepare::Prepared;
use crate::shared::console::Console;
use crate::shared::figures::bytes;
use crate::shared::signals::Signals;
use crate::shared::waiting::Waiting;

/// Part of a limited file that is aimed at when splats are taken away.
const AIMED: f64 = 0.98;
/// Most times that splats are taken away.
const ROUNDS: usize = 5;

/// Makes the set of a fit, and fits again with another number of splats where the set has missed its goal or is
/// too large for its file; the size counts most. If the device fails, the splats stay as they are.
///
/// # Errors
/// Fails if the set cannot be written as its file's name says.
pub fn settled(
    prepared: &Prepared<'_>,
    outcome: &mut Outcome,
    signals: &Signals,
    console: &Console,
) -> Result<SplatSet> {
    let iterations = outcome.iterations;
    let make = |splats: &[Splat]| made(prepared, splats, iterations, signals);
    // The last splats that were measured, and their set.
    let mut last: Option<(Vec<Splat>, SplatSet)> = None;
    if let Some(goal) = &prepared.goal {
        let target = text(goal, prepared.case.volume.unit().text());
        let mut surplus = |splats: &[Splat]| {
            let (_, set) = last.insert((splats.to_vec(), make(splats)));
            Ok(goal.surplus_of(&measure(prepared, &prepared.gpu, set, splats, &prepared.at_voxels)?.on_grid))
        };
        let mut told = |count| console.say(&format!("not yet {target}: fitting again with {count} splats"));
        let waiting = Waiting::on("fitting again, to reach the target");
        let mut going = waiting.going(|| signals.exit_code().is_some());
        let (gpu, splats) = (&prepared.gpu, outcome.splats.clone());
        match prepared.problem.brought_to_goal(gpu, splats, &mut surplus, &mut told, &mut going) {
            Ok(splats) => outcome.splats = splats,
            Err(error) => tracing::warn!("the fit could not be brought to its target: {error}"),
        }
    }
    let set = match last {
        Some((splats, set)) if splats == outcome.splats => set,
        _ => make(&outcome.splats),
    };
    within_size(prepared, outcome, set, signals, console)
}

/// Takes splats away from a fit until the file of its set is small enough.
fn within_size(
    prepared: &Prepared<'_>,
    outcome: &mut Outcome,
    set: SplatSet,
    signals: &Signals,
    console: &Console,
) -> Result<SplatSet> {
    let mut set = set;
    let Some(most) = prepared.arguments.max_size else { return Ok(set) };
    for round in 0..=ROUNDS {
        let size = splat::file_bytes(&prepared.files.splats, &set, &prepared.write)?;
        let count = (outcome.splats.len() as f64 * AIMED * most as f64 / size as f64) as usize;
        if size <= most || signals.exit_code().is_some() {
            break;
        }
        if round == ROUNDS || count == 0 {
            let (size, most) = (bytes(size), bytes(most));
            tracing::warn!("the file has {size}, more than {most}: its grid and its mask need the rest");
            break;
        }
        console.say(&format!(
            "{} are more than {}: fitting again with {count} splats",
            bytes(size),
            bytes(most)
        ));
        let waiting = Waiting::on("fitting again, for a smaller file");
        let mut going = waiting.going(|| signals.exit_code().is_some());
        match prepared.problem.with_count(&prepared.gpu, &outcome.splats, count, &mut going) {
            Ok(splats) => outcome.splats = splats,
            Err(error) => {
                tracing::warn!("the file could not be made smaller than {}: {error}", bytes(size));
                break;
            }
        }
        set = made(prepared, &outcome.splats, outcome.iterations, signals);
    }
    Ok(set)
}

/// Returns the set of a finished fit as its file has it: rounded where the file rounds.
fn made(prepared: &Prepared<'_>, splats: &[Splat], iterations: u32, signals: &Signals) -> SplatSet {
    let rounded = if prepared.is_rounded() {
        let waiting = Waiting::on("rounding the splats, and fitting them again");
        prepared.rounded_set(splats, iterations, &mut waiting.going(|| signals.exit_code().is_some()))
    } else {
        None
    };
    rounded.unwrap_or_else(|| prepared.set(splats, iterations))
}

/// Measures the field of a set that is shown, by `protocol`: the decoded field if the splats were fitted for the
/// voxels alone. `splats` are those of the fit (voxel space of the working grid, HU).
pub fn measure(
    prepared: &Prepared<'_>,
    gpu: &Gpu,
    set: &SplatSet,
    splats: &[Splat],
    protocol: &Protocol,
) -> Result<Evaluation> {
    let case = prepared.case;
    let between = evaluate::between_slices_of(set, &case.volume);
    evaluate::with_slices(&case.volume, &case.roi, between, protocol, |volume, roi, protocol| {
        if set.form != Form::Field {
            return evaluate_decoded(gpu, set, volume, roi, protocol);
        }
        // Splats of a working grid are converted to that of the volume, and those of a small file are not those of
        // the fit. Others are there already, and need no conversion, which is not exact.
        let converted = prepared.problem.has_own_grid() || set.rounding.is_some();
        let there = converted.then(|| set.to_voxel(&volume.world_from_voxel));
        evaluate::evaluate(gpu, there.as_deref().unwrap_or(splats), &prepared.field, volume, roi, protocol)
    })
}
