//! Regions without splats: what is coded of their voxels, and that it is shown as the volume is.

use engine::coded::{coded, usual_bound};
use engine::error::Kind;
use engine::fidelity::{ShownError, evaluate_decoded, in_volume};
use engine::fit::errors::ErrorMap;
use engine::fit::evaluate::Protocol;
use engine::image::psnr;
use engine::rasterize::{Quantity, rasterize};
use engine::render::{DecodeOptions, Probe, Scene, VolumeSource, decode, decode_as, mode};
use engine::splat::{Region, SplatSet, join, vgs};
use engine::unit::Unit;
use engine::volume::edges::Edges;
use engine::volume::phantom::Phantom;
use engine::volume::{self, BetweenSlices, Labels, Roi, Volume};
use glam::{DAffine3, DVec3};
use vgs_tests::Device;
use vgs_tests::rendering::{camera, look, render, settings};

fn case() -> (Volume, Roi) {
    let phantom = Phantom::new([40, 36, 44], DVec3::new(1.0, 1.5, 2.0), 3);
    let mut volume = phantom.volume();
    volume.samples.iter_mut().for_each(|v| *v = v.round());
    (volume, phantom.roi().expect("a region"))
}

/// The set as a file gives it back.
fn read_again(set: &SplatSet) -> SplatSet {
    let bytes = vgs::encode(set).expect("a file");
    let strict = engine::splat::ReadOptions { strict: true, ..Default::default() };
    let (read, widened) = vgs::decode(&bytes, &strict).expect("the file");
    assert_eq!((vgs::encode(&read).expect("a file"), widened), (bytes, 0), "written again as it was");
    read
}

fn places(volume: &Volume) -> impl Iterator<Item = [usize; 3]> {
    let [nx, ny, _] = volume.size;
    (0..volume.len()).map(move |i| [i % nx, i / nx % ny, i / (nx * ny)])
}

#[test]
fn no_voxel_is_off_by_more_than_the_bound_and_what_is_shown_is_what_is_coded() {
    let gpu = Device::boot();
    let (volume, roi) = case();
    let halves = Volume { samples: volume.samples.iter().map(|v| v * 0.37).collect(), ..volume.clone() };
    for (volume, bound) in [(&volume, 0.0), (&volume, 7.9), (&volume, 30.0), (&halves, 5.0), (&halves, 0.01)]
    {
        let set = read_again(&coded(volume, &roi, None, bound).expect("coded"));
        assert_eq!((set.coded_count(), set.volume_crc32), (roi.voxel_count(), Some(volume.crc32())));
        let mut shown = volume.clone();
        let outside = -5000.0;
        rasterize(&gpu, &set, Quantity::Intensity { outside }, &mut shown).expect("voxels");
        for (i, at) in places(volume).enumerate() {
            let inside = roi.weight[i] > 0.5;
            assert_eq!(shown.samples[i] == outside, !inside, "{at:?}");
            if inside {
                let value = set.voxels[0].at(at.map(|v| v as i64)).expect("in the region");
                assert!((value - f64::from(volume.samples[i])).abs() <= bound + 1e-4, "{at:?} at {bound}");
                // 16 bits hold whole numbers, and of others the range.
                let near = if bound == 0.01 { 0.05 } else { 1e-3 };
                assert!((value - f64::from(shown.samples[i])).abs() < near, "{at:?} at {bound}");
            }
        }
        let protocol = Protocol { offsets: Vec::new(), range: [-1000.0, 2000.0], shell: 0, threshold: 0.0 };
        let found = evaluate_decoded(&gpu, &set, volume, &roi, &protocol).expect("figures");
        let decoded = decode(&gpu, &set, 1.0).expect("a field");
        let map = ErrorMap::of_field(decoded.in_voxels_of(volume, set.origin_mm), volume, &roi);
        let whole = map.whole();
        assert!((found.on_grid.rmse_hu - whole.rmse_hu).abs() < 1e-3 && whole.worst_hu <= bound + 0.06);
        assert_eq!((found.on_grid.occupancy_rmse, map.uncovered), (0.0, 0));
        let error = ShownError::new(&gpu, &set, volume, Some(&roi), &mut |_| ()).expect("a device");
        assert_eq!(error.expect("intensities").voxels, roi.voxel_count());
    }
}

