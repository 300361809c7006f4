//! Errors of the engine as exceptions, whose classes are those of `vgs/_errors.py`.

use std::fmt::Display;

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
            let of = (error.message, error.code, file, as_arguments(&error.help), error.kind.exit_code());
            module.getattr(class(error.kind))?.call1(of)
        });
        made.map_or_else(|e| e, PyErr::from_value)
    })
}

/// Returns advice with the flags of the command line as arguments, `--roi-label` as `roi_label=`; whole commands stay.
fn as_arguments(help: &str) -> String {
    if help.contains('`') || help.contains("vgs ") {
        return help.to_owned();
    }
    let mut words = help.split("--");
    let mut told = words.next().unwrap_or_default().to_owned();
    for word in words {
        let end = word.find(|c: char| !(c.is_ascii_lowercase() || c == '-')).unwrap_or(word.len());
        let (flag, rest) = word.split_at(end);
        told += &flag.replace('-', "_");
        told += if flag == "force" { "=True" } else { "=" };
        told += rest;
    }
    told
}

/// Returns the error of something that cannot be.
pub fn internal(error: impl Display) -> PyErr {
    raised(Error::new(Kind::Internal, "VGS-PY-002", error.to_string()))
}

/// Returns the exception of an argument that the Python half refuses.
#[pyfunction]
pub fn usage_error(py: Python<'_>, message: String, help: String) -> Py<PyAny> {
    raised(Error::new(Kind::Usage, "VGS-PY-018", message).help(help)).into_value(py).into_any()
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
