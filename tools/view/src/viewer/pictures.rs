//! The pictures: when one is begun, with what quality, and how it goes on between frames.

use std::collections::BTreeMap;
use std::time::Instant;

use engine::Result;
use engine::budget::Controller;
use engine::render::{Quality, level_costs, quality_levels};

use super::begun::{Begun, PictureTimes, REST};
use super::viewer::Viewer;
use crate::model::state::{Subject, mode_row};
use crate::screen::canvas::{self, Canvas, Overlay, render_setups};
use crate::screen::rendered_scene::RenderSetup;

/// Quality of the first picture, low so that something is shown at once.
const FIRST: Quality = Quality { resolution: 0.25, coarseness: 2.0, occlusion: false };

/// Instructions to the event loop between frames.
pub enum Between {
    /// Nothing is on its way.
    Nothing,
    /// A picture is on its way: ask again soon.
    Waiting,
    /// A frame should be drawn.
    Draw,
}

impl Viewer {
    /// Begins a picture if one is needed. What is only to be shown soon is finished before the next one is begun, so that
    /// something is seen of a drag; any other is given up for a newer one. Returns true if it is one of a drag.
    pub(super) fn render(&mut self, canvas: &mut Canvas, overlay: &Overlay) -> Result<bool> {
        let shown = self.app.state.subjects(|subject| self.data.has(subject));
        let chosen: Vec<_> = shown.iter().map(|&subject| self.chosen_mode(canvas, subject)).collect();
        let chosen: BTreeMap<_, _> = shown.into_iter().zip(chosen).collect();
        self.choose_levels();
        let changes = self.app.take_changes();
        self.changed |= changes.any();
        self.look_changed |= changes.look;
        if !self.look_changed {
            self.edited = None;
        }
        let size = canvas::size(overlay.picture, overlay.pixels_per_point);
        let quality = self.app.state.quality;
        self.controller.set_budget_ms(quality.target_frame_ms);
        let waits = chosen.iter().any(|(&subject, mode)| self.waits_for(subject, mode));
        self.stale |= std::mem::replace(&mut self.waits, waits) && !waits;
        // Another scene has given it up.
        self.stale |= self.begun.take_if(|_| !canvas.is_rendering()).is_some();
        let outdated = self.stale || self.changed || size != self.size;
        if self.begun.as_ref().is_some_and(|begun| begun.fast || !outdated) {
            return Ok(false);
        }
        let moves = quality.adaptive && self.changed && self.app.held() && size == self.size;
        // Something is shown at once; the rest follows.
        let first = quality.adaptive && canvas.is_blank() && self.data.fitted.is_none() || waits;
        let rested = self.moved.is_some_and(|at| at.elapsed() >= REST || !quality.adaptive);
        let (Some(pixels), true) = (size, outdated || rested) else { return Ok(false) };
        let fast = moves || first;
        let level = self.controller.level();
        let given_up = |step| match (first, moves) {
            (true, _) => FIRST,
            (false, true) => quality_levels(self.kind)[level].quality.at_step(step),
            (false, false) => Quality::FULL,
        };
        // The first level is the user's choice. So is every other level whose mode is not ready yet.
        let faster = quality_levels(self.kind)[level].mode;
        let mode_of = |subject| {
            let other = moves && level > 0 && self.moves_in(canvas, subject, faster);
            if other { faster } else { chosen[&subject] }
        };
        let has = |subject| self.data.has(subject);
        let mut setups = render_setups(&self.app.state, pixels, mode_of, given_up, has);
        for (subject, setup) in &mut setups {
            setup.settings.decoding = self.shown_decoding(canvas, *subject);
        }
        let as_wanted =
            |(subject, setup): &(Subject, RenderSetup)| setup.mode.name == self.wanted_mode(*subject);
        let is_full = |(_, setup): &(Subject, RenderSetup)| setup.quality == Quality::FULL;
        let draft = !setups.iter().all(|setup| is_full(setup) && as_wanted(setup));
        let edited = self.begun.take().and_then(|given_up| given_up.edited);
        if setups.is_empty() {
            // Nothing will be refined.
            (self.moved, self.changed) = (None, false);
            return Ok(false);
        }
        self.set_look(canvas, &setups)?;
        if quality.splat_budget != self.budget {
            self.budget = quality.splat_budget;
            canvas.set_splat_budget(self.budget)?;
        }
        let expected = match (first, fast) {
            (true, _) => Some(0.0),
            (_, true) => self.times.expected(level, self.controller.costs().ratio(0, level)),
            (_, false) => self.times.full,
        };
        let shown = canvas.begin(setups, self.app.camera(), expected)?;
        for (&subject, mode) in &chosen {
            let lacks_detail = !fast && self.lacks_detail(canvas, subject);
            if self.waits_for(subject, mode) || self.lacks_edges(canvas, subject) || lacks_detail {
                self.decode(canvas, subject)?;
            }
            if subject == Subject::Volume {
                self.edge_volume();
            }
        }
        let level = moves.then_some(level);
        let edited = edited.or(self.edited.take());
        self.begun = Some(Begun { fast, level, draft, shown, edited });
        if shown {
            self.show_begun();
        }
        if !canvas.is_rendering() {
            // Nothing of it is on the device: there is nothing to wait for.
            self.begun = None;
        }
        // What waits is not refined by time.
        self.moved = (fast && !waits).then(Instant::now);
        (self.size, self.stale, self.changed) = (size, false, false);
        Ok(moves)
    }

