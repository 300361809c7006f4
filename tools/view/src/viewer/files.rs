//! Files that are opened, and those that are written beside the window.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use engine::Result;
use engine::figures::bytes;

use super::viewer::Viewer;
use crate::io::loaded_splats::LoadedSplats;
use crate::io::pack::pack;
use crate::io::sharing;
use crate::io::sorting::{Sorted, needs_look, put_beside, sort};
use crate::model::deletions::Target;
use crate::model::picture_options::PictureOptions;
use crate::model::state::{Files, Subject, ViewState};
use crate::screen::canvas::Canvas;
use crate::screen::export::Export;

impl Viewer {
    /// Notes that the files of a subject are open, and puts them among the recent ones.
    pub(super) fn remember_files(&mut self, subject: Subject) {
        let opened = self.open_files.was_read(subject, &self.app.state.files);
        opened.iter().for_each(|path| self.app.settings.opened(path));
        if !opened.is_empty()
            && let Err(error) = self.app.settings.write()
        {
            self.app.report(&error);
        }
    }

    /// Drops what is not open any more.
    pub(super) fn forget(&mut self, canvas: &mut Canvas, gone: Vec<Subject>) -> Result<()> {
        for subject in gone {
            self.data.forget(subject);
            self.data_number += 1;
            self.open_files.forget(subject);
            self.set_scene(canvas, subject)?;
        }
        Ok(())
    }

    /// Begins to read the files of the state that are not open yet.
    pub(super) fn read_files(&mut self) {
        let volume = self.data.volume.as_ref().map(|loaded| &loaded.volume);
        self.loader.open(&self.app.state.files, self.open_files.read(), volume, self.app.state.edges);
    }

    /// Writes a file beside the window.
    pub(super) fn export(
        &mut self,
        canvas: &Canvas,
        path: PathBuf,
        options: PictureOptions,
        write: impl FnOnce(&Export, &Path, &mut dyn FnMut(f32)) -> Result<()> + Send + 'static,
    ) {
        let points = self.app.picture().size().into();
        let shown = (&self.app.state, &self.data);
        let export = Export::new(canvas.gpu(), shown, options, points, self.range);
        // Nobody waits for a long turntable at the end.
        drop(
            self.loader
                .write(path.clone(), move |progress| write(&export, &path, progress).map(|()| String::new())),
        );
    }

    /// Begins to read files, or to look into them where names do not tell what they are. Returns the subjects of
    /// which a session has no files.
    pub(super) fn open(&mut self, paths: &[PathBuf]) -> Result<Vec<Subject>> {
        let files = &self.app.state.files;
        if needs_look(files, paths) {
            let volume = self.data.volume.as_ref().map(|loaded| &loaded.volume);
            self.loader.sort(files, paths.to_vec(), volume);
            return Ok(Vec::new());
        }
        self.open_sorted(sort(files, paths)?, paths)
    }

    pub(super) fn open_sorted(&mut self, sorted: Sorted, paths: &[PathBuf]) -> Result<Vec<Subject>> {
        if let (Some(state), Some(session)) = (sorted.state().transpose()?, sorted.session) {
            if !state.files.missing().is_empty() {
                self.app.ask_missing(state, session);
                return Ok(Vec::new());
            }
            self.open_files.ask(paths);
            return Ok(self.begin_session(state, session));
        }
        // What is still being read is read again, together with the new files.
        let fresh = *self.open_files.read() == Files::default();
        self.app.state.files = sorted.files;
        self.frame_all |= fresh;
        if !sorted.notes.is_empty() {
            self.app.done(sorted.notes.join(" "));
        }
        self.open_files.ask(paths);
        Ok(self.read_and_forget())
    }

    /// Shows a session in place of what is open. Returns the subjects of which it has no files.
    pub(super) fn begin_session(&mut self, state: ViewState, session: PathBuf) -> Vec<Subject> {
        self.app.settings.opened(&session);
        self.app.begin(state, Some(session));
        self.frame_all = false;
        if let Err(error) = self.app.settings.write() {
            self.app.report(&error);
        }
        self.read_and_forget()
    }

    /// Begins to read the files of the state; returns the subjects of which it has none.
    fn read_and_forget(&mut self) -> Vec<Subject> {
        let files = &self.app.state.files;
        let mut gone = Vec::new();
        if files.splats.is_empty() {
            gone.push(Subject::Splats);
        }
        if files.beside.is_none() {
            gone.push(Subject::Beside);
        }
        if files.volume.is_none() {
            gone.push(Subject::Volume);
        }
        self.read_files();
        gone
    }

    /// Begins to read splats beside those that are open.
    pub(super) fn open_beside(&mut self, path: PathBuf) {
        if let Err(error) = put_beside(&mut self.app.state, path.clone()) {
            return self.app.report(&error);
        }
        self.open_files.ask(&[path]);
        self.read_files();
    }

    /// Begins to write the session with all of its files into a zip.
    pub(super) fn pack(&mut self, path: PathBuf, force: bool) {
        let state = self.app.state.clone();
        self.loader.write_to_the_end(path.clone(), move |progress| {
            let contents = pack(&state, &path, force, progress)?;
            Ok(if contents.has_dicom {
                "; the DICOM files in it name the patient".to_owned()
            } else {
                String::new()
            })
        });
    }

    /// Begins to write the splats that are shown, or those of one object.
    pub(super) fn save_splats(
        &mut self,
        canvas: &Canvas,
        path: PathBuf,
        object: Option<Target>,
        force: bool,
    ) {
        let state = self.app.state.clone();
        let Some(left) = self.remaining_splats() else { return };
        let gpu = canvas.gpu().clone();
        self.loader.write_to_the_end(path.clone(), move |_| {
            let left_out = left().write(&gpu, &state, object, &path, force)?;
            Ok(match left_out {
                0 => String::new(),
                count => {
                    format!("; {count} splats are not in it, which are hidden, cut away or transparent")
                }
            })
        });
    }

    /// Begins to write what is shown as a page.
    pub(super) fn share(&mut self, canvas: &Canvas, path: PathBuf, title: String, force: bool) {
        let state = self.app.state.clone();
        let Some(left) = self.remaining_splats() else { return };
        let gpu = canvas.gpu().clone();
        self.loader.write_to_the_end(path.clone(), move |_| {
            let sizes = sharing::write(&gpu, &state, &left(), &title, &path, force)?;
            Ok(format!(", {}; whoever has it has the splats in it", bytes(sizes.page)))
        });
    }

    /// Returns what finds the splats that deletions leave, on any thread; `None` without splats.
    fn remaining_splats(&self) -> Option<impl FnOnce() -> Arc<LoadedSplats> + Send + 'static> {
        let deleted = self.app.state.deleted.clone();
        let whole = self.data.splats.clone()?;
        // What was deleted last may still be being found.
        let left = self.data.remaining_splats().filter(|_| *self.data.deleted() == deleted[..]).cloned();
        Some(move || left.unwrap_or_else(|| Arc::new(whole.without(&deleted))))
    }
}
