//! What is made in a headset is kept: distances, planes, objects, the transfer function and the patient's place go into a
//! session file, which the desktop viewer opens, too.

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use engine::Result;
use view::model::state::{Edited, Files, InHeadset, ViewState, is_session};

/// Ending of the session that is written beside splats.
const ENDING: &str = "vgs-session.toml";
/// Greatest number of sessions beside the same splats.
const MOST: u32 = 9999;
/// Time from one writing to the next while the session lasts, seconds.
const EVERY: f64 = 10.0;

/// The session that is kept.
pub struct Keeper {
    /// The file, once it is known: that which the user has named, or the new one that was written.
    path: Option<PathBuf>,
    /// The file that a new one stands beside.
    beside: Option<PathBuf>,
    /// What the file has, or what there was at the start.
    kept: (Edited, Option<InHeadset>),
    /// Time of the next writing, seconds.
    next: f64,
    /// The writing that goes on beside the frames.
    writing: Option<JoinHandle<Result<()>>>,
}

impl Keeper {
    /// Creates the keeper of a session that begins with a state and shows `files`. `named` is the file that the user has
    /// named for it.
    pub fn new(named: Option<&Path>, files: &[PathBuf], state: &ViewState) -> Self {
        let Files { splats, volume, .. } = &state.files;
        let session = files.iter().find(|path| is_session(path));
        let beside = session.or(splats.first()).or(volume.as_ref()).cloned();
        let kept = (state.edited(), state.headset);
        Keeper { path: named.map(Path::to_owned), beside, kept, next: 0.0, writing: None }
    }

    /// Writes a state beside the frames, if it is time and anything has been made. No frame waits for it.
    pub fn keep_soon(&mut self, seconds: f64, state: impl FnOnce() -> ViewState) {
        if seconds < self.next || self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        self.next = seconds + EVERY;
        // What fails is tried again, and told at the end.
        self.note_written();
        self.writing = self.task(state()).map(std::thread::spawn);
    }

    /// Writes the last state, if anything has been made since the last time. Returns the file, if there is one: the one that
    /// the user has named, or a new one, since nothing that exists is replaced unasked.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::write`].
    pub fn finish(&mut self, state: ViewState) -> Result<Option<PathBuf>> {
        self.note_written();
        let Some(task) = self.task(state) else { return Ok(self.path.clone().filter(|path| path.exists())) };
        task().map(|()| self.path.clone())
    }

    /// Waits for the writing; if it has failed, nothing is known of what the file has.
    fn note_written(&mut self) {
        if self.writing.take().is_some_and(|writing| !matches!(writing.join(), Ok(Ok(())))) {
            self.kept.1 = Some(InHeadset { scale: f64::NAN, ..InHeadset::HOME });
        }
    }

    /// Returns what writes a state; `None` if it is already kept, or if there is nothing to stand beside.
    fn task(&mut self, state: ViewState) -> Option<impl FnOnce() -> Result<()> + Send + use<>> {
        let (edited, headset) = &self.kept;
        if state.is_edited_as(edited) && state.headset == *headset {
            return None;
        }
        if self.path.is_none() {
            self.path = new_beside(self.beside.as_deref()?);
        }
        let path = self.path.clone()?;
        self.kept = (state.edited(), state.headset);
        Some(move || state.write(&path, true))
    }
}

/// Returns a name beside a file that no file has.
fn new_beside(file: &Path) -> Option<PathBuf> {
    let stem = file.file_stem()?.to_string_lossy();
    let stem = stem.strip_suffix(".vgs-session").unwrap_or(&stem);
    let name = |n: u32| match n {
        1 => format!("{stem}.{ENDING}"),
        n => format!("{stem}-{n}.{ENDING}"),
    };
    (1..=MOST).map(|n| file.with_file_name(name(n))).find(|path| !path.exists())
}

#[cfg(test)]
mod tests {
    use engine::transfer::preset;
    use glam::{DQuat, DVec3};
    use view::model::state::Distance;

    use super::*;

    #[test]
    fn what_was_made_is_kept_in_a_new_file_or_in_the_one_that_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let splats = folder.path().join("bones.ply");
        let mut state = ViewState::new(&preset("CT-Bone").expect("a preset").over([0.0, 1.0]));
        state.files.splats = vec![splats.clone()];
        let files = [splats.clone()];
        let mut made = state.clone();
        made.distances.push(Distance { from_mm: DVec3::ZERO, to_mm: DVec3::X });
        made.headset = Some(InHeadset { moved_m: DVec3::Y, turned: DQuat::from_rotation_x(0.5), scale: 2.0 });
        let names =
            ["bones.vgs-session.toml", "bones-2.vgs-session.toml"].map(|name| folder.path().join(name));
        for name in &names {
            let mut own = Keeper::new(None, &files, &state);
            assert_eq!(own.finish(state.clone()).expect("nothing to keep"), None);
            assert_eq!(own.finish(made.clone()).expect("kept").as_ref(), Some(name), "none is replaced");
            let read = ViewState::read(name).expect("a session");
            assert_eq!((read.distances.len(), read.files.splats.clone()), (1, vec![splats.clone()]));
            let [place, kept] = [made.headset, read.headset].map(|place| place.expect("a place"));
            assert!((place.moved_m - kept.moved_m).length() < 1e-12 && kept.scale == 2.0);
        }
        // The one that is named is written again and again.
        let plan = folder.path().join("plan.toml");
        for _ in 0..2 {
            let mut named = Keeper::new(Some(&plan), &files, &state);
            assert_eq!(named.finish(made.clone()).expect("kept"), Some(plan.clone()));
        }
        // Where only the patient was moved, that is kept, too.
        let moved = ViewState { headset: made.headset, ..state.clone() };
        assert!(Keeper::new(None, &files, &state).finish(moved).expect("kept").is_some());
    }

    #[test]
    fn what_was_made_is_kept_while_the_session_lasts() {
        let folder = tempfile::tempdir().expect("a folder");
        let files = [folder.path().join("bones.ply")];
        let mut state = ViewState::new(&preset("CT-Bone").expect("a preset").over([0.0, 1.0]));
        state.files.splats = files.to_vec();
        let mut keeper = Keeper::new(None, &files, &state);
        keeper.keep_soon(0.0, || state.clone());
        assert!(keeper.writing.is_none(), "nothing was made");
        state.background = DVec3::ONE;
        keeper.keep_soon(1.0, || panic!("it is too soon"));
        keeper.keep_soon(EVERY, || state.clone());
        keeper.writing.take().expect("a writing").join().expect("no panic").expect("written");
        let path = folder.path().join("bones.vgs-session.toml");
        assert_eq!(ViewState::read(&path).expect("a session").background, DVec3::ONE);
        // The same file is written to the end, though it is there by now.
        state.background = DVec3::X;
        assert_eq!(keeper.finish(state.clone()).expect("kept"), Some(path.clone()));
        assert_eq!(ViewState::read(&path).expect("a session").background, DVec3::X);
        assert_eq!(keeper.finish(state).expect("nothing new"), Some(path));
    }
}
