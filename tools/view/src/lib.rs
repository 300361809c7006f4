//! The desktop viewer.

pub mod history;
pub mod orbit;
pub mod state;
pub mod transfer;
