//! Output files appear whole or not at all.

use std::io::Write;
use std::path::Path;

use crate::error::{Error, Kind, Result};

/// Writes `path` through a temporary file beside it: `f` fills the file, which is flushed to disk and then takes the
/// name. An existing file is replaced only with `force`, and stays as it was on any error.
pub fn write_atomic(
    path: &Path,
    force: bool,
    f: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    let exists = || {
        Error::new(Kind::CannotCreate, "VGS-OUT-001", "the file exists")
            .file(path)
            .help("choose another name or allow replacing it (--force)")
    };
    if !force && path.exists() {
        return Err(exists());
    }
    let failed = |error: &std::io::Error| Error::io(path, "writing", error);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(|error| {
        Error::new(Kind::CannotCreate, "VGS-OUT-002", format!("cannot create the file: {error}")).file(path)
    })?;
    f(file.as_file_mut()).and_then(|()| file.as_file().sync_all()).map_err(|error| failed(&error))?;
    let persisted = if force { file.persist(path) } else { file.persist_noclobber(path) };
    persisted.map(drop).map_err(|error| match error.error.kind() {
        std::io::ErrorKind::AlreadyExists => exists(),
        _ => failed(&error.error),
    })
}
