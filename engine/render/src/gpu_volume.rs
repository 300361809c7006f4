//! The volume on the device that rays are marched through: intensity and occupancy in an image that is
//! sampled with trilinear interpolation, and the intervals of intensity of its bricks, by which empty space
//! is skipped. It is a volume, or a decoded field ([`Decoded`]) in an atlas of bricks
//! (`include/medium.glsl`).
//!
//! For a volume with a region the image is the region's box with a border of one voxel, and holds (V, M):
//! outside the region it is empty, and V and M are interpolated separately. Without a region it is the whole
//! volume and holds V; the occupancy is 1 up to the outermost voxel centres and fades to 0 over one voxel.
//!
//! Both are 16-bit fractions. Whole numbers that span at most 65535, as in every CT, are kept exactly: one
//! unit is a whole number of steps. Other intensities are rounded to 1/65535 of their range, masks to
//! 1/65535.

use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use shaders_glsl::medium;
use shaders_glsl::types::BrickGrid;

use super::atlas::ALONE;
use super::atlas::SeenSize;
use super::decoded::Decoded;
use super::detail::{FieldBudget, seen_size};
use super::look::LookBuffers;
use super::scale::{Scale, to_fraction};
use base::error::{Error, Kind, Result};
use gpu::{Buffer, Format, Gpu, Image, Recorder};
use passes::voxel_gradients::{GradientSource, NOWHERE, VoxelGradients};
use passes::{Faces, Occupancy};
use volume::{Roi, Volume};

/// Edge of a brick along the axis of the shortest voxel edge, as a logarithm to base 2. Along the other axes
/// it is the power of two that comes closest to the same length.
const BRICK_SHIFT: u32 = 2;

/// A volume with the region that is shown of it; without a region all of the volume is shown.
pub struct VolumeSource<'a> {
    /// Intensities.
    pub volume: &'a Volume,
    /// The region whose mask is the occupancy.
    pub roi: Option<&'a Roi>,
}

impl VolumeSource<'_> {
    /// Returns the middle of the volume, rounded to whole mm RAS.
    pub(super) fn centre(&self) -> DVec3 {
        let [x, y, z] = self.volume.size.map(|n| (n as f64 - 1.0) * 0.5);
        self.volume.world_from_voxel.transform_point3(DVec3::new(x, y, z)).round()
    }
}

/// A volume or a decoded field on the device.
pub struct GpuVolume {
    /// Least and greatest intensity.
    pub range: [f64; 2],
    /// Corners of the box around it, mm in the space of the scene.
    pub bounds: [DVec3; 2],
    /// The shortest edge of a voxel, mm.
    pub spacing_mm: f64,
    /// The mean edge of a voxel of the CT, mm; of a decoded field, too, whatever its pitch.
    pub mean_edge_mm: f64,
    image: Image,
    /// Places of the bricks of the grid in an atlas; a single number for a volume.
    places: Buffer<u32>,
    /// Objects that the voxels of an atlas belong to; a single texel if all belong to one, and for a volume.
    labels: Image,
    /// Stands for gradients that are not kept.
    no_gradients: Image,
    /// Coordinates and level of the brick at each place of an atlas.
    bricks: Vec<[u32; 4]>,
    /// What the image is: `ATLAS` of the shaders.
    atlas: u32,
    scale: Scale,
    voxel_from_scene: DAffine3,
    grid: BrickGrid,
    marked: Mutex<Marked>,
}

/// What depends on the look: the bricks that can be seen, and the gradients at the voxels.
pub(super) struct Marked {
    occupancy: Occupancy,
    /// Number of the look that they were marked for.
    look: Option<u64>,
    /// Faces around them, with the number of the look that they were listed for; `None` before they are needed.
    faces: Option<(Faces, Option<u64>)>,
    /// Gradients, with what they were made of; `None` before they are needed.
    gradients: Option<(VoxelGradients, Option<GradientKey>)>,
    /// Number of the look of the picture that was rendered last.
    shown: Option<u64>,
    /// True if there was no memory for them.
    no_room: bool,
}

/// What gradients follow from: v₀, and what is left of the O of objects where that counts.
type GradientKey = (f32, Option<Vec<f32>>);

impl Marked {
    fn new(occupancy: Occupancy) -> Mutex<Self> {
        Mutex::new(Marked {
            occupancy,
            look: None,
            faces: None,
            gradients: None,
            shown: None,
            no_room: false,
        })
    }

