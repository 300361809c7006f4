//! Camera that turns around a pivot.
//!
//! `orbit` has all of it: [`Orbit`], and [`Side`] for the views along the axes of the patient.

mod orbit;

pub use orbit::{FOV_RANGE, Orbit, Side};
