//! Where an error is, on phantoms whose errors are known: the field is 100 HU everywhere, so the error at a voxel is 100 less
//! its value.

use engine::fit::errors::{ErrorMap, Group};
use engine::gpu::Gpu;
use engine::splat::Kernel;
use engine::volume::{LabelChoice, Labels, Roi, Volume};
use glam::{DAffine3, DVec3};
use vgs_tests::Device;
use vgs_tests::sampling::{field, one};

const SIZE: [usize; 3] = [14, 12, 10];
const SPACING: DVec3 = DVec3::new(1.0, 0.5, 2.0);

fn place(i: usize) -> [usize; 3] {
    [i % SIZE[0], i / SIZE[0] % SIZE[1], i / (SIZE[0] * SIZE[1])]
}

fn volume(value: impl Fn([usize; 3]) -> f32) -> Volume {
    let count = SIZE.iter().product();
    Volume::new(SIZE, DAffine3::from_scale(SPACING), (0..count).map(|i| value(place(i))).collect())
}

fn map<'a>(gpu: &Gpu, volume: &'a Volume, roi: &'a Roi) -> ErrorMap<'a> {
    let splat = one([7.0, 6.0, 5.0], [5.0; 3], 3.0, 100.0);
    ErrorMap::new(gpu, &[splat], &field(Kernel::Compact, 100.0), volume, roi).expect("a map")
}

/// Name, voxels, mean, RMSE and worst of groups.
fn figures(groups: &[Group]) -> Vec<(&str, usize, f64, f64, f64)> {
    groups.iter().map(|g| (g.name.as_str(), g.voxels, g.mean_hu, g.rmse_hu, g.worst_hu)).collect()
}

#[test]
fn the_map_is_signed_and_ends_with_the_region() {
    let gpu = Device::boot();
    let volume = volume(|[x, ..]| x as f32 * 20.0);
    let inside = |i: usize| place(i)[0] > 2 && place(i)[1] < 6;
    let roi = Roi::new((0..volume.len()).map(|i| f32::from(u8::from(inside(i)))).collect(), &volume)
        .expect("a region");
    let map = map(&gpu, &volume, &roi);
    for (i, &hu) in map.hu.iter().enumerate() {
        assert_eq!(hu, if inside(i) { 100.0 - volume.samples[i] } else { 0.0 }, "voxel {:?}", place(i));
    }
    assert_eq!(
        (map.uncovered, map.worst_voxel()),
        (0, 13),
        "x = 13 has the error -160, the first voxel of several"
    );
    let written = map.volume();
    assert_eq!((written.size, written.world_from_voxel), (volume.size, volume.world_from_voxel));
    assert_eq!(written.samples, map.hu);
    // Errors of 40, 20, 0, ... -160.
    let whole = map.whole();
    let errors: Vec<f64> = (3..14).map(|x| 100.0 - 20.0 * f64::from(x)).collect();
    let mean = errors.iter().sum::<f64>() / 11.0;
    let rmse = (errors.iter().map(|e| e * e).sum::<f64>() / 11.0).sqrt();
    assert_eq!((whole.voxels, whole.worst_hu, whole.p99_hu), (660, 160.0, 160.0));
    assert!((whole.mean_hu - mean).abs() < 1e-9 && (whole.rmse_hu - rmse).abs() < 1e-9);
}

#[test]
fn tissues_are_told_by_the_value() {
    let gpu = Device::boot();
    let values = [-1000.0, -900.0, -201.0, -200.0, -30.0, 199.0, 200.0, 2999.0, 3000.0, 100.0];
    let volume = volume(|[.., z]| values[z]);
    let roi = Roi::new(vec![1.0; volume.len()], &volume).expect("a region");
    let groups = map(&gpu, &volume, &roi).by_tissue();
    let slice = SIZE[0] * SIZE[1];
    let expected: Vec<_> = [
        ("air, below -900 HU", &[-1000.0f64][..]),
        ("lung, -900 to -200 HU", &[-900.0, -201.0]),
        ("fat, -200 to -30 HU", &[-200.0]),
        ("soft tissue, -30 to 200 HU", &[-30.0, 199.0, 100.0]),
        ("bone, 200 to 3000 HU", &[200.0, 2999.0]),
        ("metal, from 3000 HU", &[3000.0]),
    ]
    .into_iter()
    .map(|(name, values)| {
        let errors: Vec<f64> = values.iter().map(|v| 100.0 - v).collect();
        let n = errors.len() as f64;
        let rmse = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        let worst = errors.iter().fold(0.0f64, |a, e| a.max(e.abs()));
        (name, values.len() * slice, errors.iter().sum::<f64>() / n, rmse, worst)
    })
    .collect();
    for (got, want) in figures(&groups).iter().zip(&expected) {
        assert_eq!((got.0, got.1, got.4), (want.0, want.1, want.4));
        assert!((got.2 - want.2).abs() < 1e-9 && (got.3 - want.3).abs() < 1e-9, "{got:?} for {want:?}");
    }
    assert_eq!(groups.len(), expected.len());
}

