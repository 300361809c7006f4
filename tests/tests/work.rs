//! The work of frames, as shaders and buffers count it, against what the reference implementations find by
//! asking every splat at every plane of every pixel.

use engine::unit::Unit;
use std::collections::{BTreeMap, BTreeSet};

use engine::gpu::Gpu;
use engine::passes::WorkgroupShape;
use engine::render::{Camera, Look, Rays, Renderer, Scene, Settings, VolumeSource, mode};
use engine::splat::{Harmonics, Kernel};
use engine::transfer::{ColourPoint, Light, Material, OpacityPoint, TransferFunction};
use engine::volume::Volume;
use glam::{DAffine3, DVec2, DVec3};
use reference::eye::{self, Eye};
use reference::quads::{self, Face, Quad};
use reference::slab::{self, Seen};
use vgs_tests::Device;
use vgs_tests::rendering::{SIZE, camera, look, set};

/// Pixels of a part, and parts of a tile: columns and rows.
const PART: [usize; 2] = [4, 8];
const PARTS: [usize; 2] = [4, 2];
/// Planes that a part is evaluated at together, and of a block.
const HALF: usize = 4;
const PLANES: usize = 8;
/// How much nearer or farther, relative to the support, what a kernel in f32 may decide either way is.
const MARGIN: f64 = 1e-3;

fn settings() -> Settings {
    // Light never ends: what is done does not depend on what is seen.
    let plain = Settings { rays: Rays::Computed, ..Settings::new(SIZE) };
    Settings { precise: true, counting: true, dark: -1.0, ..plain }
}

fn counted(renderer: &Renderer) -> Vec<[usize; 4]> {
    let picture = renderer.target.read_colour(0).expect("a picture");
    picture.iter().map(|counts| counts.map(|n| n as usize)).collect()
}

/// Where planes are, as mode slab places them.
struct Planes {
    first: f64,
    spacing: f64,
    count: usize,
}

impl Planes {
    fn of(scene: &Scene, eye: &Eye) -> Self {
        let splats = scene.splats.as_ref().expect("splats");
        let [low, high] = splats.bounds;
        let (radius, spacing) = ((high - low).length() * 0.5, splats.sigma_mm);
        let first = (eye.seen((low + high) * 0.5).z - radius).max(slab::NEAREST);
        Planes { first, spacing, count: (2.0 * radius / (spacing * PLANES as f64)).ceil() as usize * PLANES }
    }

    fn depth(&self, plane: usize) -> f64 {
        self.first + (plane as f64 + 0.5) * self.spacing
    }
}

/// The least q of each (splat, half) at the pixels of a part.
fn least_q(
    near: &BTreeSet<(usize, usize)>,
    splats: &[Seen],
    eye: &Eye,
    planes: &Planes,
    part: [usize; 2],
) -> BTreeMap<(usize, usize), f64> {
    let rays: Vec<DVec3> = (0..PART[0] * PART[1])
        .map(|n| [part[0] * PART[0] + n % PART[0], part[1] * PART[1] + n / PART[0]])
        .map(|place| eye.ray(place.map(|x| x as f64 + 0.5), SIZE))
        .collect();
    let least = |&(splat, half): &(usize, usize)| {
        let Seen { mean, whitening, .. } = splats[splat];
        let depths = (half * HALF..(half + 1) * HALF).map(|plane| planes.depth(plane));
        let q =
            depths.flat_map(|z| rays.iter().map(move |&ray| (whitening * (ray * z - mean)).length_squared()));
        ((splat, half), q.fold(f64::INFINITY, f64::min))
    };
    near.iter().map(least).collect()
}

/// (Splat, half) whose boxes may meet a part: halves by depth, and the part by the box of the box's corners.
fn near(splats: &[Seen], eye: &Eye, planes: &Planes, part: [usize; 2]) -> BTreeSet<(usize, usize)> {
    let mut near = BTreeSet::new();
    let scale = |axis: usize, tangent: f64| {
        let [left, right, up, down] = eye.tangents;
        let [low, high] = if axis == 0 { [left, right] } else { [up, down] };
        (tangent - low) / (high - low) * f64::from(SIZE[axis])
    };
    for (i, splat) in splats.iter().enumerate() {
        let reach = splat.extent * (1.0 + MARGIN);
        let beside = (0..2).any(|axis| {
            let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)].map(|(a, z): (f64, f64)| {
                let depth = (splat.mean.z + z * reach.z).max(slab::NEAREST);
                scale(axis, (splat.mean[axis] + a * reach[axis]) / depth)
            });
            let low = corners.iter().copied().fold(f64::INFINITY, f64::min);
            let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let from = (part[axis] * PART[axis]) as f64;
            high < from - 0.1 || low > from + PART[axis] as f64 + 0.1
        });
        if beside {
            continue;
        }
        for half in 0..planes.count / HALF {
            let [from, to] = [half * HALF, half * HALF + HALF - 1].map(|plane| planes.depth(plane));
            if splat.mean.z + reach.z >= from && splat.mean.z - reach.z <= to {
                near.insert((i, half));
            }
        }
    }
    near
}

