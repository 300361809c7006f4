//! Editor of a transfer function.
//!
//! | file | what is there |
//! |---|---|
//! | `editor` | [`Editor`]: changes the points and the visible range of intensities |
//! | `widget` | the editor on the screen, under the mouse |

mod editor;
pub mod widget;

pub use editor::{Editor, full_range, height, opacity, ticks};