#[test]
fn labels_have_their_own_errors() {
    let gpu = Device::boot();
    let volume = volume(|[x, ..]| if x < 4 { 90.0 } else { 130.0 });
    let mut mask = volume.clone();
    mask.samples = (0..volume.len()).map(|i| if place(i)[0] < 4 { 5.0 } else { 9.0 }).collect();
    mask.labels = [(5, "liver".to_owned())].into();
    let choice: LabelChoice = "5,9".parse().expect("labels");
    let roi = Roi::from_mask(&mask, &choice, &volume).expect("a region");
    let labels = Labels::chosen(&mask, &choice, &volume).expect("labels").expect("two of them");
    let groups = map(&gpu, &volume, &roi).by_label(&labels);
    assert_eq!(figures(&groups), [("5 liver", 480, 10.0, 10.0, 10.0), ("9", 1200, -30.0, 30.0, 30.0)]);
}

#[test]
fn distances_are_in_mm() {
    let gpu = Device::boot();
    // The whole volume: the nearest voxel outside is one beyond a face. An error of 1 HU where that is at most 1 mm away, of 2
    // to 2 mm, 3 to 4 mm, 4 beyond.
    let mm = |[x, y, z]: [usize; 3]| {
        let to_face = |at: usize, n: usize, spacing: f64| (at + 1).min(n - at) as f64 * spacing;
        to_face(x, SIZE[0], 1.0).min(to_face(y, SIZE[1], 0.5)).min(to_face(z, SIZE[2], 2.0))
    };
    let class = |at: [usize; 3]| [1.0, 2.0, 4.0].iter().filter(|end| mm(at) > **end).count();
    let boundary = volume(|at| 99.0 - class(at) as f32);
    let roi = Roi::new(vec![1.0; boundary.len()], &boundary).expect("a region");
    let groups = map(&gpu, &boundary, &roi).by_distance_to_boundary();
    let names = ["up to 1 mm", "1 to 2 mm", "2 to 4 mm"];
    assert_eq!(groups.len(), 3, "no voxel is further than 3 mm inside: {groups:?}");
    for (k, (group, name)) in groups.iter().zip(names).enumerate() {
        let voxels = (0..boundary.len()).filter(|&i| class(place(i)) == k).count();
        let error = k as f64 + 1.0;
        assert_eq!((group.name.as_str(), group.voxels), (name, voxels));
        assert_eq!(
            (group.mean_hu, group.rmse_hu, group.p99_hu, group.worst_hu),
            (error, error, error, error)
        );
    }
    // A step at x = 7: the voxels on its two sides have the gradient, 50 HU in 2 mm; the others lie 1, 2, ... mm away.
    let step = volume(|[x, ..]| if x < 7 { 100.0 } else { 150.0 });
    let (groups, strong) = map(&gpu, &step, &roi).by_distance_to_edges();
    assert!((strong - 25.0).abs() < 1e-5, "{strong}");
    let column = SIZE[1] * SIZE[2];
    let found: Vec<_> = groups.iter().map(|g| (g.name.as_str(), g.voxels, g.mean_hu)).collect();
    assert_eq!(
        found,
        [
            ("up to 1 mm", 4 * column, -25.0),
            ("1 to 2 mm", 2 * column, -25.0),
            ("2 to 4 mm", 4 * column, -25.0),
            ("4 to 8 mm", 4 * column, -25.0)
        ]
    );
    let flat = volume(|_| 100.0);
    assert_eq!(map(&gpu, &flat, &roi).by_distance_to_edges(), (vec![], 0.0));
}
