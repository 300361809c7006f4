//! The ranking of the splats by importance.

use shaders_glsl as glsl;

use super::Rows;
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel};

/// An order of the splats by importance, for listings with a budget.
pub struct Ranking {
    pub(super) rows: Rows,
    pub(super) limit: Kernel,
    pub(super) order: Buffer<u32>,
    pub(super) ranks: Buffer<u32>,
    pub(super) flags: Buffer<u32>,
}

impl Ranking {
    /// Creates a ranking from an order of all splats, the most important first.
    ///
    /// # Panics
    /// If an index of `order` is not below its length.
    pub fn new(gpu: &Gpu, order: &[u32]) -> Result<Self> {
        let mut ranks = vec![0; order.len()];
        for (rank, &splat) in (0..).zip(order) {
            ranks[splat as usize] = rank;
        }
        Ok(Ranking {
            rows: Rows::new(gpu)?,
            limit: Kernel::new(gpu, &glsl::LIMIT_ACTIVE, &[])?,
            order: gpu.upload("splats by importance", "splats", order)?,
            ranks: gpu.upload("ranks of the splats", "splats", &ranks)?,
            flags: gpu.buffer("activity by importance", "sorting", order.len())?,
        })
    }
}
