//! How many splats a fit begins with: what a goal takes, and what a file of limited size holds.

use std::time::Instant;

use engine::fit::{GOAL_MARGIN_DB, Goal, Problem, Trial};
use engine::gpu::Gpu;
use engine::splat::{self, Form, Rounding, Splat, SplatSet};
use engine::{Error, Kind, Result};

use super::arguments::FitArguments;
use super::settings::Settings;
use crate::shared::console::Console;
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
/// Most times that first splats are placed for a limited file.
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
    let waiting = Waiting::on("finding the number of splats, by short trials");
    let margin = GOAL_MARGIN_DB + if is_rounded(&problem, arguments) { ROUNDING_DB } else { 0.0 };
    let until = arguments.time_budget.map(|time| start + time.mul_f64(TRIALS_OF_BUDGET));
    let over = || until.is_some_and(|until| Instant::now() >= until);
    let mut trials = 0;
    let mut told = |trial: &Trial| {
        trials += 1;
        tracing::info!("{} splats would be {:+.1} dB from the target", trial.splats, trial.surplus_db);
    };
    let count = problem.count_for(gpu, goal, margin, &mut told, &mut waiting.going(over))?;
    drop(waiting);
    let most = problem.config().most_splats(problem.native_voxels());
    let limited = if count > most { format!("; {most} are the most there may be") } else { String::new() };
    let trials = if trials == 1 { "a short trial".to_owned() } else { format!("{trials} short trials") };
    console.say(&format!(
        "for {}: about {count} splats, by {trials}{limited}",
        text(goal, problem.volume().unit().text())
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
        let limit = problem.config().most_splats(problem.native_voxels());
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

/// Returns true if the splats are rounded for a small file and fitted again. A clock leaves no time for that.
pub fn is_rounded(problem: &Problem<'_>, arguments: &FitArguments) -> bool {
    problem.is_rounded_in(&arguments.output) && arguments.time_budget.is_none()
}

/// Returns true if the target is only aimed at: trials find the number of splats, and that is final.
pub fn is_aim(settings: &Settings) -> bool {
    settings.config.target_rounds == 0
}

/// Describes a goal in a few words.
pub fn text(goal: &Goal, unit: &str) -> String {
    let psnr = goal.psnr_db.map(|db| format!("a PSNR of {db} dB"));
    let p99 = goal.p99_hu.map(|hu| format!("99 of 100 voxels within {hu}{unit} of the scan"));
    psnr.into_iter().chain(p99).collect::<Vec<_>>().join(" with ")
}
