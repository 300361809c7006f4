//! What the tests of vgs share: a device that fails on validation messages, a tolerance model, seeded scenes, one
//! forward and backward pass with everything it leaves behind, golden texts, and the table of docs/results/numerics.md.
//!
//! The tests themselves are in `tests/`, one file per question: does each kernel compute what its twin does
//! (`oracle`), are the derivatives right (`gradients`), what holds without any reference (`properties`), does the
//! whole fit (`fit`, `golden`, `real`), how far off are the extremes (`extremes`), and is the source tree as it claims to be (`arrows`).
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