/// Returns true, with a sentence, for devices on which a part of a tile is several subgroups (4 or 16 invocations in
/// lockstep): each counts for itself, and the picture shows the count of one.
fn is_narrow(gpu: &Gpu) -> bool {
    let lanes = gpu.description().subgroup_size;
    let is_narrow = lanes < 8 || (9..32).contains(&lanes);
    if is_narrow {
        println!("skipped: {lanes} invocations run in lockstep, less than a part of a tile");
    }
    is_narrow
}

#[test]
fn slabs_count_what_their_reference_meets() {
    let gpu = Device::boot();
    if is_narrow(&gpu) {
        return;
    }
    let set = set(120, Kernel::Compact);
    let mut scene = Scene::new(&gpu, Some(&set), None, &look("CT-Soft-Tissue", false)).expect("a scene");
    scene.list_all().expect("a list");
    let camera = camera(&scene);
    let mut renderer =
        Renderer::new(&gpu, mode("slab").expect("a mode"), &scene, &settings()).expect("a renderer");
    renderer.render(&scene, &[camera]).expect("a frame");
    let counts = counted(&renderer);
    let work = renderer.work().expect("counts");
    assert_eq!((work.rows, work.shown), (120, 120));
    assert!(work.sorted <= work.room && work.tiles > 0 && work.digits > 0, "{work:?}");

    let eye = Eye::from(&camera.view(scene.origin));
    let background = f64::from(set.field.background);
    let splats: Vec<Seen> = set
        .splats
        .iter()
        .map(|s| slab::seen(&s.into(), &eye, Kernel::Compact, background).expect("before the eye"))
        .collect();
    let planes = Planes::of(&scene, &eye);
    let support = Kernel::Compact.support_q();
    let size = SIZE.map(|n| n as usize);
    let tiles = [0, 1].map(|axis| size[axis].div_ceil(PART[axis] * PARTS[axis]));
    assert_eq!(work.lists as usize, tiles[0] * tiles[1] * planes.count / PLANES);
    let (mut pairs, mut evaluated, mut needed) = (0, 0, 0);
    for tile in (0..tiles[0] * tiles[1]).map(|n| [n % tiles[0], n / tiles[0]]) {
        let mut tile_counts = BTreeSet::new();
        // What two parts side by side meet, what is near them, and what was counted for both.
        let mut beside = vec![(BTreeSet::new(), BTreeSet::new(), BTreeSet::new()); PARTS[0] * PARTS[1] / 2];
        for n in 0..PARTS[0] * PARTS[1] {
            let within = [n % PARTS[0], n / PARTS[0]];
            let part = [0, 1].map(|axis| tile[axis] * PARTS[axis] + within[axis]);
            let near = near(&splats, &eye, &planes, part);
            let q = least_q(&near, &splats, &eye, &planes, part);
            let [surely, perhaps] = [1.0 - MARGIN, 1.0 + MARGIN].map(|margin| -> BTreeSet<(usize, usize)> {
                q.iter().filter(|(_, q)| **q < support * margin).map(|(at, _)| *at).collect()
            });
            let at = [part[0] * PART[0], part[1] * PART[1]];
            if at[0] < size[0] && at[1] < size[1] {
                let [own, both, classified, looked] = counts[at[1] * size[0] + at[0]];
                let of = |set: &BTreeSet<_>| set.len() * HALF;
                assert!(
                    of(&surely) <= own && own <= of(&near),
                    "{part:?}: {} {own} {}",
                    of(&surely),
                    of(&near)
                );
                let least: BTreeSet<usize> = surely.iter().map(|&(_, half)| half).collect();
                // A wide group classifies what any of its parts needs.
                let most = match WorkgroupShape::of(&gpu) {
                    WorkgroupShape::OneByOne => {
                        perhaps.iter().map(|&(_, half)| half).collect::<BTreeSet<_>>().len() * HALF
                    }
                    WorkgroupShape::SideBySide => planes.count,
                };
                assert!(least.len() <= classified && classified <= most, "{part:?}: {classified}");
                tile_counts.insert(looked);
                beside[n / 2].2.insert(both);
                evaluated += own;
                needed += of(&surely);
            }
            beside[n / 2].0.extend(surely);
            beside[n / 2].1.extend(near);
        }
        // Parts of a tile go through the same lists.
        assert_eq!(tile_counts.len(), 1, "{tile:?}: {tile_counts:?}");
        for (met, near, counts) in beside {
            // None was counted where both lie outside of the picture.
            assert!(counts.len() <= 1, "{tile:?}: {counts:?}");
            for both in counts {
                assert!(met.len() * HALF <= both && both <= near.len() * HALF, "{tile:?}: {both}");
            }
        }
        pairs += tile_counts.into_iter().next().expect("a tile");
    }
    assert_eq!(pairs as u64, work.sorted, "every pair is in one list");
    println!("{needed} of {evaluated} evaluations meet a support; {pairs} pairs");
    assert!(needed > 1000 && evaluated < 3 * needed, "{needed} {evaluated}");
}

