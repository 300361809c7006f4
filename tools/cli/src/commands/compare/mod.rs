//! `vgs compare`: how different two pictures are, or two volumes inside a region.
//!
//! | file | subject |
//! |---|---|
//! | `arguments` | the flags |
//! | `run` | the command: pictures or volumes |
//! | `pictures`, `volumes` | either of them |

mod arguments;
mod pictures;
mod run;
mod volumes;

pub use arguments::CompareArguments;
pub use run::run;
