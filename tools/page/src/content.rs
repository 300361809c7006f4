//! The data of a page: splats, or the coded voxels in their place, as files of them; or their field on voxels where that is
//! smaller or all that the page can read.

use engine::gpu::Gpu;
use engine::render::{DecodeOptions, decode_as, decodes_every_voxel};
use engine::splat::{Activations, Form, Grid, SplatSet, vgs};
use engine::unit::Unit;
use engine::{Result, memory};
use glam::{DVec3, IVec3, UVec3, Vec3};

use crate::scene::{Part, PartKind};
use crate::source::Source;
use crate::splats::{Piece, Splats};
use crate::voxels::{self, VoxelField};

/// Greatest error of V on voxels, HU.
const TOLERANCE_HU: f64 = 0.5;
/// The same as a share of the range, for scans without HU.
const TOLERANCE: f64 = 1.0 / 4096.0;
/// Host bytes that a voxel of the box takes while it becomes bytes: V and O, twice, and what is written.
const HOST_BYTES_A_VOXEL: u64 = 24;
/// Bytes of a voxel that a decoded field has at least, about: what has fewer in splats need not be tried.
const BYTES_A_VOXEL: u64 = 1;
/// Greatest grid of which the voxels that splats reach are counted.
const MOST_VOXELS: u64 = 1 << 30;
/// q at one standard deviation: what lies within it is mostly inside the region.
const CORE_Q: f64 = 1.0;

/// What a page holds.
#[derive(Clone, Debug)]
pub struct Content {
    /// Number and name of each object, ascending.
    pub objects: Vec<(u8, String)>,
    /// What the data are.
    pub parts: Vec<Part>,
    /// Data of each part.
    pub data: Vec<Vec<u8>>,
}

impl Content {
    /// Returns what a page of some splats holds. Asks for the device, and waits for it, where splats have to be decoded.
    ///
    /// # Errors
    /// Returns the errors of `device`, of [`decode_as`] and of [`vgs::encode`].
    pub fn of(splats: &Splats, device: &mut dyn FnMut() -> Result<Gpu>) -> Result<Self> {
        let Splats { set, pieces, names } = splats;
        let content = |parts| Content { objects: names.clone(), ..Content::of_parts(parts) };
        let voxels = |device: &mut dyn FnMut() -> Result<Gpu>| {
            let (data, has_labels) = voxels_of(set, device)?;
            let number = |(number, _): &(u8, String)| [if has_labels { *number } else { 0 }, *number];
            Ok(content(vec![(PartKind::Voxels, data, names.iter().map(number).collect())]))
        };
        // The limits of pages are those of the engine, which goes on with coarser voxels.
        let of_pieces = || pieces.iter().map(|piece| &piece.source.set);
        // A scene of one set with a region has a region, for which pages want that of every set.
        let is_read =
            of_pieces().all(|own| is_read_by_pages(own) && own.region.is_some() == set.region.is_some());
        if !is_read || !decodes_every_voxel(set) {
            return voxels(device);
        }
        let file = |Piece { source, numbers }: &Piece| Ok((PartKind::Vgs, file_of(source)?, numbers.clone()));
        let files = content(pieces.iter().map(file).collect::<Result<_>>()?);
        // Coded voxels are smaller than a field on voxels.
        let with_splats =
            pieces.iter().zip(&files.parts).filter(|(piece, _)| !piece.source.set.splats.is_empty());
        let of_splats: u64 = with_splats.map(|(_, part)| part.bytes).sum();
        if of_splats > 0 && core_voxels(set).is_some_and(|voxels| of_splats > BYTES_A_VOXEL * voxels) {
            let voxels = voxels(device)?;
            if voxels.bytes() < files.bytes() {
                return Ok(voxels);
            }
        }
        Ok(files)
    }

    fn of_parts(parts: Vec<(PartKind, Vec<u8>, Vec<[u8; 2]>)>) -> Self {
        let part =
            |(kind, data, numbers): (_, Vec<u8>, _)| (Part { kind, bytes: data.len() as u64, numbers }, data);
        let (parts, data) = parts.into_iter().map(part).unzip();
        Content { objects: Vec::new(), parts, data }
    }

    /// Returns the size of the data, bytes.
    pub fn bytes(&self) -> u64 {
        self.parts.iter().map(|part| part.bytes).sum()
    }
}

