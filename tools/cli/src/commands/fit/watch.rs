//! Watches a fit: shows progress, stops it on signals, and writes checkpoints on the way.

use std::ops::ControlFlow;

use engine::Result;
use engine::fit::{Beginning, Count, Milestone, Progress, Stage, Watch};

use super::prepare::Prepared;
use super::telling::Stages;
use crate::shared::console::Console;
use crate::shared::progress::Display;
use crate::shared::signals::Signals;
use crate::shared::waiting::Waiting;

/// Watches one fit.
pub struct FitWatch<'a> {
    prepared: &'a Prepared<'a>,
    stages: Stages<'a>,
    signals: &'a Signals,
    console: &'a Console,
    display: Option<Display>,
    /// Span of the range of the figures, HU.
    span: f64,
    /// What the fit waits for before its iterations begin.
    waiting: Option<Waiting>,
    /// Iteration of the last checkpoint, or the one with which the fit resumes.
    saved: u32,
}

impl<'a> FitWatch<'a> {
    /// Creates a watch for a fit.
    pub fn new(prepared: &'a Prepared<'a>, signals: &'a Signals, console: &'a Console) -> Self {
        let waiting = Some(Waiting::on("preparing the device for the fit"));
        let unit = prepared.case.volume.unit().text();
        let stages = Stages::new(signals, console, prepared.plan.goal().copied(), unit);
        FitWatch { prepared, stages, signals, console, display: None, span: 1.0, waiting, saved: 0 }
    }
}

impl Watch for FitWatch<'_> {
    fn begin(&mut self, beginning: &Beginning) {
        let &Beginning { splats, iterations, range: [low, high] } = beginning;
        self.signals.defer_first_signal();
        self.waiting = None;
        self.span = f64::from(high) - f64::from(low);
        let before = match iterations {
            0 => String::new(),
            _ => format!("continuing after {iterations} iterations: "),
        };
        let problem = self.prepared.plan.problem();
        let (voxels, unit) = (problem.roi().voxel_count(), problem.volume().unit().text());
        self.console.say(&format!(
            "{before}fitting {splats} splats to {voxels} voxels; errors on the way are root mean squares, and dB are PSNR \
             over {low} to {high}{unit}"
        ));
        self.display = Some(Display::new(self.console));
        self.saved = iterations;
    }

    fn step(&mut self, iteration: u32, share: f64) {
        if let Some(display) = &mut self.display {
            display.show(iteration, share);
        }
    }

    fn figures(&mut self, progress: &Progress) {
        if let Some(display) = &mut self.display {
            display.figures(progress, self.span, self.prepared.plan.problem().volume().unit().text());
        }
    }

    fn stops(&mut self) -> bool {
        self.stages.stops()
    }

    fn begin_stage(&mut self, stage: Stage) {
        // The iterations are over.
        self.display = None;
        self.stages.begin_stage(stage);
    }

    fn going(&mut self, done: f64) -> ControlFlow<()> {
        self.stages.going(done)
    }

    fn end_stage(&mut self) {
        self.stages.end_stage();
    }

    fn counted(&mut self, count: &Count) {
        self.stages.counted(count);
    }

    fn keeps(&self, iteration: u32) -> bool {
        iteration > self.saved && self.prepared.checkpoints.is_due(iteration)
    }

    fn keep(&mut self, milestone: &mut Milestone<'_, '_>) -> Result<bool> {
        let checkpoints = &self.prepared.checkpoints;
        let state = milestone.fitter.state()?;
        if self.keeps(milestone.iteration) {
            let set = self.prepared.plan.set(milestone.splats, milestone.iteration);
            checkpoints.write_splats(&set, milestone.iteration)?;
            self.saved = milestone.iteration;
        }
        checkpoints.write_state(&state, milestone.seconds, milestone.curve)?;
        Ok(true)
    }
}
