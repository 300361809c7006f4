//! Tells of the stages of a fit besides its iterations, and of the number of splats.

use std::ops::ControlFlow;

use engine::fit::{Count, Goal, Stage, Trial, Watch};

use crate::shared::console::Console;
use crate::shared::figures::bytes;
use crate::shared::signals::Signals;
use crate::shared::waiting::Waiting;

/// Tells of the stages of a fit besides its iterations, and ends them on signals.
pub struct Stages<'a> {
    signals: &'a Signals,
    console: &'a Console,
    goal: Option<Goal>,
    /// Text behind an intensity.
    unit: &'static str,
    waiting: Option<Waiting>,
}

impl<'a> Stages<'a> {
    /// Creates a watch for a fit with this goal.
    pub fn new(signals: &'a Signals, console: &'a Console, goal: Option<Goal>, unit: &'static str) -> Self {
        Stages { signals, console, goal, unit, waiting: None }
    }

    fn target(&self) -> String {
        self.goal.map(|goal| goal.text(self.unit)).unwrap_or_default()
    }
}

impl Watch for Stages<'_> {
    fn begin_stage(&mut self, stage: Stage) {
        // One is over before the next tells of itself.
        self.waiting = None;
        self.waiting = Some(Waiting::on(stage.text()));
    }

    fn going(&mut self, done: f64) -> ControlFlow<()> {
        if let Some(waiting) = &self.waiting {
            waiting.at(done);
        }
        if self.stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn end_stage(&mut self) {
        self.waiting = None;
    }

    fn counted(&mut self, count: &Count) {
        let target = self.target();
        let told = match *count {
            Count::Tried(trial) => {
                let Trial { splats, surplus_db } = trial;
                return tracing::info!("{splats} splats would be {surplus_db:+.1} dB from the target");
            }
            Count::Found { splats, most, trials } => {
                let limited = match splats > most {
                    true => format!("; {most} are the most there may be"),
                    false => String::new(),
                };
                let trials = match trials {
                    1 => "a short trial".to_owned(),
                    _ => format!("{trials} short trials"),
                };
                format!("for {target}: about {splats} splats, by {trials}{limited}")
            }
            Count::MissedGoal { splats } => format!("not yet {target}: fitting again with {splats} splats"),
            Count::TooLarge { splats, bytes: size, most } => {
                format!("{} are more than {}: fitting again with {splats} splats", bytes(size), bytes(most))
            }
        };
        self.console.say(&told);
    }

    fn stops(&mut self) -> bool {
        self.signals.exit_code().is_some()
    }
}