    /// Returns for each brick the distance, in bricks, to the next one that can be seen.
    pub(super) fn distances(&self) -> &Buffer<u32> {
        &self.occupancy.distances
    }

    /// Returns true if the picture before was one of the same look, and notes that of this one.
    pub(super) fn rests(&mut self, look: &LookBuffers) -> bool {
        self.shown.replace(look.number) == Some(look.number)
    }

    /// Returns the faces around the bricks that can be seen. Records their listing if the bricks were marked
    /// anew.
    pub(super) fn faces(&mut self, gpu: &Gpu, recorder: &mut Recorder) -> Result<&Faces> {
        let (faces, look) = match &mut self.faces {
            Some(made) => made,
            none => none.insert((Faces::new(gpu, self.occupancy.grid)?, None)),
        };
        if *look != self.look {
            faces.record(recorder, &self.occupancy.distances);
            *look = self.look;
        }
        Ok(faces)
    }
}

/// The part of a volume that is kept, x fastest.
struct Cut {
    /// Voxel of the volume at the first texel; -1 if that lies before the volume.
    low: [i64; 3],
    size: [usize; 3],
    values: Vec<u16>,
    mask: Option<Vec<u16>>,
    scale: Scale,
}

impl Cut {
    fn new(source: &VolumeSource<'_>) -> Self {
        let volume = source.volume;
        let mask: Option<Vec<u16>> = match source.roi {
            Some(roi) => Some(roi.weight.par_iter().map(|&w| to_fraction(w)).collect()),
            // A voxel without a value is not shown.
            None if volume.samples.par_iter().all(|v| v.is_finite()) => None,
            None => Some(
                volume.samples.par_iter().map(|v| to_fraction(f32::from(u8::from(v.is_finite())))).collect(),
            ),
        };
        let (low, size) = match &mask {
            None => ([0; 3], volume.size),
            Some(mask) => around(mask, volume.size),
        };
        let at = |x: usize, y: usize, z: usize| {
            let inside =
                |k: usize, place: usize| (low[k] + place as i64).clamp(0, volume.size[k] as i64 - 1) as usize;
            volume.samples[volume.index(inside(0, x), inside(1, y), inside(2, z))]
        };
        let rows = |row: usize| (0..size[0]).map(move |x| (x, row % size[1], row / size[1]));
        let (low_value, high_value, whole) = (0..size[1] * size[2])
            .into_par_iter()
            .map(|row| {
                let finite = rows(row).map(|(x, y, z)| at(x, y, z)).filter(|v| v.is_finite());
                finite.fold((f32::INFINITY, f32::NEG_INFINITY, true), |(low, high, whole), v| {
                    (low.min(v), high.max(v), whole && v.fract() == 0.0)
                })
            })
            .reduce(
                || (f32::INFINITY, f32::NEG_INFINITY, true),
                |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 && b.2),
            );
        let range =
            if low_value <= high_value { [f64::from(low_value), f64::from(high_value)] } else { [0.0, 1.0] };
        let scale = Scale::of(range, whole.then_some(1.0));
        let filled = |of: &(dyn Fn(usize, usize, usize) -> u16 + Sync)| {
            let mut all = vec![0; size.iter().product()];
            all.par_chunks_mut(size[0]).enumerate().for_each(|(row, out)| {
                for ((x, y, z), out) in rows(row).zip(out) {
                    *out = of(x, y, z);
                }
            });
            all
        };
        let values = filled(&|x, y, z| {
            let v = at(x, y, z);
            scale.fraction(if v.is_finite() { v } else { range[0] as f32 })
        });
        let mask = mask.map(|mask| {
            filled(&|x, y, z| {
                let place = [x, y, z];
                let voxel: [i64; 3] = std::array::from_fn(|k| low[k] + place[k] as i64);
                match (0..3).all(|k| (0..volume.size[k] as i64).contains(&voxel[k])) {
                    true => mask[volume.index(voxel[0] as usize, voxel[1] as usize, voxel[2] as usize)],
                    false => 0,
                }
            })
        });
        Cut { low, size, values, mask, scale }
    }

    /// Returns the intervals of intensity of all bricks. An interval covers all voxels that are read for
    /// places in the brick and up to a voxel away, so that a step into or out of the brick loses nothing.
    fn intervals(&self, grid: &BrickGrid) -> Vec<[f32; 2]> {
        let [bx, by, bz] = grid.bricks.map(|n| n as usize);
        (0..bx * by * bz)
            .into_par_iter()
            .map(|brick| {
                let brick = [brick % bx, brick / bx % by, brick / (bx * by)];
                let [xs, ys, zs]: [std::ops::RangeInclusive<usize>; 3] = std::array::from_fn(|k| {
                    // Brick 0 begins one voxel before the image.
                    let edge = 1i64 << grid.shift[k];
                    let from = brick[k] as i64 * edge - 2;
                    let to = from + edge + 2;
                    let last = self.size[k] as i64 - 1;
                    from.clamp(0, last) as usize..=to.clamp(0, last) as usize
                });
                let (mut least, mut greatest, mut there) = (u16::MAX, 0, self.mask.is_none());
                for z in zs {
                    for y in ys.clone() {
                        let row = (z * self.size[1] + y) * self.size[0];
                        let row = row + xs.start()..row + xs.end() + 1;
                        for &v in &self.values[row.clone()] {
                            (least, greatest) = (least.min(v), greatest.max(v));
                        }
                        there =
                            there || self.mask.as_ref().is_some_and(|mask| mask[row].iter().any(|&m| m > 0));
                    }
                }
                match there {
                    true => [least, greatest].map(|v| self.scale.value(v) as f32),
                    false => [f32::INFINITY, f32::NEG_INFINITY],
                }
            })
            .collect()
    }
}

