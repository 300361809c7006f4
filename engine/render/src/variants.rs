//! The pipelines of a mode that depend on the look, each created when it is first needed.

use std::ops::Index;

use base::error::Result;
use gpu::Kernel;

/// Kernels or drawings by the variant that they were created for.
pub(super) struct Variants<K, P = Kernel>(Vec<(K, P)>);

impl<K: PartialEq, P> Variants<K, P> {
    pub(super) fn new() -> Self {
        Variants(Vec::new())
    }

    /// Returns the index of the kernel or drawing for `wanted`; `make` creates it if it does not exist yet.
    pub(super) fn find(&mut self, wanted: K, make: impl FnOnce(&K) -> Result<P>) -> Result<usize> {
        if let Some(at) = self.0.iter().position(|(made_for, _)| *made_for == wanted) {
            return Ok(at);
        }
        let made = make(&wanted)?;
        self.0.push((wanted, made));
        Ok(self.0.len() - 1)
    }
}

impl<K, P> Index<usize> for Variants<K, P> {
    type Output = P;

    fn index(&self, at: usize) -> &P {
        &self.0[at].1
    }
}
