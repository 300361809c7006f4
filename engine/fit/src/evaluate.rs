//! Evaluation of a set of splats, on the native grid with all splats: equation (4) and related error figures.
//!
//! On-grid figures alone can be gamed (a fit may be right at the voxels and wrong between them), so the same
//! figures are taken at sub-voxel offsets against the trilinear volume, and the worst is reported beside the
//! on-grid one.

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::targets;
use base::error::Result;
use gpu::Gpu;
pub use passes::{FieldSample, Sampler};
use splat::{Field, Grid, Splat, SplatSet};
use volume::bricks::SAMPLES;
use volume::{BetweenSlices, Bricks, Displacements, FinerSlices, Roi, Volume};

/// Error figures at one offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Offset of the samples from the voxel centres, voxels.
    pub offset: [f32; 3],
    /// Equation (4): Σ M (V̂ - V)² / Σ M, in squared spans of the range. On the grid M is the mask as it is;
    /// between voxels a binary mask counts where its interpolation exceeds ½, and a soft mask is the weight.
    pub mmse: f64,
    /// PSNR, -10 log10(mmse), dB; infinite when V̂ is exact.
    pub psnr_db: f64,
    /// Root mean square intensity error in the ROI, HU.
    pub rmse_hu: f64,
    /// Mean |V̂ - V| in the ROI, HU.
    pub mean_error_hu: f64,
    /// 99th percentile of |V̂ - V| in the ROI, HU: the least error that 99 % of the weight does not exceed.
    pub p99_hu: f64,
    /// Root mean square of O - M over ROI and shell.
    pub occupancy_rmse: f64,
    /// Soft Dice of occupancy and mask, 2 Σ O M / (Σ O² + Σ M²), over ROI and shell.
    pub soft_dice: f64,
    /// Σ M over the samples that the intensity errors count; 0 if no sample is inside the region.
    #[serde(skip)]
    pub weight: f64,
    /// How far the outlines of splats and mask are apart.
    #[serde(skip)]
    pub outline: Outline,
}

/// Sums over samples between voxels, of which follows how far the outlines of splats (O = ½) and mask (M = ½) are
/// apart: the volume between them over the area of one. The area of the outlines of all M from 0 to 1 is ∫ |∇M| in
/// the mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outline {
    /// Samples on the wrong side of the mask's outline.
    wrong: f64,
    /// Σ |∇M|, per voxel.
    per_voxel: f64,
    /// Σ |∇M|, per mm.
    per_mm: f64,
}

impl Outline {
    fn plus(self, other: Outline) -> Outline {
        Outline {
            wrong: self.wrong + other.wrong,
            per_voxel: self.per_voxel + other.per_voxel,
            per_mm: self.per_mm + other.per_mm,
        }
    }
}

/// Error figures of a set of splats.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Figures at the voxel centres.
    pub on_grid: Metrics,
    /// Figures at the requested sub-voxel offsets, without those at which no sample is inside the region: in
    /// a region one voxel thin, most of them.
    pub between: Vec<Metrics>,
    /// Intensity range of the normalisation, HU.
    pub range: [f32; 2],
    /// Text printed after an intensity; see [`Volume::unit`].
    #[serde(skip)]
    pub unit: &'static str,
}

impl Evaluation {
    /// Returns the worst PSNR between voxels, dB, or the one on the grid if there are no figures between
    /// voxels.
    pub fn worst_psnr_db(&self) -> f64 {
        self.between.iter().map(|m| m.psnr_db).fold(f64::INFINITY, f64::min).min(if self.between.is_empty() {
            self.on_grid.psnr_db
        } else {
            f64::INFINITY
        })
    }

    /// Returns the mean PSNR between voxels, dB, or the one on the grid if there are no figures between
    /// voxels.
    pub fn mean_psnr_db(&self) -> f64 {
        if self.between.is_empty() {
            return self.on_grid.psnr_db;
        }
        self.between.iter().map(|m| m.psnr_db).sum::<f64>() / self.between.len() as f64
    }

    /// Returns the occupancy error over all offsets between voxels (root of the mean square), or the one on
    /// the grid if there are no figures between voxels. On the grid it is larger, because the trilinear mask
    /// has its kinks there.
    pub fn occupancy_rmse(&self) -> f64 {
        if self.between.is_empty() {
            return self.on_grid.occupancy_rmse;
        }
        let squares: f64 = self.between.iter().map(|m| m.occupancy_rmse * m.occupancy_rmse).sum();
        (squares / self.between.len() as f64).sqrt()
    }
}

