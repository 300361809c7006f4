//! Edges that change in the headset are those of a session that begins with them.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::support::{device, script, silent};
use engine::coded::coded;
use engine::gpu::Gpu;
use engine::render::{DecodeOptions, Look, Scene, SplatKind, quality_levels};
use engine::transfer::preset;
use engine::volume::edges::Edges;
use engine::volume::{Roi, Volume};
use glam::DAffine3;
use view::io::loader::LoadedVolume;
use xr_app::headset::Pose;
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::start::{Start, view_of};
use xr_app::viewer::{Options, Viewer};

const SMOOTH: Edges = Edges::Within(0.0);

/// Returns a ball of bone, and its mask.
fn ball() -> (Volume, Roi) {
    let inside = |i: usize| {
        let from_middle = [i % 24, i / 24 % 24, i / 576].map(|at| at as f32 - 11.5);
        from_middle.iter().map(|d| d * d).sum::<f32>() < 80.0
    };
    let samples = (0..24usize.pow(3)).map(|i| if inside(i) { 900.0 } else { -100.0 }).collect();
    let volume = Volume::new([24; 3], DAffine3::from_scale(glam::DVec3::splat(5.0)), samples);
    let weight = (0..24usize.pow(3)).map(|i| f32::from(u8::from(inside(i)))).collect();
    let roi = Roi::new(weight, &volume).expect("a region");
    (volume, roi)
}

/// Returns what the eyes see at the end of a session that begins with some edges, where the state wants others.
fn seen(gpu: &Gpu, of_volume: bool, begins: Edges, wanted: Edges) -> Vec<[u8; 4]> {
    let (volume, roi) = ball();
    let look = Look::new(preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]));
    let loaded = LoadedVolume::new(Arc::new(volume.clone()), Some(roi.clone()), None, None);
    let (scene, mode) = if of_volume {
        let shown = loaded.shown(begins);
        (Scene::new(gpu, None, Some(&loaded.source(&shown)), &look), "volume")
    } else {
        let set = coded(&volume, &roi, None, 0.0).expect("a set");
        (Scene::new(gpu, Some(&set), None, &look), "decoded")
    };
    let scene = scene.expect("a scene");
    let mut start = Start { has_region: true, ..view_of(&look, scene.objects(), [-1000.0, 2000.0]) };
    start.state.edges = wanted;
    let levels =
        quality_levels(SplatKind::Grid).iter().map(|level| engine::render::QualityLevel { mode, ..*level });
    let options = Options {
        level: Some(0),
        decoding: DecodeOptions { edges: begins, ..DecodeOptions::default() },
        start: Some(start),
        ..Options::of_levels(levels.collect())
    };
    // Until no words are shown any more.
    let script = Script { head: |_| (Pose::IDENTITY, true), ..script(250) };
    let mut headset = Simulated::new(gpu, script).expect("a headset");
    let mut viewer = Viewer::new(gpu, scene, &headset, options).expect("a viewer");
    viewer.set_volume(loaded);
    viewer.run(&mut headset, &AtomicBool::new(false)).expect("a session");
    headset.picture().read().expect("the picture")
}

#[test]
fn other_edges_are_shown_once_they_are_wanted() {
    let gpu = device();
    for of_volume in [false, true] {
        let smooth = seen(&gpu, of_volume, SMOOTH, SMOOTH);
        let blocks = seen(&gpu, of_volume, Edges::Voxel, Edges::Voxel);
        let differ = smooth.iter().zip(&blocks).filter(|(a, b)| a != b).count();
        assert!(differ > 50, "{differ} pixels differ");
        assert!(seen(&gpu, of_volume, SMOOTH, Edges::Voxel) == blocks, "of a volume: {of_volume}");
        assert!(seen(&gpu, of_volume, Edges::Voxel, SMOOTH) == smooth, "of a volume: {of_volume}");
    }
    silent(&gpu);
}
