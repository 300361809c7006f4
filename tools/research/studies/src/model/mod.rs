//! `studies model`: what the frames of a headset would take on a device that is not at hand.
//!
//! Work is counted where it is made (`work`): splats, tiles, pairs, evaluations, planes, fragments. A stage is one or a few
//! passes, with the terms that its time goes by (`stages`). `headset` counts the frames, and a roofline over the rates of a
//! data sheet (`device`) says what they take.

mod device;
mod headset;
mod operations;
mod plan;
mod plot;
mod shots;
mod stages;
mod work;

pub use headset::{ModelArguments, run};
