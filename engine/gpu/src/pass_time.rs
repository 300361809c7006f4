//! The device time of a pass.

/// Time and calls of one named pass, from GPU timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassTime {
    /// Number of times that the pass ran.
    pub calls: u64,
    /// Sum over all calls, milliseconds of device time.
    pub total_ms: f64,
    /// The longest single call, milliseconds.
    pub longest_ms: f64,
}
