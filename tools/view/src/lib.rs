//! The desktop viewer.
//!
//! What is shown is plain data ([`ViewState`], the session file); panels draw it into any [`egui::Ui`] and
//! change it, and know neither windows nor the device. [`App`] puts them together; `window::run` shows it in
//! a window. Without the feature `window` only the rest is built, for programs that show panels elsewhere.
//!
//! The map, with the arrows that are allowed ("A -> B": A may use B; `tests/tests/arrows` checks them):
//!
//! ```text
//! window -> viewer -> app -> panels -> model          window, viewer, app -> io -> model
//! window, viewer -> screen -> panels, io -> model
//! model     what is shown: the session file, what a user may ask for, plain logic
//! io        reads, fits and writes beside the window
//! panels    what shows and changes the state, drawn by egui: at the side, over the picture, in it
//! screen    the picture, in the window and in files
//! app       the viewer without its window: puts the panels together
//! viewer    frame after frame, within the frame budget
//! window    the events of winit
//! ```
#![forbid(unsafe_code)]

pub mod app;
pub mod io;
pub mod model;
pub mod panels;
pub mod screen;
#[cfg(feature = "window")]
pub mod viewer;
#[cfg(feature = "window")]
pub mod window;

pub use app::{App, Changes};
pub use model::actions::Action;
pub use model::histogram::Histogram;
pub use model::orbit::Orbit;
pub use model::panel_info::{PanelInfo, Statistics};
pub use model::settings::Settings;
pub use model::state::ViewState;
