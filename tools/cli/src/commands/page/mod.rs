//! Tells what a page holds, and serves it to browsers (`vgs page`).
//!
//! | file | subject |
//! |---|---|
//! | `arguments` | the flags |
//! | `run` | the command |
//! | `server` | connections: one thread each, with limits |
//! | `http` | requests and answers |
//! | `tls` | certificates |

mod arguments;
mod http;
mod run;
mod server;
mod tls;

pub use arguments::PageArguments;
pub use run::run;
