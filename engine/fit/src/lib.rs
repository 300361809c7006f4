//! Fitting: the optimization of splats against the voxels of a region of interest.
//!
//! [`run()`] is the entry point: it turns a volume and a region into a splat set.
//!
//! | file | what it is |
//! |---|---|
//! | `plan` | the one way to fit: [`Order`], [`Plan`], [`Fitted`]; [`run()`] is all of it |
//! | `run`, `schedule` | the iterations: [`Problem`], [`Schedule`], and the observer of a fit ([`Watch`]) |
//! | `stage` | what it hears besides |
//! | `config`, `unit` | every hyper-parameter, with its unit |
//! | `declare` | how they are declared: keys, groups and bounds |
//! | `profiles`, `qualities`, `settings` | configurations with a name, and one made of both and of single values |
//! | `goal`, `count`, `adjust` | an error to reach, the number of splats that it takes, and more or fewer of them |
//! | `going` | how far a stage that takes long is, and whether it goes on |
//! | `init` | the first splats |
//! | `fitter` | the iterations on the device |
//! | `voxels` | the error at the voxels, as the objective that they lower |
//! | `subset` | mini-batches |
//! | `pause`, `topology` | between iterations: splats are added, removed and moved (density control) |
//! | `targets`, `terms` | the samples that a fit must match, and its loss terms |
//! | `state` | an interrupted fit, as a file |
//! | `rounding` | a fit rounded for a small file: [`Problem::rounded_set`] |
//! | `evaluate`, `errors` | how good splats are, and where they are wrong |
//! | `labels`, `place` | which structure a splat belongs to; the voxel grid of splats from other programs |
#![forbid(unsafe_code)]

mod adjust;
pub mod config;
mod count;
mod declare;
pub mod errors;
pub mod evaluate;
mod fitter;
mod goal;
mod going;
pub mod init;
pub mod labels;
mod pause;
pub mod place;
mod plan;
mod profiles;
mod qualities;
mod rounding;
mod run;
mod schedule;
mod settings;
mod stage;
mod state;
mod subset;
mod targets;
mod terms;
pub mod topology;
mod unit;
mod voxels;

pub use config::{Background, FitConfig, FitForm, IntensityRange, Parameter, Storage};
pub use fitter::{Fitter, Progress};
pub use goal::Goal;
pub use going::{Going, to_the_end};
pub use plan::{BytesOf, Clock, Fitted, Measure, Order, Plan, SizeLimit, run};
pub use profiles::{PROFILES, Profile};
pub use qualities::{DEFAULT_QUALITY, EARLY, QUALITIES, QualityPreset};
pub use rounding::ROUNDING_ITERATIONS;
pub use run::{
    Beginning, CurvePoint, End, GOAL_MARGIN_DB, Interrupted, Milestone, Outcome, Problem, Start, Watch,
};
pub use schedule::Schedule;
pub use settings::Settings;
pub use stage::{Count, Stage, Trial};
pub use state::FitState;
pub use targets::{Scaling, offsets, sample};
pub use terms::{ChosenLoss, INTENSITY_LOSSES, MASK_LOSSES};
pub use unit::ScaleUnit;