#[test]
fn fragments_are_those_of_the_quads_ellipses() {
    let gpu = Device::boot();
    let mut set = set(60, Kernel::Compact);
    let grey = [0.3f32; 3];
    let coefficients = set.splats.iter().flat_map(|_| grey).collect();
    (set.unit, set.colours) = (Unit::Luminance, Some(Harmonics { degree: 0, coefficients }));
    let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone", false)).expect("a scene");
    let camera = Camera { fov: engine::render::Fov::symmetric(70.0, 72.0 / 56.0), ..camera(&scene) };
    let mut renderer =
        Renderer::new(&gpu, mode("alpha").expect("a mode"), &scene, &settings()).expect("a renderer");
    renderer.render(&scene, &[camera]).expect("a frame");
    let counts = counted(&renderer);
    let work = renderer.work().expect("counts");

    let eye = Eye::from(&camera.view(scene.origin));
    let material =
        Material { shade: false, ambient: 1.0, diffuse: 0.0, specular: 0.0, power: 1.0, occlusion: 0.0 };
    let quad_look =
        quads::Look { material: &material, light: &Light::HEAD, dark: 0.0, planes: &[], widening: 0.3 };
    let face = Face::Own(DVec3::ONE);
    let object = eye::Appearance::default();
    let quads: Vec<Quad> = set
        .splats
        .iter()
        .filter_map(|s| quads::quad(&s.into(), &face, &object, &eye, SIZE, &quad_look))
        .collect();
    assert_eq!((work.shown, work.sorted, work.quads as usize), (60, 60, quads.len()));
    let (mut fragments, mut blended, mut wanted, mut off) = (0, 0, 0, 0);
    for (i, got) in counts.iter().enumerate() {
        let place = DVec2::new((i as u32 % SIZE[0]) as f64 + 0.5, (i as u32 / SIZE[0]) as f64 + 0.5);
        let want = quads.iter().filter(|q| q.opacity(place) > 0.0).count();
        assert!(got[1] <= got[0]);
        fragments += got[0];
        blended += got[1];
        wanted += want;
        off += got[1].abs_diff(want);
    }
    // What is at the edge of an ellipse may fall either way.
    assert!(wanted > 2000 && off * 100 <= wanted, "{blended} of {wanted}, {off} off");
    // Squares and triangles around ellipses: 4/π and 3√3/π times their area, less where ellipses end beside the picture.
    let around = fragments as f64 / blended as f64;
    println!("{fragments} fragments, {blended} blended: {around:.3}");
    let full = if WorkgroupShape::of(&gpu) == WorkgroupShape::OneByOne { 27f64.sqrt() } else { 4.0 }
        / std::f64::consts::PI;
    assert!((0.8 * full..1.1 * full).contains(&around), "{around} {full}");
}

/// The cells of a ray through a grid: the first and the last, `step` mm long from the eye on; nothing if it
/// passes the grid and its border of one voxel by.
fn cells(volume: &Volume, scene: &Scene, eye: &Eye, ray: DVec3, step: f64) -> Option<[f64; 2]> {
    let voxel_from_scene = (DAffine3::from_translation(-scene.origin) * volume.world_from_voxel).inverse();
    let origin = voxel_from_scene.transform_point3(eye.position);
    let direction = voxel_from_scene.transform_vector3(eye.direction(ray));
    let size = DVec3::from_array(volume.size.map(|n| n as f64));
    let (a, b) = ((-1.0 - origin) / direction, (size - origin) / direction);
    let from = a.min(b).max_element().max(slab::NEAREST);
    let to = a.max(b).min_element();
    let dz = step / ray.length();
    (from < to).then(|| [(from / dz).floor(), (to / dz).ceil() - 1.0])
}

