//! State of the viewer as plain data: the session file.
//!
//! `state` has all of it: [`ViewState`], its parts, and how it is read and written.

mod state;

pub use state::{
    Bookmark, Clip, CropBox, Distance, Edited, Files, MOST_PLANES, Object, Plane, Quality, Show, Slices,
    SplatMode, Subject, VERSION, ViewState, is_session, mode_row,
};
pub(crate) use state::{text_of, toml_text};
