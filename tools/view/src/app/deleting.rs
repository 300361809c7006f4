//! Deletes splats by the crop box, and tells when that cannot be.

use std::path::Path;

use super::app::App;
use crate::model::deletions::{Bounds, Deletion};
use crate::model::panel_info::PanelInfo;
use crate::model::state::Files;
use crate::panels::messages::Message;

impl App {
    /// Deletes the splats inside or outside of the crop box. The box then goes off: it has done its work.
    pub(super) fn delete(&mut self, inside: bool, info: &PanelInfo<'_>) {
        // Only files that were read have rows.
        let files = self.state.objects.iter().map(|object| object.file + 1).max();
        let crop = self.state.clip.crop.as_mut().filter(|crop| crop.on);
        let (crop, files) = match (crop, files) {
            _ if info.fitted => {
                return self.refuse("The fitted splats have not been saved", "keep them first");
            }
            (_, None) => return self.refuse("There are no splats to delete", "open some"),
            (None, _) => {
                return self
                    .refuse("The crop box decides which splats are deleted", "press X to switch it on");
            }
            (Some(crop), Some(files)) => (crop, files),
        };
        crop.on = false;
        let bounds = Bounds { low_mm: crop.low_mm, high_mm: crop.high_mm, files };
        self.state.deleted.push(if inside { Deletion::Inside(bounds) } else { Deletion::Outside(bounds) });
    }

    /// Returns true if splats can be written to a file of this name; otherwise says why not.
    pub(super) fn may_write_splats(&mut self, path: &Path, info: &PanelInfo<'_>) -> bool {
        // Links and relative paths name the same file as others do.
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let Files { splats, beside, .. } = &self.state.files;
        if splats.iter().chain(beside).any(|open| real(open) == real(path)) {
            self.refuse("This file is open and still has the deleted splats", "choose another name");
            return false;
        }
        self.has_splats_to_write(info)
    }

    /// Returns true if there are splats of files to write; otherwise says what to do.
    pub(super) fn has_splats_to_write(&mut self, info: &PanelInfo<'_>) -> bool {
        if info.fitted {
            self.refuse("The fitted splats have not been saved", "save them from the fit panel");
        } else if info.splats.is_none_or(|count| count == 0) {
            self.refuse("There are no splats to save", "open a file, or restore deleted splats");
        } else {
            return true;
        }
        false
    }

    /// Tells the user why something cannot be done, and what to do.
    pub(super) fn refuse(&mut self, text: &str, help: &str) {
        self.messages.tell(Message { text: text.to_owned(), help: help.to_owned(), bad: true });
    }
}
