//! What the tests of the loop share: a device, a scene, a script.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

pub mod monado;
pub mod screen;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use engine::gpu::{Gpu, GpuOptions};
use engine::image::{self, Image, WriteOptions};
use engine::render::{Look, Quality, QualityLevel, Scene, SplatKind, quality_levels};
use engine::splat::{Field, Splat, SplatSet};
use engine::transfer::preset;
use glam::DVec3;
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::viewer::{Options, Viewer};

/// Returns a device with validation layers, which must have nothing to say in the end.
pub fn device() -> Gpu {
    Gpu::new(&GpuOptions { validation: true, ..GpuOptions::default() })
        .expect("a device with validation layers")
}

pub fn silent(gpu: &Gpu) {
    gpu.wait_idle().expect("a live device");
    assert_eq!(gpu.validation_messages(), Vec::<String>::new());
}

/// Returns a cross of dense splats, longer at the patient's left and head, so that a mirrored picture is
/// another one.
pub fn set() -> SplatSet {
    let splat = |mean: [f32; 3], intensity| Splat {
        mean,
        opacity_logit: 3.0,
        rotation: [1.0, 0.0, 0.0, 0.0],
        log_scale: [1.6; 3],
        intensity,
    };
    let mut splats = vec![];
    for i in 0..20 {
        let t = 6.0 * i as f32;
        splats.push(splat([-t, 0.0, 0.0], 700.0));
        splats.push(splat([0.0, 0.0, 0.5 * t], 500.0));
        splats.push(splat([0.3 * t, 0.0, 0.0], 900.0));
        splats.push(splat([0.0, 0.3 * t, 0.0], 1200.0));
    }
    SplatSet {
        splats,
        field: Field::default(),
        origin_mm: DVec3::new(9.0, 80.0, -400.0),
        ..SplatSet::default()
    }
}

pub fn scene(gpu: &Gpu) -> Scene {
    try_scene(gpu).expect("a scene")
}

pub fn try_scene(gpu: &Gpu) -> engine::Result<Scene> {
    let look = Look::new(preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]));
    Scene::new(gpu, Some(&set()), None, &look)
}

pub fn script(frames: u64) -> Script {
    Script { eye_size: [96, 112], real_time: false, frames: Some(frames), ..Script::default() }
}

/// Returns the levels of these splats, after one in mode slab and before one in mode alpha.
pub fn all_levels() -> Vec<QualityLevel> {
    let mut all = vec![QualityLevel { mode: "slab", quality: Quality::FULL, cost: 1.5 }];
    all.extend(quality_levels(SplatKind::Field));
    let last = all.last().expect("levels").cost;
    let quality = Quality { resolution: 0.7, coarseness: 1.0, occlusion: false };
    all.push(QualityLevel { mode: "alpha", quality, cost: 0.5 * last });
    all
}

pub fn options() -> Options {
    let levels = Options::of_levels(all_levels());
    Options { budget_ms: Some(1e9), background: [0.2, 0.1, 0.0], ..levels }
}

/// Writes a picture of both eyes side by side into the folder that `VGS_SHOTS` names, if it does, to be looked at.
pub fn keep(name: &str, [width, height]: [u32; 2], eyes: &[[u8; 4]]) {
    let Some(folder) = std::env::var_os("VGS_SHOTS") else { return };
    let [width, height] = [width, height].map(|n| n as usize);
    let eye = |at: usize| eyes[at * width * height..][..width * height].chunks(width);
    let rows = eye(0).zip(eye(1)).flat_map(|(left, right)| left.iter().chain(right));
    let pixels = rows.map(|texel| texel.map(|byte| f32::from(byte) / 255.0)).collect();
    let both = Image { size: [2 * width, height], pixels };
    let options = WriteOptions { background: Some([0.0; 3]), force: true, ..WriteOptions::default() };
    image::write(Path::new(&folder).join(format!("{name}.png")), &both, None, &options).expect("a picture");
}

pub fn session(gpu: &Gpu, script: Script, options: Options) -> (Viewer, Simulated) {
    let mut headset = Simulated::new(gpu, script).expect("a headset");
    let mut viewer = Viewer::new(gpu, scene(gpu), &headset, options).expect("a viewer");
    viewer.run(&mut headset, &AtomicBool::new(false)).expect("a session");
    (viewer, headset)
}
