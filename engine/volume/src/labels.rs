//! The chosen labels of a label map, which tell the structure that a point belongs to.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::label_choice::resolve;
use super::mask_values::label_of;
use super::roi::{Grids, relate};
use super::{BetweenSlices, Displacements, FinerSlices, LabelChoice, Volume};
use base::{Error, Kind, Result};

/// Labels of the voxels of a mask, on the mask's own grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    size: [usize; 3],
    voxel_from_world: DAffine3,
    /// Lower bound of the distance between two points that are a voxel apart along any direction, mm.
    least_spacing_mm: f64,
    world_from_voxel: DAffine3,
    /// Label of each voxel, x fastest; 0 for voxels without any of the chosen labels.
    values: Vec<u8>,
    /// Names of the chosen labels, if the mask has them.
    pub names: BTreeMap<u8, String>,
}

impl Labels {
    /// Returns the labels of `mask` that `choice` names, in the world of `volume`; `None` if the mask is used
    /// as a whole, which has no labels.
    ///
    /// # Errors
    /// [`Kind::Usage`] if the choice does not fit the mask; [`Kind::BadData`] if a chosen label is not one of
    /// 1 to 255, or the grids cannot be related.
    pub fn chosen(mask: &Volume, choice: &LabelChoice, volume: &Volume) -> Result<Option<Labels>> {
        let LabelChoice::Labels(names) = choice else { return Ok(None) };
        let mut byte_of = BTreeMap::new();
        for label in resolve(names, mask)? {
            let byte = u8::try_from(label).ok().filter(|&byte| byte > 0).ok_or_else(|| {
                Error::new(
                    Kind::BadData,
                    "VGS-ROI-013",
                    format!("label {label} was chosen, and splats carry labels from 1 to 255"),
                )
                .help("renumber the labels of the mask, or make the structure a mask of 0 and 1 of its own")
            })?;
            byte_of.insert(label, byte);
        }
        // Without orientation a grid of equal size is the volume's own.
        let world_from_voxel = match relate(mask, volume)? {
            Grids::Same | Grids::Assumed => volume.world_from_voxel,
            Grids::Differ => mask.world_from_voxel,
        };
        let value = |&v: &f32| byte_of.get(&label_of(v)).copied().unwrap_or(0);
        Ok(Some(Labels {
            values: mask.samples.par_iter().map(value).collect(),
            names: byte_of
                .iter()
                .filter_map(|(label, &byte)| Some((byte, mask.labels.get(label)?.clone())))
                .collect(),
            ..Labels::on_grid(mask.size, world_from_voxel)
        }))
    }

    /// Returns the labels with what lies between the slices of their mask, if these are thick: each label by its own
    /// shape, along the displacements of `volume` if that is on the mask's grid.
    ///
    /// # Errors
    /// [`Kind::HostMemory`] if there is no memory for that.
    pub fn with_slices(self, between: BetweenSlices, volume: &Volume) -> Result<Labels> {
        let finer = match between {
            BetweenSlices::Smooth => FinerSlices::of(self.size, &self.world_from_voxel),
            BetweenSlices::Linear => None,
        };
        let Some(finer) = finer else { return Ok(self) };
        finer.require_memory()?;
        let same = (volume.size, volume.world_from_voxel) == (self.size, self.world_from_voxel);
        let along = if same { Displacements::of(&finer, volume) } else { Displacements::none() };
        let (values, size) = (finer.labels(&self.values, &along), finer.size());
        Ok(Labels { values, names: self.names, ..Labels::on_grid(size, finer.world_from_voxel()) })
    }

    /// Returns the labels of a grid before it has voxels.
    fn on_grid(size: [usize; 3], world_from_voxel: DAffine3) -> Labels {
        let voxel_from_world = world_from_voxel.inverse();
        let inverse = voxel_from_world.matrix3.to_cols_array();
        Labels {
            size,
            voxel_from_world,
            // The Frobenius norm of the inverse is never below its greatest stretch.
            least_spacing_mm: inverse.iter().map(|v| v * v).sum::<f64>().sqrt().recip(),
            world_from_voxel,
            values: Vec::new(),
            names: BTreeMap::new(),
        }
    }