/// A faint extinction that is the same everywhere.
fn fog() -> Look {
    let colours = vec![ColourPoint { intensity: 0.0, colour: DVec3::ONE }];
    let opacities = vec![OpacityPoint { intensity: 0.0, opacity: 0.01 }];
    Look::new(TransferFunction::new("fog", colours, opacities, Material::default()).expect("a function"))
}

#[test]
fn rays_count_the_cells_of_their_group() {
    let gpu = Device::boot();
    if is_narrow(&gpu) {
        return;
    }
    let size = [24, 20, 16];
    // A slope along x: the left half is seen by the second look, all of it by the first.
    let samples = (0..size.iter().product()).map(|i: usize| (i % size[0]) as f32 * 40.0 - 500.0).collect();
    let volume = Volume::new(size, DAffine3::from_scale(DVec3::new(0.8, 1.1, 1.7)), samples);
    let source = VolumeSource { volume: &volume, roi: None };
    let mut transfer = engine::transfer::preset("CT-Bone").expect("a preset").over([-1000.0, 1000.0]);
    transfer.material.shade = true;
    let bone = Look::new(transfer);
    let step = 0.5 * 0.8;
    // Cells of one part, which are sampled once.
    let settings = Settings { step: 0.5, cell: Some(0.5), ..settings() };
    let mut scene = Scene::new(&gpu, None, Some(&source), &fog()).expect("a scene");
    let [low, high] = scene.bounds();
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let camera =
        Camera::from_side("anterior-left", (low + high) * 0.5, (high - low).length() * 0.4, 40.0, aspect)
            .expect("a camera");
    let eye = Eye::from(&camera.view(scene.origin));
    let counts = |scene: &Scene, voxel_bytes: usize| {
        let mut renderer =
            Renderer::new(&gpu, mode("volume").expect("a mode"), scene, &settings).expect("a renderer");
        renderer.render(scene, &[camera]).expect("a frame");
        let work = renderer.work().expect("counts");
        assert_eq!(work.image_bytes, (voxel_bytes * size.iter().product::<usize>()) as u64);
        counted(&renderer)
    };
    let all = counts(&scene, 2);
    scene.set_look(&bone).expect("a look");
    // With the gradients.
    let some = counts(&scene, 10);
    let [width, height] = SIZE.map(|n| n as usize);
    // A subgroup has one block of 4 x 2 rays or more of the same square of 8 x 8.
    let square = if WorkgroupShape::of(&gpu) == WorkgroupShape::OneByOne { [4, 2] } else { [8, 8] };
    let span = |left: usize, top: usize, [wide, tall]: [usize; 2]| {
        let pixels =
            (top..height.min(top + tall)).flat_map(|y| (left..width.min(left + wide)).map(move |x| [x, y]));
        let cells = pixels.filter_map(|place| {
            let ray = eye.ray(place.map(|n| n as f64 + 0.5), SIZE);
            cells(&volume, &scene, &eye, ray, step)
        });
        cells.reduce(|[a, b], [from, to]| [a.min(from), b.max(to)]).map_or(0.0, |[a, b]| b - a + 1.0)
    };
    let (mut rounds, mut sampled, mut gradients) = (0, 0, 0);
    for top in (0..height).step_by(2) {
        for left in (0..width).step_by(4) {
            let [round, sample, gradient, _] = all[top * width + left];
            let least = span(left, top, [4, 2]);
            let most = span(left / square[0] * square[0], top / square[1] * square[1], square);
            let found = round as f64;
            assert!(least - 2.0 <= found && found <= most + 2.0, "{left}, {top}: {least} {found} {most}");
            // Nothing is empty, and nothing lit.
            assert_eq!((sample, gradient), (round, 0), "{left}, {top}");
            let [fewer, taken, lit, _] = some[top * width + left];
            assert!(fewer <= round && taken <= fewer && lit <= taken, "{left}, {top}: {fewer} {taken} {lit}");
            rounds += round;
            sampled += taken;
            gradients += lit;
        }
    }
    // Half of the grid can be seen; the gradient is found where much is added.
    println!("{rounds} rounds, {sampled} samples of bone, {gradients} gradients");
    assert!(rounds > 10_000 && sampled > rounds / 5 && sampled < rounds * 4 / 5, "{sampled} of {rounds}");
    assert!(gradients > 50 && gradients < sampled * 3 / 4, "{gradients} of {sampled}");
}
