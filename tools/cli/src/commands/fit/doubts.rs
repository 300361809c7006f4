//! What is probably not meant, told before time is spent on it: a mask of another scan, far too many splats.

use std::io::{self, BufRead, IsTerminal, Write};

use engine::fit::Settings;
use engine::{Error, Kind, Result};

use super::arguments::FitArguments;
use crate::shared::console::Console;
use crate::shared::inputs::Case;
use crate::shared::terminal::stderr_has_colour;

/// Part of a mask that may lie outside the volume without a word: crops end at the edge of an organ, and a mask
/// on another grid is resampled.
const OUTSIDE: f64 = 0.1;
/// Part of a mask outside the volume from which on a person is asked.
const MOSTLY_OUTSIDE: f64 = 0.5;
/// Splats for each voxel of the region above which they no longer help.
const MANY: f64 = 1.0;
/// Splats for each voxel of the region above which a person is asked.
const FAR_TOO_MANY: f64 = 5.0;
/// Regions of fewer voxels are not doubted: they are trials, and the parts of a mask of few voxels are coarse.
const LEAST_VOXELS: f64 = 100.0;

/// A reason to think twice.
#[derive(Clone, Debug, PartialEq)]
struct Doubt {
    text: String,
    /// True if a person is asked whether to go on.
    asks: bool,
}

/// Warns of what is probably not meant. Where it surely is not, and somebody is there to answer, asks whether to
/// go on. A dry run and a resumed fit are not asked about.
///
/// # Errors
/// [`Kind::NothingToDo`] if the answer is no.
pub fn tell(arguments: &FitArguments, settings: &Settings, case: &Case, console: &Console) -> Result<()> {
    if let Some(doubt) = case.volume.unit_doubt() {
        tracing::warn!("the volume is {doubt}; say what it is with --unit hu or --unit arbitrary");
    }
    let voxels = case.roi.weight_sum();
    let doubts = doubts(case.mask_within, settings.config.splat_count(voxels), voxels);
    for doubt in &doubts {
        tracing::warn!("{}", doubt.text);
    }
    let somebody = stderr_has_colour() && io::stdin().is_terminal() && !console.quiet && !console.json;
    let spends = !arguments.dry_run && !arguments.checkpoint.resume;
    if somebody && spends && doubts.iter().any(|doubt| doubt.asks) && !answer(&mut io::stdin().lock()) {
        return Err(Error::new(Kind::NothingToDo, "VGS-CLI-122", "nothing was fitted, as you said"));
    }
    Ok(())
}

/// Returns the doubts about a mask of which this part lies within the volume, and about this number of splats
/// in a region of so many voxels.
fn doubts(mask_within: Option<f64>, splats: usize, voxels: f64) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    if voxels < LEAST_VOXELS {
        return doubts;
    }
    if let Some(within) = mask_within.filter(|within| *within < 1.0 - OUTSIDE) {
        doubts.push(Doubt {
            text: format!(
                "only {:.0} % of the mask lies within the volume: is it a mask of this scan?",
                100.0 * within
            ),
            asks: within < 1.0 - MOSTLY_OUTSIDE,
        });
    }
    let density = splats as f64 / voxels;
    if density > MANY {
        doubts.push(Doubt {
            text: format!(
                "{splats} splats are {density:.1} for each voxel of the region; 0.1 is usual, and more than 1 is never useful"
            ),
            asks: density > FAR_TOO_MANY,
        });
    }
    doubts
}

/// Asks whether to go on, and returns true for yes; an empty answer is no.
fn answer(input: &mut impl BufRead) -> bool {
    let _ = write!(io::stderr(), "Fit it anyway? [y/N] ");
    let mut line = String::new();
    input.read_line(&mut line).is_ok() && matches!(line.trim().to_lowercase().as_str(), "y" | "yes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_usual_is_not_doubted() {
        assert!(doubts(None, 1000, 10_000.0).is_empty());
        assert!(doubts(Some(0.97), 9999, 10_000.0).is_empty());
        assert!(doubts(Some(0.1), 1000, 27.0).is_empty());
    }

    #[test]
    fn what_is_probably_wrong_is_told_and_what_surely_is_asked() {
        let asks = |doubts: Vec<Doubt>| doubts.iter().map(|doubt| doubt.asks).collect::<Vec<_>>();
        assert_eq!(asks(doubts(Some(0.8), 20_000, 10_000.0)), [false, false]);
        assert_eq!(asks(doubts(Some(0.11), 60_000, 10_000.0)), [true, true]);
        let told = doubts(Some(0.11), 60_000, 10_000.0);
        assert!(told[0].text.contains("11 % of the mask") && told[1].text.contains("6.0 for each voxel"));
    }

    #[test]
    fn only_yes_is_yes() {
        for (line, expected) in
            [("y\n", true), (" YES \n", true), ("", false), ("\n", false), ("no\n", false)]
        {
            assert_eq!(answer(&mut line.as_bytes()), expected, "{line:?}");
        }
    }
}