#[test]
fn pictures_are_those_of_the_volume() {
    let gpu = Device::boot();
    let (volume, whole) = case();
    // Of each extent by bricks of 8 voxels, along every axis.
    for (cut, edges) in (0..8).flat_map(|cut| [(cut, Edges::Voxel), (cut, Edges::default())]) {
        let roi = without_last(&whole, cut);
        let (of_volume, of_roi) = volume::shown(&volume, Some(&roi), BetweenSlices::Linear, edges);
        for (bound, least) in [(0.0, 55.0), (30.0, 36.0)].into_iter().take(if cut == 0 { 2 } else { 1 }) {
            let set = coded(&volume, &roi, None, bound).expect("coded");
            let look = look("CT-Bone", true);
            let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
            let source = VolumeSource { volume: &of_volume, roi: of_roi.as_deref() };
            let reference = Scene::new(&gpu, None, Some(&source), &look).expect("a scene");
            let camera = camera(&scene);
            let settings = engine::render::Settings {
                decoding: DecodeOptions { edges, ..DecodeOptions::default() },
                ..settings()
            };
            let [found, wanted] = [("decoded", &scene), ("volume", &reference)].map(|(name, scene)| {
                render(&gpu, mode(name).expect("a mode"), scene, &settings, &[camera]).remove(0)
            });
            let db = psnr(&found, &wanted).expect("of one size");
            assert!(db > least, "{edges:?} at {bound}, without {cut} layers: {db} dB");
        }
    }
}

/// The region without its last `count` layers of voxels along each axis.
fn without_last(roi: &Roi, count: usize) -> Roi {
    let [nx, ny, _] = roi.size;
    let at = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)];
    let inside = || (0..roi.weight.len()).filter(|&i| roi.weight[i] > 0.5);
    let last: [usize; 3] =
        std::array::from_fn(|k| inside().map(|i| at(i)[k]).max().expect("a region") - count);
    let is_left = |i: usize| (0..3).all(|k| at(i)[k] <= last[k]);
    let weight = roi.weight.iter().enumerate().map(|(i, &w)| if is_left(i) { w } else { 0.0 }).collect();
    Roi { weight, ..roi.clone() }
}

