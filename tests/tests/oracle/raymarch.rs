//! The modes `volume` and `decoded`: gradients at the voxels of an image or of an atlas of bricks, and rays through them.

use engine::gpu::{Buffer, Format, Gpu, Image, Kernel};
use engine::passes::Occupancy;
use engine::passes::occupancy::FARTHEST;
use engine::passes::voxel_gradients::{GradientSource, NOWHERE, VoxelGradients};
use engine::render::{self, Camera, Look, LookBuffers, Target};
use engine::transfer::{Material, OpacityPoint, Table, TransferFunction, preset};
use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4};
use rand::RngExt;
use reference::eye::{Appearance, Eye};
use reference::half::half_step;
use reference::raymarch;
use reference::slab::Look as ReferenceLook;
use shaders_glsl::types::{BrickGrid, RaymarchParams, View};
use vgs_tests::rendering::SIDE_LIGHT;
use vgs_tests::scene::random;
use vgs_tests::{Bound, Device, assert_close};

use super::run;

const RANGE: [f64; 2] = [-1000.0, 2000.0];
/// Mean edge of a voxel of the CT, mm, over which gradient magnitudes are.
const EDGE: f32 = 1.4;

/// Voxels, where they are, and two eyes that see them: one asymmetric from outside, one wide from among them.
struct Stage {
    size: [usize; 3],
    values: Vec<u16>,
    mask: Option<Vec<u16>>,
    scene_from_voxel: DAffine3,
    views: Vec<View>,
}

const SIZE: [u32; 2] = [50, 38];
const FIRST: f64 = -600.0;
const SPAN: f64 = 65535.0 / 32.0;

/// Blobs of random intensity, with a soft mask or without one; voxels of 1.3 × 0.9 × 2.5 mm, oblique and left-handed.
fn stage(seed: u64, masked: bool) -> Stage {
    let mut rng = random(seed);
    let size = [26, 31, 14];
    let blobs: Vec<(DVec3, f64, f64)> = (0..14)
        .map(|_| {
            let at = DVec3::from_array(size.map(|n| rng.random_range(0.0..n as f64)));
            (at, rng.random_range(1.5..5.0), rng.random_range(200.0..1500.0))
        })
        .collect();
    let places = || {
        (0..size[2]).flat_map(move |z| (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y, z])))
    };
    let values = places()
        .map(|p| {
            // Air, where nothing is to be seen, but for the blobs.
            let x = DVec3::from_array(p.map(|v| v as f64));
            let v = blobs
                .iter()
                .map(|(at, r, v)| v * (-0.5 * (x - at).length_squared() / (r * r)).exp())
                .sum::<f64>()
                - 500.0;
            ((v.clamp(-600.0, 1400.0) - FIRST) / SPAN * 65535.0).round() as u16
        })
        .collect();
    // A ball that is cut off at the border, as masks in images are.
    let mask = masked.then(|| {
        places()
            .map(|p| {
                let border = (0..3).any(|k| p[k] == 0 || p[k] == size[k] - 1);
                let away = (DVec3::from_array(p.map(|v| v as f64)) - DVec3::new(11.0, 16.0, 6.0)).length();
                if border { 0 } else { ((12.0 - away).clamp(0.0, 3.0) / 3.0 * 65535.0).round() as u16 }
            })
            .collect()
    });
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.5, 1.1));
    let linear = turn * DMat3::from_diagonal(DVec3::new(-1.3, 0.9, 2.5));
    let centre = DVec3::from_array(size.map(|n| 0.5 * (n as f64 - 1.0)));
    let scene_from_voxel = DAffine3::from_mat3_translation(linear, -(linear * centre));
    let outside = Camera::from_side("anterior-left-superior", DVec3::ZERO, 22.0, 40.0, 1.3).unwrap();
    let inside = Camera::from_side("posterior", DVec3::new(1.0, -8.0, 2.0), 5.0, 140.0, 1.3).unwrap();
    let mut views: Vec<View> = [outside, inside].iter().map(|c| c.view(DVec3::ZERO)).collect();
    views[0].tangents[0] *= 0.6;
    views[0].tangents[3] *= 1.2;
    Stage { size, values, mask, scene_from_voxel, views }
}

