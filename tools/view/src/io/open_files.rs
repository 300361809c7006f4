//! Keeps track of the files that are open, which are those that could be read. Files that the user asks for
//! become open once they are read; if they cannot be read, the files open before stay open.

use std::path::PathBuf;

use crate::model::state::{Files, Subject};

/// Files that were read, and those that were asked for since.
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

    /// Resets the files of a subject in `files` to those that were read, since the new ones could not be
    /// read.
    pub fn revert(&mut self, subject: Subject, files: &mut Files) {
        self.asked.retain(|path| !has(subject, files, path));
        copy(subject, &self.read, files);
    }

    /// Notes that nothing of a subject is open any more.
    pub fn forget(&mut self, subject: Subject) {
        copy(subject, &Files::default(), &mut self.read);
    }
}

fn copy(subject: Subject, from: &Files, to: &mut Files) {
    match subject {
        Subject::Splats => to.splats.clone_from(&from.splats),
        Subject::Beside => to.beside.clone_from(&from.beside),
        Subject::Volume => {
            to.volume.clone_from(&from.volume);
            to.series.clone_from(&from.series);
            to.set_region(from.region());
        }
    }
}

fn has(subject: Subject, files: &Files, path: &PathBuf) -> bool {
    match subject {
        Subject::Splats => files.splats.contains(path),
        Subject::Beside => files.beside.as_ref() == Some(path),
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
        open.revert(Subject::Splats, &mut state);
        assert_eq!(state, both);
        // It does not come back with the next one that can be read, either.
        let more = files(&["a.ply", "b.ply"], Some("ct.nii"));
        open.ask(&["b.ply".into()]);
        assert_eq!(open.was_read(Subject::Splats, &more), [PathBuf::from("b.ply")]);
        let mut state = files(&["a.ply", "b.ply"], Some("bad.nii"));
        open.revert(Subject::Volume, &mut state);
        assert_eq!(state, more);
        // Splats beside them come and go alone.
        let with_beside = |name: &str| Files { beside: Some(name.into()), ..state.clone() };
        open.ask(&["coarse.vgs".into()]);
        let opened = open.was_read(Subject::Beside, &with_beside("coarse.vgs"));
        assert_eq!((opened, open.read()), (vec!["coarse.vgs".into()], &with_beside("coarse.vgs")));
        let mut other = with_beside("bad.vgs");
        open.revert(Subject::Beside, &mut other);
        assert_eq!(other, with_beside("coarse.vgs"));
        open.forget(Subject::Beside);
        assert_eq!(open.read(), &more);
        open.forget(Subject::Splats);
        assert_eq!(open.read(), &files(&[], Some("ct.nii")));
    }
}
