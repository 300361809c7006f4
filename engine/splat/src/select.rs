//! Some of a set: a crop, or one organ of several.

use glam::DVec3;

use super::{Region, RegionObject, SplatSet};

impl SplatSet {
    /// Returns the splats for which `keep` is true, with all that belongs to them; it is told the index of a
    /// splat and its mean, mm RAS. The rest of the set's statements stays, so that parts of one set can be
    /// [joined](super::join) again.
    ///
    /// The region becomes that of the splats: the voxels of their objects, and of an object of which only some splats
    /// are kept those in which they have at least half of the weight.
    pub fn selected(&self, keep: impl Fn(usize, DVec3) -> bool) -> SplatSet {
        let mean = |i: usize| DVec3::from_array(self.splats[i].mean.map(f64::from)) + self.origin_mm;
        let rows: Vec<usize> = (0..self.splats.len()).filter(|&i| keep(i, mean(i))).collect();
        self.of_rows(&rows)
    }

    /// Returns the splats, and of what is coded the voxels, for which `keep` is true, as [`SplatSet::selected`] does; it
    /// is told the number of an object and a mean or the centre of a voxel, mm RAS.
    pub fn part(&self, keep: impl Fn(u8, DVec3) -> bool + Sync) -> SplatSet {
        let number = |i: usize| self.labels.as_ref().map_or(0, |labels| labels[i]);
        let mut part = self.selected(|i, mean| keep(number(i), mean));
        if let (Some(region), Some(grid), false) = (&part.region, &self.grid, self.voxels.is_empty()) {
            let centre = |voxel: [u32; 3]| DVec3::from_array(voxel.map(f64::from));
            let stays = |voxel, object: RegionObject| {
                self.voxels_of(object.fit).is_none()
                    || keep(object.number, grid.world_from_voxel.transform_point3(centre(voxel)))
            };
            let left = region.with_objects(|voxel, object| stays(voxel, object).then_some(object));
            part.region = left.or_else(|| part.region.clone());
            part.drop_unused();
        }
        part
    }

    /// Drops the names of labels, and the coded voxels, that nothing has any more.
    fn drop_unused(&mut self) {
        let objects = self.region.as_ref().map(Region::objects).unwrap_or_default();
        self.voxels.retain(|voxels| objects.iter().any(|object| object.fit == voxels.fit));
        if let Some(labels) = &self.labels {
            let coded = objects.iter().filter(|object| self.voxels.iter().any(|v| v.fit == object.fit));
            let coded: Vec<u8> = coded.map(|object| object.number).collect();
            self.label_names.retain(|(label, _)| labels.contains(label) || coded.contains(label));
        }
    }

    /// Returns the splats of these rows, in this order, as [`SplatSet::selected`] does. What is coded stays.
    pub fn of_rows(&self, rows: &[usize]) -> SplatSet {
        let mut part = self.clone();
        part.take(rows);
        if let (Some(region), Some(grid)) = (&self.region, &self.grid) {
            let mut kept = vec![false; self.splats.len()];
            rows.iter().for_each(|&row| kept[row] = true);
            part.region = Some(region.part(self, grid, &kept));
        }
        part.drop_unused();
        part
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::region::tests::region_of;
    use crate::{Form, Grid, Harmonics, Splat, join};
    use base::unit::Unit;

    #[test]
    fn what_belongs_to_a_splat_comes_with_it() {
        let splat =
            |x: f32| Splat { mean: [x, 0.0, 0.0], rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let set = SplatSet {
            splats: [1.0, 2.0, 3.0].map(splat).to_vec(),
            origin_mm: DVec3::new(100.0, 0.0, 0.0),
            labels: Some(vec![4, 9, 4]),
            label_names: vec![(4, "liver".into()), (9, "spleen".into())],
            grid: Some(Grid {
                size: [4; 3],
                world_from_voxel: DAffine3::from_translation(DVec3::new(100.0, 0.0, 0.0)),
            }),
            form: Form::Grid,
            region: Some(region_of(&[([1, 0, 0], 4), ([2, 0, 0], 9), ([3, 0, 0], 4)])),
            ..SplatSet::default()
        };
        let right = set.selected(|_, mean| mean.x > 101.5);
        assert_eq!(right.splats, set.splats[1..]);
        assert_eq!(right.labels.as_deref(), Some(&[9, 4][..]));
        assert_eq!((right.grid, right.form, right.origin_mm), (set.grid, set.form, set.origin_mm));
        let voxels = |set: &SplatSet| {
            set.region.as_ref().expect("a region").voxels().map(|v| v.0[0]).collect::<Vec<_>>()
        };
        assert_eq!(voxels(&right), [2, 3]);
        let spleen = set.selected(|i, _| set.labels.as_ref().is_some_and(|labels| labels[i] == 9));
        assert_eq!((spleen.splats.len(), spleen.label_names.len()), (1, 1));
        assert_eq!(voxels(&spleen), [2]);
        let left = set.selected(|_, mean| mean.x <= 101.5);
        assert_eq!(voxels(&left), [1]);
        let joined = join(vec![("left".into(), left), ("right".into(), right)]).expect("parts of one set");
        assert_eq!(voxels(&joined), [1, 2, 3]);
        assert_eq!((joined.splats, joined.grid), (set.splats.clone(), set.grid));
        assert!(set.selected(|_, _| false).splats.is_empty());

        let colours = Harmonics { degree: 0, coefficients: (0..9u8).map(f32::from).collect() };
        let set = SplatSet { colours: Some(colours), unit: Unit::Luminance, ..set };
        let last = set.selected(|i, _| i == 2).colours.expect("colours");
        assert_eq!(last.coefficients, [6.0, 7.0, 8.0]);
    }
}
