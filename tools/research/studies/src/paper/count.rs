//! Numbers of splats in the paper and here.

/// Number of splats in the paper, and the corresponding one here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// The paper's number.
    pub paper: usize,
    /// Our number, for the region here.
    pub ours: usize,
}

impl Count {
    /// Scales the paper's number by the share of the region; keeps it if our region is not smaller.
    pub fn scaled(paper: usize, share: f64) -> Self {
        Count { paper, ours: ((paper as f64 * share.min(1.0)).round() as usize).max(1) }
    }
}