/// What of a stage an atlas binds in place of an image.
struct Atlas {
    image: Image,
    places: Buffer<u32>,
    labels: Image,
    /// Coordinates of the brick at each place, and its level.
    bricks: Vec<[u32; 4]>,
    /// The voxel of the stage at each texel, if one is there.
    voxels: Vec<Option<usize>>,
}

/// V and O of what is nowhere near anything.
const EMPTY: [u16; 2] = [9000, 0];
/// Voxels of a brick of an atlas along each axis, and those with its apron.
const BRICK: usize = 8;
const APRONED: usize = shaders_glsl::medium::APRONED as usize;

impl Stage {
    /// Makes all voxels [`EMPTY`] that are not beside one with an occupancy: what an atlas does not keep.
    fn emptied(mut self) -> Self {
        let mask = self.mask.as_ref().unwrap();
        let [nx, ny, nz] = self.size;
        let beside = |i: usize| {
            let place = [i % nx, i / nx % ny, i / (nx * ny)];
            let near = |k: usize, n: usize| place[k].saturating_sub(1)..=(place[k] + 1).min(n - 1);
            near(2, nz).any(|z| near(1, ny).any(|y| near(0, nx).any(|x| mask[(z * ny + y) * nx + x] > 0)))
        };
        let kept: Vec<bool> = (0..mask.len()).map(beside).collect();
        self.values.iter_mut().zip(kept).filter(|(_, kept)| !kept).for_each(|(v, _)| *v = EMPTY[0]);
        self
    }

    /// The object of each voxel: layers along an oblique direction.
    fn labels(&self) -> Vec<u8> {
        let [nx, ny, _] = self.size;
        let place = |i: usize| i % nx + i / nx % ny + 2 * (i / (nx * ny));
        (0..self.values.len()).map(|i| (place(i) / 7 % 5) as u8).collect()
    }

    /// The voxels of a brick with its apron, as places in memory; beyond the faces those at them.
    fn aproned(&self, brick: [usize; 3]) -> Vec<usize> {
        let voxel = |k: usize, i: usize| (brick[k] * BRICK + i).saturating_sub(1).min(self.size[k] - 1);
        let each = |i: usize| {
            let [x, y, z] =
                [voxel(0, i % APRONED), voxel(1, i / APRONED % APRONED), voxel(2, i / (APRONED * APRONED))];
            (z * self.size[1] + y) * self.size[0] + x
        };
        (0..APRONED.pow(3)).map(each).collect()
    }

