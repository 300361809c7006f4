//! Real extremes, through fit, evaluation and picture: metal, tiny and huge voxels, a far origin, regions of one voxel and of
//! all, many splats on one spot.

use engine::fit::evaluate::{Protocol, evaluate};
use engine::render::{Camera, Fov, Look, Scene, Settings};
use engine::splat::{Splat, SplatSet};
use engine::transfer::preset;
use engine::volume::Roi;
use glam::{DAffine3, DVec3};
use vgs_tests::Device;
use vgs_tests::fitting::Case;
use vgs_tests::numerics::keep;
use vgs_tests::rendering::{of_splats, render};

/// The RMSE over the range after the fit, and the pixels of all modes that are no numbers.
fn run(gpu: &Device, case: &Case) -> (f64, usize) {
    let mut fitter = case.fit(gpu);
    assert_eq!(fitter.frozen().expect("a count"), 0, "no gradient is lost");
    let splats = fitter.splats().expect("splats");
    let field = case.config.field(fitter.scaling().background);
    // What a fit does not look at does not count: metal is clipped to the range of the fit.
    let (low, high) = fitter.scaling().range;
    let protocol = Protocol { offsets: vec![[0.3, -0.2, 0.4]], range: [low, high], shell: 2, threshold: 0.0 };
    let e = evaluate(gpu, &splats, &field, &case.volume, &case.roi, &protocol).expect("an evaluation");
    assert!(e.on_grid.occupancy_rmse.is_finite(), "{:?}", e.on_grid);
    let set = SplatSet::from_voxel(&splats, &case.volume.world_from_voxel, field);
    // Between voxels a region of one has no sample.
    let between = e.between.iter().map(|m| m.rmse_hu).fold(0.0, f64::max);
    let rmse = e.on_grid.rmse_hu.max(between) / f64::from(high - low).max(1.0);
    (rmse, pixels(gpu, &set, low, high))
}

fn pixels(gpu: &Device, set: &SplatSet, low: f32, high: f32) -> usize {
    let look =
        Look::new(preset("CT-Bone").expect("a preset").over([low, high.max(low + 1.0)].map(f64::from)));
    let scene = Scene::new(gpu, Some(set), None, &look).expect("a scene");
    let [from, to] = scene.bounds();
    let (centre, radius) = ((from + to) * 0.5, (to - from).length() * 0.5);
    // A narrow field from at least 50 mm: nothing nearer than 1 mm is drawn.
    let distance = (6.0 * radius).max(50.0);
    let fov = Fov::symmetric((2.2 * radius / distance).atan().to_degrees(), 1.0);
    let camera = Camera::looking(centre + DVec3::Y * distance, centre, DVec3::Z, fov).expect("a camera");
    let settings = Settings { precise: true, ..Settings::new([12, 12]) };
    of_splats()
        .map(|row| {
            let picture = render(gpu, row, &scene, &settings, &[camera]).remove(0);
            picture.pixels.iter().flatten().filter(|v| !v.is_finite() || !(-1e-3..=1.01).contains(*v)).count()
        })
        .sum()
}

#[test]
fn extremes_of_real_data() {
    let gpu = Device::boot();
    let phantom = Case::phantom([28, 26, 30], 50);
    let with = |change: &dyn Fn(&mut Case)| {
        let mut case = phantom.clone();
        change(&mut case);
        case
    };
    let unit =
        |mm: f64| with(&|c: &mut Case| c.volume.world_from_voxel = DAffine3::from_scale(DVec3::splat(mm)));
    let metal = with(&|c: &mut Case| {
        let [nx, ny, _] = c.volume.size;
        let place = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
        let inside: Vec<usize> = (0..c.volume.len()).filter(|&i| c.roi.weight[i] > 0.0).collect();
        let centre = place(inside[inside.len() / 2]);
        for i in (0..c.volume.len()).filter(|&i| place(i).distance(centre) < 3.5) {
            c.volume.samples[i] = 30_000.0;
        }
    });
    let far = with(&|c: &mut Case| c.volume.world_from_voxel.translation += DVec3::new(1e5, -1e5, 1e5));
    let speck = with(&|c: &mut Case| {
        let kept = c.roi.weight.iter().position(|&w| w > 0.0).expect("a region");
        c.roi.weight.iter_mut().enumerate().for_each(|(i, w)| *w = f32::from(u8::from(i == kept)));
        c.config.loss.hold_weight = 0.1;
    });
    let whole = with(&|c: &mut Case| {
        c.roi = Roi::new(vec![1.0; c.volume.len()], &c.volume).expect("a region");
    });
    let mut wrong = 0;
    for (id, cases) in [
        ("R1", vec![metal]),
        ("R2", vec![unit(0.01), unit(10.0)]),
        ("R3", vec![far]),
        ("R4", vec![speck]),
        ("R5", vec![whole]),
    ] {
        let mut worst = 0.0f64;
        for case in cases {
            let (rmse, pixels) = run(&gpu, &case);
            println!("{id}: RMSE {rmse:.4} of the range");
            worst = if rmse <= worst { worst } else { rmse };
            wrong += pixels;
        }
        keep(id, worst);
    }
    // Many on one spot, drawn.
    let one =
        Splat { rotation: [1.0, 0.0, 0.0, 0.0], opacity_logit: -2.0, intensity: 700.0, ..Splat::default() };
    wrong += pixels(&gpu, &SplatSet { splats: vec![one; 5000], ..SplatSet::default() }, 0.0, 1000.0);
    keep("R6", wrong as f64);
}
