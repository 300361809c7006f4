//! The error type of the engine: it says what happened, to which file, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

/// The class of an error; it decides the exit code of a program (sysexits where one fits).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A wrong argument or configuration value (2).
    Usage,
    /// The input is valid and there is nothing to do, as with an empty region of interest (3).
    NothingToDo,
    /// An input file holds something that cannot be used (65).
    BadData,
    /// An input file is missing (66).
    Missing,
    /// No Vulkan device, or one that lacks a feature that is needed (69).
    Unavailable,
    /// An invariant of this program broke (70).
    Internal,
    /// The host is out of memory (71).
    HostMemory,
    /// An output cannot be created: it exists, is read-only, or its folder is missing (73).
    CannotCreate,
    /// Reading or writing failed on the way (74).
    Io,
    /// Device lost or out of device memory: trying again may help (75).
    Temporary,
}

impl Kind {
    /// All kinds, by their exit codes.
    pub const ALL: [Kind; 10] = [
        Kind::Usage,
        Kind::NothingToDo,
        Kind::BadData,
        Kind::Missing,
        Kind::Unavailable,
        Kind::Internal,
        Kind::HostMemory,
        Kind::CannotCreate,
        Kind::Io,
        Kind::Temporary,
    ];

    /// Returns when errors of this class come.
    pub fn meaning(self) -> &'static str {
        match self {
            Kind::Usage => "a wrong argument or configuration value",
            Kind::NothingToDo => {
                "the input is valid and there is nothing to do, as with an empty region of interest"
            }
            Kind::BadData => "an input file holds something that cannot be used",
            Kind::Missing => "an input file is missing",
            Kind::Unavailable => "no Vulkan device or headset, or one that lacks what is needed",
            Kind::Internal => "a fault of this program, or a fit that diverged",
            Kind::HostMemory => "out of memory",
            Kind::CannotCreate => {
                "an output cannot be created: it exists, is read-only, or its folder is missing"
            }
            Kind::Io => "reading or writing failed on the way",
            Kind::Temporary => {
                "device lost or out of its memory, or an output is locked: trying again may help"
            }
        }
    }

    /// Returns the exit code of a process for this class.
    pub fn exit_code(self) -> u8 {
        match self {
            Kind::Usage => 2,
            Kind::NothingToDo => 3,
            Kind::BadData => 65,
            Kind::Missing => 66,
            Kind::Unavailable => 69,
            Kind::Internal => 70,
            Kind::HostMemory => 71,
            Kind::CannotCreate => 73,
            Kind::Io => 74,
            Kind::Temporary => 75,
        }
    }
}

/// An error that a user can act on: its class, a stable code, the file if there is one, what was found and
/// what was needed, and what to do.
#[derive(Clone, Debug, thiserror::Error)]
pub struct Error {
    /// The class, which also decides the exit code.
    pub kind: Kind,
    /// A stable code, such as `VGS-NII-012`: scripts may match on it, while texts may change.
    pub code: &'static str,
    /// The file at fault.
    pub file: Option<PathBuf>,
    /// What was found and what was needed.
    pub message: String,
    /// What to do; may be empty.
    pub help: String,
}

/// Why something with a name cannot be read as a file: it is a folder, a pipe, a socket or a device. The payload of the
/// error that [`crate::input::open`] returns.
#[derive(Debug, thiserror::Error)]
#[error("is {0}, not a file")]
pub(crate) struct NotAFile(pub &'static str);

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Creates an error without a file and without help.
    pub fn new(kind: Kind, code: &'static str, message: impl Into<String>) -> Self {
        Error { kind, code, file: None, message: message.into(), help: String::new() }
    }

    /// Sets the file at fault.
    #[must_use]
    pub fn file(mut self, path: impl AsRef<Path>) -> Self {
        self.file = Some(path.as_ref().to_owned());
        self
    }

    /// Sets the file at fault, if none is known yet.
    #[must_use]
    pub fn or_file(self, path: impl AsRef<Path>) -> Self {
        if self.file.is_some() { self } else { self.file(path) }
    }

    /// Sets the advice on what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }

    /// Creates the error of a failed read or write of `path`; `doing` says what was being done. A missing
    /// file is [`Kind::Missing`], what is no file [`Kind::BadData`], a lack of memory [`Kind::HostMemory`], everything
    /// else [`Kind::Io`].
    pub fn io(path: impl AsRef<Path>, doing: &str, error: &std::io::Error) -> Self {
        use std::io::ErrorKind as E;
        if error.get_ref().is_some_and(|inner| inner.is::<NotAFile>()) {
            return Error::new(Kind::BadData, "VGS-IO-002", error.to_string())
                .file(path)
                .help("give a regular file; what comes through a pipe must be written to a file first");
        }
        let kind = match error.kind() {
            E::NotFound => Kind::Missing,
            E::OutOfMemory => Kind::HostMemory,
            _ => Kind::Io,
        };
        Error::new(kind, "VGS-IO-001", format!("{doing}: {error}")).file(path)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        f.write_str(&self.message)
    }
}
