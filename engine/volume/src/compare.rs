//! Comparison of two volumes inside a region.
//!
//! A voxel belongs to the region or not ([`Roi::members`]) and counts once. Figures without a unit are of
//! intensities that were normalised to 0 to 1; figures in the unit of the volume are of its samples as they
//! are.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::roi::{Grids, relate};
use super::{Roi, Volume};
use base::{Error, Kind, Result};

/// The intensities that are normalised to 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Normalisation {
    /// The least and greatest sample of each volume itself: how the authors of the paper compare volumes
    /// (Table 3). A volume then does not differ from a stretched and shifted copy of itself.
    Own,
    /// These two intensities for both volumes; intensities beyond are clipped to them.
    Range([f32; 2]),
}

/// Figures of the comparison of volume `b` with `a`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Number of voxels that the figures are of: voxels of the region where both volumes have a value.
    pub voxels: usize,
    /// Number of voxels of the region that are left out, because one of the volumes is NaN or infinite there.
    pub left_out: usize,
    /// The intensities at 0 and 1 of the first volume.
    pub range_a: [f32; 2],
    /// The intensities at 0 and 1 of the second volume.
    pub range_b: [f32; 2],
    /// Mean squared difference, normalised.
    pub mse: f64,
    /// Mean of b - a, in the unit of the volumes.
    pub mean_hu: f64,
    /// Root mean square of b - a, in the unit of the volumes.
    pub rmse_hu: f64,
    /// |b - a| that 99 % of the voxels do not exceed.
    pub p99_hu: f64,
    /// b - a where |b - a| is largest; the first of several.
    pub largest_hu: f64,
    /// Voxel index of the largest difference, along x, y, z.
    pub largest_voxel: [usize; 3],
    /// Place of the largest difference in the world, mm RAS.
    pub largest_mm: [f64; 3],
}

impl Comparison {
    /// Returns the PSNR over a peak of 1: -10 log10 of the mean squared difference. It is infinite if there
    /// is no difference.
    pub fn psnr_db(&self) -> f64 {
        -10.0 * self.mse.log10()
    }
}

/// Compares `b` with `a` inside `roi`, a region of `a`.
///
/// # Errors
/// [`Kind::BadData`] if the volumes lie on different grids, have no voxel in common that counts, or if a
/// volume has no range to normalise by.
pub fn compare(a: &Volume, b: &Volume, roi: &Roi, normalisation: Normalisation) -> Result<Comparison> {
    check_grids(a, b)?;
    let of = |volume: &Volume| volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default();
    let [range_a, range_b] = match normalisation {
        Normalisation::Own => [of(a), of(b)],
        Normalisation::Range(range) => [range; 2],
    };
    let [part_a, part_b] = [part_of("first", range_a)?, part_of("second", range_b)?];
    let members: Vec<usize> = roi.members().collect();
    let there = |&&i: &&usize| a.samples[i].is_finite() && b.samples[i].is_finite();
    let counted: Vec<usize> = members.iter().filter(there).copied().collect();
    let Some(&first) = counted.first() else {
        let message = "the volumes have no voxel of the region in common where both have a finite value";
        return Err(Error::new(Kind::BadData, "VGS-VOL-013", message));
    };
    let (mut squares, mut sum, mut sum_of_squares) = (0.0, 0.0, 0.0);
    let (mut largest, mut at) = (0.0f64, first);
    let mut sizes = Vec::with_capacity(counted.len());
    for &i in &counted {
        let [va, vb] = [a, b].map(|volume| f64::from(volume.samples[i]));
        let difference = vb - va;
        squares += (part_b(vb) - part_a(va)).powi(2);
        sum += difference;
        sum_of_squares += difference * difference;
        if difference.abs() > largest.abs() {
            (largest, at) = (difference, i);
        }
        sizes.push(difference.abs());
    }
    let count = counted.len() as f64;
    sizes.par_sort_unstable_by(f64::total_cmp);
    let [nx, ny, _] = a.size;
    let voxel = [at % nx, at / nx % ny, at / (nx * ny)];
    let place = DVec3::from_array(voxel.map(|v| v as f64));
    Ok(Comparison {
        voxels: counted.len(),
        left_out: members.len() - counted.len(),
        range_a,
        range_b,
        mse: squares / count,
        mean_hu: sum / count,
        rmse_hu: (sum_of_squares / count).sqrt(),
        // The least size that 99 % of the voxels do not exceed.
        p99_hu: sizes[((0.99 * count).ceil() as usize).clamp(1, sizes.len()) - 1],
        largest_hu: largest,
        largest_voxel: voxel,
        largest_mm: a.world_from_voxel.transform_point3(place).to_array(),
    })
}

