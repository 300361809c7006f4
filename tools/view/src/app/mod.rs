//! The viewer without its window: state, panels, and what the mouse and the keys do.
//!
//! | file | what is there |
//! |---|---|
//! | `app` | [`App`]: the state with its panels; what actions do, and what has to be rendered anew |
//! | `picture` | the picture between the panels: what the mouse does in it, and what is painted over it |
//! | `asking` | files are asked for, by the dialog of the desktop or by our own |
//! | `deleting` | splats are deleted by the crop box |
//! | `drag` | what the mouse drags |
//! | `held_keys` | which keys are down |

mod app;
mod asking;
mod deleting;
mod drag;
mod held_keys;
mod picture;

pub use app::{App, Changes};
