//! What is read and written beside the window, each on a thread of its own.
//!
//! | module | what it is |
//! |---|---|
//! | `loader`, `sorting` | reads files; tells volumes and masks apart |
//! | `loaded_data`, `loaded_splats` | what was read, and what is left of the splats |
//! | `open_files` | where what is open is from |
//! | `fitting` | fits splats |
//! | `saving`, `pack` | how splats are written; a session with its files |
//! | `sharing` | what is shown as a page |
//! | `portal` | the dialog of the desktop, over D-Bus |
//! | `report` | what was measured |

pub mod fitting;
pub mod loaded_data;
pub mod loaded_splats;
pub mod loader;
pub mod open_files;
pub mod pack;
#[cfg(all(feature = "window", unix, not(target_os = "macos"), not(target_os = "android")))]
pub mod portal;
pub mod report;
pub mod saving;
#[cfg(feature = "window")]
pub mod sharing;
pub mod sorting;
