//! Which files are open: those that could be read. What the user asks for becomes open when it was read; where it cannot
//! be, what was open before stays so.

use std::path::PathBuf;

use crate::state::{Files, Subject};

/// The files that were read, and those that were asked for since.
#[derive(Clone, Debug, Default)]
pub struct OpenFiles {
    read: Files,
    asked: Vec<PathBuf>,
}

impl OpenFiles {
    /// Returns the files that were read.
    pub fn read(&self) -> &Files {
        &self.read
    }

    /// Notes that the user asks for files.
    pub fn ask(&mut self, paths: &[PathBuf]) {
        self.asked.extend_from_slice(paths);
    }

    /// Notes that the files of a subject were read; returns those of them that were asked for.
    pub fn was_read(&mut self, subject: Subject, files: &Files) -> Vec<PathBuf> {
        copy(subject, files, &mut self.read);
        self.asked.extract_if(.., |path| has(subject, files, path)).collect()
    }

    /// Puts `files` back to what was read, where those of a subject could not be.
    pub fn could_not_be_read(&mut self, subject: Subject, files: &mut Files) {
        self.asked.retain(|path| !has(subject, files, path));
        copy(subject, &self.read, files);
    }

    /// Notes that nothing is left of a subject.
    pub fn forget(&mut self, subject: Subject) {
        copy(subject, &Files::default(), &mut self.read);
    }
}

fn copy(subject: Subject, from: &Files, to: &mut Files) {
    match subject {
        Subject::Splats => to.splats.clone_from(&from.splats),
        Subject::Volume => {
            to.volume.clone_from(&from.volume);
            to.roi.clone_from(&from.roi);
        }
    }
}

fn has(subject: Subject, files: &Files, path: &PathBuf) -> bool {
    match subject {
        Subject::Splats => files.splats.contains(path),
        Subject::Volume => files.volume.as_ref() == Some(path) || files.roi.as_ref() == Some(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(splats: &[&str], volume: Option<&str>) -> Files {
        Files {
            splats: splats.iter().map(PathBuf::from).collect(),
            volume: volume.map(PathBuf::from),
            ..Files::default()
        }
    }

    #[test]
    fn what_cannot_be_read_leaves_what_was_open() {
        let mut open = OpenFiles::default();
        open.ask(&["a.ply".into(), "ct.nii".into()]);
        let both = files(&["a.ply"], Some("ct.nii"));
        assert_eq!(open.was_read(Subject::Splats, &both), [PathBuf::from("a.ply")]);
        assert_eq!(open.read(), &files(&["a.ply"], None), "the volume is still being read");
        assert_eq!(open.was_read(Subject::Volume, &both), [PathBuf::from("ct.nii")]);

        open.ask(&["bad.ply".into()]);
        let mut state = files(&["a.ply", "bad.ply"], Some("ct.nii"));
        open.could_not_be_read(Subject::Splats, &mut state);
        assert_eq!(state, both);
        // Nor does it come back with the next one that can be read.
        let more = files(&["a.ply", "b.ply"], Some("ct.nii"));
        open.ask(&["b.ply".into()]);
        assert_eq!(open.was_read(Subject::Splats, &more), [PathBuf::from("b.ply")]);
        let mut state = files(&["a.ply", "b.ply"], Some("bad.nii"));
        open.could_not_be_read(Subject::Volume, &mut state);
        assert_eq!(state, more);
        open.forget(Subject::Splats);
        assert_eq!(open.read(), &files(&[], Some("ct.nii")));
    }
}
