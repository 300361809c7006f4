//! Downsampling: the working grid of a fit, and the coarser volumes that reconstructions are compared with.
//!
//! Every factor f applies to all three axes in voxel space, whatever the spacing. If f does not divide the
//! size, the outermost voxels are repeated beyond the upper end of an axis. Coarse voxel i covers the voxels
//! f i .. f i + f - 1 and lies at their centre, f i + (f - 1) / 2; the affine follows.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{Roi, Volume, trilinear};

/// A way to make a volume coarser: a row of [`DOWNSAMPLINGS`].
#[derive(Clone, Copy, Debug)]
pub struct Downsampling {
    /// Name in tables.
    pub name: &'static str,
    /// Returns the voxels along one axis that make up coarse voxel `i`, with their weights, whose sum is 1.
    taps: fn(i: usize, factor: usize) -> Vec<(usize, f64)>,
}

/// The mean of each block of f³ voxels.
pub const AREA: Downsampling = Downsampling {
    name: "area",
    taps: |i, factor| (0..factor).map(|k| (i * factor + k, 1.0 / factor as f64)).collect(),
};

/// Linear interpolation at the centres of the blocks, without a filter before it; for f = 2 the same as
/// [`AREA`].
pub const LINEAR: Downsampling = Downsampling {
    name: "linear",
    taps: |i, factor| {
        let below = i * factor + (factor - 1) / 2;
        if factor % 2 == 1 { vec![(below, 1.0)] } else { vec![(below, 0.5), (below + 1, 0.5)] }
    },
};

/// Every way to make a volume coarser.
pub const DOWNSAMPLINGS: &[Downsampling] = &[AREA, LINEAR];

impl Volume {
    /// Returns the volume with voxels of `factor` voxels along each axis. Voxels that are not finite do not
    /// count; a coarse voxel without any finite one is NaN.
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn downsampled(&self, factor: usize, how: &Downsampling) -> Volume {
        let size = coarse_size(self.size, factor);
        let samples = reduce(self.size, &self.samples, factor, how);
        let block = DAffine3 {
            translation: DVec3::splat((factor as f64 - 1.0) / 2.0),
            ..DAffine3::from_scale(DVec3::splat(factor as f64))
        };
        Volume {
            size,
            world_from_voxel: self.world_from_voxel * block,
            samples,
            oriented: self.oriented,
            labels: self.labels.clone(),
            frame_of_reference: self.frame_of_reference.clone(),
            stated_unit: Some(self.unit()),
            part_of: None,
        }
    }

    /// Returns the means of blocks of `factor` voxels along each axis: the working grid of a fit.
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn coarsened(&self, factor: usize) -> Volume {
        self.downsampled(factor, &AREA)
    }
}

impl Roi {
    /// Returns the share of each block of `factor` voxels along each axis that the region covers, on the grid
    /// of [`Volume::coarsened`]. A binary mask becomes soft where its outline crosses a block.
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn coarsened(&self, factor: usize) -> Roi {
        let weight = reduce(self.size, &self.weight, factor, &AREA);
        let soft = weight.iter().any(|&w| w > 0.0 && w < 1.0);
        Roi { size: coarse_size(self.size, factor), weight, soft }
    }
}

fn coarse_size(size: [usize; 3], factor: usize) -> [usize; 3] {
    assert!(factor > 0, "a block holds a voxel");
    size.map(|n| n.div_ceil(factor))
}