/// Returns true if the page evaluates such splats itself: those that are right at the voxels of a grid, which needs no least
/// squares, and coded voxels.
fn is_read_by_pages(set: &SplatSet) -> bool {
    set.form == Form::Grid && set.grid.is_some()
}

/// Returns the `.vgs` file of a source.
fn file_of(source: &Source) -> Result<Vec<u8>> {
    source.file.as_ref().map_or_else(|| vgs::encode(&source.set), |file| Ok(file.clone()))
}

/// Returns the field of splats on voxels, and whether these have labels.
fn voxels_of(set: &SplatSet, device: &mut dyn FnMut() -> Result<Gpu>) -> Result<(Vec<u8>, bool)> {
    let decoded = decode_as(&device()?, set, &DecodeOptions::default())?;
    let voxels = decoded.size.iter().fold(1, |count: u64, &n| count.saturating_mul(n.into()));
    memory::require(
        voxels.saturating_mul(HOST_BYTES_A_VOXEL),
        "the field on the voxels of the splats' grid",
    )?;
    let (volume, roi) = decoded.volume(set.origin_mm)?;
    let range = decoded.range();
    let grid = Grid { size: decoded.size, world_from_voxel: volume.world_from_voxel };
    let field = VoxelField {
        size: grid.size,
        world_from_voxel: grid.rows(),
        edge_mm: decoded.edge_mm,
        range: range.map(|v| v as f32),
        tolerance: match set.unit {
            Unit::Hu => TOLERANCE_HU,
            _ => (range[1] - range[0]) * TOLERANCE,
        },
        values: volume.samples,
        occupancies: roi.weight,
        labels: decoded.objects(),
    };
    Ok((voxels::encode(&field), field.labels.is_some()))
}

/// Returns the number of voxels within a standard deviation of some splat, about as many as there are in the region of the
/// fit; `None` if the splats have no grid, or one of too many voxels.
fn core_voxels(set: &SplatSet) -> Option<u64> {
    let Grid { size, world_from_voxel } = set.grid?;
    let count = size.iter().fold(1, |count: u64, &n| count.saturating_mul(n.into()));
    (count <= MOST_VOXELS).then_some(())?;
    let mut reached = vec![0u64; count.div_ceil(64) as usize];
    let last = UVec3::from_array(size).as_ivec3() - 1;
    for splat in set.to_voxel(&world_from_voxel) {
        let (mean, reach) = (Vec3::from_array(splat.mean).as_dvec3(), splat.reach(CORE_Q));
        let low = (mean - reach).clamp(DVec3::ZERO, last.as_dvec3()).ceil().as_ivec3();
        let high = (mean + reach).clamp(DVec3::ZERO, last.as_dvec3()).floor().as_ivec3();
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let IVec3 { x: nx, y: ny, .. } = last + 1;
                    let index = (z as u64 * ny as u64 + y as u64) * nx as u64 + x as u64;
                    reached[(index / 64) as usize] |= 1 << (index % 64);
                }
            }
        }
    }
    Some(reached.iter().map(|bits| u64::from(bits.count_ones())).sum())
}

#[cfg(test)]
mod tests {
    use engine::coded::coded;
    use engine::splat::{Region, Splat};
    use engine::volume::{Roi, Volume};
    use glam::DAffine3;

    use super::*;

    /// Splats in a row, with a grid of 1 mm.
    fn set(count: usize, form: Form) -> SplatSet {
        wide(count, 2.0, form)
    }

