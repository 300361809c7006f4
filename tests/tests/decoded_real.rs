//! Mode decoded on a real CT: how near its pictures are to those of the CT, and what a frame costs beside the other modes.

use std::path::Path;
use std::time::Instant;

use engine::fit::Profile;
use engine::image::{Image, psnr};
use engine::render::{Camera, DecodeOptions, Look, Renderer, Scene, Settings, VolumeSource, mode};
use engine::splat::{Form, Grid, SplatSet};
use engine::transfer::preset;
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use vgs_tests::Device;
use vgs_tests::fitting::Case;

const SIZE: [u32; 2] = [256, 256];
const ITERATIONS: u32 = 60;

#[test]
fn bones_are_as_near_to_the_ct_as_slabs_of_them() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/ct-torso-3mm"));
    if !folder.is_dir() {
        println!("SKIPPED: no real data: ../shared/data/ct-torso-3mm is not there");
        return;
    }
    let read = |name: &str| Volume::read(folder.join(name), &ReadOptions::default()).expect(name);
    let (volume, mask) = (read("ct.nii.gz"), read("mask_bones.nii.gz"));
    let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &volume).expect("a region");
    let field = Profile::named("field").and_then(Profile::config).expect("the field's profile");
    let config = field.with(|c| {
        c.iterations = ITERATIONS;
        c.count.density = 0.1;
    });
    let case = Case { volume, roi, config };
    let gpu = Device::boot();
    let mut fitter = case.fit(&gpu);
    let splats = fitter.splats().expect("splats");
    let field = case.config.field(fitter.scaling().background);
    let grid =
        Grid { size: case.volume.size.map(|n| n as u32), world_from_voxel: case.volume.world_from_voxel };
    let set =
        SplatSet { grid: Some(grid), ..SplatSet::from_voxel(&splats, &case.volume.world_from_voxel, field) };
    let samples = SplatSet { form: Form::Grid, ..set.clone() };
    let source = VolumeSource { volume: &case.volume, roi: Some(&case.roi) };
    for name in ["CT-Bones-Steep", "CT-Soft-Tissue"] {
        let mut transfer = preset(name).expect("a preset").over([-1024.0, 3071.0]);
        transfer.material.shade = false;
        let look = Look::new(transfer);
        let scene = Scene::new(&gpu, Some(&set), Some(&source), &look).expect("a scene");
        let sampled = Scene::new(&gpu, Some(&samples), None, &look).expect("a scene");
        let [low, high] = scene.bounds();
        let centre = (low + high) * 0.5;
        let radius = (high - low).length() * 0.35;
        let cameras = ["anterior", "anterior-left"]
            .map(|side| Camera::from_side(side, centre, radius, 30.0, 1.0).expect("a camera"));
        let shots = |mode_name: &str, scene: &Scene, step: f64, pitch: f64| -> (Vec<Image>, f64, f64) {
            let decoding = DecodeOptions { pitch, ..DecodeOptions::default() };
            let settings = Settings { precise: true, step, decoding, ..Settings::new(SIZE) };
            let start = Instant::now();
            let mut renderer =
                Renderer::new(&gpu, mode(mode_name).expect("a mode"), scene, &settings).expect("a renderer");
            let making = start.elapsed().as_secs_f64();
            let mut frame_ms = f64::INFINITY;
            let mut images = Vec::new();
            for camera in &cameras {
                for _ in 0..2 {
                    let start = Instant::now();
                    renderer.render(scene, &[*camera]).expect("a frame");
                    frame_ms = frame_ms.min(start.elapsed().as_secs_f64() * 1e3);
                }
                images.push(Image {
                    size: SIZE.map(|n| n as usize),
                    pixels: renderer.target.read_colour(0).expect("a picture"),
                });
            }
            (images, making, frame_ms)
        };
        let (reference, ..) = shots("volume", &scene, 0.25, 1.0);
        let near = |shots: &[Image]| {
            let each = shots.iter().zip(&reference).map(|(a, b)| psnr(a, b).expect("one size"));
            each.sum::<f64>() / reference.len() as f64
        };
        let mut found = Vec::new();
        for (label, mode_name, scene, pitch) in [
            ("volume", "volume", &scene, 1.0),
            ("decoded", "decoded", &scene, 1.0),
            ("decoded, samples", "decoded", &sampled, 1.0),
            ("decoded, half the pitch", "decoded", &scene, 0.5),
            ("slab", "slab", &scene, 1.0),
            ("alpha", "alpha", &scene, 1.0),
        ] {
            let (images, making, frame_ms) = shots(mode_name, scene, 0.5, pitch);
            let db = near(&images);
            println!("{name}, {label}: {db:.2} dB, {frame_ms:.0} ms a frame, made in {making:.2} s");
            found.push(db);
        }
        // Least squares bring V nearer to the CT than samples of a fit that is right between the voxels, too.
        assert!(found[1] > found[2] && found[1] > found[4] - 1.5, "{name}: {found:?}");
        assert!(found[5] > found[4] - 7.0, "{name}: alpha is another picture: {found:?}");
    }
}
