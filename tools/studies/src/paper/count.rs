//! Numbers of splats, of the paper and here.

/// A number of the paper, and what it is here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// The paper's.
    pub paper: usize,
    /// Ours, for the region here.
    pub ours: usize,
}

impl Count {
    /// Scaled by the share of the region; where ours is not smaller, the paper's number.
    pub fn scaled(paper: usize, share: f64) -> Self {
        Count { paper, ours: ((paper as f64 * share.min(1.0)).round() as usize).max(1) }
    }
}