impl Evaluation {
    /// Returns how far the outline of the splats is from that of the mask in the mean, voxels and mm; `None` without
    /// samples between voxels, where alone it can be told.
    pub fn outline_apart(&self) -> Option<[f64; 2]> {
        let outline = self.between.iter().map(|m| m.outline).fold(Outline::default(), Outline::plus);
        let Outline { wrong, per_voxel, per_mm } = outline;
        (per_voxel > 0.0).then(|| [wrong / per_voxel, wrong / per_mm])
    }
}

/// Settings of an evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Protocol {
    /// Sub-voxel offsets besides the voxel centres, voxels.
    pub offsets: Vec<[f32; 3]>,
    /// Intensity range of the normalisation, HU: the volume is clipped to it (which does nothing for the
    /// whole volume's own range) and errors are divided by its span.
    pub range: [f32; 2],
    /// Distance from the ROI up to which the occupancy counts, voxels along each axis.
    pub shell: u32,
    /// Above 0: the region is every voxel whose mask exceeds this, all with the same weight; 0: the mask is
    /// the weight.
    pub threshold: f32,
}

/// Evaluates splats, given in voxel coordinates of the volume and HU, against the volume in its ROI.
pub fn evaluate(
    gpu: &Gpu,
    splats: &[Splat],
    field: &Field,
    volume: &Volume,
    roi: &Roi,
    protocol: &Protocol,
) -> Result<Evaluation> {
    let Protocol { offsets, range, shell, threshold } = protocol;
    let bricks = Bricks::around(roi, *shell);
    let mut sampler = Sampler::new(gpu, splats, field, &bricks)?;
    let mut at = |offset: [f32; 3]| -> Result<Metrics> {
        let got = sampler.sample(offset)?;
        Ok(compare(&bricks, &got, volume, roi, offset, *range, f64::from(*threshold)))
    };
    Ok(Evaluation {
        on_grid: at([0.0; 3])?,
        between: inside(offsets.iter().map(|&o| at(o)).collect::<Result<_>>()?),
        range: *range,
        unit: volume.unit().text(),
    })
}

/// Evaluates any field in the same way. `field` gives V̂ (HU) and O at a place in voxel coordinates of the
/// volume. For a decoded field, this is the error of what a picture of it shows.
pub fn evaluate_field(
    field: impl Fn(DVec3) -> (f64, f64) + Sync,
    volume: &Volume,
    roi: &Roi,
    protocol: &Protocol,
) -> Evaluation {
    let Protocol { offsets, range, shell, threshold } = protocol;
    let bricks = Bricks::around(roi, *shell);
    let at = |offset: [f32; 3]| {
        let shift = glam::Vec3::from_array(offset).as_dvec3();
        let sample = |voxel: IVec3| {
            let (hu, occupancy) = field(voxel.as_dvec3() + shift);
            FieldSample { hu: hu as f32, occupancy: occupancy as f32, weight: occupancy as f32 }
        };
        let got: Vec<FieldSample> = (0..bricks.len() * SAMPLES)
            .into_par_iter()
            .map(|i| sample(bricks.voxel(i / SAMPLES, i % SAMPLES)))
            .collect();
        compare(&bricks, &got, volume, roi, offset, *range, f64::from(*threshold))
    };
    Evaluation {
        on_grid: at([0.0; 3]),
        between: inside(offsets.iter().map(|&offset| at(offset)).collect()),
        range: *range,
        unit: volume.unit().text(),
    }
}

/// Returns what lies between the slices of `volume` on the grid that `set` was fitted on.
pub fn between_slices_of(set: &SplatSet, volume: &Volume) -> BetweenSlices {
    let finer = BetweenSlices::Smooth.finer(volume);
    let same = |(grid, finer): (Grid, FinerSlices)| {
        let last = DVec3::from_array(finer.size().map(|n| n as f64 - 1.0));
        let apart = |at| {
            (grid.world_from_voxel.transform_point3(at) - finer.world_from_voxel().transform_point3(at))
                .length()
        };
        let shortest = volume.spacing_mm().min_element();
        Grid::of_voxels(finer.size(), grid.world_from_voxel) == grid
            && [DVec3::ZERO, last].into_iter().all(|at| apart(at) <= SAME_GRID * shortest)
    };
    if set.grid.zip(finer).is_some_and(same) { BetweenSlices::Smooth } else { BetweenSlices::Linear }
}

/// Greatest distance of voxels of grids that are the same, in the shortest edge of a voxel.
const SAME_GRID: f64 = 1e-3;

