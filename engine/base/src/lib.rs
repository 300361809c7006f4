//! What every crate of vgs stands on.
//!
//! | module | what it is |
//! |---|---|
//! | `error` | [`Error`]: what happened, to which file, and what to do about it |
//! | `figures` | bytes, seconds and dates as people read them |
//! | `input`, `output` | files that a user names or a reader gives; files that appear whole or not at all |
//! | `memory` | how much of the host there is; asked before what a flag or a file sizes is taken |
//! | `names` | the name that a mistyped one stands for |
//! | `state_file` | what interrupted work leaves, by which it goes on |
//! | `unit` | what intensities are numbers of |
#![forbid(unsafe_code)]

pub mod error;
pub mod figures;
pub mod input;
pub mod memory;
pub mod names;
pub mod output;
pub mod state_file;
pub mod unit;

pub use error::{Error, Kind, Result};
