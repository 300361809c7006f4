//! The shaded views: the CT in its region and the splats, from the same place with the same transfer function.

use engine::reference::raymarch::{Camera, ControlPoint, Medium, TransferFunction, render};
use glam::{DVec2, DVec3};

use super::canvas::{Canvas, Colour};
use super::subject::Subject;

/// From the middle of the region to the viewer, RAS: in front, to the patient's left, and above.
const TOWARDS_VIEWER: DVec3 = DVec3::new(-0.45, 0.85, 0.28);
/// Colours from the least to the greatest intensity of the region.
const RAMP: [(f64, [f64; 3]); 4] = [
    (0.0, [0.55, 0.23, 0.16]),
    (0.35, [0.86, 0.58, 0.38]),
    (0.7, [0.97, 0.88, 0.72]),
    (1.0, [1.0, 1.0, 0.98]),
];
/// Extinction at the ends of the ramp, per voxel: most of the light ends at the surface.
const EXTINCTION: [f64; 2] = [0.9, 2.5];

/// The two views, ready to be drawn.
pub struct Solids {
    media: [Medium; 2],
    transfer: TransferFunction,
    camera: Camera,
    step: f64,
}

impl Solids {
    /// In images of `width` by at most `height` pixels.
    pub fn new(subject: &Subject, width: usize, height: usize) -> Self {
        let ct = &subject.ct;
        let medium = |hu: &[f32], occupancy: &[f32]| Medium::new(ct.size, ct.world_from_voxel, hu, occupancy);
        let media = [medium(&ct.samples, &subject.roi.weight), medium(&subject.hu, &subject.occupancy)];
        let forward = -TOWARDS_VIEWER.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let up = right.cross(forward);
        let (low, high) = subject
            .region()
            .map(|voxel| ct.world_from_voxel.transform_point3(voxel))
            .map(|p| DVec2::new(p.dot(right), p.dot(up)))
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        // A region without a voxel of weight one half has no box: any view of it is empty.
        let (low, high) = if low.cmple(high).all() { (low, high) } else { (DVec2::ZERO, DVec2::ONE) };
        let extent = high - low + 2.0 * ct.spacing_mm().max_element();
        let mm_per_pixel = (extent.x / width as f64).max(extent.y / height as f64);
        let rows = ((extent.y / mm_per_pixel).ceil() as usize).clamp(1, height);
        let middle = (low + high) / 2.0;
        let depth = ct.world_from_voxel.transform_point3(subject.centre).dot(forward);
        let target = right * middle.x + up * middle.y + forward * depth;
        let spacing = ct.spacing_mm();
        Solids {
            media,
            transfer: transfer(subject, spacing.element_sum() / 3.0),
            camera: Camera { target, right, up, mm_per_pixel, size: [width, rows] },
            step: 0.4 * spacing.min_element(),
        }
    }

    /// Height of the images, pixels.
    pub fn height(&self) -> usize {
        self.camera.size[1]
    }

    /// Marches the rays of one view and draws it over `background`.
    pub fn draw(&self, canvas: &mut Canvas, which: usize, at: [usize; 2], background: Colour) {
        let image = render(&self.media[which], &self.transfer, &self.camera, self.step);
        let [width, _] = self.camera.size;
        canvas.image(at, self.camera.size, |x, y| {
            let [r, g, b, a] = image[y * width + x];
            let over = |light: f32, below: u8| {
                (255.0 * light + f32::from(below) * (1.0 - a)).round().clamp(0.0, 255.0) as u8
            };
            [over(r, background[0]), over(g, background[1]), over(b, background[2])]
        });
    }

    /// The colour that stands for a share of the region's range, unlit.
    pub fn ramp(&self, share: f64) -> Colour {
        let (first, last) = (self.transfer.0.first(), self.transfer.0.last());
        let (low, high) = first.zip(last).map_or((0.0, 1.0), |(a, b)| (a.hu, b.hu));
        let colour = self.transfer.at(low + (high - low) * share).0;
        (colour * 255.0).to_array().map(|v| v.round() as u8)
    }
}

fn transfer(subject: &Subject, voxel_mm: f64) -> TransferFunction {
    let [low, high] = subject.percentiles.map(f64::from);
    let span = (high - low).max(1.0);
    let point = |(share, colour): (f64, [f64; 3])| ControlPoint {
        hu: low + span * share,
        colour: DVec3::from_array(colour),
        extinction: (EXTINCTION[0] + (EXTINCTION[1] - EXTINCTION[0]) * share) / voxel_mm,
    };
    TransferFunction(RAMP.map(point).to_vec())
}
