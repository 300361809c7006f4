//! A scene of random splats, its pictures in any mode, and its picture by the reference implementation of
//! mode slab.

use engine::gpu::Gpu;
use engine::image::Image;
use engine::render::{Camera, Look, MODES, ModeRow, Renderer, Scene, Settings};
use engine::splat::{Field, Kernel, Splat, SplatSet};
use engine::transfer::{FixedTo, Light, Table, TransferFunction, preset};
use engine::unit::Unit;
use glam::{DVec3, DVec4, Vec3};
use rand::RngExt;
use reference::eye::{self, Eye};
use reference::slab;

use crate::scene::{random, splat};

/// Size of the pictures.
pub const SIZE: [u32; 2] = [72, 56];

/// Creates splats in a ball of 30 mm about a place far from the world's origin, soft and dense ones apart
/// from each other.
pub fn set(count: usize, kernel: Kernel) -> SplatSet {
    let mut rng = random(21);
    let splats = (0..count)
        .map(|_| {
            let mut s = splat(&mut rng, Vec3::splat(50.0));
            s.mean = s.mean.map(|v| v - 25.0);
            s.log_scale = s.log_scale.map(|v| v + 0.9);
            s.intensity = if s.mean[0] > 0.0 {
                rng.random_range(-80.0f32..60.0)
            } else {
                rng.random_range(300.0f32..900.0)
            };
            s
        })
        .collect();
    SplatSet {
        splats,
        origin_mm: DVec3::new(-120.0, 340.0, 1000.0),
        field: Field { kernel, background: 200.0, ..Field::default() },
        unit: Unit::Hu,
        ..SplatSet::default()
    }
}

/// Creates a set without splats.
pub fn empty() -> SplatSet {
    SplatSet { unit: Unit::Hu, ..SplatSet::default() }
}

/// A light that is fixed to the patient, at the right and above, with a fill light: all that the first light has not.
pub const SIDE_LIGHT: Light = Light { fixed_to: FixedTo::Patient, towards: [0.9, 0.3, 0.5], fill: 0.35 };

/// Creates the look of a preset over −100 to 900 HU, lit or not.
pub fn look(name: &str, shade: bool) -> Look {
    let mut transfer: TransferFunction = preset(name).expect("a preset").over([-100.0, 900.0]);
    transfer.material.shade = shade;
    Look::new(transfer)
}

/// Returns settings for pictures of [`SIZE`] in f32.
pub fn settings() -> Settings {
    Settings { precise: true, ..Settings::new(SIZE) }
}

/// Creates a camera that sees all of the scene, with the tails of splats, from the patient's left front.
pub fn camera(scene: &Scene) -> Camera {
    let tails = scene.splats.as_ref().map(|splats| splats.bounds.map(|corner| corner + scene.origin));
    let [low, high] = tails.unwrap_or_else(|| scene.bounds());
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    Camera::from_side("anterior-left", (low + high) * 0.5, (high - low).length() * 0.35, 40.0, aspect)
        .expect("a camera")
}

/// Renders a picture for each camera.
pub fn render(
    gpu: &Gpu,
    row: &ModeRow,
    scene: &Scene,
    settings: &Settings,
    cameras: &[Camera],
) -> Vec<Image> {
    let mut renderer = Renderer::new(gpu, row, scene, settings).expect("a renderer");
    renderer.render(scene, cameras).expect("a frame");
    (0..settings.views)
        .map(|view| Image {
            size: settings.size.map(|n| n as usize),
            pixels: renderer.target.read_colour(view).expect("a picture"),
        })
        .collect()
}

/// Returns the modes that show splats.
pub fn of_splats() -> impl Iterator<Item = &'static ModeRow> {
    MODES.iter().filter(|row| row.of_splats)
}

/// Renders a set with the reference implementation, at planes as the mode places them.
pub fn reference_picture(set: &SplatSet, scene: &Scene, camera: &Camera, look: &Look, step: f64) -> Image {
    let gpu_splats = scene.splats.as_ref().expect("splats");
    let eye = Eye::from(&camera.view(scene.origin));
    let background = f64::from(set.field.background);
    let appearance = |splat: usize| {
        let label = set.labels.as_ref().map_or(0, |labels| labels[splat]);
        let shown = look.objects.get(&label).copied().unwrap_or_default();
        let tint = shown.tint.map_or(DVec4::ZERO, |t| Vec3::from_array(t).as_dvec3().extend(1.0));
        eye::Appearance { tint, opacity: f64::from(shown.opacity) }
    };
    let seen = |(i, s): (usize, &Splat)| {
        let seen = slab::seen(&s.into(), &eye, set.field.kernel, background)?;
        Some(slab::Seen { appearance: appearance(i), ..seen })
    };
    let splats: Vec<_> = set.splats.iter().enumerate().filter_map(seen).collect();
    let [low, high] = gpu_splats.bounds;
    let radius = (high - low).length() * 0.5;
    let spacing = gpu_splats.sigma_mm * step;
    let first = (eye.seen((low + high) * 0.5).z - radius).max(1.0);
    let planes = slab::Planes { first, spacing, count: (2.0 * radius / spacing).ceil() as u32 + 8 };
    let table = Table::new(&look.transfer, gpu_splats.range);
    let [visible, _] = look.transfer.visible().expect("something to see");
    let reference_look = slab::Look {
        table: &table,
        functions: &[],
        material: &look.transfer.material,
        light: &look.light,
        dark: if visible.is_finite() { visible } else { gpu_splats.range[0] },
        planes: &[],
        segments: false,
        gradient_edge: None,
        least_light: 1e-4,
    };
    let size = SIZE.map(|n| n as usize);
    let pixels = (0..size[0] * size[1])
        .map(|i| {
            let ray = eye.ray([(i % size[0]) as f64 + 0.5, (i / size[0]) as f64 + 0.5], SIZE);
            slab::ray(&splats, &set.field, &eye, ray, &planes, &reference_look).pixel().map(|v| v as f32)
        })
        .collect();
    Image { size, pixels }
}
