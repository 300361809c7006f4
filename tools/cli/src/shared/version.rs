//! Version of this program.

/// Version and, if the build knew it, the commit.
pub const VERSION: &str = if COMMIT.is_empty() {
    NUMBER
} else {
    concat!(env!("CARGO_PKG_VERSION"), " (", env!("VGS_COMMIT"), ")")
};
/// Number of the version.
pub const NUMBER: &str = env!("CARGO_PKG_VERSION");
/// Commit that was built; empty if the build did not know it.
pub const COMMIT: &str = env!("VGS_COMMIT");
