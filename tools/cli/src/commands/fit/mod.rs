//! Fits splats to the region of interest of a volume (`vgs fit`), or of many (`vgs batch`).
//!
//! | file | subject |
//! |---|---|
//! | `arguments` | the flags; `settings`: the hyper-parameters among them |
//! | `run` | the command, stage by stage: prepare, estimate, fit, evaluate, report |
//! | `stages` | estimate, fit, evaluate |
//! | `prepare` | the first stage: reads, chooses and checks |
//! | `doubts` | what is probably not meant, told or asked about first |
//! | `explain` | estimates what the fit will cost, by its first iterations |
//! | `telling` | tells of the stages of a fit besides its iterations |
//! | `watch` | watches the fit: progress, signals; `checkpoint`: files written on the way |
//! | `reporting` | the last stage: record, curve, printed figures |
//! | `output_files` | the files that the fit writes |
//! | `batch`, `cases` | many fits in one process, and the table of their cases |

mod arguments;
mod batch;
mod cases;
mod checkpoint;
mod doubts;
mod explain;
mod output_files;
mod prepare;
mod reporting;
mod run;
mod settings;
mod stages;
mod telling;
mod watch;

pub use arguments::FitArguments;
pub use batch::{BatchArguments, run as batch};
pub use run::run;
