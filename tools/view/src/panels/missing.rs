//! Question where the missing files of a session are.

use std::path::{Path, PathBuf};

use egui::{Context, Id, Modal, ScrollArea};

use super::widgets::escaped;
use crate::model::state::ViewState;

/// Session that is opened once its missing files are found or left out.
#[derive(Clone, Debug)]
pub struct Missing {
    /// What it shows.
    pub state: ViewState,
    /// Its file.
    pub session: PathBuf,
    /// Missing file that the user is asked for.
    pub wanted: Option<PathBuf>,
    /// Files that are missing, as they are listed.
    files: Vec<PathBuf>,
}

impl Missing {
    /// Creates the question.
    pub fn new(state: ViewState, session: PathBuf) -> Self {
        let files = state.files.missing();
        Missing { state, session, wanted: None, files }
    }

    /// Takes a file for the one that is wanted, and others that lie beside it for theirs. Returns true if none is missing
    /// any more.
    pub fn take(&mut self, found: &Path) -> bool {
        if let Some(wanted) = self.wanted.take() {
            self.state.files.replace_missing(&wanted, found);
            self.files = self.state.files.missing();
        }
        self.files.is_empty()
    }
}

/// Answer of a user who is asked for missing files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The user wants to say where this one is.
    Find(PathBuf),
    /// The session is opened without them.
    LeaveOut,
    /// The session is not opened.
    Cancel,
}

/// Asks where the missing files are. Returns the answer once there is one.
pub fn show(context: &Context, asked: &Missing) -> Option<Choice> {
    let missing = &asked.files;
    let modal = Modal::new(Id::new("missing")).show(context, |ui| {
        ui.set_width(460.0);
        ui.heading(if missing.len() == 1 { "A file is missing" } else { "Files are missing" });
        let name = asked.session.file_name().unwrap_or_default().to_string_lossy();
        ui.label(format!("{name} refers to files that are neither where it says nor next to it."));
        let mut choice = None;
        ScrollArea::vertical().max_height(240.0).show(ui, |ui| {
            for path in missing {
                ui.horizontal(|ui| {
                    let find = ui
                        .button("Find…")
                        .on_hover_text("show where it is; others next to it are found as well");
                    if find.clicked() {
                        choice = Some(Choice::Find(path.clone()));
                    }
                    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                    ui.label(name).on_hover_text(path.display().to_string());
                });
            }
        });
        ui.horizontal(|ui| {
            let without = ui.button("Open without").on_hover_text("what belongs to them is left out as well");
            if without.clicked() {
                choice = Some(Choice::LeaveOut);
            }
            if ui.button("Cancel").on_hover_text("keep what is open").clicked() {
                choice = Some(Choice::Cancel);
            }
        });
        choice
    });
    if modal.inner.is_none() && escaped(context, &modal) { Some(Choice::Cancel) } else { modal.inner }
}
