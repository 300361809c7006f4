//! The voxels where the splats of a fit are on the wrong side of a binary mask. They are few (one in a thousand
//! at 0.1 splats a voxel) and a picture shows each, so the file lists them.

use base::error::Result;
use base::memory;
use gpu::Gpu;
use splat::{Exception, Form, Grid, SplatSet};
use volume::Roi;

/// Greatest distance of an occupancy from ½ at which a voxel is listed although it is right: another device
/// rounds otherwise.
const MARGIN: f32 = 1e-3;

/// What a fit for a binary mask has on the wrong side of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Misclassified {
    /// Voxels where the splats show another occupancy than the mask, in ascending order of z, y, x.
    pub exceptions: Vec<Exception>,
    /// Number of voxels of the mask that no splat reaches: they cannot be shown.
    pub unreached: usize,
}

/// Returns what `set` has on the wrong side of the mask `roi`, which is on the set's grid; nothing if the set
/// is not for a binary mask.
pub fn misclassified(gpu: &Gpu, set: &SplatSet, roi: &Roi) -> Result<Misclassified> {
    let (Form::Grid { binary: true }, Some(grid)) = (set.form, set.grid) else {
        return Ok(Misclassified::default());
    };
    let (mut found, mut reached) = (Vec::new(), 0);
    passes::visit(gpu, &set.to_voxel(&grid.world_from_voxel), &set.field, roi.size, |i, sample| {
        let inside = roi.weight[i] > 0.5;
        reached += usize::from(inside && sample.weight > 0.0);
        let wrong = (sample.occupancy > 0.5) != inside || (sample.occupancy - 0.5).abs() < MARGIN;
        if wrong && sample.weight > 0.0 {
            found.extend(Exception::at(i as u64, inside, &grid));
        }
    })?;
    let voxels = roi.weight.iter().filter(|&&m| m > 0.5).count();
    found.sort_unstable_by_key(|exception| exception.index(&grid));
    Ok(Misclassified { exceptions: found, unreached: voxels - reached })
}

/// Returns `changed`, the splats of `set` but for small changes, with the exceptions that give it the mask that
/// `set` has.
pub(super) fn with_same_mask(gpu: &Gpu, set: &SplatSet, mut changed: SplatSet) -> Result<SplatSet> {
    let (Form::Grid { binary: true }, Some(grid)) = (set.form, set.grid) else { return Ok(changed) };
    let mask = mask(gpu, set, &grid, |_, _| ())?;
    changed.exceptions = misclassified(gpu, &changed, &mask)?.exceptions;
    Ok(changed)
}

/// Returns `part`, which are some of the splats of `whole`, with the exceptions that give it its part of the mask
/// of `whole`: the voxels in which it has at least half of W. Sets for anything but a binary mask have none.
/// Waits for the device.
///
/// # Errors
/// Fails if the device fails, and with [`Kind::HostMemory`](base::Kind) for a grid that memory does not hold.
pub fn with_part_of_mask(gpu: &Gpu, whole: &SplatSet, mut part: SplatSet) -> Result<SplatSet> {
    let (Form::Grid { binary: true }, Some(grid)) = (whole.form, whole.grid) else { return Ok(part) };
    memory::require(voxels(&grid).saturating_mul(8), "two numbers for each voxel of the splats' grid")?;
    let mut sums = vec![0.0; grid.size.iter().map(|&n| n as usize).product()];
    let mut mask = mask(gpu, whole, &grid, |i, sample| sums[i] = sample.weight)?;
    passes::visit(gpu, &part.to_voxel(&grid.world_from_voxel), &part.field, mask.size, |i, sample| {
        if 2.0 * sample.weight < sums[i] {
            mask.weight[i] = 0.0;
        }
    })?;
    part.exceptions = misclassified(gpu, &part, &mask)?.exceptions;
    Ok(part)
}

/// Returns the mask of a set for a binary one, and tells `each` the samples at the voxels that it reaches.
fn mask(
    gpu: &Gpu,
    set: &SplatSet,
    grid: &Grid,
    mut each: impl FnMut(usize, &passes::FieldSample),
) -> Result<Roi> {
    // The size is a claim of a file.
    memory::require(voxels(grid).saturating_mul(4), "the voxels of the splats' grid")?;
    let size = grid.size.map(|n| n as usize);
    let mut weight = vec![0.0; size.iter().product()];
    passes::visit(gpu, &set.to_voxel(&grid.world_from_voxel), &set.field, size, |i, sample| {
        weight[i] = f32::from(u8::from(sample.occupancy > 0.5));
        each(i, sample);
    })?;
    for exception in &set.exceptions {
        weight[exception.index(grid) as usize] = f32::from(u8::from(exception.inside));
    }
    Ok(Roi { size, weight, soft: false })
}

fn voxels(grid: &Grid) -> u64 {
    grid.size.iter().fold(1, |voxels: u64, &n| voxels.saturating_mul(n.into()))
}