/// Returns the first voxel and the size of the box around all occupied voxels, with a border of one voxel.
fn around(mask: &[u16], size: [usize; 3]) -> ([i64; 3], [usize; 3]) {
    let (low, high) = mask
        .par_chunks(size[0])
        .enumerate()
        .filter_map(|(row, line)| {
            let first = line.iter().position(|&m| m > 0)?;
            let last = line.iter().rposition(|&m| m > 0)?;
            let (y, z) = (row % size[1], row / size[1]);
            Some(([first, y, z], [last, y, z]))
        })
        .reduce(
            || ([usize::MAX; 3], [0; 3]),
            |a, b| {
                let low = std::array::from_fn(|k| a.0[k].min(b.0[k]));
                (low, std::array::from_fn(|k| a.1[k].max(b.1[k])))
            },
        );
    if low[0] > high[0] {
        return ([-1; 3], [3; 3]);
    }
    (low.map(|v| v as i64 - 1), std::array::from_fn(|k| high[k] - low[k] + 3))
}

/// Returns the grid of bricks for an image of this size.
pub(super) fn brick_grid(size: [usize; 3], spacing: DVec3) -> BrickGrid {
    let texels = size.map(|n| n as u32);
    let shift = spacing.to_array().map(|mm| {
        let coarser = (mm / spacing.min_element()).log2().round();
        (f64::from(BRICK_SHIFT) - coarser).clamp(1.0, f64::from(BRICK_SHIFT)) as u32
    });
    // Places go from one voxel before the first to one behind the last.
    let bricks = std::array::from_fn(|k| (texels[k] + 1).div_ceil(1 << shift[k]));
    BrickGrid { texels, bricks, shift }
}