fn reduce(size: [usize; 3], samples: &[f32], factor: usize, how: &Downsampling) -> Vec<f32> {
    let coarse = coarse_size(size, factor);
    // Taps for each axis and coarse voxel; beyond the upper end the outermost voxel is repeated.
    let taps: [Vec<Vec<(usize, f64)>>; 3] = std::array::from_fn(|axis| {
        let inside = |(at, weight): (usize, f64)| (at.min(size[axis] - 1), weight);
        (0..coarse[axis]).map(|i| (how.taps)(i, factor).into_iter().map(inside).collect()).collect()
    });
    let mut out = vec![0.0; coarse.iter().product()];
    out.par_chunks_mut(coarse[0].max(1)).enumerate().for_each(|(row, out)| {
        let (y_taps, z_taps) = (&taps[1][row % coarse[1]], &taps[2][row / coarse[1]]);
        for (out, x_taps) in out.iter_mut().zip(&taps[0]) {
            let (mut sum, mut finite) = (0.0, 0.0);
            for &(z, wz) in z_taps {
                for &(y, wy) in y_taps {
                    let line = size[0] * (y + size[1] * z);
                    for &(x, wx) in x_taps {
                        let (sample, weight) = (samples[line + x], wx * wy * wz);
                        if sample.is_finite() {
                            sum += weight * f64::from(sample);
                            finite += weight;
                        }
                    }
                }
            }
            // This is 0 / 0 if no voxel is finite.
            *out = (sum / finite) as f32;
        }
    });
    out
}

/// Difference of a volume from itself after downsampling and upsampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// The masked mean squared error of equation (4), Σ M (U - V)² / Σ M at the voxels, in squared spans of
    /// the range.
    pub mmse: f64,
    /// PSNR, -10 log10(mmse); infinite if nothing is lost.
    pub psnr_db: f64,
}

/// Returns what is lost in `roi` when `volume`, clipped to `range` (HU), is made coarser by `factor` and
/// brought back linearly: the paper's downsampled baseline (its Table 3). Along each axis voxel j is sampled
/// at (j + ½) / f - ½ of the coarse grid, clamped to its ends. Soft masks weight the errors, and voxels that
/// are not finite do not count.
///
/// # Panics
/// If `factor` is 0 or the region is not on the grid of the volume.
pub fn downsampling_loss(
    volume: &Volume,
    roi: &Roi,
    factor: usize,
    how: &Downsampling,
    range: [f32; 2],
) -> Loss {
    assert_eq!(volume.size, roi.size, "a region of interest lies on the grid of its volume");
    let clip = |v: f32| if v.is_finite() { v.clamp(range[0], range[1]) } else { v };
    let clipped: Vec<f32> = volume.samples.par_iter().map(|&v| clip(v)).collect();
    let size = coarse_size(volume.size, factor);
    let coarse = reduce(volume.size, &clipped, factor, how);
    let [nx, ny, _] = volume.size;
    let place = |j: usize| (j as f64 + 0.5) / factor as f64 - 0.5;
    // Summed by rows and then in the order of rows, so that the sums do not depend on the threads.
    let rows: Vec<[f64; 2]> = (0..volume.len() / nx.max(1))
        .into_par_iter()
        .map(|row| {
            let mut sums = [0.0; 2];
            for x in 0..nx {
                let (weight, wanted) = (roi.weight[row * nx + x], clipped[row * nx + x]);
                if weight > 0.0 && wanted.is_finite() {
                    let at = DVec3::new(place(x), place(row % ny), place(row / ny));
                    if let Some(found) = finite_trilinear(size, at, &coarse) {
                        let error = found - f64::from(wanted);
                        sums[0] += f64::from(weight) * error * error;
                        sums[1] += f64::from(weight);
                    }
                }
            }
            sums
        })
        .collect();
    let [squared, weight] = rows.into_iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
    let span = f64::from(range[1]) - f64::from(range[0]);
    let unit = if span > 0.0 { span * span } else { 1.0 };
    let mmse = if weight > 0.0 { squared / weight / unit } else { 0.0 };
    Loss { mmse, psnr_db: -10.0 * mmse.log10() }
}

