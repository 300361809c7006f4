//! How far a stage of a fit is that takes long, told to whoever waits for it, who may stop it.

use std::ops::ControlFlow;

use super::{Fitter, Schedule};
use base::error::Result;

/// Iterations between two tellings.
const BATCH: u32 = 10;

/// Hears the part of a stage that is done, 0 to 1, and says whether to go on.
pub type Going<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Goes on to the end, whatever is done: a [`Going`] for those who only wait.
pub fn to_the_end(_done: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Runs a fit for so many iterations without a clock, or until `going` stops it. Waits for the device.
pub(super) fn iterate(fitter: &mut Fitter<'_>, iterations: u32, going: &mut Going<'_>) -> Result<()> {
    let schedule = Schedule { iterations, time: None };
    while fitter.iteration() < iterations {
        if going(f64::from(fitter.iteration()) / f64::from(iterations)).is_break() {
            break;
        }
        fitter.run_to((fitter.iteration() + BATCH).min(iterations), schedule)?;
    }
    Ok(())
}

/// Returns what hears of a part of a stage, from `from` to `to`.
pub(super) fn part(going: &mut Going<'_>, from: f64, to: f64) -> impl FnMut(f64) -> ControlFlow<()> {
    move |done| going(from + (to - from) * done)
}
