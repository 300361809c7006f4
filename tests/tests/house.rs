//! What can be told from sources, documents and small programs: no device computes much here.
#![forbid(unsafe_code)]

mod arrows;
mod documentation;
mod error_codes;
mod examples;
mod fields;
mod outsiders;
mod page;
mod reliability;

use std::path::{Path, PathBuf};
use std::process::Command;

/// The repository's root.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository")
}

/// Where `tools/setup` has put one of its parts, if it is there.
fn set_up(part: &str) -> Option<PathBuf> {
    let asked = Command::new(root().join("tools/setup")).args(["--where", part]).output().expect("bash");
    let place = PathBuf::from(String::from_utf8_lossy(&asked.stdout).trim());
    if !place.exists() {
        eprintln!("left out: `tools/setup {part}` gets what this needs");
        return None;
    }
    Some(place)
}
