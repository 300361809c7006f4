//! The pipelines of a mode that depend on the look, each created when it is first needed.

use std::ops::Index;

use crate::error::Result;
use crate::gpu::Kernel;

/// Kernels by the variant that they were created for.
pub(super) struct Variants<K>(Vec<(K, Kernel)>);

impl<K: PartialEq> Variants<K> {
    pub(super) fn new() -> Self {
        Variants(Vec::new())
    }

    /// Returns the index of the kernel for `wanted`; `make` creates it if it does not exist yet.
    pub(super) fn find(&mut self, wanted: K, make: impl FnOnce(&K) -> Result<Kernel>) -> Result<usize> {
        if let Some(at) = self.0.iter().position(|(made_for, _)| *made_for == wanted) {
            return Ok(at);
        }
        let kernel = make(&wanted)?;
        self.0.push((wanted, kernel));
        Ok(self.0.len() - 1)
    }
}

impl<K> Index<usize> for Variants<K> {
    type Output = Kernel;

    fn index(&self, at: usize) -> &Kernel {
        &self.0[at].1
    }
}
