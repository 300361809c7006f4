//! What would interrupt a frame loop, counted.

use std::sync::atomic::AtomicU64;

/// Counts of actions that would interrupt a frame loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hitches {
    /// Number of allocations of device memory for a buffer or an image.
    pub allocations: u64,
    /// Number of pipelines that were created.
    pub pipelines: u64,
    /// Number of waits of the host for the device.
    pub waits: u64,
}

/// The numbers behind [`Hitches`].
#[derive(Default)]
pub(super) struct Counters {
    pub(super) allocations: AtomicU64,
    pub(super) pipelines: AtomicU64,
    pub(super) waits: AtomicU64,
}
