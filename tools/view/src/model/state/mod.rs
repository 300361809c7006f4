//! State of the viewer as plain data: the session file.
//!
//! | file | what is there |
//! |---|---|
//! | `splat_mode` | the modes that show splats |
//! | `state` | all of it: [`ViewState`], its parts, and how it is read and written |
//! | `error_colours` | [`ErrorColours`]: what of the picture has the colours of the error |
//! | `files` | [`Files`]: where they are, as a session names them, and those that are missing |
//! | `unpacked` | [`Unpacked`]: the folder that a packed session is unpacked into |
//! | `in_headset` | [`InHeadset`]: where a headset shows the patient |
//! | `usual` | how objects look as long as nobody has said so |

mod error_colours;
mod files;
mod in_headset;
mod splat_mode;
mod state;
mod unpacked;
mod usual;

pub use error_colours::ErrorColours;
pub use files::Files;
pub use in_headset::InHeadset;
pub use splat_mode::{DECODED, SplatMode, mode_row};
pub use state::{
    Bookmark, Clip, CropBox, Distance, Edited, MOST_PLANES, Object, Plane, Quality, Show, Slices, Subject,
    VERSION, ViewState, is_session,
};
pub(crate) use state::{text_of, toml_text};
pub(crate) use unpacked::{Copy, copy};
pub use unpacked::{Unpacked, is_packed};
