//! One file or folder for each command: its flags, and `run`. No command uses another.

pub mod bake;
pub mod blocks;
pub mod compare;
pub mod completions;
#[cfg(feature = "window")]
pub mod convert;
pub mod devices;
pub mod eval;
pub mod explain;
pub mod fit;
pub mod info;
pub mod man;
#[cfg(feature = "window")]
pub mod pack;
pub mod page;
pub mod phantom;
pub mod rasterize;
pub mod render;
pub mod stats;
#[cfg(feature = "window")]
pub mod view;
