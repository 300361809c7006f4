//! The error of the splats against the volume: it is measured beside the window once the picture is there, and its
//! colours come into the picture once the field is decoded with them.

use engine::Result;
use engine::render::{DecodeOptions, Look};

use super::viewer::{Viewer, is_lost};
use crate::model::state::Subject;
use crate::screen::canvas::Canvas;

/// Work without which the picture cannot have the colours of the error.
const COLOURING: &str = "colouring by the error";

impl Viewer {
    /// Begins to measure the error, if it can be and nothing else has to be made.
    pub(super) fn measure_error(&mut self, canvas: &Canvas) {
        if self.fit.is_some() || self.measuring || self.loader.doing().is_some() {
            return;
        }
        if let Some((splats, volume)) = self.data.to_measure() {
            self.measuring = true;
            self.loader.measure(splats, volume, canvas.gpu());
        }
    }

    /// Puts the colours of the error into the picture, or takes them out, as the state says.
    pub(super) fn follow_error(&mut self, canvas: &mut Canvas) -> Result<()> {
        let shown = self.data.shows_error(&self.app.state) && self.fit.is_none();
        if shown && !canvas.has_error() {
            match self.data.error_scene(canvas.gpu(), &self.app.state, DecodeOptions::default()) {
                Ok(Some((scene, decoding))) => {
                    canvas.set_error(Some(scene));
                    self.loader.prepare(COLOURING, decoding);
                }
                Ok(None) => {}
                Err(error) if is_lost(&error) => return Err(error),
                Err(error) => {
                    self.app.report(&error);
                    self.app.state.errors.picture = false;
                }
            }
        }
        let shown = shown && canvas.error_is_decoded(DecodeOptions::default());
        if std::mem::replace(&mut self.error_shown, shown) != shown {
            canvas.show_error(shown);
            // What has changed meanwhile, both scenes have to follow.
            let look = self.look(Subject::Splats)?;
            canvas.set_look(Subject::Splats, &look)?;
            self.stale = true;
        }
        Ok(())
    }

    /// Returns the look of a subject, with the colours of the error where they are shown.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::look`](crate::ViewState::look).
    pub(super) fn look(&self, subject: Subject) -> Result<Look> {
        self.data.look(subject, &self.app.state).map(|look| self.coloured(subject, look))
    }

    /// Returns a look with the colours of the error, where they are shown.
    pub(super) fn coloured(&self, subject: Subject, look: Look) -> Look {
        match self.data.error_found().filter(|_| self.error_shown && subject == Subject::Splats) {
            Some(error) => error.look(&look, self.app.state.errors.range(error)),
            None => look,
        }
    }
}
