//! Compares two pictures, or two volumes inside a region (`vgs compare`).
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
