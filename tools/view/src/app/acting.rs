//! What actions do.

use std::path::PathBuf;

use super::app::App;
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::series::Series;
use crate::model::state::Files;
use crate::panels::prompt::Purpose;

impl App {
    /// Carries out an action, or returns it if only the window can do it.
    pub fn act(&mut self, action: Action, info: &PanelInfo<'_>) -> Option<Action> {
        // Something is lost only if the user says so.
        if self.loss(&action, info).any() && self.leaving.as_ref() != Some(&action) {
            self.leaving = Some(action);
            return None;
        }
        let state = &mut self.state;
        match action {
            Action::Open(_) => {
                self.leaving = None;
                return Some(action);
            }
            Action::SaveSplats { ref path, .. } => {
                return self.may_write_splats(path, info).then_some(action);
            }
            Action::Share { .. } => return self.has_splats_to_write(info).then_some(action),
            Action::Screenshot { .. }
            | Action::Record { .. }
            | Action::Beside(_)
            | Action::Region(_)
            | Action::StartFit { .. }
            | Action::StopFit
            | Action::Keep { .. }
            | Action::DiscardFit
            | Action::WantThumbnails
            | Action::AskSeries
            | Action::ReadFiles
            | Action::Pack { .. }
            | Action::BeginSession
            | Action::Quit => return Some(action),
            Action::AskFound(path) => {
                // Dialogs of the desktop take either a file or a folder.
                let may_be_folder = path.extension().is_none();
                self.missing.as_mut()?.wanted = Some(path);
                if may_be_folder {
                    self.ask_by_own_dialog(Purpose::Find);
                } else {
                    self.ask(Purpose::Find);
                }
            }
            Action::Found(found) => {
                let all = self.missing.as_mut()?.take(&found);
                return all.then_some(Action::BeginSession);
            }
            Action::LeaveOutMissing => {
                let state = &mut self.missing.as_mut()?.state;
                state.files.missing().iter().for_each(|path| state.leave_out(path));
                return Some(Action::BeginSession);
            }
            Action::CloseBeside if state.files.beside.is_none() => {}
            Action::CloseBeside => {
                state.files.beside = None;
                state.forget_missing_files();
                state.split.take_if(|_| !info.volume);
                return Some(action);
            }
            Action::Series(number) => {
                let Series { files, rows } = self.series.take()?;
                let row = rows.into_iter().find(|row| row.summary.number == number)?;
                state.files = Files { series: Some(row.key), ..files };
                return Some(Action::ReadFiles);
            }
            Action::AskOpen
            | Action::AskOpenFolder
            | Action::AskSave
            | Action::AskScreenshot
            | Action::AskRecord
            | Action::AskTransfer
            | Action::AskSaveTransfer
            | Action::AskSaveSplats
            | Action::AskSaveObject(_)
            | Action::AskShare
            | Action::AskPack
            | Action::AskBeside
            | Action::AskMask
            | Action::AskKeep => self.ask_for(&action, info),
            Action::Mask(path) => return Some(Action::Region(Some(self.fit_form.take_mask(path)))),
            Action::Save { path, force } => return self.save(path, force, info),
            Action::SaveTransfer { path, force } => {
                let written =
                    state.transfer.function().and_then(|f| engine::transfer::save(&f, &path, force));
                self.report_outcome(written, || format!("The transfer function is in {}.", path.display()));
            }
            Action::Transfer(name) => self.take_transfer(&name, info),
            Action::Undo | Action::Redo => {
                let edited = state.edited();
                let step = match action {
                    Action::Undo => self.history.undo(&edited),
                    _ => self.history.redo(&edited),
                };
                step.into_iter().for_each(|edited| self.state.restore(edited));
            }
            Action::DeleteInside => self.delete(true, info),
            Action::DeleteOutside => self.delete(false, info),
            Action::Cancel => {
                self.measuring = None;
                self.end_questions();
                self.keys = false;
                self.leaving = None;
                self.messages.close();
            }
            _ => self.change_view(&action, info),
        }
        None
    }

    /// Writes the session, and goes on to what waited for that.
    fn save(&mut self, path: PathBuf, force: bool, info: &PanelInfo<'_>) -> Option<Action> {
        let written = self.state.write(&path, force);
        let next = self.saves_to_leave.take().filter(|_| written.is_ok());
        if written.is_ok() {
            self.note_saved();
            self.session = Some(path.clone());
        }
        self.report_outcome(written, || format!("The session is in {}.", path.display()));
        self.act(next?, info)
    }
}
