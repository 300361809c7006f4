//! Helpers that the tests of vgs share: a device that fails on validation messages, a tolerance model, seeded
//! scenes, one forward and backward pass with all its results, golden texts, and the table of
//! docs/results/data/numerics.csv.
//!
//! The tests themselves are in `tests/`, one file per question: does each kernel compute what its reference
//! implementation does (`oracle`), are the derivatives right (`gradients`), what holds without any reference
//! (`properties`), does a whole fit work (`fit`, `golden`, `real`), how large are the errors at the extremes
//! (`extremes`), and does the source tree have the structure that it claims (`arrows`).
#![forbid(unsafe_code)]

pub mod close;
pub mod device;
pub mod fitting;
pub mod golden;
pub mod numerics;
pub mod picture;
pub mod rendering;
pub mod sampling;
pub mod scene;
pub mod step;
pub mod storage;

pub use close::{Bound, assert_close};
pub use device::Device;
pub use scene::Scene;
