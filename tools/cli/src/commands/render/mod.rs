//! Renders pictures of splats, or of the volume they were fitted to, through a transfer function (`vgs
//! render`).
//!
//! | file | subject |
//! |---|---|
//! | `arguments` | the flags; `values`: what they may say |
//! | `run` | the command: what is shown, how, and from where |
//! | `frames` | the pictures: one, an animation or a sequence |

mod arguments;
mod frames;
mod run;
mod values;

pub use arguments::RenderArguments;
pub use run::run;
