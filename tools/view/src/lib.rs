//! The desktop viewer.

pub mod composer;
pub mod painter;
