//! The volume type: scalar samples on a regular grid.

use std::collections::BTreeMap;

use flate2::Crc;
use glam::{DAffine3, DVec3};

use super::PartOf;
use super::affine::{axis_codes_of, spacing_of};
use super::interpolation::trilinear;
use base::unit::Unit;

/// Samples that a checksum takes at once.
const CRC_SAMPLES: usize = 1 << 14;
/// Bits of the NaN that stands for what is not finite.
const NOT_FINITE: u32 = 0x7fc0_0000;

/// A scalar volume on a regular grid.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Map from voxel index (centres at integers) to world, mm RAS. It may be oblique, sheared or
    /// left-handed.
    pub world_from_voxel: DAffine3,
    /// Samples, x fastest: HU for CT, the stored unit otherwise. Their number is the product of `size`. They
    /// may be NaN or infinite if those of the file are.
    pub samples: Vec<f32>,
    /// True if the file says how the patient lies. Otherwise the axes are those of the grid, and left and
    /// right are unknown.
    pub oriented: bool,
    /// Names of label values, if the file has them.
    pub labels: BTreeMap<i32, String>,
    /// UID of the space that the world is (DICOM's frame of reference), if the file names it.
    pub frame_of_reference: Option<String>,
    /// What the file, its name or the user says that the samples are numbers of; `None` if none of them says it.
    pub stated_unit: Option<Unit>,
    /// The volume that this is a box of, if it was read as such.
    pub part_of: Option<PartOf>,
}

/// Summary of the samples of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    /// Number of finite samples; the other figures are of these.
    pub finite: usize,
    /// Number of samples that are NaN or infinite.
    pub non_finite: usize,
    /// Smallest sample; 0 if none is finite.
    pub min: f32,
    /// Largest sample; 0 if none is finite.
    pub max: f32,
    /// Mean; 0 if none is finite.
    pub mean: f64,
    /// Population standard deviation; 0 if none is finite.
    pub std_dev: f64,
}

impl Volume {
    /// Creates a volume of known orientation and without label names. `samples` has x fastest.
    ///
    /// # Panics
    /// If the number of samples is not the product of `size`.
    pub fn new(size: [usize; 3], world_from_voxel: DAffine3, samples: Vec<f32>) -> Self {
        assert_eq!(samples.len(), size.iter().product::<usize>(), "one sample for every voxel");
        Volume {
            size,
            world_from_voxel,
            samples,
            oriented: true,
            labels: BTreeMap::new(),
            frame_of_reference: None,
            stated_unit: None,
            part_of: None,
        }
    }

    /// Returns the number of voxels.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Returns true if there is no voxel.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Returns the index of voxel (x, y, z) in `samples`.
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        debug_assert!(x < self.size[0] && y < self.size[1] && z < self.size[2]);
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// Returns the map from the world (mm RAS) to voxel space.
    pub fn voxel_from_world(&self) -> DAffine3 {
        self.world_from_voxel.inverse()
    }

    /// Returns the CRC-32 of the samples, x fastest, as little-endian 32-bit floats; -0 counts as 0, and what is not
    /// finite as NaN. It is the same whatever format the volume came in.
    pub fn crc32(&self) -> u32 {
        let mut crc = Crc::new();
        let mut bytes = Vec::with_capacity(4 * CRC_SAMPLES);
        for samples in self.samples.chunks(CRC_SAMPLES) {
            bytes.clear();
            // Adding 0 makes 0 of -0.
            let plain =
                samples.iter().map(|v| if v.is_finite() { v + 0.0 } else { f32::from_bits(NOT_FINITE) });
            bytes.extend(plain.flat_map(f32::to_le_bytes));
            crc.update(&bytes);
        }
        crc.sum()
    }

    /// Returns the distance between neighbouring voxel centres along each voxel axis, mm.
    pub fn spacing_mm(&self) -> DVec3 {
        spacing_of(&self.world_from_voxel)
    }

    /// Returns the direction in which each voxel index grows, as "RAS" or "LPS"; "???" if the orientation is
    /// unknown.
    pub fn axis_codes(&self) -> String {
        if self.oriented { axis_codes_of(&self.world_from_voxel) } else { "???".into() }
    }

    /// Returns the trilinear sample at a point in voxel space, clamped to the grid: beyond the edge it is the
    /// edge value.
    pub fn trilinear(&self, voxel: DVec3) -> f64 {
        trilinear(self.size, voxel, |i| f64::from(self.samples[i]))
    }

    /// Returns the trilinear sample at `x` (voxel space), clamped to the edge, of voxels that are first
    /// clipped to `clip`; a voxel that is not finite counts as `idle`.
    pub fn sample_clipped(&self, x: DVec3, clip: (f32, f32), idle: f32) -> f64 {
        trilinear(self.size, x, |i| {
            let v = self.samples[i];
            f64::from(if v.is_finite() { v.clamp(clip.0, clip.1) } else { idle })
        })
    }

    /// Returns the smallest and largest finite sample; `None` if there is none.
    pub fn min_max(&self) -> Option<(f32, f32)> {
        let finite = || self.samples.iter().copied().filter(|v| v.is_finite());
        Some((finite().reduce(f32::min)?, finite().reduce(f32::max)?))
    }

    /// Returns the counts, range, mean and spread of the samples, in two passes of f64.
    pub fn gather_stats(&self) -> Stats {
        let finite = || self.samples.iter().copied().filter(|v| v.is_finite()).map(f64::from);
        let n = finite().count();
        let (min, max) = self.min_max().unwrap_or_default();
        let over = n.max(1) as f64;
        let mean = finite().sum::<f64>() / over;
        let variance = finite().map(|v| (v - mean).powi(2)).sum::<f64>() / over;
        Stats { finite: n, non_finite: self.len() - n, min, max, mean, std_dev: variance.sqrt() }
    }

    /// Returns the eight corners of the box of all voxels, in world mm: half a voxel beyond the outermost
    /// centres. Corner `i` is at the far end of axis `a` if bit `a` of `i` is set.
    pub fn world_corners(&self) -> [DVec3; 8] {
        self.voxel_corners().map(|c| self.world_from_voxel.transform_point3(c))
    }

    /// Returns the corners of [`Volume::world_corners`] in voxel space.
    pub(super) fn voxel_corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::from_array(std::array::from_fn(|a| {
                if i >> a & 1 == 1 { self.size[a] as f64 - 0.5 } else { -0.5 }
            }))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_samples_alone() {
        let volume = |samples: Vec<f32>| Volume::new([samples.len(), 1, 1], DAffine3::IDENTITY, samples);
        // The check value of CRC-32: "123456789", and here "12345678".
        let letters = [*b"1234", *b"5678"].map(f32::from_le_bytes);
        assert_eq!(volume(letters.to_vec()).crc32(), 0x9ae0_daaf);
        assert_eq!(volume(vec![0.0, f32::NAN]).crc32(), volume(vec![-0.0, f32::INFINITY]).crc32());
        let long = |last| volume((0..40_000).map(|i| if i == 39_999 { last } else { i as f32 }).collect());
        assert_ne!(long(1.0).crc32(), long(2.0).crc32());
        assert_eq!(long(1.0).crc32(), long(1.0).crc32());
    }
}