    /// An atlas of 3 × 2 × n bricks in which those of the stage lie in a random order behind one that is empty; labels in
    /// the same shape, or a single one.
    fn atlas(&self, gpu: &Gpu, labelled: bool, seed: u64) -> Atlas {
        let bricks = self.size.map(|n| (n + 1).div_ceil(BRICK));
        let count: usize = bricks.iter().product();
        let mask = self.mask.as_ref().unwrap();
        let at = |i: usize| [self.values[i], mask[i]];
        let brick = |i: usize| [i % bricks[0], i / bricks[0] % bricks[1], i / (bricks[0] * bricks[1])];
        let mut kept: Vec<usize> =
            (0..count).filter(|&i| self.aproned(brick(i)).iter().any(|&v| at(v) != EMPTY)).collect();
        assert!(kept.len() < count, "some bricks are empty");
        let mut rng = random(seed);
        for i in (1..kept.len()).rev() {
            kept.swap(i, rng.random_range(0..=i));
        }
        let (across, rows) = (3, 2);
        let layers = (kept.len() + 1).div_ceil(across * rows);
        let size = [across * APRONED, rows * APRONED, layers * APRONED];
        let mut texels = vec![EMPTY; size.iter().product()];
        let mut labels = vec![0u8; texels.len()];
        let mut places = vec![0u32; count];
        let mut at_place = vec![NOWHERE; across * rows * layers];
        let mut voxels = vec![None; texels.len()];
        let own = self.labels();
        for (to, &i) in (1..).zip(&kept) {
            let place = [to % across, to / across % rows, to / (across * rows)];
            places[i] = (place[0] | place[1] << 10 | place[2] << 20) as u32;
            at_place[to] = {
                let [x, y, z] = brick(i).map(|n| n as u32);
                [x, y, z, 0]
            };
            for (j, &voxel) in self.aproned(brick(i)).iter().enumerate() {
                let x = place[0] * APRONED + j % APRONED;
                let y = place[1] * APRONED + j / APRONED % APRONED;
                let z = place[2] * APRONED + j / (APRONED * APRONED);
                let texel = (z * size[1] + y) * size[0] + x;
                (texels[texel], labels[texel]) = (at(voxel), own[voxel]);
                // Those beyond the faces stand for others.
                let [bx, by, bz] = brick(i).map(|n| n * BRICK);
                let own = [bx + j % APRONED, by + j / APRONED % APRONED, bz + j / (APRONED * APRONED)];
                let inside = (0..3).all(|k| (1..=self.size[k]).contains(&own[k]));
                voxels[texel] = inside.then_some(voxel);
            }
        }
        let edges = size.map(|n| n as u32);
        let mut image = gpu.volume("atlas", "test", Format::Rg16, edges).unwrap();
        image.write(&texels).unwrap();
        let label_size = if labelled { edges } else { [1; 3] };
        let mut label_image = gpu.volume("labels", "test", Format::Rg8, label_size).unwrap();
        // All in a cell has one label; cells that reach beyond their brick are not asked.
        let told = |i: usize| {
            let [x, y, z] = [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
            let next = |v: usize, c: usize, axis: usize| (v + (c >> axis & 1)).min(size[axis] - 1);
            let corner = |c: usize| (next(z, c, 2) * size[1] + next(y, c, 1)) * size[0] + next(x, c, 0);
            [labels[i], if (0..8).all(|c| labels[corner(c)] == labels[i]) { 255 } else { 0 }]
        };
        let told: Vec<[u8; 2]> = (0..labels.len()).map(told).collect();
        assert!(
            (0..2).all(|k| told.iter().any(|told| usize::from(told[1] == 255) == k)),
            "both kinds of cells"
        );
        label_image.write(if labelled { &told } else { &[[3, 255]][..] }).unwrap();
        let places = gpu.upload("places", "test", &places).unwrap();
        Atlas { image, places, labels: label_image, bricks: at_place, voxels }
    }

    /// The image of all voxels, as an atlas.
    fn dense(&self, gpu: &Gpu) -> Atlas {
        Atlas {
            image: self.image(gpu),
            places: gpu.upload("no places", "test", &[0]).unwrap(),
            labels: gpu.volume("no labels", "test", Format::Rg8, [1; 3]).unwrap(),
            bricks: vec![NOWHERE],
            voxels: (0..self.values.len()).map(Some).collect(),
        }
    }

    fn image(&self, gpu: &Gpu) -> Image {
        let texels = self.size.map(|n| n as u32);
        match &self.mask {
            None => {
                let mut image = gpu.volume("volume", "test", Format::R16, texels).unwrap();
                image.write(&self.values).unwrap();
                image
            }
            Some(mask) => {
                let mut image = gpu.volume("volume", "test", Format::Rg16, texels).unwrap();
                let both: Vec<[u16; 2]> = self.values.iter().zip(mask).map(|(&v, &m)| [v, m]).collect();
                image.write(&both).unwrap();
                image
            }
        }
    }

    fn intensities(&self) -> Vec<f32> {
        self.values.iter().map(|&v| (FIRST + SPAN * f64::from(v) / 65535.0) as f32).collect()
    }

    fn medium(&self, atlas: Source, shown: &[Appearance]) -> raymarch::Medium {
        let mask: Option<Vec<f32>> =
            self.mask.as_ref().map(|mask| mask.iter().map(|&m| (f64::from(m) / 65535.0) as f32).collect());
        let medium =
            raymarch::Medium::new(self.size, self.scene_from_voxel, &self.intensities(), mask.as_deref());
        let labels = match atlas {
            Source::Image | Source::Atlas => return medium,
            Source::Objects | Source::Functions => self.labels(),
            Source::OneObject => vec![3; self.values.len()],
        };
        let medium = medium.with_objects(labels.iter().map(|&label| shown[usize::from(label)]).collect());
        match atlas {
            Source::Functions => {
                medium.with_functions(labels.iter().map(|&label| FUNCTION_OF[usize::from(label)]).collect())
            }
            _ => medium,
        }
    }

    /// Bricks of 4 × 4 × 2 voxels with the intervals of all that their places and those a voxel away look up.
    fn bricks(&self) -> (BrickGrid, Vec<[f32; 2]>) {
        let shift = [2u32, 2, 1];
        let texels = self.size.map(|n| n as u32);
        let bricks: [u32; 3] = std::array::from_fn(|k| (texels[k] + 1).div_ceil(1 << shift[k]));
        let values = self.intensities();
        let intervals = (0..bricks.iter().product::<u32>())
            .map(|i| {
                let brick = [i % bricks[0], i / bricks[0] % bricks[1], i / (bricks[0] * bricks[1])];
                let mut interval = [f32::INFINITY, f32::NEG_INFINITY];
                let mut there = self.mask.is_none();
                let reach = |k: usize| {
                    let from = (brick[k] << shift[k]) as i64 - 2;
                    let last = self.size[k] as i64 - 1;
                    let to = from + (1 << shift[k]) + 2;
                    from.clamp(0, last) as usize..=to.clamp(0, last) as usize
                };
                for z in reach(2) {
                    for y in reach(1) {
                        for x in reach(0) {
                            let at = x + self.size[0] * (y + self.size[1] * z);
                            interval = [interval[0].min(values[at]), interval[1].max(values[at])];
                            there |= self.mask.as_ref().is_some_and(|m| m[at] > 0);
                        }
                    }
                }
                if there { interval } else { [f32::INFINITY, f32::NEG_INFINITY] }
            })
            .collect();
        (BrickGrid { texels, bricks, shift }, intervals)
    }
}

/// Where V and O come from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Source {
    /// An image of all voxels.
    Image,
    /// An atlas of bricks.
    Atlas,
    /// The same with objects that are shown apart.
    Objects,
    /// The same, some of which have transfer functions of their own.
    Functions,
    /// The same where all voxels belong to one.
    OneObject,
}

