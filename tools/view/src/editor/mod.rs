//! The editor of a transfer function.
//!
//! | file | what is there |
//! |---|---|
//! | `editor` | [`Editor`]: what can be done to the points, and which intensities are in view |
//! | `widget` | the editor on the screen, under the mouse |

mod editor;
pub mod widget;

pub use editor::{Editor, full_range, height, opacity, ticks};
