//! Deletes splats beside the window: what is left of them comes into the picture once it is found.

use super::viewer::{Viewer, is_lost};
use crate::io::loader::{Loaded, Remaining};
use crate::model::state::Subject;

impl Viewer {
    /// Begins to find the splats that the deletions of the state leave, unless they are shown already.
    pub(super) fn follow_deletions(&mut self) {
        let deleted = &self.app.state.deleted;
        let Some(whole) = self.data.splats.as_ref().filter(|_| self.data.deleted() != deleted) else {
            return;
        };
        // One after the other; the last one has all that was deleted meanwhile.
        if !std::mem::replace(&mut self.deleting, true) {
            self.loader.delete(whole.clone(), deleted.clone());
        }
    }

    /// Takes the splats that deletions leave. Returns the subject that has to be shown anew.
    pub(super) fn take_left(&mut self, left: Remaining) -> Option<Subject> {
        self.deleting = false;
        match self.data.take(Loaded::Remaining(left)) {
            Ok(subject) => subject.filter(|_| self.data.fitted.is_none()),
            // The window begins anew, and tries it again.
            Err(error) if is_lost(&error) => {
                self.stale = true;
                None
            }
            Err(error) => {
                self.app.report(&error);
                // What could not be deleted stays.
                let deleted = self.data.deleted().to_vec();
                self.app.change_unasked(|state| state.deleted = deleted);
                std::mem::take(&mut self.data.waits).then_some(Subject::Splats)
            }
        }
    }
}
