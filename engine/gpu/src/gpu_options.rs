//! The options of booting.

#[cfg(feature = "fault")]
use super::Fault;
use super::{MessageLog, Windows};

/// The options of booting.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Index (as `vgs devices` prints it) or part of the name of the device; the best device if absent.
    pub device: Option<String>,
    /// True if the validation layer with synchronisation checks is on; booting fails if the layer is not
    /// installed.
    pub validation: bool,
    /// Largest storage-buffer range to plan with, bytes, as on a smaller device; for tests.
    pub storage_range_limit: Option<u64>,
    /// Bytes of memory to take as free, as beside other programs; for tests.
    pub free_limit: Option<u64>,
    /// Subgroup size to plan with, as on another device; for tests and for recipes of its pipelines.
    pub subgroup_size: Option<u32>,
    /// True if passes bind sets of descriptors from pools even where the device takes pushed ones; for tests.
    pub descriptor_pools: bool,
    /// A call of the driver that fails; for tests. Where it is absent, that of `VGS_FAULT`.
    #[cfg(feature = "fault")]
    pub fault: Option<Fault>,
    /// Where the messages of the validation layers go.
    pub messages: MessageLog,
    /// The windows in which pictures are shown, if any.
    pub windows: Option<Windows>,
}