    /// Returns the label of the voxel that contains `world`, mm RAS. If that has none, returns the label of
    /// the labelled voxel whose centre is nearest (of several always the same one). Returns 0 only if no
    /// voxel has a label.
    pub fn nearest(&self, world: DVec3) -> u8 {
        let voxel = self.voxel_from_world.transform_point3(world);
        // The voxel that contains the point, or the nearest outermost one; NaN is put at 0.
        let home: [i64; 3] =
            std::array::from_fn(|axis| voxel[axis].round().clamp(0.0, self.size[axis] as f64 - 1.0) as i64);
        let here = self.value(home);
        let inside = (0..3).all(|axis| (voxel[axis] - home[axis] as f64).abs() <= 0.5);
        if here > 0 && inside {
            return here;
        }
        let last = self.size.map(|n| n as i64 - 1);
        let reach = (0..3).map(|axis| home[axis].max(last[axis] - home[axis])).max().unwrap_or(0);
        let mut best = (f64::INFINITY, 0);
        for radius in 0..=reach {
            // The shell of voxels at this distance along the farthest axis; later shells are at least as far
            // away.
            if best.0.sqrt() <= (radius as f64 - 0.5) * self.least_spacing_mm {
                break;
            }
            let span = |axis: usize| (home[axis] - radius).max(0)..=(home[axis] + radius).min(last[axis]);
            for z in span(2) {
                for y in span(1) {
                    let whole_row = (z - home[2]).abs() == radius || (y - home[1]).abs() == radius;
                    let ends = [home[0] - radius, home[0] + radius];
                    let row: &mut dyn Iterator<Item = i64> =
                        if whole_row { &mut span(0) } else { &mut ends.into_iter() };
                    for x in row.filter(|x| (0..=last[0]).contains(x)) {
                        let label = self.value([x, y, z]);
                        if label > 0 {
                            let centre = DVec3::new(x as f64, y as f64, z as f64);
                            let away = self.world_from_voxel.transform_point3(centre) - world;
                            if away.length_squared() < best.0 {
                                best = (away.length_squared(), label);
                            }
                        }
                    }
                }
            }
        }
        best.1
    }

    /// Returns [`Labels::nearest`] for each of the points.
    pub fn of(&self, points: impl IndexedParallelIterator<Item = DVec3>) -> Vec<u8> {
        points.map(|world| self.nearest(world)).collect()
    }

