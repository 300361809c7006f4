//! Evaluates the field of the splats on the host, for the point under the cursor.
//!
//! `probe` has all of it: a [`Probe`] is made once from a set of splats and then asked for points and rays.

mod probe;

pub use probe::{Hit, Probe, Reading};
