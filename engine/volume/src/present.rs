//! The labels that a mask has, and what each covers.

use glam::DVec3;
use serde::Serialize;

use super::Volume;
use super::label_choice::present_labels;
use super::mask_values::{is_whole, label_of};
use super::roi::{Grids, in_box, relate};
use base::Result;

/// A label that some voxels of a mask have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PresentLabel {
    /// Number in the mask.
    pub number: i32,
    /// Name, if the mask has one for it.
    pub name: Option<String>,
    /// Number of the mask's voxels.
    pub voxels: usize,
    /// Their volume, ml.
    pub ml: f64,
    /// Mean of the intensities of a volume there, and their population standard deviation, HU for CT; `None` without a
    /// volume, or where it has no values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[expect(missing_docs, reason = "the line above is of both")]
    pub std_dev: Option<f64>,
}

impl PresentLabel {
    /// Returns the labels of a mask of whole numbers from 0 on, in their order, with the intensities that `volume` has
    /// at the centres of their voxels: its own voxels where the grids agree, else trilinear samples. Returns `None` if
    /// the values are no labels.
    ///
    /// # Errors
    /// [`Kind::BadData`](base::Kind::BadData) if the grids of mask and volume cannot be related.
    pub fn list(mask: &Volume, volume: Option<&Volume>) -> Result<Option<Vec<PresentLabel>>> {
        if mask.samples.iter().any(|&v| !is_whole(v) || label_of(v) < 0) {
            return Ok(None);
        }
        let Some(present) = present_labels(mask) else { return Ok(None) };
        let numbers: Vec<i32> = present.keys().copied().collect();
        let mut sums = vec![Sums::default(); numbers.len()];
        if let Some(volume) = volume {
            let at = intensities(mask, volume)?;
            for (i, &value) in mask.samples.iter().enumerate().filter(|(_, value)| label_of(**value) > 0) {
                if let (Ok(row), Some(intensity)) = (numbers.binary_search(&label_of(value)), at(i)) {
                    sums[row].add(intensity);
                }
            }
        }
        let voxel_ml = mask.world_from_voxel.matrix3.determinant().abs() / 1000.0;
        let row = |((number, voxels), sums): ((i32, usize), &Sums)| PresentLabel {
            number,
            name: mask.labels.get(&number).cloned(),
            voxels,
            ml: voxels as f64 * voxel_ml,
            mean: sums.mean(),
            std_dev: sums.std_dev(),
        };
        Ok(Some(present.into_iter().zip(&sums).map(row).collect()))
    }
}

/// Returns what tells the finite intensity of a volume at the centre of a voxel of a mask, given by its index.
fn intensities<'a>(mask: &Volume, volume: &'a Volume) -> Result<impl Fn(usize) -> Option<f64> + 'a> {
    let same = !matches!(relate(mask, volume)?, Grids::Differ);
    let volume_from_mask = volume.voxel_from_world() * mask.world_from_voxel;
    let [nx, ny, _] = mask.size;
    Ok(move |i: usize| {
        let value = if same {
            f64::from(volume.samples[i])
        } else {
            let voxel = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
            let place = volume_from_mask.transform_point3(voxel);
            if in_box(place, volume.size) { volume.trilinear(place) } else { f64::NAN }
        };
        value.is_finite().then_some(value)
    })
}

/// Sums of intensities less the first one, so that squares of large numbers do not cancel.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    first: f64,
    sum: f64,
    squares: f64,
}

impl Sums {
    fn add(&mut self, value: f64) {
        if self.count == 0.0 {
            self.first = value;
        }
        let apart = value - self.first;
        (self.count, self.sum, self.squares) =
            (self.count + 1.0, self.sum + apart, self.squares + apart * apart);
    }

    fn mean(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.first + self.sum / self.count)
    }

    fn std_dev(&self) -> Option<f64> {
        let mean = self.sum / self.count;
        (self.count > 0.0).then(|| (self.squares / self.count - mean * mean).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::DAffine3;

    use super::*;

    #[test]
    fn each_label_has_its_voxels_and_what_the_volume_is_there() {
        let size = [4, 3, 2];
        let volume = |value: &dyn Fn(usize) -> f32| {
            let world = DAffine3::from_scale(DVec3::new(10.0, 10.0, 5.0));
            Volume::new(size, world, (0..24).map(value).collect())
        };
        let mut mask = volume(&|i| [0.0, 2.0, 9.0, 0.0][i % 4]);
        mask.labels = BTreeMap::from([(2, "liver".into()), (5, "aorta".into())]);
        let ct = volume(&|i| if i == 1 { f32::NAN } else { (i / 12) as f32 * 10.0 + (i % 4) as f32 });
        let found = PresentLabel::list(&mask, Some(&ct)).unwrap().expect("labels");
        let facts: Vec<_> = found.iter().map(|l| (l.number, l.name.as_deref(), l.voxels, l.ml)).collect();
        assert_eq!(facts, [(2, Some("liver"), 6, 3.0), (9, None, 6, 3.0)], "none that has no voxel");
        // Of the liver one voxel has no value: two of 1 and three of 11 are left.
        let [mean, std_dev] = [found[0].mean, found[0].std_dev].map(|v| v.expect("a figure"));
        assert!((mean - 7.0).abs() < 1e-9 && (std_dev - 24f64.sqrt()).abs() < 1e-9, "{mean} {std_dev}");

        // On a grid of its own the mask is asked in the world: two voxels along x between four of the volume.
        let world = DAffine3 {
            translation: DVec3::new(5.0, 0.0, 0.0),
            ..DAffine3::from_scale(DVec3::new(20.0, 10.0, 5.0))
        };
        let coarse = Volume::new([2, 3, 2], world, vec![1.0; 12]);
        let ramp = volume(&|i| (i % 4) as f32);
        let found = PresentLabel::list(&coarse, Some(&ramp)).unwrap().expect("labels");
        assert_eq!((found[0].voxels, found[0].ml, found[0].mean), (12, 12.0, Some(1.5)));

        assert_eq!(PresentLabel::list(&volume(&|i| i as f32 - 3.0), None).unwrap(), None, "an image");
        assert_eq!(PresentLabel::list(&volume(&|_| 0.5), None).unwrap(), None, "a soft mask");
        assert_eq!(PresentLabel::list(&mask, None).unwrap().expect("labels")[0].mean, None);
    }
}
