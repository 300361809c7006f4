//! Errors of the engine as exceptions, whose classes are those of `vgs/_errors.py`.

use engine::{Error, Kind};
use pyo3::prelude::*;

/// Name of the class of an exception.
fn class(kind: Kind) -> &'static str {
    match kind {
        Kind::Usage => "UsageError",
        Kind::NothingToDo => "NothingToDoError",
        Kind::BadData => "BadDataError",
        Kind::Missing => "MissingFileError",
        Kind::Unavailable => "DeviceUnavailableError",
        Kind::Internal => "InternalError",
        Kind::HostMemory => "HostMemoryError",
        Kind::CannotCreate => "CannotCreateError",
        Kind::Io => "ReadWriteError",
        Kind::Temporary => "TemporaryError",
    }
}

/// Returns an error as the exception of its kind.
pub fn raised(error: Error) -> PyErr {
    Python::attach(|py| {
        let file = error.file.as_ref().map(|path| path.display().to_string());
        let made = py.import("vgs._errors").and_then(|module| {
            let of = (error.message, error.code, file, error.help, error.kind.exit_code());
            module.getattr(class(error.kind))?.call1(of)
        });
        made.map_or_else(|e| e, PyErr::from_value)
    })
}

/// The result of what Python calls, from the engine's.
pub trait Raise<T> {
    /// Turns an error into an exception.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> Raise<T> for engine::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(raised)
    }
}