/// Presets of objects' own transfer functions ...
const FUNCTIONS: [&str; 2] = ["CT-Bone", "CT-Skin"];
/// ... and which of them each object has, counted from 1; 0 is the function of the scene.
const FUNCTION_OF: [usize; 5] = [0, 2, 1, 1, 0];

/// A row of what the kernel is compared in.
struct RaymarchRow {
    source: Source,
    preset: &'static str,
    masked: bool,
    segments: bool,
    shade: bool,
    /// Strength of the ambient occlusion.
    occlusion: f64,
    /// True if the opacity depends on the gradient.
    graded: bool,
    jitter: bool,
    /// True if gradients are kept for the voxels.
    kept: bool,
    group: u32,
}

/// Voxels, where they lie in an image, and what there is of objects.
fn held(gpu: &Gpu, source: Source, masked: bool, seed: u64) -> (Stage, Atlas) {
    let stage = stage(seed, masked);
    if source == Source::Image {
        let dense = stage.dense(gpu);
        return (stage, dense);
    }
    let stage = stage.emptied();
    let atlas = stage.atlas(gpu, matches!(source, Source::Objects | Source::Functions), seed);
    (stage, atlas)
}

/// Appearances of the five objects of a stage.
fn appearances() -> [render::Appearance; 5] {
    let appearance = |visible, tint, opacity| render::Appearance { visible, tint, opacity };
    [
        appearance(true, None, 1.0),
        appearance(true, Some([0.9, 0.2, 0.1]), 1.0),
        appearance(false, Some([0.0, 1.0, 0.0]), 1.0),
        appearance(true, None, 0.15),
        appearance(true, Some([0.1, 0.4, 1.0]), 0.5),
    ]
}

