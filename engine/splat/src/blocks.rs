//! Blocks of one region that were fitted separately (`vgs blocks`). Each counts in its own part of the region alone, so those
//! that no splat of the others reaches are as good as one fit: a scene of many blocks has few parts.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::objects::merged;
use super::{Form, SplatSet};
use base::error::Result;

/// Voxels around a block in which nothing of another one of the same part may lie: what is shown at a voxel depends on its
/// neighbours.
const MARGIN: f64 = 2.0;

/// Splats that become objects of a scene together.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Place of the first file among those that were given.
    pub file: usize,
    /// Name of the file without its ending; of blocks, that of their folder.
    pub name: String,
    /// The splats.
    pub set: SplatSet,
}

/// Returns the name of the file of a block, without its ending, by the block's first voxel.
pub fn block_name([x, y, z]: [usize; 3]) -> String {
    format!("x{x:05}-y{y:05}-z{z:05}")
}

/// Returns the folder of a block, by its name as of [`stem`]; `None` if it is the name of no block.
fn folder_of(name: &str) -> Option<&str> {
    let (folder, stem) = name.rsplit_once('/').unwrap_or(("blocks", name));
    let first: Vec<usize> = stem.split('-').filter_map(|part| part.get(1..)?.parse().ok()).collect();
    <[usize; 3]>::try_from(first).is_ok_and(|first| block_name(first) == stem).then_some(folder)
}

/// Returns the name of a file without its ending, of a block after that of its folder, as [`parts`] takes it.
pub fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    match path.parent().and_then(Path::file_name) {
        Some(folder) if folder_of(&stem).is_some() => format!("{}/{stem}", folder.to_string_lossy()),
        _ => stem.into_owned(),
    }
}

/// Blocks that become one part.
struct Apart {
    /// Place of the first one among the files.
    file: usize,
    folder: String,
    blocks: Vec<(Reach, SplatSet)>,
}

impl Apart {
    fn takes(&self, folder: &str, reach: &Reach, set: &SplatSet) -> bool {
        let lies_apart =
            |(other, block): &(Reach, SplatSet)| other.is_apart(reach) && go_together(block, set);
        self.folder == folder && self.blocks.iter().all(lies_apart)
    }
}

/// Returns the splats of files, each with its name as of [`stem`], as parts of a scene, in the order of their first files: of
/// blocks in one folder, those that lie apart as one, all others each by itself.
///
/// # Errors
/// [`base::error::Kind::Internal`] only.
pub fn parts(files: Vec<(String, SplatSet)>) -> Result<Vec<Part>> {
    let (mut parts, mut apart): (Vec<Part>, Vec<Apart>) = Default::default();
    for (file, (name, set)) in files.into_iter().enumerate() {
        let block = folder_of(&name).zip(Reach::of(&set));
        let Some((folder, reach)) = block else {
            parts.push(Part { file, name, set });
            continue;
        };
        match apart.iter_mut().find(|part| part.takes(folder, &reach, &set)) {
            Some(part) => part.blocks.push((reach, set)),
            None => apart.push(Apart { file, folder: folder.to_owned(), blocks: vec![(reach, set)] }),
        }
    }
    for Apart { file, folder, blocks } in apart {
        let set = merged(blocks.into_iter().map(|(_, set)| set).collect())?;
        parts.push(Part { file, name: folder, set });
    }
    parts.sort_by_key(|part| part.file);
    Ok(parts)
}

/// Returns true if two blocks are of the same kind: of one grid and one field, with labels of the same names.
fn go_together(a: &SplatSet, b: &SplatSet) -> bool {
    let field = |set: &SplatSet| (set.field.kernel, set.field.epsilon, set.field.occupancy_w0);
    let named =
        |(number, name): &(u8, String)| b.label_names.iter().all(|(n, other)| n != number || other == name);
    a.grid == b.grid
        && a.form == b.form
        && a.unit == b.unit
        && a.volume_crc32 == b.volume_crc32
        && field(a) == field(b)
        && a.labels.is_some() == b.labels.is_some()
        && a.label_names.iter().all(named)
}

/// What a block takes of the grid, voxels: least and greatest index along x, y, z.
struct Reach {
    /// Of its region.
    region: [DVec3; 2],
    /// Of its region and of all that its splats reach.
    all: [DVec3; 2],
}

impl Reach {
    /// Returns the reach of a set that may be one of several blocks; `None` if it is not of that kind.
    fn of(set: &SplatSet) -> Option<Self> {
        let (grid, region) = (set.grid.as_ref()?, set.region.as_ref()?);
        let [first, end] = region.bounds();
        let is_empty = (0..3).any(|k| end[k] <= first[k]);
        if is_empty || set.form == Form::Field || set.colours.is_some() || !set.voxels.is_empty() {
            return None;
        }
        let corner = |at: [u32; 3]| DVec3::from_array(at.map(f64::from));
        let region = [corner(first), corner(end) - 1.0];
        let voxel_from_world = grid.world_from_voxel.inverse();
        // How far a voxel index changes along 1 mm at most.
        let turned: DMat3 = voxel_from_world.matrix3.transpose();
        let per_mm = DVec3::new(turned.x_axis.length(), turned.y_axis.length(), turned.z_axis.length());
        let support = set.field.kernel.support_q().sqrt();
        let mut all = region;
        for splat in &set.splats {
            let mean = set.origin_mm + DVec3::from_array(splat.mean.map(f64::from));
            let sigma = splat.log_scale.into_iter().fold(f32::NEG_INFINITY, f32::max).exp();
            let (at, by) = (voxel_from_world.transform_point3(mean), per_mm * support * f64::from(sigma));
            all = [all[0].min(at - by), all[1].max(at + by)];
        }
        Some(Reach { region, all })
    }

