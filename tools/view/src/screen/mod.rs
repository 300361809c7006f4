//! Pictures: in the window and in files.
//!
//! | module | what it is |
//! |---|---|
//! | `canvas` | the picture in the window |
//! | `rendered_scene` | renders it |
//! | `composer`, `painter` | put it and the panels on the screen |
//! | `export`, `overlay_image` | write it; what the window tells, painted into it |

#[cfg(feature = "window")]
pub mod canvas;
pub mod composer;
pub mod export;
pub mod overlay_image;
pub mod painter;
pub mod rendered_scene;
