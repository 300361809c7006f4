//! Words for how many splats there are: what a target takes, and what a file of limited size holds.

use engine::fit::{Goal, Settings};
use engine::{Error, Kind, Result};

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
