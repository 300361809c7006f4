//! The desktop viewer.
//!
//! What is shown is plain data ([`State`], the session file); panels draw it into any [`egui::Ui`] and change it, and know
//! neither windows nor the device. [`App`] puts them together; `window::run` shows it in a window. Without the feature `window`
//! the rest is there alone, for programs that show panels elsewhere.
#![forbid(unsafe_code)]

pub mod actions;
pub mod annotations;
pub mod app;
#[cfg(feature = "window")]
pub mod canvas;
pub mod composer;
pub mod content;
pub mod editor;
pub mod export;
pub mod facts;
pub mod handles;
pub mod histogram;
pub mod history;
pub mod loader;
pub mod orbit;
pub mod painter;
pub mod panels;
pub mod pick;
pub mod prompt;
pub mod report;
pub mod settings;
pub mod stage;
pub mod state;
pub mod theme;
pub mod transfer;
#[cfg(feature = "window")]
pub mod viewer;
#[cfg(feature = "window")]
pub mod window;

pub use actions::Action;
pub use app::{App, Changes};
pub use facts::{Facts, Statistics};
pub use histogram::Histogram;
pub use orbit::Orbit;
pub use pick::Probe;
pub use settings::Settings;
pub use state::State;
