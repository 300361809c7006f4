//! Describes the contents of a file (`vgs info`).
//!
//! | file | subject |
//! |---|---|
//! | `run` | the command and its text |
//! | `budget` | where bytes and milliseconds go when splats are rendered |

mod budget;
mod run;

pub use run::{InfoArguments, run};
