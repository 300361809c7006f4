//! A region without splats: the intensities of its voxels, coded so that none is off by more than a bound.

use crate::error::{Error, Kind, Result};
use crate::splat::voxels::{LARGEST_CODE, Precision, Voxels};
use crate::splat::{Field, Form, Grid, Region, SplatSet, vgs};
use crate::unit::Unit;
use crate::volume::{Labels, Roi, Volume};
use glam::DVec3;

/// The bound of CTs for which none is given, HU.
const USUAL_HU: f64 = 30.0;
/// The same of other scans, as a part of the range of the region.
const USUAL_PART: f64 = 0.01;
/// Most voxels of a region that is coded only to tell what that takes: about two seconds.
const MOST_TRIED: usize = 4 << 20;

/// Returns the bound that is usual for a volume: 30 HU, or, without HU, 1 % of the range of the region.
pub fn usual_bound(volume: &Volume, roi: &Roi) -> f64 {
    let within =
        || roi.weight.iter().zip(&volume.samples).filter(|(w, _)| **w > 0.5).map(|(_, &v)| f64::from(v));
    match volume.unit() {
        Unit::Hu => USUAL_HU,
        _ => {
            (within().fold(f64::NEG_INFINITY, f64::max) - within().fold(f64::INFINITY, f64::min)) * USUAL_PART
        }
    }
}

/// Returns a set that has the intensities of a binary region, and of the rim that interpolation needs, as coded voxels
/// on the volume's grid. No voxel of the region is off by more than `bound`, in the unit of the volume; with 0 whole
/// numbers are kept as they are. The objects are the structures of `labels`; without labels there is one.
///
/// Beyond the region V is what a fit of splats aims at: the scan's, as far as it goes the way in which the object ends.
///
/// # Errors
/// [`Kind::Usage`] for a soft region, and for a bound below 0, or too small for intensities that are no whole numbers or
/// so large; [`Kind::NothingToDo`] for a region without voxels.
///
/// # Panics
/// If the region has another size than the volume.
pub fn coded(volume: &Volume, roi: &Roi, labels: Option<&Labels>, bound: f64) -> Result<SplatSet> {
    assert_eq!(volume.size, roi.size, "a region of the volume");
    if roi.soft {
        let message = "a soft mask, and a region that is coded has whole voxels";
        return Err(Error::new(Kind::Usage, "VGS-CODE-001", message)
            .help("give a mask of 0 and 1, or fit splats: vgs fit"));
    }
    let inside = |i: usize| roi.weight[i] > 0.5 && volume.samples[i].is_finite();
    let region = Region::of(volume.size, |i| inside(i).then_some(0))
        .filter(|region| region.voxel_count() > 0)
        .ok_or_else(|| Error::new(Kind::NothingToDo, "VGS-CODE-002", "the region has no voxels"))?;
    let within = || (0..volume.len()).filter(|&i| inside(i)).map(|i| f64::from(volume.samples[i]));
    let whole = within().all(|v| v.fract() == 0.0);
    let most = within().fold(0.0, |most: f64, v| most.max(v.abs()));
    let precision = Precision::within(bound, whole)
        .filter(|precision| most / precision.step <= f64::from(LARGEST_CODE / 2))
        .ok_or_else(|| {
            let message = format!("a bound of {bound}{} for intensities up to {most}", volume.unit().text());
            let help =
                if whole { "give one from 0 on" } else { "they are no whole numbers: give one above 0" };
            Error::new(Kind::Usage, "VGS-CODE-003", message).help(help)
        })?;
    let grid = Grid::of_voxels(volume.size, volume.world_from_voxel);
    let alone = volume.of_region_alone(roi);
    let value = |voxel: [u32; 3]| {
        let [x, y, z] = voxel.map(|at| at as usize);
        f64::from(alone.samples[volume.index(x, y, z)])
    };
    let voxels = Voxels::of(&region, grid.size, precision, value);
    let [first, end] = region.bounds().map(|at| DVec3::from_array(at.map(f64::from)));
    let centre = grid.world_from_voxel.transform_point3((first + end) * 0.5 - 0.5);
    let mean = within().sum::<f64>() / region.voxel_count() as f64;
    let mut set = SplatSet {
        origin_mm: centre.round(),
        field: Field { background: mean as f32, ..Field::default() },
        unit: volume.unit(),
        grid: Some(grid),
        volume_crc32: Some(volume.crc32()),
        form: Form::Grid,
        region: Some(region),
        voxels: vec![voxels],
        ..SplatSet::default()
    };
    if let Some(labels) = labels {
        crate::fit::labels::label(&mut set, labels);
    }
    Ok(set)
}

/// What a region takes that is coded in place of splats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InPlaceOfSplats {
    /// Greatest error of a voxel, in the unit of the volume.
    pub bound: f64,
    /// Bytes of the file.
    pub bytes: u64,
}

/// Returns what a region takes that is coded with no greater root mean square error than splats have; `None` for a soft
/// region, one of too many voxels to be tried by the way, and one that cannot be coded so.
pub fn in_place_of_splats(volume: &Volume, roi: &Roi, rmse: f64) -> Option<InPlaceOfSplats> {
    if roi.soft || roi.voxel_count() > MOST_TRIED {
        return None;
    }
    // Errors are spread evenly up to the bound.
    let set = coded(volume, roi, None, (3f64.sqrt() * rmse).floor()).ok()?;
    let bound = set.voxels.first()?.precision.bound();
    vgs::encode(&set).ok().map(|file| InPlaceOfSplats { bound, bytes: file.len() as u64 })
}