/// The same for the reference.
fn for_reference(objects: &[render::Appearance]) -> Vec<Appearance> {
    let of = |object: &render::Appearance| Appearance {
        tint: object.tint.map_or(DVec4::ZERO, |t| DVec3::from_array(t.map(f64::from)).extend(1.0)),
        opacity: if object.visible { f64::from(object.opacity) } else { 0.0 },
    };
    objects.iter().map(of).collect()
}

pub fn voxel_gradients() {
    let gpu = Device::boot();
    let look = |objects: &[render::Appearance]| Look {
        objects: (0u8..).zip(objects.iter().copied()).collect(),
        ..Look::new(preset("CT-Bone").unwrap().over(RANGE))
    };
    let objects = appearances();
    let buffers = LookBuffers::new(&gpu, &look(&objects), RANGE, DVec3::ZERO).unwrap();
    for (i, (source, masked)) in [
        (Source::Image, false),
        (Source::Image, true),
        (Source::Atlas, true),
        (Source::Objects, true),
        (Source::OneObject, true),
    ]
    .into_iter()
    .enumerate()
    {
        let (stage, atlas) = held(&gpu, source, masked, 500 + i as u64);
        let medium = stage.medium(source, &for_reference(&objects));
        let mut kept = VoxelGradients::new(&gpu, &atlas.image, &atlas.bricks).unwrap();
        // Within the intensities, at an end, and far away, where halves would not hold differences of V as they are.
        for dark in [150.0, FIRST, 1e6, -1e9] {
            let wanted = medium.voxel_gradients(dark);
            let of = gradient_source(&stage, &atlas, &buffers, source);
            let fraction = ((dark - FIRST) / SPAN) as f32;
            run(&gpu, |r| kept.record(&gpu, r, &of, fraction).unwrap());
            let unit = f64::from(VoxelGradients::unit(fraction)) / SPAN;
            let found: Vec<[u16; 4]> = kept.image.read().unwrap();
            for (texel, voxel) in found.iter().zip(&atlas.voxels) {
                let texel = texel.map(|v| f64::from(half::f16::from_bits(v)));
                let Some(voxel) = *voxel else { continue };
                let slopes = (wanted[voxel] * unit).to_array();
                for (axis, (got, wanted)) in texel.into_iter().zip(slopes).enumerate() {
                    // Devices may round to the half below; differences of f32 lose a little.
                    let room = 2.0 * half_step(wanted) + 8192.0 * 3e-7;
                    assert!(
                        (got - wanted).abs() <= room,
                        "{source:?} dark {dark} voxel {voxel} {axis}: {got} instead of {wanted}"
                    );
                }
            }
        }
    }
}

fn gradient_source<'a>(
    stage: &Stage,
    atlas: &'a Atlas,
    look: &'a LookBuffers,
    source: Source,
) -> GradientSource<'a> {
    GradientSource {
        grid: stage.bricks().0,
        medium: &atlas.image,
        atlas: u32::from(source != Source::Image),
        places: &atlas.places,
        labels: &atlas.labels,
        appearances: &look.appearances,
        objects: !matches!(source, Source::Image | Source::Atlas),
    }
}

