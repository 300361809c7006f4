//! How many splats a fit gets: what a goal takes, and what a file of limited size holds.

use std::time::Instant;

use engine::fit::{GOAL_MARGIN_DB, Goal, Outcome, Problem, Trial};
use engine::gpu::Gpu;
use engine::splat::{self, Form, Rounding, Splat, SplatSet};
use engine::{Error, Kind, Result};

use super::arguments::FitArguments;
use super::prepare::Prepared;
use super::settings::Settings;
use super::stages;
use crate::shared::console::Console;
use crate::shared::figures::bytes;
use crate::shared::signals::Signals;
use crate::shared::waiting::Waiting;

/// What rounding for a small file costs, dB: the fit before it should be better by as much.
const ROUNDING_DB: f64 = 0.3;
/// Part of a time budget that trials may take.
const TRIALS_OF_BUDGET: f64 = 0.25;
/// Part of a limited file that the first splats may fill where voxels on the wrong side of a mask come to them
/// later ...
const FILLED_BESIDE_MASK: f64 = 0.9;
/// ... where none do ...
const FILLED: f64 = 0.99;
/// ... and of either where splats are rounded: fitted ones differ more, and take more bytes.
const FILLED_IF_ROUNDED: f64 = 0.8;
/// A file that is filled to this part of what the first splats may fill is full.
const NEARLY: f64 = 0.97;
/// Part of a limited file that is aimed at when splats are taken away.
const AIMED: f64 = 0.98;
/// Most times that splats are taken away.
const ROUNDS: usize = 5;

/// Refuses two answers to the question how many splats there are.
pub fn check(settings: &Settings) -> Result<()> {
    let both = ["splats", "density"].into_iter().find(|key| settings.is_explicit(key));
    match both.filter(|_| settings.config.has_goal()) {
        None => Ok(()),
        Some(key) => {
            let message = format!("--{key} and a target both say how many splats there are");
            Err(Error::new(Kind::Usage, "VGS-CLI-125", message)
                .help("leave one out; --max-splats limits what a target takes"))
        }
    }
}

/// Returns the problem with the number of splats that `goal` takes, and says so.
pub fn for_goal<'a>(
    problem: Problem<'a>,
    gpu: &Gpu,
    goal: &Goal,
    arguments: &FitArguments,
    console: &Console,
    start: Instant,
) -> Result<Problem<'a>> {
    let waiting = Waiting::on("finding out how many splats the target takes");
    let margin = GOAL_MARGIN_DB + if is_rounded(&problem, arguments) { ROUNDING_DB } else { 0.0 };
    let until = arguments.time_budget.map(|time| start + time.mul_f64(TRIALS_OF_BUDGET));
    let mut over = || until.is_some_and(|until| Instant::now() >= until);
    let mut trials = 0;
    let mut told = |trial: &Trial| {
        trials += 1;
        tracing::info!("{} splats would be {:+.1} dB from the target", trial.splats, trial.surplus_db);
    };
    let count = problem.count_for(gpu, goal, margin, &mut told, &mut over)?;
    drop(waiting);
    let most = problem.config().most_splats(problem.roi().weight_sum());
    let limited = if count > most { format!("; {most} are the most there may be") } else { String::new() };
    let trials = if trials == 1 { "a short trial".to_owned() } else { format!("{trials} short trials") };
    console.say(&format!(
        "for {}: about {count} splats, by {trials}{limited}",
        text(goal, problem.volume().unit())
    ));
    Ok(problem.of_count(count))
}

/// Returns the problem and its first splats: as many as it says, but no more than a file of limited size holds; as
/// many as that holds, if nothing else says how many.
pub fn placed<'a>(
    problem: Problem<'a>,
    settings: &Settings,
    arguments: &FitArguments,
    write: &splat::WriteOptions,
    start: Instant,
) -> Result<(Problem<'a>, Vec<Splat>)> {
    let _waiting = Waiting::on("placing the first splats");
    // Reading and placing get half of the time, the fit the rest.
    let deadline = arguments.time_budget.map(|time| start + time / 2);
    let mut problem = problem;
    let mut first = problem.first_splats_by(deadline)?;
    let Some(most) = arguments.max_size else { return Ok((problem, first)) };
    let fills =
        !settings.config.has_goal() && !["splats", "density"].iter().any(|key| settings.is_explicit(key));
    for _ in 0..ROUNDS {
        let rounding = is_rounded(&problem, arguments).then(|| Rounding::coarse(&first));
        let set = SplatSet { rounding, ..problem.splat_set(&first, 0) };
        let size = splat::file_bytes(&arguments.output, &set, write)?;
        let beside_mask = set.form == (Form::Grid { binary: true });
        let filled = if beside_mask { FILLED_BESIDE_MASK } else { FILLED };
        let rounded = if splat::rounds(&arguments.output) { FILLED_IF_ROUNDED } else { 1.0 };
        let part = size as f64 / (most as f64 * filled * rounded);
        let limit = problem.config().most_splats(problem.roi().weight_sum());
        let count = ((first.len() as f64 / part) as usize).clamp(1, limit.max(1));
        let fits = part <= 1.0 && (!fills || part > NEARLY || count == first.len());
        if fits || count == first.len() {
            break;
        }
        problem = problem.of_count(count);
        first = problem.first_splats_by(deadline)?;
    }
    Ok((problem, first))
}

/// Returns true if the splats are rounded for a small file and fitted again. A clock leaves no time for that, and
/// a fit of mini-batches no memory; their splats are rounded as they are.
pub fn is_rounded(problem: &Problem<'_>, arguments: &FitArguments) -> bool {
    splat::rounds(&arguments.output) && arguments.time_budget.is_none() && problem.config().subset == 0
}

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
    let make = |splats: &[Splat]| stages::made(prepared, splats, iterations, signals);
    // The last splats that were measured, and their set.
    let mut last: Option<(Vec<Splat>, SplatSet)> = None;
    if let Some(goal) = &prepared.goal {
        let target = text(goal, prepared.case.volume.unit());
        let mut surplus = |splats: &[Splat]| {
            let (_, set) = last.insert((splats.to_vec(), make(splats)));
            Ok(goal.surplus_of(&stages::measure(prepared, set, splats, &prepared.at_voxels)?.on_grid))
        };
        let mut told = |count| console.say(&format!("not yet {target}: fitting again with {count} splats"));
        let mut stopped = || signals.exit_code().is_some();
        let (gpu, splats) = (&prepared.gpu, outcome.splats.clone());
        match prepared.problem.brought_to_goal(gpu, splats, &mut surplus, &mut told, &mut stopped) {
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
        let mut stopped = || signals.exit_code().is_some();
        match prepared.problem.with_count(&prepared.gpu, &outcome.splats, count, &mut stopped) {
            Ok(splats) => outcome.splats = splats,
            Err(error) => {
                tracing::warn!("the file could not be made smaller than {}: {error}", bytes(size));
                break;
            }
        }
        set = stages::made(prepared, &outcome.splats, outcome.iterations, signals);
    }
    Ok(set)
}

/// Describes a goal in a few words.
pub fn text(goal: &Goal, unit: &str) -> String {
    let psnr = goal.psnr_db.map(|db| format!("a PSNR of {db} dB"));
    let p99 = goal.p99_hu.map(|hu| format!("99 % of the voxels within {hu}{unit}"));
    psnr.into_iter().chain(p99).collect::<Vec<_>>().join(" with ")
}