/// Returns the trilinear sample of the finite samples alone; `None` if none of them has weight.
fn finite_trilinear(size: [usize; 3], at: DVec3, samples: &[f32]) -> Option<f64> {
    let all = trilinear(size, at, |i| f64::from(samples[i]));
    if all.is_finite() {
        return Some(all);
    }
    let finite = |i: usize| samples[i].is_finite();
    let sum = trilinear(size, at, |i| if finite(i) { f64::from(samples[i]) } else { 0.0 });
    let share = trilinear(size, at, |i| f64::from(u8::from(finite(i))));
    (share > 0.0).then(|| sum / share)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 3] = [7, 5, 6];

    /// Rough, so that a shift by one voxel anywhere shows.
    fn rough() -> (Volume, Roi) {
        let affine = DAffine3::from_mat3_translation(
            glam::DMat3::from_rotation_z(0.3) * glam::DMat3::from_diagonal(DVec3::new(-0.8, 0.8, 2.0)),
            DVec3::new(5.0, -60.0, 300.0),
        );
        let volume = Volume::new(SIZE, affine, (0..210).map(|i| ((i * 7919) % 101) as f32).collect());
        let roi = Roi::new((0..210).map(|i| ((i * 31) % 5) as f32 / 4.0).collect(), &volume);
        (volume, roi.expect("a region"))
    }

    #[test]
    fn blocks_and_their_edges() {
        let (volume, _) = rough();
        let coarse = |factor, how| volume.downsampled(factor, how);
        assert_eq!(coarse(1, &AREA).samples, volume.samples);
        assert_eq!(coarse(1, &LINEAR).samples, volume.samples);
        assert_eq!(coarse(2, &AREA).samples, coarse(2, &LINEAR).samples);
        // By numpy, with the outermost voxels going on.
        assert_eq!(coarse(4, &AREA).samples[..4], [48.484375, 50.734375, 54.25, 43.875]);
        assert_eq!(coarse(4, &LINEAR).samples[4..], [41.5, 54.0, 52.0, 64.5]);
        assert_eq!(coarse(3, &LINEAR).samples[..6], [46.0, 68.0, 49.0, 99.0, 20.0, 1.0]);
        for (factor, size) in [(2, [4, 3, 3]), (3, [3, 2, 2]), (4, [2, 2, 2]), (16, [1, 1, 1])] {
            assert_eq!(coarse(factor, &AREA).size, size);
        }
    }

    #[test]
    fn losses_are_those_of_numpy() {
        let (volume, roi) = rough();
        // With the script of the data's description, in f64.
        let rows = [
            (1, AREA, [0.0, 100.0], 0.0),
            (2, AREA, [0.0, 100.0], 0.07774935766674224),
            (2, LINEAR, [0.0, 100.0], 0.07774935766674224),
            (3, AREA, [0.0, 100.0], 0.0812374194496885),
            (3, LINEAR, [0.0, 100.0], 0.1146546234241296),
            (4, AREA, [0.0, 100.0], 0.08196164542748106),
            (4, LINEAR, [0.0, 100.0], 0.08326227569580077),
            (8, AREA, [0.0, 100.0], 0.0827106848762149),
            (8, LINEAR, [0.0, 100.0], 0.088405),
            (2, AREA, [20.0, 70.0], 0.1536977290344238),
            (3, LINEAR, [20.0, 70.0], 0.22636829577372783),
            (4, AREA, [20.0, 70.0], 0.16165921984070825),
            (8, LINEAR, [20.0, 70.0], 0.17048738095238095),
        ];
        for (factor, how, range, mmse) in rows {
            let loss = downsampling_loss(&volume, &roi, factor, &how, range);
            let error = (loss.mmse - mmse).abs();
            assert!(error <= 1e-6 * mmse, "{} by {factor} over {range:?}: {loss:?}, not {mmse}", how.name);
            assert!(mmse == 0.0 || (loss.psnr_db + 10.0 * mmse.log10()).abs() < 1e-4);
        }
        assert_eq!(downsampling_loss(&volume, &roi, 1, &AREA, [0.0, 100.0]).psnr_db, f64::INFINITY);
    }

    #[test]
    fn coarse_voxels_lie_where_their_blocks_are() {
        let (volume, _) = rough();
        for factor in [1, 2, 3, 5] {
            let coarse = volume.coarsened(factor);
            let voxels = |i: usize| i * factor..(i + 1) * factor;
            for voxel in [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 1, 1]] {
                let [x, y, z] = voxel.map(voxels);
                let block = z.flat_map(|z| {
                    let (x, y) = (x.clone(), y.clone());
                    y.flat_map(move |y| x.clone().map(move |x| DVec3::new(x as f64, y as f64, z as f64)))
                });
                let count = factor.pow(3) as f64;
                let centre =
                    block.map(|v| volume.world_from_voxel.transform_point3(v)).sum::<DVec3>() / count;
                let found =
                    coarse.world_from_voxel.transform_point3(DVec3::from_array(voxel.map(|v| v as f64)));
                assert!((found - centre).length() < 1e-9, "{voxel:?} by {factor}: {found}, not {centre}");
            }
        }
    }

    #[test]
    fn a_ramp_stays_the_ramp() {
        let (mut volume, _) = rough();
        volume = Volume::new([12, 8, 4], volume.world_from_voxel, vec![0.0; 384]);
        let ramp = |world: DVec3| 3.0 * world.x - 2.0 * world.y + 0.5 * world.z;
        let sampled = |volume: &Volume| -> Vec<f64> {
            let [nx, ny, _] = volume.size;
            let voxel = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
            (0..volume.len()).map(|i| ramp(volume.world_from_voxel.transform_point3(voxel(i)))).collect()
        };
        volume.samples = sampled(&volume).iter().map(|&v| v as f32).collect();
        for factor in [2, 4] {
            for how in DOWNSAMPLINGS {
                let coarse = volume.downsampled(factor, how);
                for (found, wanted) in coarse.samples.iter().zip(sampled(&coarse)) {
                    assert!((f64::from(*found) - wanted).abs() < 1e-4, "{}: {found}, not {wanted}", how.name);
                }
            }
        }
    }

    #[test]
    fn masks_become_shares_and_holes_stay_holes() {
        let volume = Volume::new([4, 4, 2], DAffine3::IDENTITY, (0..32).map(|i| i as f32).collect());
        let mask = |marked: &dyn Fn(usize) -> bool, volume: &Volume| {
            Roi::new((0..32).map(|i| f32::from(u8::from(marked(i)))).collect(), volume).expect("a region")
        };
        // The left half is whole blocks; three columns are not.
        let half = mask(&|i| i % 4 < 2, &volume).coarsened(2);
        assert_eq!((half.size, &half.weight[..], half.soft), ([2, 2, 1], &[1.0, 0.0, 1.0, 0.0][..], false));
        let three = mask(&|i| i % 4 < 3, &volume).coarsened(2);
        assert_eq!((&three.weight[..], three.soft), (&[1.0, 0.5, 1.0, 0.5][..], true));
        // Blocks over the end: the outermost voxels go on.
        assert_eq!(mask(&|i| i % 4 == 3, &volume).coarsened(3).weight, [0.0, 1.0, 0.0, 1.0]);

        let mut holes = volume;
        for i in [0, 1, 4, 5, 16, 17, 20, 21, 2] {
            holes.samples[i] = [f32::NAN, f32::INFINITY][i % 2];
        }
        let coarse = holes.coarsened(2);
        assert!(coarse.samples[0].is_nan());
        assert_eq!(coarse.samples[1], (3.0 + 6.0 + 7.0 + 18.0 + 19.0 + 22.0 + 23.0) / 7.0);
        let whole = mask(&|_| true, &holes);
        let roi = whole.coarsened(2);
        assert_eq!((roi.weight[0], roi.weight[1]), (0.0, 7.0 / 8.0));
        // Beside a hole the other blocks stand in for it; a constant is not touched by it.
        let loss = downsampling_loss(&holes, &whole, 2, &AREA, [0.0, 31.0]);
        assert!(loss.mmse > 0.0 && loss.psnr_db > 5.0, "{loss:?}");
        holes.samples.iter_mut().filter(|v| v.is_finite()).for_each(|v| *v = 7.0);
        for how in DOWNSAMPLINGS {
            assert_eq!(downsampling_loss(&holes, &whole, 2, how, [0.0, 31.0]).mmse, 0.0, "{}", how.name);
        }
    }
}
