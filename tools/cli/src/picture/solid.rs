//! Draws the shaded views: the CT in its region and the splats, from the same place through the same transfer function,
//! as `vgs render` shows them.

use engine::Result;
use engine::gpu::Gpu;
use engine::render::{
    Camera, Fov, Intensities, Look, OF_VOLUMES, Renderer, Scene, Settings, SplatKind, VolumeSource, mode,
};
use engine::splat::SplatSet;
use engine::transfer::{TransferFunction, preset};
use glam::{DVec2, DVec3};

use super::canvas::{Canvas, Colour};
use super::subject::Subject;

/// Direction from the middle of the region to the viewer, RAS: in front, to the patient's left, and above.
const TOWARDS_VIEWER: DVec3 = DVec3::new(-0.45, 0.85, 0.28);
/// Distance of the eye in extents of the picture, so large that rays are nearly parallel.
const DISTANCE: f64 = 12.0;

/// The two views, rendered.
pub struct Solids {
    /// Colours of the CT and of the splats, with premultiplied opacity.
    pictures: [Vec<[f32; 4]>; 2],
    transfer: TransferFunction,
    range: [f64; 2],
    size: [u32; 2],
}

impl Solids {
    /// Renders the two views in images of `width` by at most `height` pixels, through the preset that suits the splats.
    ///
    /// # Errors
    /// Fails if the device fails or has no memory for the scenes.
    pub fn new(gpu: &Gpu, set: &SplatSet, subject: &Subject, [width, height]: [usize; 2]) -> Result<Self> {
        let forward = -TOWARDS_VIEWER.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let up = right.cross(forward);
        let world = |voxel: DVec3| subject.ct.world_from_voxel.transform_point3(voxel);
        let (low, high) = subject
            .region()
            .map(world)
            .map(|p| DVec2::new(p.dot(right), p.dot(up)))
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        // A region without a voxel of weight one half has no box; any view of it is empty.
        let (low, high) = if low.cmple(high).all() { (low, high) } else { (DVec2::ZERO, DVec2::ONE) };
        let extent = high - low + 2.0 * subject.ct.spacing_mm().max_element();
        let per_pixel = (extent.x / width as f64).max(extent.y / height as f64);
        let rows = ((extent.y / per_pixel).ceil() as usize).clamp(1, height);
        let middle = (low + high) / 2.0;
        let target = right * middle.x + up * middle.y + forward * world(subject.centre).dot(forward);
        let distance = DISTANCE * extent.max_element();
        let [x, y] = [width, rows].map(|n| 0.5 * per_pixel * n as f64 / distance);
        let fov = Fov { left: -x, right: x, up: y, down: -y };
        let camera = Camera::looking(target - forward * distance, target, up, fov)?;

        let range = subject.percentiles.map(f64::from);
        let name = Intensities::of_set(set).suiting_preset(subject.ct.unit());
        let transfer = preset(name)?.over(set.intensity_range().unwrap_or(range));
        let look = Look::new(transfer.clone());
        let size = [width as u32, rows as u32];
        let source = VolumeSource { volume: &subject.ct, roi: Some(&subject.roi) };
        let render = |splats: Option<&SplatSet>, mode_name| {
            let volume = splats.is_none().then_some(&source);
            let scene = Scene::new(gpu, splats, volume, &look)?;
            let row = mode(mode_name)?;
            let settings = Settings { step: row.step, ..Settings::new(size) };
            let mut renderer = Renderer::new(gpu, row, &scene, &settings)?;
            renderer.render(&scene, &[camera])?;
            renderer.target.read_colour(0)
        };
        let pictures = [render(None, OF_VOLUMES)?, render(Some(set), SplatKind::of(set).usual_mode())?];
        Ok(Solids { pictures, transfer, range, size })
    }

    /// Returns the height of the images, pixels.
    pub fn height(&self) -> usize {
        self.size[1] as usize
    }

    /// Returns the name of the transfer function.
    pub fn transfer(&self) -> &str {
        &self.transfer.name
    }

    /// Draws one view over `background`.
    pub fn draw(&self, canvas: &mut Canvas, which: usize, at: [usize; 2], background: Colour) {
        let size = self.size.map(|n| n as usize);
        canvas.image(at, size, |x, y| {
            let [r, g, b, a] = self.pictures[which][y * size[0] + x];
            let over = |light: f32, below: u8| {
                (255.0 * light + f32::from(below) * (1.0 - a)).round().clamp(0.0, 255.0) as u8
            };
            [over(r, background[0]), over(g, background[1]), over(b, background[2])]
        });
    }

    /// Returns the unlit colour for a share of the region's range.
    pub fn ramp(&self, share: f64) -> Colour {
        let [low, high] = self.range;
        (self.transfer.at(low + (high - low) * share).0 * 255.0).to_array().map(|v| v.round() as u8)
    }
}
