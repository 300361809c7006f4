//! A volume and its region as they are shown: with smooth edges, and beyond the region with intensities of its own.

use std::borrow::Cow;

use glam::{DAffine3, IVec3};
use rayon::prelude::*;

use super::edges::{Edges, Occupancy, occupancy};
use super::{BetweenSlices, Roi, Volume, beyond, spacing_of};
use base::error::Result;
use base::memory;

/// Returns a volume and its region as they are shown: with what lies between thick slices, and, of a binary region, the
/// box around it, with these edges and V of its own beyond. What memory does not hold is left out, with a warning.
///
/// # Panics
/// If the region has another size than the volume.
pub fn shown<'a>(
    volume: &'a Volume,
    roi: Option<&'a Roi>,
    between: BetweenSlices,
    edges: Edges,
) -> (Cow<'a, Volume>, Option<Cow<'a, Roi>>) {
    let (volume, roi) = between.shown(volume, roi);
    let with_edges = roi.as_ref().map_or(Ok(None), |roi| edges.around(&volume, roi));
    match with_edges {
        Ok(Some((volume, roi))) => (Cow::Owned(volume), Some(Cow::Owned(roi))),
        Ok(None) => (volume, roi),
        Err(error) => {
            tracing::warn!("shown with the edges of the mask: {error}");
            (volume, roi)
        }
    }
}

impl Edges {
    /// Returns the box around a binary region, as it is shown: O as the weights, and V of its own beyond it. `None` for a
    /// region that is soft, which is shown as it is.
    ///
    /// # Errors
    /// [`Kind::HostMemory`](base::Kind) if memory does not hold the box.
    ///
    /// # Panics
    /// If the region has another size than the volume.
    fn around(self, volume: &Volume, roi: &Roi) -> Result<Option<(Volume, Roi)>> {
        assert_eq!(volume.size, roi.size, "a region of the volume");
        if roi.soft {
            return Ok(None);
        }
        memory::require(2 * volume.len() as u64, "the region")?;
        let numbers: Vec<u8> = roi.weight.par_iter().map(|&w| u8::from(w > 0.5)).collect();
        let spacing = spacing_of(&volume.world_from_voxel).to_array();
        let Occupancy { origin, size, values } = occupancy(&numbers, volume.size, spacing, self)?;
        memory::require(12 * values.len() as u64, "the edges of the region")?;
        let (mut samples, mut own) = (vec![f32::NAN; values.len()], vec![0u8; values.len()]);
        copy(&volume.samples, volume.size, origin, size, &mut samples);
        copy(&numbers, volume.size, origin, size, &mut own);
        beyond::extend(&mut samples, &mut own, size, self.layers(spacing));
        // Nothing is shown where there is no V, so any number does.
        samples.par_iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        let offset = DAffine3::from_translation(origin.as_dvec3());
        let shown = Volume {
            size,
            samples,
            world_from_voxel: volume.world_from_voxel * offset,
            labels: volume.labels.clone(),
            frame_of_reference: volume.frame_of_reference.clone(),
            stated_unit: Some(volume.unit()),
            part_of: None,
            oriented: volume.oriented,
        };
        let weight = values.par_iter().map(|&o| f32::from(o) / 255.0).collect();
        Ok(Some((shown, Roi { size, weight, soft: self != Edges::Voxel })))
    }
}

impl Volume {
    /// Returns the volume with V of a region's own in the rim of one voxel beyond it; see [`beyond`].
    ///
    /// # Panics
    /// If the region has another size than the volume.
    pub fn of_region_alone(&self, roi: &Roi) -> Volume {
        assert_eq!(self.size, roi.size, "a region of the volume");
        let mut out = self.clone();
        let mut own: Vec<u8> = roi.weight.par_iter().map(|&w| u8::from(w > 0.5)).collect();
        beyond::extend(&mut out.samples, &mut own, self.size, 1);
        out
    }
}

/// Copies the values of a volume into a box of it that begins at `origin` and may reach beyond its faces.
fn copy<T: Copy + Send + Sync>(from: &[T], whole: [usize; 3], origin: IVec3, size: [usize; 3], to: &mut [T]) {
    to.par_chunks_mut(size[0].max(1)).enumerate().for_each(|(row, to)| {
        let place = origin + IVec3::new(0, (row % size[1]) as i32, (row / size[1]) as i32);
        let inside = |k: usize| (0..whole[k] as i32).contains(&place[k]);
        if !inside(1) || !inside(2) {
            return;
        }
        let start = (place.z as usize * whole[1] + place.y as usize) * whole[0];
        let first = origin.x.max(0);
        let end = (origin.x + size[0] as i32).min(whole[0] as i32);
        if first < end {
            let row = &from[start + first as usize..start + end as usize];
            to[(first - origin.x) as usize..][..row.len()].copy_from_slice(row);
        }
    });
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_region_is_shown_with_its_own_intensities_and_soft_ones_as_they_are() {
        let size = [12, 9, 7];
        let at = |i: usize| [i % 12, i / 12 % 9, i / 108];
        let inside = |[x, y, _]: [usize; 3]| (3..8).contains(&x) && y < 5;
        let samples =
            (0..756).map(|i| if inside(at(i)) { 100.0 + at(i)[0] as f32 } else { -900.0 }).collect();
        let affine = DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0));
        let volume = Volume::new(size, affine, samples);
        let weight = (0..756).map(|i| f32::from(u8::from(inside(at(i))))).collect();
        let roi = Roi::new(weight, &volume).expect("a region");
        for edges in [Edges::Voxel, Edges::Within(0.0), Edges::Within(1.0)] {
            let (boxed, of) = edges.around(&volume, &roi).expect("memory").expect("it is binary");
            let there = boxed.world_from_voxel.inverse() * volume.world_from_voxel;
            for i in 0..756 {
                let voxel = at(i).map(|v| v as f64);
                let place = there.transform_point3(DVec3::from_array(voxel)).round().as_ivec3();
                let beyond = (0..3).any(|k| place[k] < 0 || place[k] >= boxed.size[k] as i32);
                if beyond {
                    assert!(!inside(at(i)));
                    continue;
                }
                let [x, y, z] = place.to_array().map(|v| v as usize);
                let here = (z * boxed.size[1] + y) * boxed.size[0] + x;
                if inside(at(i)) {
                    assert_eq!(boxed.samples[here], volume.samples[i], "V inside is that of the scan");
                }
                if edges != Edges::Within(1.0) {
                    assert_eq!(of.weight[here] >= 0.5, inside(at(i)), "{edges:?}: each voxel keeps its side");
                }
            }
        }
        let own = volume.of_region_alone(&roi);
        assert_eq!(own.samples, volume.samples, "the region is brighter, and ends as the scan does");
        let dark = Volume { samples: volume.samples.iter().map(|v| -v).collect(), ..volume.clone() };
        assert_eq!(dark.of_region_alone(&roi).samples, dark.samples, "or darker");
        let soft = Roi { soft: true, ..roi };
        let (as_it_is, _) = shown(&volume, Some(&soft), BetweenSlices::Linear, Edges::default());
        assert!(matches!(as_it_is, Cow::Borrowed(_)));
    }
}
