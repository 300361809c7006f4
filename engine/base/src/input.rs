//! Opening of input files: the one way in which a file that a user names is opened for reading.

use std::fs::{self, File, FileType};
use std::io;
use std::path::Path;

use crate::error::NotAFile;

/// Opens a file for reading. What is no regular file is refused before it is opened: opening a pipe waits until somebody
/// writes to it, and that may be never.
///
/// # Errors
/// Those of [`File::open`], and an error around `NotAFile`, which [`Error::io`](crate::Error::io) knows.
pub fn open(path: impl AsRef<Path>) -> io::Result<File> {
    let path = path.as_ref();
    refuse_others(fs::metadata(path)?.file_type())?;
    let file = File::open(path)?;
    // What has taken the place of the file since then is refused as well.
    refuse_others(file.metadata()?.file_type())?;
    Ok(file)
}

fn refuse_others(found: FileType) -> io::Result<()> {
    if found.is_file() {
        return Ok(());
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, NotAFile(name_of(found))))
}

fn name_of(found: FileType) -> &'static str {
    if found.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if found.is_fifo() {
            return "a pipe";
        }
        if found.is_socket() {
            return "a socket";
        }
    }
    "a device"
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;
    use crate::error::{Error, Kind};

    fn refused(path: &Path) -> Error {
        Error::io(path, "reading", &open(path).expect_err("no file"))
    }

    #[test]
    fn only_regular_files_are_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        assert_eq!(refused(&path).kind, Kind::Missing);
        fs::write(&path, "text").expect("a file");
        let mut text = String::new();
        open(&path).expect("a file").read_to_string(&mut text).expect("text");
        assert_eq!(text, "text");
        let error = refused(folder.path());
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-IO-002"));
        assert!(error.message.contains("is a folder, not a file") && !error.help.is_empty(), "{error:?}");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_sockets_and_devices_are_refused_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let (pipe, socket) = (folder.path().join("pipe"), folder.path().join("socket"));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
        assert!(made.success());
        let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
        for (path, what) in
            [(pipe.as_path(), "a pipe"), (&socket, "a socket"), (Path::new("/dev/null"), "a device")]
        {
            let error = refused(path);
            assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-IO-002"), "{what}");
            assert!(error.message.contains(what), "{error}");
        }
    }
}
