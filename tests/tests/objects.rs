//! Several objects in one scene: joined, tinted, faded, hidden; and as many splats as a budget allows.

use std::collections::BTreeMap;

use engine::gpu::Gpu;
use engine::image::{Image, psnr};
use engine::render::{Appearance, Camera, Look, MODES, ModeRow, Precision, Renderer, Scene, Settings, mode};
use engine::splat::{SplatSet, join};
use engine::transfer::preset;
use glam::{DVec3, Vec3};
use rand::RngExt;
use vgs_tests::Device;
use vgs_tests::scene::{random, splat};

const SIZE: [u32; 2] = [64, 48];
const PLAIN: Appearance = Appearance { visible: true, tint: None, opacity: 1.0 };

/// Splats in a ball of 15 mm about a place of the world, with an origin elsewhere.
fn ball(seed: u64, place: DVec3) -> SplatSet {
    let mut rng = random(seed);
    let mut one = |_| {
        let mut s = splat(&mut rng, Vec3::splat(20.0));
        s.mean = s.mean.map(|v| v - 10.0 + 7.0);
        s.log_scale = s.log_scale.map(|v| v.min(0.8));
        s.intensity = rng.random_range(100.0f32..900.0);
        s
    };
    SplatSet { splats: (0..90).map(&mut one).collect(), origin_mm: place - 7.0, ..SplatSet::default() }
}

/// Two objects, "left" and "right", whose centres are so far apart along x, mm.
fn pair(apart: f64) -> SplatSet {
    let [left, right] = [-0.5, 0.5].map(|side| DVec3::new(-80.0 + side * apart, 200.0, 900.0));
    join(vec![("left".to_owned(), ball(1, left)), ("right".to_owned(), ball(2, right))]).expect("one scene")
}

fn look(objects: &[(u8, Appearance)]) -> Look {
    let mut transfer = preset("CT-Soft-Tissue").expect("a preset").over([-100.0, 900.0]);
    transfer.material.shade = false;
    Look { objects: objects.iter().copied().collect(), ..Look::new(transfer) }
}

fn of_splats() -> impl Iterator<Item = &'static ModeRow> {
    MODES.iter().filter(|row| row.of_splats)
}

fn picture(gpu: &Gpu, row: &ModeRow, scene: &Scene) -> Image {
    let settings = Settings { precise: true, ..Settings::new(SIZE) };
    let mut renderer = Renderer::new(gpu, row, scene, &settings).expect("a renderer");
    let [low, high] = scene.bounds();
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let camera = Camera::from_side("A", (low + high) * 0.5, (high - low).length() * 0.4, 30.0, aspect);
    renderer.render(scene, &[camera.expect("a camera")]).expect("a frame");
    Image { size: SIZE.map(|n| n as usize), pixels: renderer.target.read_colour(0).expect("a picture") }
}

fn scene(gpu: &Gpu, set: &SplatSet, look: &Look) -> Scene {
    Scene::new(gpu, Some(set), None, look).expect("a scene")
}