/// Takes the figures at the voxels of `volume`, and those between them on the grid with more slices that `between`
/// gives it, if it does: there the offsets of `protocol` count in its voxels. `measure` takes them of a volume and a
/// region on one grid.
///
/// # Errors
/// Those of `measure`, and [`Kind::HostMemory`](base::Kind::HostMemory) if there is no memory for more slices.
pub fn with_slices(
    volume: &Volume,
    roi: &Roi,
    between: BetweenSlices,
    protocol: &Protocol,
    mut measure: impl FnMut(&Volume, &Roi, &Protocol) -> Result<Evaluation>,
) -> Result<Evaluation> {
    let finer = between.finer(volume).filter(|_| !protocol.offsets.is_empty());
    let Some(finer) = finer else { return measure(volume, roi, protocol) };
    finer.require_memory()?;
    let at_voxels = measure(volume, roi, &Protocol { offsets: Vec::new(), ..protocol.clone() })?;
    let along = Displacements::of(&finer, volume);
    let fine = finer.volume(volume, Some(roi), &along);
    let between = measure(&fine, &finer.roi(roi, &fine, &along), protocol)?.between;
    Ok(Evaluation { between, ..at_voxels })
}

/// Leaves out the figures of offsets that have no sample inside the region, with a warning: an error over no
/// samples is not an error of 0.
fn inside(mut between: Vec<Metrics>) -> Vec<Metrics> {
    let asked = between.len();
    between.retain(|metrics| metrics.weight > 0.0);
    if between.len() < asked {
        let left_out = asked - between.len();
        tracing::warn!("at {left_out} of {asked} offsets no sample is inside the region: left out");
    }
    between
}

/// Returns `count` random offsets in ±½ voxel for evaluation, which are never those of a fit with the same
/// seed.
pub fn random_offsets(count: usize, seed: u64) -> Vec<[f32; 3]> {
    targets::offsets(count + 1, seed.wrapping_add(0x6576_616c)).split_off(1)
}

fn compare(
    bricks: &Bricks,
    got: &[FieldSample],
    volume: &Volume,
    roi: &Roi,
    offset: [f32; 3],
    range: [f32; 2],
    threshold: f64,
) -> Metrics {
    let between = offset != [0.0; 3];
    let shift = glam::Vec3::from_array(offset).as_dvec3();
    let clip = (range[0], range[1]);
    // Per sample: weight, V in HU, M (-1 where the sample takes no part), and |∇M| per voxel and per mm. The totals
    // below are summed in a fixed order.
    let idle = [0.0f64, 0.0, -1.0, 0.0, 0.0];
    let mut totals = [0.0f64; 7];
    let mut outline = Outline::default();
    let per_mm = volume.world_from_voxel.matrix3.inverse().transpose();
    let mut errors = Vec::new();
    for (slot, samples) in got.chunks(SAMPLES).enumerate() {
        let wanted = bricks.map_samples(slot..slot + 1, idle, |voxel| {
            let x = voxel.as_dvec3() + shift;
            let m = roi.trilinear(x);
            let limit = if threshold > 0.0 { threshold } else { 0.5 };
            let all_alike = threshold > 0.0 || between && !roi.soft;
            let weight = if all_alike { f64::from(u8::from(m > limit)) } else { m };
            // At the voxels the trilinear mask has its kinks; where it is 0 or 1 between them, it is flat.
            let steep = between && m > 0.0 && m < 1.0;
            let slope = if steep { mask_gradient(roi, x) } else { DVec3::ZERO };
            let hu = volume.sample_clipped(x, clip, f32::NAN);
            [weight, hu, m, slope.length(), (per_mm * slope).length()]
        });
        for (s, [weight, hu, m, slope, slope_mm]) in samples.iter().zip(wanted) {
            if m < 0.0 {
                continue;
            }
            if weight > 0.0 && hu.is_finite() {
                let error = f64::from(s.hu) - hu;
                totals[0] += weight;
                totals[1] += weight * error * error;
                totals[6] += weight * error.abs();
                errors.push([error.abs() as f32, weight as f32]);
            }
            let o = f64::from(s.occupancy);
            totals[2] += 1.0;
            totals[3] += (o - m) * (o - m);
            totals[4] += o * m;
            totals[5] += o * o + m * m;
            let wrong = f64::from(u8::from(between && (o > 0.5) != (m > 0.5)));
            outline = outline.plus(Outline { wrong, per_voxel: slope, per_mm: slope_mm });
        }
    }
    let [weight, squared, count, occupancy, both, squares, sizes] = totals;
    let mse_hu = if weight > 0.0 { squared / weight } else { 0.0 };
    let span = f64::from(range[1]) - f64::from(range[0]);
    let mmse = if span > 0.0 { mse_hu / (span * span) } else { mse_hu };
    Metrics {
        offset,
        mmse,
        psnr_db: -10.0 * mmse.log10(),
        rmse_hu: mse_hu.sqrt(),
        mean_error_hu: if weight > 0.0 { sizes / weight } else { 0.0 },
        p99_hu: percentile(&mut errors, 0.99),
        occupancy_rmse: (occupancy / count.max(1.0)).sqrt(),
        soft_dice: if squares > 0.0 { 2.0 * both / squares } else { 1.0 },
        weight,
        outline,
    }
}