impl GpuVolume {
    pub(super) fn new(gpu: &Gpu, source: &VolumeSource<'_>, origin: DVec3) -> Result<Self> {
        let volume = source.volume;
        if volume.is_empty() {
            return Err(Error::new(Kind::NothingToDo, "VGS-RENDER-021", "a volume without voxels"));
        }
        let cut = Cut::new(source);
        let spacing = volume.spacing_mm();
        let low = DVec3::from_array(cut.low.map(|v| v as f64));
        let scene_from_voxel =
            DAffine3::from_translation(-origin) * volume.world_from_voxel * DAffine3::from_translation(low);
        let voxel_from_scene = scene_from_voxel.inverse();
        if !voxel_from_scene.is_finite() {
            return Err(Error::new(
                Kind::BadData,
                "VGS-RENDER-022",
                "the volume's voxel axes lie in one plane: its affine cannot be inverted",
            )
            .help("repair the affine in the volume's header"));
        }
        let texels = cut.size.map(|n| n as u32);
        let image = match &cut.mask {
            None => {
                let mut image = gpu.volume("volume", "volume", Format::R16, texels)?;
                image.write(&cut.values)?;
                image
            }
            Some(mask) => {
                let mut image = gpu.volume("volume and mask", "volume", Format::Rg16, texels)?;
                let both: Vec<[u16; 2]> = cut.values.iter().zip(mask).map(|(&v, &m)| [v, m]).collect();
                image.write(&both)?;
                image
            }
        };
        let (least, greatest) =
            cut.values.iter().fold((u16::MAX, 0), |(low, high), &v| (low.min(v), high.max(v)));
        // The faces lie where the occupancy is one half: the border of a region is not shown.
        let edge = if cut.mask.is_some() { 0.5 } else { -0.5 };
        let bounds = bounds(cut.size, edge, &scene_from_voxel);
        let grid = brick_grid(cut.size, spacing);
        Ok(GpuVolume {
            range: [cut.scale.value(least), cut.scale.value(greatest)],
            bounds,
            spacing_mm: spacing.min_element(),
            mean_edge_mm: spacing.element_sum() / 3.0,
            image,
            places: gpu.upload("no places of bricks", "volume", &[0])?,
            labels: gpu.volume("no labels", "volume", Format::Rg8, [1; 3])?,
            no_gradients: no_gradients(gpu)?,
            bricks: vec![NOWHERE],
            atlas: 0,
            scale: cut.scale,
            voxel_from_scene,
            grid,
            marked: Marked::new(Occupancy::new(gpu, grid, &cut.intervals(&grid))?),
        })
    }