    fn value(&self, [x, y, z]: [i64; 3]) -> u8 {
        let [nx, ny, _] = self.size;
        self.values[x as usize + nx * (y as usize + ny * z as usize)]
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    const SIZE: [usize; 3] = [9, 7, 5];

    fn map(affine: DAffine3, value: impl Fn(usize) -> f32) -> Volume {
        let mut map = Volume::new(SIZE, affine, (0..315).map(value).collect());
        map.labels = BTreeMap::from([(2, "liver".into()), (9, "spleen".into()), (255, "aorta".into())]);
        map
    }

    fn chosen(map: &Volume, text: &str) -> Result<Option<Labels>> {
        Labels::chosen(map, &text.parse().unwrap(), &map.clone())
    }

    #[test]
    fn only_the_chosen_count() {
        let map = map(DAffine3::IDENTITY, |i| [0.0, 2.0, 9.0, 4.0, 255.0][i % 5]);
        let labels = chosen(&map, "Liver, 4,255").unwrap().expect("labels");
        assert_eq!(labels.values[..6], [0, 2, 0, 4, 255, 0]);
        assert_eq!(labels.names, BTreeMap::from([(2, "liver".into()), (255, "aorta".into())]));
        assert_eq!(Labels::chosen(&map, &LabelChoice::Whole, &map).unwrap(), None);
        assert_eq!(chosen(&map, "kidney").unwrap_err().code, "VGS-ROI-010");
    }

    #[test]
    fn labels_that_do_not_fit_a_byte() {
        let map = map(DAffine3::IDENTITY, |i| [0.0, 256.0, -3.0, 4.0][i % 4]);
        for (text, word) in [("256", "label 256"), ("4,-3", "label -3")] {
            let error = chosen(&map, text).unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-ROI-013"));
            assert!(error.message.contains(word) && error.help.contains("renumber"), "{error}");
        }
        assert!(chosen(&map, "4").is_ok(), "what is not chosen does not matter");
    }

    #[test]
    fn the_nearest_is_that_of_all_voxels() {
        let tilt = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.6, 1.0, 0.0), DVec3::new(0.0, 0.4, 1.0));
        let affines = [
            DMat3::IDENTITY,
            tilt * DMat3::from_diagonal(DVec3::new(0.5, -0.5, 4.0)),
            shear * DMat3::from_diagonal(DVec3::new(3.0, 1.0, 1.0)),
        ];
        let mut rng = Pcg64::seed_from_u64(5);
        for (matrix, every) in affines.into_iter().flat_map(|m| [(m, 3), (m, 60), (m, 300)]) {
            let affine = DAffine3::from_mat3_translation(matrix, DVec3::new(-50.0, 20.0, 7.0));
            let map = map(affine, |i| if i % every == 1 { [2.0, 9.0][i / every % 2] } else { 0.0 });
            let labels = chosen(&map, "2,9").unwrap().expect("labels");
            for _ in 0..300 {
                // Inside the grid and up to its own size beyond.
                let voxel = DVec3::from_array(SIZE.map(|n| rng.random_range(-1.0..2.0) * n as f64));
                let world = affine.transform_point3(voxel);
                let at = |i: usize| DVec3::new((i % 9) as f64, (i / 9 % 7) as f64, (i / 63) as f64);
                let own =
                    (0..315).find(|&i| (at(i) - voxel).abs().max_element() < 0.5 && labels.values[i] > 0);
                let away = |i: usize| (affine.transform_point3(at(i)) - world).length();
                let all = (0..315).filter(|&i| labels.values[i] > 0);
                let expected = own.or_else(|| all.min_by(|&i, &j| away(i).total_cmp(&away(j))));
                let expected = labels.values[expected.expect("a voxel with a label")];
                assert_eq!(labels.nearest(world), expected, "{voxel}, one in {every}, {matrix}");
            }
        }
        let none = map(DAffine3::IDENTITY, |i| f32::from(u8::from(i == 0)) * 2.0);
        let mut none = chosen(&none, "2").unwrap().expect("labels");
        assert_eq!(none.nearest(DVec3::new(1e9, -1e9, 3.0)), 2);
        assert_eq!(none.nearest(DVec3::NAN), 0, "nowhere is near nothing");
        none.values.fill(0);
        assert_eq!(none.nearest(DVec3::ONE), 0);
    }

    #[test]
    fn a_mask_on_another_grid_is_asked_in_the_world() {
        let volume = Volume::new([18, 14, 10], DAffine3::from_scale(DVec3::splat(0.5)), vec![0.0; 2520]);
        let mut mask = map(DAffine3::IDENTITY, |i| if i % 9 < 4 { 2.0 } else { 9.0 });
        let of =
            |mask: &Volume| Labels::chosen(mask, &"2,9".parse().unwrap(), &volume).unwrap().expect("labels");
        let points = [DVec3::new(3.4, 2.0, 2.0), DVec3::new(3.6, 2.0, 2.0)];
        assert_eq!(of(&mask).of(points.into_par_iter()), [2, 9]);
        // Of unknown orientation but of the same size: voxel by voxel.
        mask.oriented = false;
        let volume = Volume::new(SIZE, DAffine3::from_scale(DVec3::splat(0.5)), vec![0.0; 315]);
        let labels = Labels::chosen(&mask, &"2,9".parse().unwrap(), &volume).unwrap().expect("labels");
        assert_eq!(labels.of([DVec3::new(1.7, 1.0, 1.0), DVec3::new(1.8, 1.0, 1.0)].into_par_iter()), [2, 9]);
    }
}
