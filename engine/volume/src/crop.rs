//! Parts of a volume and of a region, as grids of their own.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{Roi, Volume};

impl Volume {
    /// Returns the box of `size` voxels whose first one is `first`, where it lies in the patient.
    ///
    /// # Panics
    /// If the box reaches beyond the volume.
    pub fn cropped(&self, first: [usize; 3], size: [usize; 3]) -> Volume {
        let offset = DVec3::from_array(first.map(|c| c as f64));
        Volume {
            size,
            world_from_voxel: self.world_from_voxel * DAffine3::from_translation(offset),
            samples: cropped(&self.samples, self.size, first, size),
            oriented: self.oriented,
            labels: self.labels.clone(),
            frame_of_reference: self.frame_of_reference.clone(),
            // A part without air is of the same scan.
            stated_unit: Some(self.unit()),
            part_of: None,
        }
    }
}

impl Roi {
    /// Returns the region within the box of [`Volume::cropped`]. It counts as soft if the whole is.
    ///
    /// # Panics
    /// If the box reaches beyond the volume.
    pub fn cropped(&self, first: [usize; 3], size: [usize; 3]) -> Roi {
        Roi { size, weight: cropped(&self.weight, self.size, first, size), soft: self.soft }
    }
}

impl Roi {
    /// Returns the region in every `every`-th plane of voxels across `axis`, from plane `first` on.
    pub fn in_planes(&self, axis: usize, every: usize, first: usize) -> Roi {
        let [nx, ny, _] = self.size;
        let plane = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)][axis];
        let is_in = |i: usize| plane(i) >= first && (plane(i) - first).is_multiple_of(every);
        let weight = self.weight.par_iter().enumerate().map(|(i, &w)| if is_in(i) { w } else { 0.0 });
        Roi { weight: weight.collect(), ..*self }
    }
}

fn cropped(values: &[f32], whole: [usize; 3], first: [usize; 3], size: [usize; 3]) -> Vec<f32> {
    assert!((0..3).all(|k| first[k] + size[k] <= whole[k]), "the box lies within the volume");
    let mut out = vec![0.0; size.iter().product()];
    out.par_chunks_mut(size[0].max(1)).enumerate().for_each(|(row, out)| {
        let (y, z) = (first[1] + row % size[1], first[2] + row / size[1]);
        let start = first[0] + whole[0] * (y + whole[1] * z);
        out.copy_from_slice(&values[start..start + size[0]]);
    });
    out
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    #[test]
    fn planes_keep_their_weights_and_the_others_have_none() {
        let size = [3, 4, 5];
        let volume = Volume::new(size, DAffine3::IDENTITY, vec![0.0; 60]);
        let roi = Roi::new((1..=60).map(|i| i as f32 / 60.0).collect(), &volume).expect("a region");
        for (axis, every, first) in [(0, 2, 1), (1, 3, 0), (2, 2, 1), (2, 1, 0), (1, 9, 8)] {
            let found = roi.in_planes(axis, every, first);
            for (i, (&w, &whole)) in found.weight.iter().zip(&roi.weight).enumerate() {
                let plane = [i % 3, i / 3 % 4, i / 12][axis];
                let is_in = plane >= first && (plane - first) % every == 0;
                assert_eq!(w, if is_in { whole } else { 0.0 }, "{axis} {every} {first}: {i}");
            }
        }
    }

    #[test]
    fn a_part_has_the_voxels_of_the_whole_where_they_are() {
        let size = [5, 4, 3];
        let samples: Vec<f32> = (0..60).map(|i| i as f32).collect();
        let affine = DAffine3::from_mat3_translation(
            DMat3::from_cols(DVec3::new(0.5, 0.1, 0.0), DVec3::Y * 2.0, DVec3::Z * -3.0),
            DVec3::new(7.0, -8.0, 9.0),
        );
        let volume = Volume::new(size, affine, samples);
        let roi = Roi { size, weight: (0..60).map(|i| (i % 7) as f32 / 6.0).collect(), soft: true };
        let (first, part_size) = ([1, 2, 0], [4, 1, 3]);
        let (part, part_roi) = (volume.cropped(first, part_size), roi.cropped(first, part_size));
        assert_eq!((part.size, part.len(), part_roi.soft), (part_size, 12, true));
        for z in 0..3 {
            for x in 0..4 {
                let there = volume.index(x + 1, 2, z);
                assert_eq!(part.samples[part.index(x, 0, z)], volume.samples[there]);
                assert_eq!(part_roi.weight[part.index(x, 0, z)], roi.weight[there]);
                let voxel = DVec3::new(x as f64, 0.0, z as f64);
                let world = volume.world_from_voxel.transform_point3(voxel + DVec3::new(1.0, 2.0, 0.0));
                assert!(part.world_from_voxel.transform_point3(voxel).distance(world) < 1e-12);
            }
        }
    }

    #[test]
    #[should_panic(expected = "within the volume")]
    fn a_part_beyond_the_end_is_refused() {
        Volume::new([2, 2, 2], DAffine3::IDENTITY, vec![0.0; 8]).cropped([1, 0, 0], [2, 2, 2]);
    }
}