pub fn raymarch() {
    let gpu = Device::boot();
    let row = |source, preset, masked, segments, shade, jitter, group| RaymarchRow {
        source,
        preset,
        masked,
        segments,
        shade,
        occlusion: 0.0,
        graded: false,
        jitter,
        kept: true,
        group,
    };
    let by_differences = |row| RaymarchRow { kept: false, ..row };
    let occluded = |occlusion, row| RaymarchRow { occlusion, ..row };
    let graded = |row| RaymarchRow { graded: true, ..row };
    for (i, row) in [
        row(Source::Image, "CT-Soft-Tissue", false, false, false, false, 8),
        row(Source::Image, "CT-Soft-Tissue", true, true, true, true, 64),
        row(Source::Image, "CT-Bone", true, false, true, false, 64),
        row(Source::Image, "CT-Bone", false, true, false, true, 8),
        row(Source::Image, "CT-Skin", true, true, false, false, 8),
        row(Source::Image, "CT-Skin", false, true, true, false, 64),
        row(Source::Atlas, "CT-Soft-Tissue", true, true, true, true, 8),
        row(Source::Atlas, "CT-Bone", true, false, true, false, 64),
        row(Source::Atlas, "CT-Skin", true, false, false, true, 8),
        row(Source::Objects, "CT-Soft-Tissue", true, true, true, false, 64),
        row(Source::Objects, "CT-Bone", true, false, true, true, 8),
        row(Source::Functions, "CT-Soft-Tissue", true, true, true, false, 64),
        row(Source::Functions, "CT-Bones-Steep", true, false, true, true, 8),
        row(Source::Functions, "CT-Skin", true, false, false, false, 64),
        row(Source::OneObject, "CT-Skin", true, false, false, false, 64),
        occluded(1.0, row(Source::Image, "CT-Bone", true, false, true, false, 64)),
        occluded(0.7, row(Source::Image, "CT-Soft-Tissue", false, true, true, true, 8)),
        occluded(0.8, row(Source::Atlas, "CT-Skin", true, false, true, false, 8)),
        occluded(0.9, row(Source::Objects, "CT-Bone", true, true, true, false, 64)),
        occluded(1.0, row(Source::Functions, "CT-Soft-Tissue", true, false, true, true, 8)),
        occluded(0.5, row(Source::OneObject, "CT-Bone", true, false, true, false, 64)),
        // Not lit, so that there is no light to take away.
        occluded(0.5, row(Source::Atlas, "CT-Bone", true, false, false, false, 64)),
        graded(row(Source::Image, "CT-Bone", true, false, true, false, 64)),
        graded(row(Source::Image, "CT-Soft-Tissue", false, true, false, true, 8)),
        graded(row(Source::Image, "CT-Skin", true, true, true, false, 64)),
        graded(row(Source::Atlas, "CT-Skin", true, false, true, true, 8)),
        graded(row(Source::Objects, "CT-Soft-Tissue", true, true, true, false, 64)),
        graded(row(Source::Functions, "CT-Bone", true, true, true, false, 8)),
        graded(row(Source::Functions, "CT-Skin", true, false, false, true, 64)),
        graded(row(Source::OneObject, "CT-Bone", true, false, false, false, 64)),
        graded(occluded(0.8, row(Source::Functions, "CT-Soft-Tissue", true, false, true, false, 8))),
        by_differences(row(Source::Image, "CT-Bone", true, false, true, true, 8)),
        by_differences(row(Source::Image, "CT-Soft-Tissue", false, true, true, false, 64)),
        by_differences(row(Source::Atlas, "CT-Skin", true, false, true, false, 64)),
        by_differences(graded(occluded(0.6, row(Source::Atlas, "CT-Bone", true, true, true, false, 8)))),
    ]
    .iter()
    .enumerate()
    {
        compare(&gpu, row, 300 + i as u64);
    }
}

