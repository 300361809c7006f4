//! Results of commands as text and as files.
//!
//! | file | subject |
//! |---|---|
//! | `quality` | how good splats are |
//! | `errors` | where their error is |
//! | `estimate` | what a fit will cost, and how right that was |
//! | `results` | the results of a fit |
//! | `curve` | the curve of a fit: a table and a plot |
//! | `record` | the run record of a fit |

pub mod curve;
pub mod errors;
pub mod estimate;
pub mod quality;
pub mod record;
pub mod results;
