//! Opening of input files: the one way in which a file that a user names is opened for reading, and files that are read
//! from elsewhere.

use std::fs::{self, File, FileType};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Kind, NotAFile, Result};

/// A file that is read: at a path, which is converted to it, or from a reader.
#[derive(Clone)]
pub struct Input {
    name: PathBuf,
    reader: Option<Arc<Mutex<dyn ReadSeek>>>,
}

trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send> ReadSeek for T {}

impl<P: AsRef<Path>> From<P> for Input {
    fn from(path: P) -> Self {
        Input { name: path.as_ref().to_owned(), reader: None }
    }
}

impl From<&Input> for Input {
    fn from(input: &Input) -> Self {
        input.clone()
    }
}

impl Input {
    /// Creates the file that `reader` reads, from its first byte on. Errors and warnings call it `name`, whose ending
    /// counts like that of a path; nothing is opened by this name.
    pub fn of(reader: impl Read + Seek + Send + 'static, name: impl AsRef<Path>) -> Self {
        Input { name: name.as_ref().to_owned(), reader: Some(Arc::new(Mutex::new(reader))) }
    }

    /// Returns the path, or the name of what a reader reads.
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// Returns the path; `None` if a reader was given.
    pub fn path(&self) -> Option<&Path> {
        self.reader.is_none().then_some(&self.name)
    }

    /// Returns the path of a file that is not read alone; `found` says what it is.
    ///
    /// # Errors
    /// [`Kind::Usage`] if a reader was given.
    pub fn needed_path(&self, found: &str) -> Result<&Path> {
        self.path().ok_or_else(|| {
            let message = format!("{found}: a path is needed, and the bytes of one file were given");
            Error::new(Kind::Usage, "VGS-IO-003", message).file(&self.name).help("give the path of the file")
        })
    }

    /// Opens the file at its beginning. A reader is shared by all that was opened of it: only the last may be in use.
    ///
    /// # Errors
    /// Those of [`open`], or of the reader.
    pub fn open(&self) -> io::Result<Stream> {
        let reader = match &self.reader {
            Some(reader) => Arc::clone(reader),
            None => Arc::new(Mutex::new(open(&self.name)?)),
        };
        let mut opened = Stream { reader, length: 0 };
        opened.length = opened.seek(SeekFrom::End(0))?;
        opened.rewind()?;
        Ok(opened)
    }
}

/// The bytes of an open [`Input`].
pub struct Stream {
    reader: Arc<Mutex<dyn ReadSeek>>,
    /// Size of the file, bytes.
    pub length: u64,
}

impl Stream {
    fn reader(&self) -> MutexGuard<'_, dyn ReadSeek + 'static> {
        // A reader that has panicked is sought anew before it is read again.
        self.reader.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.reader().read(buffer)
    }
}

impl Seek for Stream {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.reader().seek(to)
    }
}

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
    use super::*;

    #[test]
    fn a_reader_is_read_from_its_beginning_each_time() {
        let mut reader = io::Cursor::new(b"text".to_vec());
        reader.set_position(3);
        let input = Input::of(reader, "a/b.nii");
        for _ in 0..2 {
            let mut opened = input.open().expect("memory");
            let mut text = String::new();
            opened.read_to_string(&mut text).expect("text");
            assert_eq!((text.as_str(), opened.length), ("text", 4));
        }
        assert_eq!((input.name(), input.path()), (Path::new("a/b.nii"), None));
        let error = input.needed_path("half of a pair").expect_err("no path");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-IO-003"));
        assert!(
            error.to_string().starts_with("a/b.nii: half of a pair: ") && !error.help.is_empty(),
            "{error}"
        );
        assert_eq!(Input::from("a.nii").needed_path("a pair").expect("a path"), Path::new("a.nii"));
    }

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
