//! Handles of clip planes and of the crop box, which the mouse takes hold of.
//!
//! `handles` says where they are, which one is under the cursor, and what a drag does.

mod handles;

pub use handles::{Handle, Placed, drag, edges, handles, hit, outline};
