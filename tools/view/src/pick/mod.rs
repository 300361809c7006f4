//! What the splats stand for at a point: the field, evaluated on the host for whatever is under the cursor.
//!
//! `probe` has all of it: a [`Probe`] is made once of a set of splats and then asked for points and rays.

mod probe;

pub use probe::{Hit, Probe, Reading};