#[test]
fn objects_are_told_apart_left_out_and_joined() {
    let gpu = Device::boot();
    let (volume, roi) = case();
    let half = |at: [usize; 3]| if at[2] < 22 { 4.0 } else { 9.0 };
    let mask = Volume {
        samples: places(&volume)
            .zip(&roi.weight)
            .map(|(at, w)| if *w > 0.5 { half(at) } else { 0.0 })
            .collect(),
        labels: [(4, "lower".to_owned())].into(),
        ..volume.clone()
    };
    let labels = Labels::chosen(&mask, &"4,9".parse().expect("a choice"), &volume).expect("labels");
    let set = read_again(&coded(&volume, &roi, labels.as_ref(), 10.0).expect("coded"));
    let names: Vec<_> = set.objects().into_iter().map(|o| (o.number, o.name)).collect();
    assert_eq!(names, [(4, "lower".to_owned()), (9, "label 9".to_owned())]);
    let all: Vec<_> = set.coded().collect();
    let lower = read_again(&set.part(|number, _| number == 4));
    let own: Vec<_> = all.iter().copied().filter(|(number, _)| *number == 4).collect();
    // What is written again, among other neighbours, has the intensities that it had.
    assert!(lower.coded().eq(own));
    assert_eq!(lower.label_names, [(4, "lower".to_owned())]);
    let grid = set.grid.expect("a grid");
    let left = set.part(|_, at| grid.world_from_voxel.inverse().transform_point3(at).x < 20.0);
    assert!(left.coded_count() > 0 && left.coded_count() < set.coded_count());
    assert!(set.part(|_, _| false).is_empty());

    // Beside splats of the same grid, and beside another that is coded.
    let upper = coded(&volume, &upper_of(&roi, &volume), None, 0.0).expect("coded");
    let splats = SplatSet {
        splats: vec![engine::splat::Splat {
            log_scale: [1.0; 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            intensity: 77.0,
            ..Default::default()
        }],
        region: lower.region.clone(),
        labels: Some(vec![4]),
        voxels: Vec::new(),
        ..lower.clone()
    };
    for (name, other) in [("splats", &splats), ("coded", &lower)] {
        let joined = join(vec![("a".into(), other.clone()), ("b".into(), upper.clone())]).expect("one scene");
        let joined = if name == "coded" { read_again(&joined) } else { joined };
        let decoded = decode_as(&gpu, &joined, &DecodeOptions { edges: Edges::Voxel, ..Default::default() })
            .expect("a field");
        let field = decoded.in_voxels_of(&volume, joined.origin_mm);
        for (at, v) in places(&volume).zip(&volume.samples) {
            let place = DVec3::from_array(at.map(|v| v as f64));
            if upper.region.as_ref().is_some_and(|r: &Region| r.at(at.map(|v| v as i64)).is_some()) {
                assert!((field(place).0 - f64::from(*v)).abs() < 0.1, "{name}: {at:?}");
            }
        }
        let twice = join(vec![("c".into(), joined), ("d".into(), upper.clone())]);
        assert_eq!(twice.expect_err("joined before").code, "VGS-SPLAT-003");
    }
}

fn upper_of(roi: &Roi, volume: &Volume) -> Roi {
    let weight = places(volume).zip(&roi.weight).map(|(at, w)| if at[2] >= 22 { *w } else { 0.0 });
    Roi::new(weight.collect(), volume).expect("a region")
}

#[test]
fn a_probe_reads_what_is_coded() {
    let (volume, roi) = case();
    let set = coded(&volume, &roi, None, 0.0).expect("coded");
    let probe = Probe::new(&set);
    let mut read = 0;
    for (i, at) in places(&volume).enumerate() {
        let place = volume.world_from_voxel.transform_point3(DVec3::from_array(at.map(|v| v as f64)));
        let found = probe.at(place).filter(|reading| reading.occupancy > 0.5);
        assert_eq!(found.is_some(), roi.weight[i] > 0.5, "{at:?}");
        if let Some(reading) = found {
            assert!((reading.intensity - f64::from(volume.samples[i])).abs() < 1e-3, "{at:?}");
            read += 1;
        }
    }
    assert_eq!(read, roi.voxel_count());
    let [low, high] = engine::render::bounds(&set);
    let from = DVec3::new(low.x - 50.0, (low.y + high.y) * 0.5, (low.z + high.z) * 0.5);
    let hit = probe.along(from, DVec3::X, &look("CT-Bone", true)).expect("a surface");
    assert!((low.x..high.x).contains(&hit.at_mm.x), "{hit:?}");
}

#[test]
fn what_cannot_be_coded_is_refused() {
    let (volume, roi) = case();
    let code = |volume: &Volume, roi: &Roi, bound: f64| {
        coded(volume, roi, None, bound).map_err(|e| (e.kind, e.code))
    };
    for bound in [-1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert_eq!(code(&volume, &roi, bound).expect_err("a bound"), (Kind::Usage, "VGS-CODE-003"));
    }
    let halves = Volume { samples: volume.samples.iter().map(|v| v * 0.5).collect(), ..volume.clone() };
    assert_eq!(code(&halves, &roi, 0.0).expect_err("no whole numbers"), (Kind::Usage, "VGS-CODE-003"));
    let soft = Roi { soft: true, ..roi.clone() };
    assert_eq!(code(&volume, &soft, 1.0).expect_err("soft"), (Kind::Usage, "VGS-CODE-001"));
    let none = Roi { weight: vec![0.0; volume.len()], ..roi.clone() };
    assert_eq!(code(&volume, &none, 1.0).expect_err("empty"), (Kind::NothingToDo, "VGS-CODE-002"));
    let holes = Volume { samples: vec![f32::NAN; volume.len()], ..volume.clone() };
    assert_eq!(code(&holes, &roi, 1.0).expect_err("holes"), (Kind::NothingToDo, "VGS-CODE-002"));
    assert_eq!(usual_bound(&volume, &roi), 30.0);
    let other = Volume { stated_unit: Some(Unit::Arbitrary), ..volume.clone() };
    assert!(usual_bound(&other, &roi) < 30.0);
    // One voxel, at a corner, and all of them.
    for (size, count) in [([1, 1, 1], 1), ([3, 4, 5], 60)] {
        let tiny = Volume::new(size, DAffine3::IDENTITY, vec![5.0; count]);
        let all = Roi::new(vec![1.0; count], &tiny).expect("a region");
        assert_eq!(read_again(&coded(&tiny, &all, None, 0.0).expect("coded")).coded_count(), count);
    }
}

/// Voxels are compared with what lies where they do, not where the box around them does.
#[test]
fn only_what_lies_in_a_volume_is_compared_with_it() {
    let size = [20usize; 3];
    let along = |i: usize| i % 20 == i / 20 % 20 && i % 20 == i / 400;
    let volume = Volume::new(size, DAffine3::IDENTITY, vec![100.0; 8000]);
    let roi = Roi::new((0..8000).map(|i| f32::from(u8::from(along(i)))).collect(), &volume).expect("a line");
    let set = coded(&volume, &roi, None, 0.0).expect("a set");
    let at = |place: DVec3| Volume::new([4; 3], DAffine3::from_translation(place), vec![100.0; 64]);
    assert!(in_volume(&set, &at(DVec3::splat(14.0))).is_ok(), "on the line");
    let beside = in_volume(&set, &at(DVec3::new(14.0, 1.0, 7.0))).expect_err("beside the line");
    assert_eq!(beside.code, "VGS-FIT-041");
}
