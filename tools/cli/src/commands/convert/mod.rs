//! Writes splats in another format, or as a page (`vgs convert`).
//!
//! | file | subject |
//! |---|---|
//! | `arguments` | the flags |
//! | `run` | the command, and files of splats |
//! | `page` | pages |
//! | `coded` | the region of a volume, without splats |
//! | `selection`, `look` | which splats, and how they look |
//! | `again` | splats that other programs have written, or that are fitted again |

mod again;
mod arguments;
mod coded;
mod look;
mod page;
mod run;
mod selection;

pub use arguments::ConvertArguments;
pub use run::run;
