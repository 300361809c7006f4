//! The viewer: the data, the user's wishes, and the frames that show them.
//!
//! | file | what is there |
//! |---|---|
//! | `viewer` | [`Viewer`]: frames, what is loaded, and what the user asks for |
//! | `files` | what is opened, and what is written beside the window |
//! | `deleting` | splats that are deleted, beside the window |
//! | `begun` | the picture on its way |
//! | `pictures` | when a picture is begun, with what quality, and how it goes on between frames |
//! | `input_queue` | what the user has done, for the next frame |
//! | `preparing` | in which mode splats are shown, and what is made beside the window for it |
//! | `error` | the error of the splats against the volume: measured, and in colours |
//! | `fit` | a fit beside the window: it is begun, its splats are shown as they come, kept or dropped |
//! | `thumbnails` | pictures of the scene by each preset |
//! | `shown_fit` | what of the fit waits to be shown |

mod begun;
mod deleting;
mod error;
mod files;
mod fit;
pub mod input_queue;
mod pictures;
mod preparing;
mod shown_fit;
mod thumbnails;
mod viewer;

pub use pictures::Between;
pub use viewer::{ActiveWindow, Next, Start, Viewer, is_lost};