/// Greatest difference of any number of two pictures.
fn apart(a: &Image, b: &Image) -> f32 {
    let channels = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    channels.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn objects_are_named_and_numbered() {
    let gpu = Device::boot();
    let scene = scene(&gpu, &pair(20.0), &look(&[]));
    let found: Vec<_> = scene.objects().iter().map(|o| (o.number, o.name.as_str(), o.splats)).collect();
    assert_eq!(found, [(1, "left", 90), (2, "right", 90)]);
}

#[test]
fn a_set_in_two_files_is_the_same_picture() {
    let gpu = Device::boot();
    let whole = ball(3, DVec3::new(40.0, -70.0, 1200.0));
    let mut parts = [whole.clone(), whole.clone()];
    parts[0].splats.truncate(40);
    parts[1].splats.drain(..40);
    // The other one about another place.
    let moved = DVec3::new(31.0, -17.0, 250.0);
    parts[1].origin_mm += moved;
    for s in &mut parts[1].splats {
        s.mean = (Vec3::from_array(s.mean) - moved.as_vec3()).to_array();
    }
    let joined = join(parts.map(|p| ("part".to_owned(), p)).into()).expect("one scene");
    for row in of_splats() {
        let [a, b] = [&whole, &joined].map(|set| picture(&gpu, row, &scene(&gpu, set, &look(&[]))));
        let db = psnr(&a, &b).expect("pictures of one size");
        println!("{}: {db:.1} dB", row.name);
        // Where alpha looks beside a splat follows from the digits of its mean.
        assert!(db > if row.name == "alpha" { 38.0 } else { 75.0 }, "{}: {db}", row.name);
    }
}

#[test]
fn plain_objects_change_nothing() {
    let gpu = Device::boot();
    let set = pair(12.0);
    for row in of_splats() {
        let mut scene = scene(&gpu, &set, &look(&[]));
        let before = picture(&gpu, row, &scene);
        assert!(before.pixels.iter().filter(|p| p[3] > 0.3).count() > 300, "{}: to be seen", row.name);
        scene.set_look(&look(&[(1, PLAIN), (2, PLAIN)])).expect("a look");
        assert_eq!(picture(&gpu, row, &scene), before, "{}: the same bits", row.name);
        // An object that is not there has a tint: the kernels look for tints and find none.
        let red = Appearance { tint: Some([1.0, 0.0, 0.0]), opacity: 0.5, ..PLAIN };
        scene.set_look(&look(&[(9, red)])).expect("a look");
        let worst = apart(&picture(&gpu, row, &scene), &before);
        assert!(worst < 1e-5, "{}: {worst}", row.name);
        // And back again.
        scene.set_look(&look(&[(1, red)])).expect("a look");
        assert!(apart(&picture(&gpu, row, &scene), &before) > 0.1, "{}: red is to be seen", row.name);
        scene.set_look(&look(&[])).expect("a look");
        assert_eq!(picture(&gpu, row, &scene), before, "{}: as before", row.name);
    }
}

#[test]
fn what_is_hidden_is_what_has_no_opacity_where_nothing_overlaps() {
    let gpu = Device::boot();
    let set = pair(60.0);
    let hidden = Appearance { visible: false, ..PLAIN };
    let clear = Appearance { opacity: 0.0, ..PLAIN };
    for row in of_splats() {
        let of = |look: &Look| picture(&gpu, row, &scene(&gpu, &set, look));
        let both = of(&look(&[]));
        for number in [1, 2] {
            let gone = of(&look(&[(number, hidden)]));
            let worst = apart(&gone, &of(&look(&[(number, clear)])));
            assert!(worst < 1e-5, "{}: object {number}: {worst}", row.name);
            // Seen from the front the patient's left, towards -x, lies on the picture's right.
            let half = |image: &Image, right: bool| {
                let columns =
                    |(i, p): (usize, &[f32; 4])| ((i % SIZE[0] as usize >= 32) == right).then_some(p[3]);
                image.pixels.iter().enumerate().filter_map(columns).sum::<f32>()
            };
            let right = number == 2;
            let (here, there) = (half(&gone, right), half(&gone, !right));
            assert!(here.min(there) == 0.0 && here.max(there) > 50.0, "{}: {here} {there}", row.name);
            assert!((here + there) < half(&both, true) + half(&both, false), "{}", row.name);
        }
    }
}

#[test]
fn a_tint_replaces_the_colour_and_an_opacity_fades() {
    let gpu = Device::boot();
    let set = pair(8.0);
    let tint = [0.9f32, 0.3, 0.1];
    let total = |image: &Image| image.pixels.iter().map(|p| p[3]).sum::<f32>();
    for row in of_splats() {
        let of = |objects: &[(u8, Appearance)]| picture(&gpu, row, &scene(&gpu, &set, &look(objects)));
        let before = of(&[]);
        let one = Appearance { tint: Some(tint), ..PLAIN };
        let red = of(&[(1, one), (2, one)]);
        for (a, b) in red.pixels.iter().zip(&before.pixels) {
            assert!((a[3] - b[3]).abs() < 1e-5, "{}: the opacity stays", row.name);
            assert!((0..3).all(|k| (a[k] - tint[k] * a[3]).abs() < 1e-4), "{}: {a:?}", row.name);
        }
        let mut last = f32::INFINITY;
        for opacity in [1.0, 0.6, 0.2, 0.05, 0.0] {
            let faded = Appearance { opacity, ..PLAIN };
            let now = total(&of(&[(1, faded), (2, faded)]));
            assert!(now < last, "{}: {now} after {last}", row.name);
            last = now;
        }
        assert_eq!(last, 0.0, "{}", row.name);
    }
}

#[test]
fn packed_splats_keep_their_objects() {
    let gpu = Device::boot();
    let set = pair(12.0);
    let tint = |tint| Appearance { tint: Some(tint), ..PLAIN };
    let look = look(&[(1, tint([1.0, 0.1, 0.0])), (2, tint([0.0, 0.4, 1.0]))]);
    for row in of_splats() {
        let full = picture(&gpu, row, &scene(&gpu, &set, &look));
        let packed =
            Scene::with_precision(&gpu, Some(&set), None, &look, Precision::Packed).expect("a scene");
        let db = psnr(&full, &picture(&gpu, row, &packed)).expect("pictures of one size");
        println!("{}: packed {db:.1} dB", row.name);
        assert!(db > 38.0, "{}: {db}", row.name);
    }
}

#[test]
fn a_budget_takes_the_most_important_of_what_can_be_seen() {
    let gpu = Device::boot();
    let mut set = pair(12.0);
    // The greatest splats belong to an object that is hidden: the budget is for the others.
    let labels = set.labels.as_mut().expect("objects");
    for (s, label) in set.splats.iter_mut().zip(labels).take(20) {
        s.log_scale = [2.5; 3];
        *label = 3;
    }
    let objects = BTreeMap::from([(3, Appearance { visible: false, ..PLAIN })]);
    let look = Look { objects, ..look(&[]) };
    let row = mode("slab").expect("a mode");
    let mut scene = scene(&gpu, &set, &look);
    let count = |scene: &Scene| scene.splats.as_ref().expect("splats").active_count().expect("a count");
    let whole = picture(&gpu, row, &scene);
    let all = count(&scene);
    assert_eq!(all, 160);
    let mut last = 0.0;
    for budget in [20, 80, 140] {
        scene.set_splat_budget(Some(budget)).expect("a budget");
        assert_eq!(count(&scene), budget);
        let db = psnr(&whole, &picture(&gpu, row, &scene)).expect("pictures of one size");
        println!("{budget} of {all}: {db:.1} dB");
        assert!(db > last, "{budget}: {db} after {last}");
        last = db;
    }
    // A look keeps the budget, and what is enough for all changes nothing.
    scene.set_look(&look).expect("a look");
    assert_eq!(count(&scene), 140);
    for budget in [Some(all), Some(usize::MAX), None] {
        scene.set_splat_budget(budget).expect("a budget");
        assert_eq!((count(&scene), &picture(&gpu, row, &scene)), (all, &whole), "{budget:?}");
    }
}
