//! `studies model`: what a frame costs, from the work it is made of.
//!
//! Work is counted where it is made (`work`): splats, tiles, pairs, evaluations, planes, fragments. A stage is one or a few passes, with
//! the terms that its time goes by (`stages`). `fit` renders scenes in many ways, reads the device's time for each pass, and finds
//! what each term costs on this device (`rates`); scenes that were held out say how good that is. `headset` counts the frames
//! of a standalone headset and says what a device that is not at hand would take, by a roofline over the rates of its
//! data sheet (`device`).

mod device;
mod fit;
mod headset;
mod nnls;
mod operations;
mod plan;
mod plot;
mod rates;
mod report;
mod shots;
mod stages;
mod work;

pub use fit::ModelFitArguments;
pub use fit::run as fit;
pub use headset::ModelHeadsetArguments;
pub use headset::run as headset;

use clap::Subcommand;

/// Which part.
#[derive(Subcommand)]
pub enum ModelStudy {
    /// What each piece of work costs on this device, and how well that predicts scenes that were held out.
    Fit(ModelFitArguments),
    /// The frames of a headset, and what devices that are not at hand would take for them.
    Headset(ModelHeadsetArguments),
}
