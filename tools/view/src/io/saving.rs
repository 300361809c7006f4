//! Splats as they are written to files: what a look shows of them, with its colours where a format holds colours.

use std::path::Path;

use engine::Result;
use engine::gpu::Gpu;
use engine::render::{Look, baked};
use engine::splat::{self, SplatSet, WriteOptions};

/// Splats that are ready to be written.
pub struct Ready {
    /// The splats.
    pub set: SplatSet,
    /// The splats that the colours of the set were made of, row by row, if they were.
    pub made_of: Option<SplatSet>,
    /// Number of splats of which the transfer function shows nothing; they are left out.
    pub hidden: usize,
}

/// Returns the splats that a look shows as a file with this name holds them: with the colours of the look in a format of
/// colours, and in any if `coloured` is set. Waits for the device where colours have to be found.
///
/// # Errors
/// Returns the errors of [`baked`].
pub fn ready(gpu: &Gpu, set: &SplatSet, look: &Look, path: &Path, coloured: bool) -> Result<Ready> {
    splat::check_held(path, set)?;
    if coloured || splat::is_coloured(path) && set.colours.is_none() {
        let baked = baked(gpu, set, look)?;
        let both = splat::is_coloured(path) && splat::is_physical(path);
        let made_of = both.then(|| set.of_rows(&baked.rows));
        return Ok(Ready { set: baked.set, made_of, hidden: baked.hidden });
    }
    Ok(Ready { set: look.shown_part(set), made_of: None, hidden: 0 })
}

impl Ready {
    /// Writes the splats; the extension of `path` names the format.
    ///
    /// # Errors
    /// Returns the errors of [`splat::write_as`].
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        let made_of = self.made_of.as_ref();
        splat::write_as(path, &self.set, &WriteOptions { made_of, ..*options })
    }
}
