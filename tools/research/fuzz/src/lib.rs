//! Fuzzing of everything that reads files of others: files are changed, read, and judged.
//!
//! A [target](targets::TARGETS) is a reader with valid files to begin with (`seeds`). [`mutate`] changes their bytes,
//! [`trial`] reads the result and judges it: a reader may refuse a file with an error of the user's, but it must not
//! panic, call the file's fault its own (`Kind::Internal`), take more memory than a bound, or longer than a second.
//! A new format is one row of the table.
#![forbid(unsafe_code)]

pub mod mutate;
mod seeds;
pub mod targets;
pub mod trial;

pub use seeds::crc;