    /// Uploads a field that was decoded in the space of the scene, whose origin is given in the world, mm RAS; within a budget,
    /// if there is one.
    pub(super) fn of_field(
        gpu: &Gpu,
        field: &Decoded,
        origin: DVec3,
        budget: Option<&FieldBudget>,
    ) -> Result<Self> {
        let size = field.size.map(|n| n as usize);
        let spacing = volume::spacing_of(&field.scene_from_voxel);
        let grid = brick_grid(size, spacing);
        let seen = |middle: DVec3, radius: f64| match budget {
            Some(FieldBudget { camera: Some(camera), .. }) => {
                let middle = field.scene_from_voxel.transform_point3(middle);
                seen_size(camera, camera.eye - origin, middle, radius * spacing.max_element())
            }
            _ => radius,
        };
        let budget = budget.map(|budget| (budget.bytes, &seen as &SeenSize<'_>));
        let atlas = field.atlas(gpu.limits().volume_edge, budget)?;
        let mut image = gpu.volume("atlas", "decoded field", Format::Rg16, atlas.size)?;
        image.write(&atlas.texels)?;
        let (texels, labels) = match &atlas.labels {
            Some(labels) => (atlas.size, labels.as_slice()),
            None => ([1; 3], &[[field.label, ALONE]][..]),
        };
        let mut label_image = gpu.volume("labels of the atlas", "decoded field", Format::Rg8, texels)?;
        label_image.write(labels)?;
        let scale = field.scale;
        Ok(GpuVolume {
            range: [scale.first, scale.first + scale.span],
            bounds: bounds(size, 0.5, &field.scene_from_voxel),
            spacing_mm: spacing.min_element(),
            mean_edge_mm: field.edge_mm,
            image,
            places: gpu.upload("places of bricks", "decoded field", &atlas.places)?,
            labels: label_image,
            no_gradients: no_gradients(gpu)?,
            bricks: atlas.bricks,
            atlas: if atlas.levels.is_some() { medium::LEVELS } else { medium::ONE_LEVEL },
            scale,
            voxel_from_scene: field.scene_from_voxel.inverse(),
            grid,
            marked: Marked::new(Occupancy::new(gpu, grid, &field.intervals(&grid, atlas.levels.as_deref()))?),
        })
    }

    /// Returns the bricks of which a look can show something. Records the marking if the look has changed.
    pub(super) fn marked(&self, recorder: &mut Recorder, look: &LookBuffers) -> MutexGuard<'_, Marked> {
        // Marks that a panic has left are made anew.
        let mut marked = self.marked.lock().unwrap_or_else(PoisonError::into_inner);
        if marked.look != Some(look.number) {
            marked.occupancy.record(recorder, &look.rows, &look.visible);
            marked.look = Some(look.number);
        }
        marked
    }

    /// Makes the gradients at the voxels for a look, unless they are there: eight bytes a voxel. Returns false if they are
    /// not kept, because more than half of the free memory would go into them. `objects` tells whether objects leave different
    /// parts of their O. `as_they_are` keeps those of an earlier look.
    pub(super) fn keep_gradients(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        marked: &mut Marked,
        look: &LookBuffers,
        objects: bool,
        as_they_are: bool,
    ) -> Result<bool> {
        if marked.no_room {
            return Ok(false);
        }
        let (gradients, made_of) = match &mut marked.gradients {
            Some(made) => made,
            none => {
                let texels: u64 = self.image.size().iter().map(|&n| u64::from(n)).product();
                let bytes = texels * Format::Rgba16f.bytes() as u64;
                if gpu.free_bytes().is_some_and(|free| 2 * bytes > free) {
                    tracing::info!("no memory for gradients at the voxels ({bytes} bytes): light is slower");
                    marked.no_room = true;
                    return Ok(false);
                }
                none.insert((VoxelGradients::new(gpu, &self.image, &self.bricks)?, None))
            }
        };
        let key = (self.dark(look), objects.then(|| look.facts.shown.clone()));
        if made_of.as_ref() != Some(&key) && !(as_they_are && made_of.is_some()) {
            let source = GradientSource {
                grid: self.grid,
                medium: &self.image,
                atlas: self.atlas,
                places: &self.places,
                labels: &self.labels,
                appearances: &look.appearances,
                objects,
            };
            gradients.record(gpu, recorder, &source, key.0)?;
            *made_of = Some(key);
        }
        Ok(true)
    }

    /// Returns v₀ of the gradients as a fraction.
    fn dark(&self, look: &LookBuffers) -> f32 {
        ((look.facts.dark - self.scale.first) / self.scale.span.max(f64::MIN_POSITIVE)) as f32
    }

    /// Returns the intensity per voxel that 1 of a kept gradient stands for; 1 if none are kept.
    pub(super) fn gradient_unit(&self, marked: &Marked) -> f64 {
        let dark = marked.gradients.as_ref().and_then(|(_, made_of)| Some(made_of.as_ref()?.0));
        dark.map_or(1.0, |dark| self.scale.span / f64::from(VoxelGradients::unit(dark)))
    }

    /// Returns the kept gradients, or an image that stands for them.
    pub(super) fn gradients<'a>(&'a self, marked: &'a Marked) -> &'a Image {
        marked.gradients.as_ref().map_or(&self.no_gradients, |(gradients, _)| &gradients.image)
    }

    /// Returns the image of intensities as fractions of the scale, with occupancies if there is an atlas or a
    /// region.
    pub(super) fn image(&self) -> &Image {
        &self.image
    }

    pub(super) fn places(&self) -> &Buffer<u32> {
        &self.places
    }

    pub(super) fn labels(&self) -> &Image {
        &self.labels
    }

    /// Returns what the image is: `ATLAS` of the shaders.
    pub(super) fn atlas(&self) -> u32 {
        self.atlas
    }

    pub(super) fn scale(&self) -> Scale {
        self.scale
    }

    pub(super) fn grid(&self) -> BrickGrid {
        self.grid
    }

    /// Returns the rows of the affine from the scene, mm, to voxels of the image.
    pub(super) fn voxel_from_scene(&self) -> [[f32; 4]; 3] {
        let m = self.voxel_from_scene;
        [0, 1, 2].map(|k| m.matrix3.row(k).extend(m.translation[k]).as_vec4().to_array())
    }
}

/// Creates what is bound where gradients are not kept.
fn no_gradients(gpu: &Gpu) -> Result<Image> {
    gpu.volume("no gradients", "gradients", Format::Rgba16f, [1; 3])
}

/// Returns the box around all voxels, from `edge` beyond the centre of the first one to as much before that
/// of the last, in the space of the scene.
fn bounds(size: [usize; 3], edge: f64, scene_from_voxel: &DAffine3) -> [DVec3; 2] {
    let last = DVec3::from_array(size.map(|n| n as f64 - 1.0)) - edge;
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for corner in 0..8 {
        let at = |axis: usize| if corner >> axis & 1 == 1 { last[axis] } else { edge };
        let place = scene_from_voxel.transform_point3(DVec3::new(at(0), at(1), at(2)));
        bounds = [bounds[0].min(place), bounds[1].max(place)];
    }
    bounds
}