fn compare(gpu: &Device, row: &RaymarchRow, seed: u64) {
    let (stage, atlas) = held(gpu, row.source, row.masked, seed);
    let mut transfer = preset(row.preset).unwrap().over(RANGE);
    let RaymarchRow { shade, occlusion, .. } = *row;
    transfer.material = Material { shade, ambient: 0.2, diffuse: 0.7, specular: 0.3, power: 12.0, occlusion };
    let graded = |function: TransferFunction, points: &[[f64; 2]]| {
        let points = points.iter().map(|&[intensity, opacity]| OpacityPoint { intensity, opacity });
        let points = if row.graded { points.collect() } else { Vec::new() };
        function.with_gradient_opacity(points).expect("gradient opacities")
    };
    let transfer = graded(transfer, &[[0.0, 0.1], [150.0, 0.4], [400.0, 1.0]]);
    let mut look = Look::new(transfer);
    if row.group == 64 {
        look.light = SIDE_LIGHT;
    }
    let appearances = appearances();
    look.objects = (0u8..).zip(appearances).collect();
    // Those of objects are steeper, and lighter at the end.
    let own = FUNCTIONS
        .map(|name| graded(preset(name).unwrap().over(RANGE), &[[50.0, 0.0], [250.0, 1.0], [300.0, 0.7]]));
    if row.source == Source::Functions {
        let chosen = FUNCTION_OF.iter().enumerate().filter(|(_, function)| **function > 0);
        look.functions = chosen.map(|(number, k)| (number as u8, own[k - 1].clone())).collect();
    }
    let range = [FIRST, FIRST + SPAN];
    let table = Table::new(&look.transfer, range);
    let mut buffers = LookBuffers::new(gpu, &look, range, DVec3::ZERO).unwrap();
    let cut = [[0.6f32, 0.0, 0.8, 9.0], [0.0, -1.0, 0.0, 14.0]];
    let mut rows_on_device = buffers.rows.read().unwrap();
    let row_on_device = &mut rows_on_device[0];
    row_on_device.plane_count = 2;
    row_on_device.planes[..2].copy_from_slice(&cut);
    let gradient_from = f64::from(row_on_device.dark);
    buffers.rows.write_range(0, &rows_on_device).unwrap();

    let views = gpu.upload("views", "test", &stage.views).unwrap();
    let (grid, intervals) = stage.bricks();
    let mut occupancy = Occupancy::new(gpu, grid, &intervals).unwrap();
    run(gpu, |r| occupancy.record(r, &buffers.rows, &buffers.visible));
    let distances = occupancy.distances.read().unwrap();
    let empty = distances.iter().filter(|&&d| d > 0).count();
    assert!(
        empty > 50 && distances.contains(&0),
        "{}: {empty} of {} bricks are empty",
        row.preset,
        distances.len()
    );
    assert!(distances.iter().all(|&d| d <= FARTHEST));
    let nothing_skipped = gpu.upload("distances", "test", &vec![0u32; distances.len()]).unwrap();

    let inverse = stage.scene_from_voxel.inverse();
    let (slack, dark) = (60.0, 1e-3);
    let fraction = ((gradient_from - FIRST) / SPAN) as f32;
    let unit = f64::from(VoxelGradients::unit(fraction)) / SPAN; // of a kept gradient, per intensity
    let mut gradients = VoxelGradients::new(gpu, &atlas.image, &atlas.bricks).unwrap();
    let of = gradient_source(&stage, &atlas, &buffers, row.source);
    run(gpu, |r| gradients.record(gpu, r, &of, fraction).unwrap());
    let objects = match row.source {
        Source::Image | Source::Atlas => 0,
        Source::Objects | Source::OneObject => shaders_glsl::medium::TINTS,
        Source::Functions => shaders_glsl::medium::OWN_FUNCTIONS,
    };
    let constants = [
        u32::from(row.masked),
        u32::from(row.source != Source::Image),
        objects,
        0,
        u32::from(row.segments),
        u32::from(row.shade),
        0,
        u32::from(row.jitter),
        u32::from(buffers.facts.occluded),
        u32::from(buffers.facts.graded),
        u32::from(row.kept),
        1,
        row.group,
    ];
    let kernel = Kernel::new(gpu, &shaders_glsl::RAYMARCH, &constants).unwrap();
    let tile = if row.group == 8 { [4, 2] } else { [8, 8] };
    let patches = gpu.upload("patches", "test", &[0u32]).unwrap();
    let render = |params: &RaymarchParams, distances| {
        let mut target = Target::new(gpu, SIZE, 2, true, true).unwrap();
        run(gpu, |r| {
            r.pass(&kernel)
                .read("views", &views)
                .read("look_rows", &buffers.rows)
                .read("look_points", &buffers.points)
                .read("look_integrals", &buffers.integrals)
                .sample("medium", &atlas.image)
                .read("places", &atlas.places)
                .sample("labels", &atlas.labels)
                .read("appearances", &buffers.appearances)
                .read("distances", distances)
                .read("patches", &patches)
                .read("gradient_factors", &buffers.gradient_factors)
                .read("visible_before", &buffers.visible)
                .sample("gradients", &gradients.image)
                .write_image("colour_image", &mut target.colour)
                .write_image("depth_image", &mut target.depth)
                .push(params)
                .dispatch_3d([SIZE[0].div_ceil(tile[0]), SIZE[1].div_ceil(tile[1]), 2]);
        });
        target
    };

    let functions = own.map(|function| Table::new(&function, range));
    let reference_look = ReferenceLook {
        table: &table,
        functions: &functions,
        material: &look.transfer.material,
        light: &look.light,
        dark: gradient_from,
        planes: &cut.map(|p| p.map(f64::from)),
        segments: row.segments,
        gradient_edge: row.graded.then_some(f64::from(EDGE)),
        least_light: f64::from(dark),
    };
    let mut medium = stage.medium(row.source, &for_reference(&appearances));
    if row.kept {
        // Those of the device: devices may round to either half beside a number.
        let found: Vec<[u16; 4]> = gradients.image.read().unwrap();
        let mut kept = vec![DVec3::ZERO; stage.values.len()];
        for (texel, voxel) in found.iter().zip(&atlas.voxels) {
            if let Some(voxel) = *voxel {
                let [x, y, z, _] = texel.map(|v| f64::from(half::f16::from_bits(v)));
                kept[voxel] = DVec3::new(x, y, z) / unit;
            }
        }
        medium = medium.with_gradients(kept);
    }
    // Cells of one part, and those that are cut where something can show.
    for (cell, parts) in [(0.55, 1), (1.1, 4)] {
        let params = RaymarchParams {
            grid,
            voxel_from_scene: [0, 1, 2]
                .map(|k| inverse.matrix3.row(k).extend(inverse.translation[k]).as_vec4().to_array()),
            first: FIRST as f32,
            span: SPAN as f32,
            size: SIZE,
            cell,
            parts,
            slack,
            dark,
            edge: if row.kept { EDGE / unit as f32 } else { EDGE },
        };
        let target = render(&params, &occupancy.distances);
        let whole = render(&params, &nothing_skipped);
        let cells = raymarch::Cells { length: f64::from(cell), parts, slack: f64::from(slack) };
        let depths: Vec<f32> = target.depth.read().unwrap();
        let (mut colours, mut depth_pairs, mut skips) = (Vec::new(), Vec::new(), Vec::new());
        let mut opaque = [0; 2];
        for (v, view) in (0u32..).zip(&stage.views) {
            let eye = Eye::from(view);
            let got = target.read_colour(v).unwrap();
            skips.extend(got.iter().flatten().zip(whole.read_colour(v).unwrap().iter().flatten()).map(pair));
            for (i, pixel) in got.iter().enumerate() {
                let at = [i as u32 % SIZE[0], i as u32 / SIZE[0]];
                let ray = eye.ray(at.map(|x| f64::from(x) + 0.5), SIZE);
                let shift = if row.jitter { raymarch::noise(at, v) } else { 0.0 };
                let wanted = raymarch::ray(&medium, &eye, ray, &reference_look, &cells, shift);
                opaque[v as usize] += usize::from(wanted.clear < 0.9);
                colours.extend(pixel.iter().zip(wanted.pixel()).map(|(&g, w)| (f64::from(g), w)));
                depth_pairs.push((f64::from(depths[v as usize * got.len() + i]), wanted.depth));
            }
        }
        let label = format!(
            "raymarch in {parts} parts: {:?} {} masked {} segments {} shade {} occlusion {} graded {} kept {} group {}",
            row.source,
            row.preset,
            row.masked,
            row.segments,
            row.shade,
            row.occlusion,
            row.graded,
            row.kept,
            row.group
        );
        assert!(opaque.iter().all(|&n| n > 35), "{label}: both eyes see something: {opaque:?}");
        // An intensity at the border between two entries of the table may take either, a cell at a clip plane may be
        // there or not, and a share at the threshold may find its light or not.
        assert_close(&label, Bound::new(5e-4, 0.0).outliers(0.002, 0.05), colours);
        assert_close(&format!("{label}, depth"), Bound::new(0.02, 1e-4).outliers(0.002, 5.0), depth_pairs);
        assert_close(&format!("{label}, skipped or not"), Bound::new(0.0, 0.0), skips);
    }
}

fn pair((a, b): (&f32, &f32)) -> (f64, f64) {
    (f64::from(*a), f64::from(*b))
}