    /// Splats of this deviation, voxels.
    fn wide(count: usize, sigma: f32, form: Form) -> SplatSet {
        let splat = |i: usize| Splat {
            mean: [10.0 + 5.0 * i as f32, 10.0, 10.0],
            log_scale: [sigma.ln(); 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..Splat::default()
        };
        let grid = Grid { size: [64, 20, 20], world_from_voxel: DAffine3::IDENTITY };
        SplatSet { splats: (0..count).map(splat).collect(), form, grid: Some(grid), ..SplatSet::default() }
    }

    #[test]
    fn voxels_inside_are_counted_once() {
        let soft = Form::Grid;
        assert_eq!(core_voxels(&set(1, soft)), Some(125), "two to each side");
        assert_eq!(core_voxels(&set(3, soft)), Some(375));
        let doubled =
            SplatSet { splats: [set(3, soft).splats, set(2, soft).splats].concat(), ..set(0, soft) };
        assert_eq!(core_voxels(&doubled), Some(375), "those that overlap");
        let huge = Grid { size: [1 << 20; 3], world_from_voxel: DAffine3::IDENTITY };
        assert_eq!(core_voxels(&SplatSet { grid: Some(huge), ..set(1, soft) }), None);
        assert_eq!(core_voxels(&SplatSet { grid: None, ..set(1, soft) }), None);
    }

    /// The coded voxels of a cube, on the grid of [`set`].
    fn voxels() -> SplatSet {
        let Grid { size, world_from_voxel } = set(0, Form::Grid).grid.expect("a grid");
        let size = size.map(|n| n as usize);
        let samples = (0..size.iter().product()).map(|i: usize| (i * i % 1999) as f32).collect();
        let volume = Volume::new(size, world_from_voxel, samples);
        let inside = |i: usize| (4..16).contains(&(i % 64)) && (2..18).contains(&(i / 64 % 20));
        let weight = (0..volume.len()).map(|i| f32::from(u8::from(inside(i)))).collect();
        coded(&volume, &Roi { size, weight, soft: false }, None, 0.0).expect("coded")
    }

    #[test]
    fn a_device_is_asked_for_only_where_it_is_needed() {
        let mut asked = 0;
        let mut device = || -> Result<Gpu> {
            asked += 1;
            Err(engine::Error::new(engine::Kind::Unavailable, "T", "no device"))
        };
        let join = |sources| Splats::join(sources).expect("splats");
        let soft = set(8, Form::Grid);
        let content = Content::of(&join(vec![Source::of("", soft.clone())]), &mut device).expect("a file");
        assert_eq!((content.parts[0].kind, &content.parts[0].numbers[..]), (PartKind::Vgs, &[[0, 0]][..]));
        let binary = wide(8, 5.0, Form::Grid);
        let file = vgs::encode(&binary).expect("a file");
        let source = Source { file: Some(file.clone()), ..Source::of("", binary.clone()) };
        let both = join(vec![source.clone(), Source { stem: "b".to_owned(), ..source }]);
        let content = Content::of(&both, &mut device).expect("as they are");
        assert!(content.data == [file.clone(), file]);
        assert_eq!(content.objects.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [1, 2]);
        let source = |stem: &str, set: SplatSet| Source { stem: stem.to_owned(), ..Source::of("", set) };
        let alone = Content::of(&join(vec![source("a", voxels())]), &mut device).expect("a file");
        assert!(alone.bytes() > 4000, "{} bytes, which splats would not have", alone.bytes());
        let region = Region::of([64, 20, 20], |i| (i % 64 > 30).then_some(0));
        let fitted = SplatSet { region, ..binary };
        let sources = vec![source("a", voxels()), source("b", fitted)];
        let both = Content::of(&join(sources), &mut device).expect("two files");
        assert_eq!((&both.data[0], both.parts.len()), (&alone.data[0], 2));
        assert_eq!(both.parts.iter().map(|part| &part.numbers[..]).collect::<Vec<_>>(), [[[0, 1]], [[0, 2]]]);
        assert_eq!(asked, 0);
    }

    #[test]
    fn what_pages_do_not_read_is_decoded() {
        let mut device =
            || -> Result<Gpu> { Err(engine::Error::new(engine::Kind::Unavailable, "T", "no device")) };
        let mut fails = |set: SplatSet| {
            let splats = Splats::join(vec![Source::of("", set)]).expect("splats");
            Content::of(&splats, &mut device).is_err_and(|error| error.code == "T")
        };
        let soft = Form::Grid;
        assert!(fails(set(8, Form::Field)) && fails(SplatSet { grid: None, ..set(8, soft) }));
        let many = SplatSet { splats: set(3, soft).splats.repeat(100), ..set(0, soft) };
        assert!(fails(many), "they may be larger than their voxels");
        let sources = [voxels(), set(8, soft)].map(|set| Source::of("", set)).to_vec();
        let both = Splats::join(sources).expect("splats");
        assert_eq!(Content::of(&both, &mut device).expect_err("regions beside soft masks").code, "T");
    }
}
