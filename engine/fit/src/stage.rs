//! What a fit tells of besides its iterations: its stages, and the number of splats.

/// A stage of a fit other than its iterations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Short trials tell how many splats the goal takes.
    Count,
    /// The first splats are placed.
    Place,
    /// The splats are rounded, and fitted again.
    Round,
    /// The splats miss the goal, and are fitted again with more of them.
    ReachGoal,
    /// The file is too large, and fewer splats are fitted again.
    ReachSize,
}

impl Stage {
    /// Returns what happens, as people are told.
    pub fn text(self) -> &'static str {
        match self {
            Stage::Count => "finding the number of splats, by short trials",
            Stage::Place => "placing the first splats",
            Stage::Round => "rounding the splats, and fitting them again",
            Stage::ReachGoal => "fitting again, to reach the target",
            Stage::ReachSize => "fitting again, for a smaller file",
        }
    }
}

/// News of the number of splats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Count {
    /// A trial has ended.
    Tried(Trial),
    /// The number that the goal takes.
    Found {
        /// The number.
        splats: usize,
        /// The most there may be.
        most: usize,
        /// Trials that it took.
        trials: usize,
    },
    /// The goal is missed: this many are fitted again.
    MissedGoal {
        /// The number.
        splats: usize,
    },
    /// The file is too large: this many are fitted again.
    TooLarge {
        /// The number.
        splats: usize,
        /// Bytes of the file.
        bytes: u64,
        /// Most bytes that it may have.
        most: u64,
    },
}

/// A trial, and what follows from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Number of splats that the whole region would have.
    pub splats: usize,
    /// How much better than the goal a finished fit of so many should be, dB.
    pub surplus_db: f64,
}
