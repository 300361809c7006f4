//! Splats as they are written to files: what a look shows of them, with its colours where a format holds colours.

use std::path::Path;

use engine::Result;
use engine::fit::{rounded_as_it_is, with_part_of_mask};
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

/// Returns the splats of `set` that a look shows: without hidden objects and what its clip planes cut away, with their
/// part of a binary mask. Waits for the device if there is such a mask.
///
/// # Errors
/// Returns the errors of [`with_part_of_mask`].
pub fn shown(gpu: &Gpu, set: &SplatSet, look: &Look) -> Result<SplatSet> {
    of_rows(gpu, set, &look.shown(set))
}

/// Returns the splats of these rows, with their part of a binary mask.
fn of_rows(gpu: &Gpu, set: &SplatSet, rows: &[usize]) -> Result<SplatSet> {
    match rows.len() {
        // The exceptions of the whole are right for the whole.
        all if all == set.splats.len() => Ok(set.clone()),
        0 => Ok(set.of_rows(rows)),
        _ => with_part_of_mask(gpu, set, set.of_rows(rows)),
    }
}

/// Returns the splats that a look shows as a file with this name holds them: with the colours of the look in a format of
/// colours, and in any if `coloured` is set; rounded where the format rounds. Waits for the device where colours or a
/// mask have to be found.
///
/// # Errors
/// Returns the errors of [`baked`], of [`with_part_of_mask`] and of [`rounded_as_it_is`].
pub fn ready(gpu: &Gpu, set: &SplatSet, look: &Look, path: &Path, coloured: bool) -> Result<Ready> {
    if coloured || splat::is_coloured(path) && set.colours.is_none() {
        let baked = baked(gpu, set, look)?;
        let both = splat::is_coloured(path) && splat::is_physical(path);
        let made_of = both.then(|| of_rows(gpu, set, &baked.rows)).transpose()?;
        return Ok(Ready { set: baked.set, made_of, hidden: baked.hidden });
    }
    let mut set = shown(gpu, set, look)?;
    if splat::rounds(path) && set.rounding.is_none() && !set.splats.is_empty() {
        set = rounded_as_it_is(gpu, set)?;
    }
    Ok(Ready { set, made_of: None, hidden: 0 })
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
