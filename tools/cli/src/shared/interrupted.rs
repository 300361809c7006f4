//! What interrupted work leaves, by which `--resume` goes on.

use std::path::{Path, PathBuf};

use engine::{Error, Kind, Result};

use super::outputs::beside;

/// Returns the path of the state of work on `output`.
pub fn state_path(output: &Path) -> PathBuf {
    beside(output, ".state")
}

/// Returns an error if one of these states exists.
pub fn check_none_left(states: &[PathBuf]) -> Result<()> {
    match states.iter().find(|path| path.exists()) {
        Some(state) => {
            let message = "interrupted work left its state here";
            Err(Error::new(Kind::CannotCreate, "VGS-CLI-030", message)
                .file(state)
                .help("continue with --resume, or start over with --force"))
        }
        None => Ok(()),
    }
}

/// Returns the error for a state that should be at `path`, and is not.
pub fn nothing_to_resume(path: PathBuf) -> Error {
    Error::new(Kind::Missing, "VGS-CLI-035", "there is no state of interrupted work here")
        .file(path)
        .help("finished work leaves none: start without --resume")
}

/// Returns the error for the state of work that differs in `what`.
pub fn of_other_work(path: &Path, what: &str) -> Error {
    Error::new(Kind::Usage, "VGS-CLI-033", format!("this is the state of other work: {what}"))
        .file(path)
        .help("give the flags of the interrupted command, or start over with --force")
}

/// Returns the error for notes in a state that are no notes.
pub fn bad_notes(path: &Path, error: &serde_json::Error) -> Error {
    Error::new(Kind::BadData, "VGS-CLI-032", format!("the notes cannot be read: {error}"))
        .file(path)
        .help("start over, with --force")
}

/// Returns notes as text.
pub fn notes_text(notes: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string(notes).map_err(|e| {
        Error::new(Kind::Internal, "VGS-CLI-031", format!("the notes of a state cannot be written: {e}"))
    })
}
