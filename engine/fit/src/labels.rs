//! Labels of splats: which structure of a label map each splat belongs to.

use glam::DVec3;
use rayon::prelude::*;

use splat::{SplatSet, label_name};
use volume::Labels;

/// Gives each splat of `set` the label of the voxel nearest to its mean, each voxel of its region its label, and the set
/// the names of the labels. The splats of a fit reach a little beyond the region; there the nearest voxel that has a label counts.
pub fn label(set: &mut SplatSet, labels: &Labels) {
    let world = |mean: [f32; 3]| DVec3::from_array(mean.map(f64::from)) + set.origin_mm;
    set.labels = Some(labels.of(set.splats.par_iter().map(|splat| world(splat.mean))));
    if let (Some(region), Some(grid)) = (&set.region, &set.grid) {
        let centre =
            |voxel: [u32; 3]| grid.world_from_voxel.transform_point3(DVec3::from_array(voxel.map(f64::from)));
        let voxels: Vec<_> = region.voxels().map(|(voxel, _)| voxel).collect();
        let mut numbers = labels.of(voxels.par_iter().map(|&voxel| centre(voxel))).into_iter();
        set.region = region.renumbered(|_| numbers.next().unwrap_or(0));
    }
    let names = labels.names.iter().map(|(&label, name)| (label, label_name(name)));
    set.label_names = names.filter(|(_, name)| !name.is_empty()).collect();
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::DAffine3;

    use super::*;
    use splat::Splat;
    use volume::Volume;

    #[test]
    fn splats_are_labelled_where_they_are_in_the_world() {
        let affine = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 1.0, 1.0),
            glam::DQuat::IDENTITY,
            DVec3::new(100.0, -40.0, 0.0),
        );
        let mut mask = Volume::new([4, 1, 1], affine, vec![0.0, 3.0, 0.0, 7.0]);
        mask.labels = BTreeMap::from([(3, " left\nlung ".into()), (7, "\u{7}".into())]);
        let labels = Labels::chosen(&mask, &"3,7".parse().unwrap(), &mask).unwrap().expect("labels");
        // Voxels 0 to 3 lie at x = 0, 2, 4, 6 mm from the set's origin.
        let splats = [-1.0, 2.9, 3.9, 4.1, 1e4f32].map(|x| Splat { mean: [x, 0.0, 0.0], ..Splat::default() });
        let origin_mm = DVec3::new(100.0, -40.0, 0.0);
        let mut set = SplatSet { splats: splats.to_vec(), origin_mm, ..SplatSet::default() };
        label(&mut set, &labels);
        assert_eq!(set.labels, Some(vec![3, 3, 3, 7, 7]));
        assert_eq!(set.label_names, [(3, "left lung".to_owned())], "a name without a letter is none");
    }
}