    /// Notes that the next frame shows what was begun.
    fn show_begun(&mut self) {
        if let Some(begun) = &mut self.begun {
            begun.shown = true;
            self.draft = begun.draft;
            self.answered = self.answered.or(begun.edited.take());
        }
    }

    /// Returns true if a frame has to be put off: the thread would wait for the part of a picture that the device renders, or
    /// the frame would delay a picture that is to be shown soon.
    pub fn puts_off(&self, canvas: &Canvas) -> Result<bool> {
        let soon = self.begun.as_ref().is_some_and(|begun| begun.fast && !begun.shown);
        Ok(canvas.is_busy()? || soon && canvas.is_rendering())
    }

    /// Goes on with the picture on its way, between two frames of the window.
    pub fn go_on(&mut self, canvas: &mut Canvas) -> Result<Between> {
        let Some(ms) = canvas.go_on()? else {
            return Ok(match (&self.begun, canvas.is_rendering()) {
                (None, _) => Between::Nothing,
                (Some(_), true) => Between::Waiting,
                // It was given up.
                (Some(_), false) => Between::Draw,
            });
        };
        let was_shown = self.begun.as_ref().is_some_and(|begun| begun.shown);
        self.show_begun();
        let Some(begun) = self.begun.take() else { return Ok(Between::Nothing) };
        if let Some(level) = begun.level {
            self.times.moving.insert(level, ms);
            self.controller.finished(level, ms);
        } else if !begun.fast {
            self.times.full = Some(ms);
            // What moves next need not find out anew that the full quality would be too slow.
            self.controller.foresee(ms);
        }
        tracing::debug!("picture rendered {}: {ms:.1} ms", if begun.fast { "fast" } else { "in full" });
        if !begun.fast {
            Subject::ALL.into_iter().try_for_each(|subject| canvas.warm_up(subject))?;
            Subject::SETS.into_iter().try_for_each(|subject| self.prepare(canvas, subject))?;
        }
        self.count(canvas, ms, begun.fast);
        Ok(if was_shown && !self.changed && !self.stale { Between::Nothing } else { Between::Draw })
    }

    /// Changes to the quality levels that belong to the mode that the user has chosen.
    fn choose_levels(&mut self) {
        let kind = mode_row(self.wanted_mode(Subject::Splats)).levels;
        if kind != self.kind {
            self.kind = kind;
            self.times = PictureTimes::default();
            self.controller = Controller::new(level_costs(quality_levels(kind)), self.controller.budget_ms());
        }
    }

    /// Gives the scenes that are about to be rendered their looks.
    fn set_look(&mut self, canvas: &mut Canvas, setups: &[(Subject, RenderSetup)]) -> Result<()> {
        let changed = std::mem::take(&mut self.look_changed);
        for (subject, _) in setups {
            match self.look(*subject) {
                Ok(look) => canvas.set_look(*subject, &look)?,
                Err(error) if changed => self.app.report(&error),
                Err(_) => {}
            }
        }
        Ok(())
    }

    /// Updates the statistics with a picture that took `ms`; reading some of them would make a fast one wait.
    fn count(&mut self, canvas: &Canvas, ms: f64, fast: bool) {
        self.report.rendered(ms);
        let statistics = &mut self.statistics;
        statistics.frame(ms);
        let passes = canvas.gpu().take_profile();
        statistics.passes = passes.into_iter().map(|(name, time)| (name, time.total_ms)).collect();
        statistics.memory = canvas.gpu().memory_by_purpose();
        statistics.step = self.app.state.quality.step;
        if !fast {
            let splats = canvas.splats_of(Subject::Splats);
            statistics.active_splats = splats.and_then(|splats| splats.active_count().ok());
        }
    }
}