/// Step of a difference within one cell of the trilinear mask, voxels.
const SMALL: f64 = 1e-3;

/// Returns ∇M at a place of voxel space, per voxel.
fn mask_gradient(roi: &Roi, x: DVec3) -> DVec3 {
    let along = |axis: DVec3| roi.trilinear(x + SMALL * axis) - roi.trilinear(x - SMALL * axis);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)) / (2.0 * SMALL)
}

/// Returns the least error that `share` of the total weight does not exceed; 0 if there are no errors. Sorts
/// `errors`, whose rows are (error, weight).
fn percentile(errors: &mut [[f32; 2]], share: f64) -> f64 {
    errors.par_sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let whole: f64 = errors.iter().map(|e| f64::from(e[1])).sum();
    let mut below = 0.0;
    let reached = errors.iter().find(|e| {
        below += f64::from(e[1]);
        below >= share * whole
    });
    reached.or(errors.last()).map_or(0.0, |e| f64::from(e[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_without_a_sample_in_the_region_is_no_perfect_one() {
        for size in [[1, 6, 6], [6, 1, 1], [1, 1, 1]] {
            let count = size.iter().product();
            let values = (0..count).map(|i| 100.0 + i as f32).collect();
            let volume = Volume::new(size, glam::DAffine3::IDENTITY, values);
            let roi = Roi::new(vec![1.0; count], &volume).unwrap();
            let protocol = Protocol {
                offsets: random_offsets(16, 3),
                range: [-1000.0, 1000.0],
                shell: 2,
                threshold: 0.0,
            };
            let figures = evaluate_field(|_| (0.0, 1.0), &volume, &roi, &protocol);
            let thin = size.iter().filter(|&&n| n == 1).count();
            assert!(figures.between.len() < 16 || thin < 2, "{size:?}");
            assert!(figures.between.iter().all(|m| m.mmse > 0.0), "{size:?}");
            for db in [figures.worst_psnr_db(), figures.mean_psnr_db(), figures.on_grid.psnr_db] {
                assert!(db.is_finite() && db < 60.0, "{size:?}: {db} dB");
            }
        }
    }

    #[test]
    fn outlines_are_as_far_apart_as_they_were_moved() {
        // A slab of four voxels along x, of 2 mm each. A sixth of its outline, by area, is at the edges of the
        // volume, and does not move.
        let world = glam::DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.0));
        let size = [12, 40, 40];
        let volume = Volume::new(size, world, vec![0.0; 19200]);
        let mask = (0..19200).map(|i| f32::from(u8::from((4..8).contains(&(i % 12))))).collect();
        let roi = Roi::new(mask, &volume).unwrap();
        let protocol =
            Protocol { offsets: random_offsets(256, 5), range: [-1000.0, 1000.0], shell: 2, threshold: 0.0 };
        let apart = |moved: f64| {
            let field = |x: DVec3| (0.0, roi.trilinear(x - DVec3::new(moved, 0.0, 0.0)));
            evaluate_field(field, &volume, &roi, &protocol).outline_apart().expect("an outline")
        };
        let [voxels, mm] = apart(0.25);
        assert!((0.15..0.26).contains(&voxels), "{voxels} voxels");
        assert!((0.28..0.51).contains(&mm), "{mm} mm");
        let half = apart(0.125)[0];
        assert!((half / voxels - 0.5).abs() < 0.15, "{half} of {voxels}");
        assert_eq!(apart(0.0), [0.0; 2]);
        let none = Protocol { offsets: Vec::new(), ..protocol };
        assert_eq!(evaluate_field(|_| (0.0, 1.0), &volume, &roi, &none).outline_apart(), None);
    }

    #[test]
    fn a_percentile_counts_weight_not_samples() {
        let mut hundred: Vec<[f32; 2]> = (1..=100).rev().map(|e| [e as f32, 1.0]).collect();
        assert_eq!(percentile(&mut hundred, 0.99), 99.0);
        assert_eq!(percentile(&mut hundred, 1.0), 100.0);
        // One sample that weighs as much as all others together.
        assert_eq!(percentile(&mut [[7.0, 3.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0]], 0.5), 3.0);
        assert_eq!(percentile(&mut [[7.0, 3.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0]], 0.51), 7.0);
        assert_eq!(percentile(&mut [], 0.99), 0.0);
    }
}
