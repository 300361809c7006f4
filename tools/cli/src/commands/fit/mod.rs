//! `vgs fit`: splats for the region of interest of a volume.
//!
//! | file | subject |
//! |---|---|
//! | `arguments` | the flags; `settings`: the hyper-parameters among them |
//! | `run` | the command, stage by stage: prepare, estimate, fit, evaluate, report |
//! | `stages` | estimate, fit, evaluate |
//! | `prepare` | the first stage: reads, chooses and checks |
//! | `explain` | what the fit will cost, by trying |
//! | `watch` | who accompanies the fit: progress, signals; `checkpoint`: what it leaves on the way |
//! | `reporting` | the last stage: record, curve, printed figures |
//! | `output_files` | the files that the fit writes |

mod arguments;
mod checkpoint;
mod explain;
mod output_files;
mod prepare;
mod reporting;
mod run;
mod settings;
mod stages;
mod watch;

pub use arguments::FitArguments;
pub use run::run;
