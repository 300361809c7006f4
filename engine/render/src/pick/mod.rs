//! Evaluates the field of splats on the host: for the point under the cursor, and for a list of points.
//!
//! `probe` has all of it: a [`Probe`] is made once from a set of splats and then asked for points and rays.

mod probe;

pub use probe::{Hit, Probe, Reading};
