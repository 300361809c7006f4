//! What commands tell at their end, as text and as files.
//!
//! | file | subject |
//! |---|---|
//! | `quality` | how good splats are |
//! | `errors` | where their error is |
//! | `estimate` | what a fit will cost, and how right that was |
//! | `results` | what a fit came to |
//! | `curve` | the course of a fit: a table and a plot |
//! | `record` | the run record of a fit |

pub mod curve;
pub mod errors;
pub mod estimate;
pub mod quality;
pub mod record;
pub mod results;
