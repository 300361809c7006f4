//! Handles of clip planes and of the crop box, which the mouse can drag.
//!
//! `handles` knows their places, finds the one under the cursor, and carries out a drag.

mod handles;

pub use handles::{Handle, Placed, drag, edges, handles, hit, outline};
