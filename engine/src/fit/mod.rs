//! The fit of a splat set to a volume.

pub mod init;
