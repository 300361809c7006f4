//! The viewer without its window: state, panels, and what the mouse and the keys do.
//!
//! | file | what is there |
//! |---|---|
//! | `app` | [`App`]: the state with its panels; what has to be rendered anew |
//! | `acting`, `viewing` | what actions do; those that only change what is seen |
//! | `picture` | the picture between the panels: what the mouse does in it, and what is painted over it |
//! | `asking` | files are asked for, by the dialog of the desktop or by our own |
//! | `deleting` | splats are deleted by the crop box |
//! | `drag` | what the mouse drags |
//! | `held_keys` | which keys are down |

mod acting;
mod app;
mod asking;
mod deleting;
mod drag;
mod held_keys;
mod picture;
mod viewing;

pub use app::{App, Changes};
