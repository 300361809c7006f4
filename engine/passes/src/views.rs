//! The views that passes read: where the eyes are, and the visibility masks of the pictures.

use shaders_glsl::types::{PATCH_WORDS, View};

use base::error::Result;
use gpu::{Buffer, Gpu};

/// The views of a frame.
pub struct Views {
    /// One row for each view.
    pub rows: Buffer<View>,
    /// Visibility masks of their pictures, [`PATCH_WORDS`] for each; a single word if kernels do not ask for
    /// masks.
    pub patches: Buffer<u32>,
}

impl Views {
    /// Creates `count` views in host memory, with empty visibility masks; without masks unless `hidden`.
    pub fn new(gpu: &Gpu, name: &str, count: u32, hidden: bool) -> Result<Self> {
        let words = if hidden { PATCH_WORDS * count as usize } else { 1 };
        Ok(Views {
            rows: gpu.mapped(name, "views", count as usize)?,
            patches: gpu.mapped(&format!("patches of {name}"), "views", words)?,
        })
    }

    /// Writes the views, and the visibility masks of as many of them as `patches` has. No submission that
    /// reads them may be in flight.
    ///
    /// # Panics
    /// If there is another number of rows, or there are more masks than there is room for.
    pub fn write(
        &mut self,
        rows: impl ExactSizeIterator<Item = View>,
        patches: impl Iterator<Item = [u32; PATCH_WORDS]>,
    ) -> Result<()> {
        let into = self.rows.mapped_mut()?;
        assert_eq!(rows.len(), into.len(), "one camera a view");
        into.iter_mut().zip(rows).for_each(|(to, row)| *to = row);
        let words = self.patches.mapped_mut()?;
        for (view, patches) in patches.enumerate() {
            words[view * PATCH_WORDS..][..PATCH_WORDS].copy_from_slice(&patches);
        }
        Ok(())
    }
}