    /// Returns true if neither has splats that reach the other's region.
    fn is_apart(&self, other: &Reach) -> bool {
        let clear = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| {
            (a - d).cmpgt(DVec3::splat(MARGIN)).any() || (c - b).cmpgt(DVec3::splat(MARGIN)).any()
        };
        clear(self.all, other.region) && clear(self.region, other.all)
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::region::tests::region_of;
    use crate::{Grid, Splat, join};

    /// A block of the voxels with these x, whose only splat lies on the first of them.
    fn block(xs: std::ops::Range<u32>) -> SplatSet {
        let mean = [xs.start as f32 * 2.0 - 100.0, 0.0, 0.0];
        let world_from_voxel = DAffine3::from_scale(DVec3::splat(2.0));
        SplatSet {
            splats: vec![Splat { mean, rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() }],
            origin_mm: DVec3::new(100.0, 0.0, 0.0),
            grid: Some(Grid { size: [64; 3], world_from_voxel }),
            form: Form::Grid,
            region: Some(region_of(&xs.map(|x| ([x, 0, 0], 0)).collect::<Vec<_>>())),
            ..SplatSet::default()
        }
    }

    fn named(first: u32) -> String {
        stem(&Path::new("all/bone").join(block_name([first as usize, 0, 0])).with_extension("vgs"))
    }

    #[test]
    fn blocks_that_lie_apart_are_one_part() {
        let rows = (0..8).map(|i| (named(8 * i), block(8 * i..8 * i + 8)));
        let found = parts(rows.collect()).expect("parts");
        let told: Vec<_> =
            found.iter().map(|part| (part.file, part.name.as_str(), part.set.splats.len())).collect();
        assert_eq!(told, [(0, "bone", 4), (1, "bone", 4)], "neighbours reach each other");
        // As many voxels and splats as before, where they were, each of the fit that it is from.
        let scene = join(found.into_iter().map(|part| (part.name, part.set)).collect()).expect("a scene");
        let region = scene.region.clone().expect("a region");
        for (voxel, object) in region.voxels() {
            assert_eq!(u32::from(object.fit), voxel[0] / 8 % 2, "{voxel:?}");
        }
        assert_eq!(region.voxel_count(), 64);
        let mut xs: Vec<f64> =
            scene.splats.iter().map(|splat| f64::from(splat.mean[0]) + scene.origin_mm.x).collect();
        xs.sort_by(f64::total_cmp);
        assert_eq!(xs, [0.0, 16.0, 32.0, 48.0, 64.0, 80.0, 96.0, 112.0]);
    }

    #[test]
    fn what_is_no_block_stays_by_itself() {
        let far = |name: &str| (stem(Path::new(name)), block(40..48));
        let count = |files: Vec<(String, SplatSet)>| parts(files).expect("parts").len();
        assert_eq!(count(vec![(named(0), block(0..8)), far("bone/x00040-y00000-z00000.vgs")]), 1);
        for name in
            ["bone/ribs.vgs", "bone/x40-y0-z0.vgs", "other/x00040-y00000-z00000.vgs", "x00040-y00000.vgs"]
        {
            assert_eq!(count(vec![(named(0), block(0..8)), far(name)]), 2, "{name}");
            assert_eq!(count(vec![far(name), (named(0), block(0..8))]), 2, "{name}");
        }
        let beside = |first| (block_name([first as usize, 0, 0]), block(first..first + 8));
        assert_eq!(parts(vec![beside(0), beside(40)]).expect("parts")[0].name, "blocks", "without a folder");
        // One of splats that reach far, of another grid, of coded voxels, or with labels.
        let mut others = vec![block(40..48); 4];
        others[0].splats[0].log_scale = [5.0, 0.0, 0.0];
        others[1].grid = Some(Grid { size: [65; 3], ..others[1].grid.expect("a grid") });
        others[2].region = None;
        others[3].labels = Some(vec![3]);
        for (i, other) in others.into_iter().enumerate() {
            assert_eq!(count(vec![(named(0), block(0..8)), (named(40), other)]), 2, "{i}");
        }
    }

    #[test]
    fn labels_of_blocks_keep_their_names() {
        let labelled = |xs: std::ops::Range<u32>, names: &[(u8, &str)]| SplatSet {
            labels: Some(vec![names[0].0]),
            label_names: names.iter().map(|&(number, name)| (number, name.to_owned())).collect(),
            region: block(xs.clone()).region.and_then(|region| region.renumbered(|_| names[0].0)),
            ..block(xs)
        };
        let files = |names: &[(u8, &str)]| {
            vec![(named(0), labelled(0..8, &[(5, "liver")])), (named(40), labelled(40..48, names))]
        };
        let [part] = &parts(files(&[(7, "aorta"), (5, "liver")])).expect("parts")[..] else {
            panic!("one part")
        };
        let objects: Vec<_> = part.set.objects().into_iter().map(|o| (o.number, o.name, o.splats)).collect();
        assert_eq!(objects, [(5, "liver".to_owned(), 1), (7, "aorta".to_owned(), 1)]);
        assert_eq!(
            parts(files(&[(5, "spleen")])).expect("parts").len(),
            2,
            "another structure of the same number"
        );
    }
}