/// Fails if the volumes lie on different grids.
fn check_grids(a: &Volume, b: &Volume) -> Result<()> {
    let different = || {
        let text = |volume: &Volume| {
            let [[x, y, z], spacing] = [volume.size.map(|n| n as f64), volume.spacing_mm().to_array()];
            let [dx, dy, dz] = spacing;
            format!("{x} x {y} x {z} voxels of {dx:.4} x {dy:.4} x {dz:.4} mm")
        };
        let mut message = format!("the volumes lie on different grids: {} and {}", text(a), text(b));
        if a.size == b.size {
            message += ", elsewhere or otherwise turned in the patient";
        }
        Error::new(Kind::BadData, "VGS-VOL-012", message)
            .help("bring one onto the grid of the other; splats with vgs rasterize SPLATS --like VOLUME")
    };
    match relate(b, a) {
        Ok(Grids::Same) => Ok(()),
        Ok(Grids::Assumed) => {
            tracing::warn!(
                "one of the volumes has no orientation: they are taken to be on one grid, since their sizes agree"
            );
            Ok(())
        }
        Ok(Grids::Differ) | Err(_) => Err(different()),
    }
}

/// Returns a function that maps the range from `low` to `high` to 0 to 1 and clips intensities to it. Fails
/// for an empty range; `which` names the volume in the error.
fn part_of(which: &str, [low, high]: [f32; 2]) -> Result<impl Fn(f64) -> f64 + use<>> {
    let [low, high] = [low, high].map(f64::from);
    if high > low {
        return Ok(move |v: f64| (v.clamp(low, high) - low) / (high - low));
    }
    let message =
        format!("the {which} volume is {low} everywhere that its range is taken from, so it has none");
    Err(Error::new(Kind::BadData, "VGS-VOL-014", message).help("give one: --range LOW,HIGH"))
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    const SIZE: [usize; 3] = [10, 5, 4];

    fn volume(value: impl Fn(usize) -> f32) -> Volume {
        let affine = DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0));
        Volume::new(SIZE, affine, (0..SIZE.iter().product()).map(value).collect())
    }

    fn region(volume: &Volume, weight: impl Fn(usize) -> f32) -> Roi {
        Roi::new((0..volume.len()).map(weight).collect(), volume).expect("a region")
    }

    #[test]
    fn figures_are_those_of_the_region_in_each_normalisation() {
        // 0 to 199 everywhere; the region has 0 to 99.
        let a = volume(|i| i as f32);
        let roi = region(&a, |i| f32::from(u8::from(i < 100)));
        let mut b = volume(|i| i as f32 + 2.0);
        b.samples[37] -= 52.0;
        // Beyond the region everything may differ, and does.
        b.samples[150] = 1000.0;
        let range = |range| compare(&a, &b, &roi, Normalisation::Range(range)).expect("figures");

        let whole = range([0.0, 199.0]);
        // 37 - 50 is clipped to 0: 37 in place of 50.
        let clipped = (99.0 * 4.0 + 37.0 * 37.0) / 100.0;
        assert_eq!((whole.voxels, whole.left_out), (100, 0));
        assert!((whole.mse - clipped / 199f64.powi(2)).abs() < 1e-12);
        assert!((whole.psnr_db() + 10.0 * whole.mse.log10()).abs() < 1e-12);
        assert!((whole.rmse_hu - ((99.0 * 4.0 + 2500.0) / 100.0f64).sqrt()).abs() < 1e-9, "not clipped");
        assert!((whole.mean_hu - (99.0 * 2.0 - 50.0) / 100.0).abs() < 1e-9);
        assert_eq!((whole.p99_hu, whole.largest_hu), (2.0, -50.0));
        assert_eq!((whole.largest_voxel, whole.largest_mm), ([7, 3, 0], [7.0, 6.0, 0.0]));

        // Over the region's own range its upper end is clipped as well: 98 and 99 are not 2 off but 1 and 0.
        let own = roi.range(&a).expect("a range");
        assert_eq!(own, [0.0, 99.0]);
        let clipped = (97.0 * 4.0 + 1.0 + 37.0 * 37.0) / 100.0;
        assert!((range(own).mse - clipped / 99f64.powi(2)).abs() < 1e-12);

        let apart = compare(&a, &b, &roi, Normalisation::Own).expect("figures");
        let difference = |i: usize| (f64::from(b.samples[i]) + 13.0) / 1013.0 - i as f64 / 199.0;
        let mse = (0..100).map(|i| difference(i).powi(2)).sum::<f64>() / 100.0;
        assert_eq!((apart.range_a, apart.range_b), ([0.0, 199.0], [-13.0, 1000.0]));
        assert!((apart.mse - mse).abs() < 1e-12 && apart.rmse_hu == whole.rmse_hu);

        // What is only stretched and shifted is the same over own ranges.
        let stretched = volume(|i| 3.0 * i as f32 - 1000.0);
        let same = compare(&a, &stretched, &roi, Normalisation::Own).expect("figures");
        assert!(same.mse < 1e-12 && same.rmse_hu > 800.0);
        let equal = compare(&a, &a, &roi, Normalisation::Own).expect("figures");
        assert_eq!((equal.mse, equal.psnr_db(), equal.largest_hu), (0.0, f64::INFINITY, 0.0));
    }

    #[test]
    fn the_faint_margin_of_a_soft_mask_does_not_count() {
        let a = volume(|i| i as f32);
        let roi = region(&a, |i| match i {
            0..50 => 0.8,
            50..60 => 0.1,
            60..70 => 0.008,
            _ => 0.0,
        });
        assert_eq!(roi.range(&a), Some([0.0, 59.0]));
        let b = volume(|i| if i < 60 { i as f32 + 1.0 } else { 0.0 });
        let found = compare(&a, &b, &roi, Normalisation::Range([0.0, 100.0])).expect("figures");
        assert_eq!((found.voxels, found.rmse_hu), (60, 1.0));
    }

    #[test]
    fn voxels_without_a_value_are_left_out_and_what_cannot_be_compared_is_refused() {
        let a = volume(|i| i as f32);
        let roi = region(&a, |_| 1.0);
        let mut b = a.clone();
        b.samples[3] = f32::NAN;
        b.samples[4] = f32::INFINITY;
        let found = compare(&a, &b, &roi, Normalisation::Range([0.0, 1.0])).expect("figures");
        assert_eq!((found.voxels, found.left_out, found.mse), (198, 2, 0.0));

        let nothing = volume(|_| f32::NAN);
        let flat = volume(|_| 7.0);
        let moved = Volume {
            world_from_voxel: DAffine3::from_translation(DVec3::X) * a.world_from_voxel,
            ..a.clone()
        };
        let small = Volume::new([2, 1, 1], DAffine3::IDENTITY, vec![0.0, 1.0]);
        let unit = Normalisation::Range([0.0, 1.0]);
        let rows: [(&Volume, Normalisation, &str, &str); 5] = [
            (&nothing, unit, "VGS-VOL-013", "in common"),
            (&flat, Normalisation::Own, "VGS-VOL-014", "second volume is 7"),
            (&a, Normalisation::Range([5.0, 5.0]), "VGS-VOL-014", "first volume is 5"),
            (&moved, unit, "VGS-VOL-012", "elsewhere"),
            (&small, unit, "VGS-VOL-012", "10 x 5 x 4 voxels of 1.0000 x 2.0000 x 3.0000 mm and 2 x 1 x 1"),
        ];
        for (b, normalisation, code, says) in rows {
            let error = compare(&a, b, &roi, normalisation).expect_err(says);
            assert_eq!((error.kind, error.code), (Kind::BadData, code), "{error}");
            assert!(error.message.contains(says), "{error}");
        }
        // Where nobody knows how one lies, their sizes must do.
        let lost = Volume { oriented: false, ..moved };
        assert!(compare(&a, &lost, &roi, unit).is_ok());
    }
}
