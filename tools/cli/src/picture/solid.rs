//! Draws the shaded views: the CT in its region and the splats, from the same place with the same transfer
//! function.

use engine::transfer::{ColourPoint, Light, MAX_INTENSITY, Material, OpacityPoint, Table, TransferFunction};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use reference::eye::Eye;
use reference::raymarch::{Cells, Medium, render};
use reference::slab::Look;

use super::canvas::{Canvas, Colour};
use super::subject::Subject;

/// Direction from the middle of the region to the viewer, RAS: in front, to the patient's left, and above.
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

/// Material of the surfaces.
const MATERIAL: Material =
    Material { shade: true, ambient: 0.25, diffuse: 0.75, specular: 0.12, power: 30.0, occlusion: 0.0 };
/// Distance of the eye in extents of the picture, so large that rays are nearly parallel.
const DISTANCE: f64 = 1e4;

/// The two views, ready to be drawn. Lengths are in mean edges of a voxel, so that the same function serves
/// all grids.
pub struct Solids {
    media: [Medium; 2],
    transfer: TransferFunction,
    range: [f64; 2],
    eye: Eye,
    size: [u32; 2],
    step: f64,
}

impl Solids {
    /// Prepares the two views in images of `width` by at most `height` pixels.
    pub fn new(subject: &Subject, width: usize, height: usize) -> Self {
        let ct = &subject.ct;
        let spacing = ct.spacing_mm();
        let edge = spacing.element_sum() / 3.0;
        let scene_from_voxel = DAffine3::from_scale(DVec3::splat(1.0 / edge)) * ct.world_from_voxel;
        let medium = |hu: &[f32], occupancy: &[f32]| {
            Medium::new(ct.size, scene_from_voxel, &continued(ct.size, hu, occupancy), Some(occupancy))
        };
        let media = [medium(&ct.samples, &subject.roi.weight), medium(&subject.hu, &subject.occupancy)];
        let forward = -TOWARDS_VIEWER.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let up = right.cross(forward);
        let (low, high) = subject
            .region()
            .map(|voxel| scene_from_voxel.transform_point3(voxel))
            .map(|p| DVec2::new(p.dot(right), p.dot(up)))
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        // A region without a voxel of weight one half has no box; any view of it is empty.
        let (low, high) = if low.cmple(high).all() { (low, high) } else { (DVec2::ZERO, DVec2::ONE) };
        let extent = high - low + 2.0 * spacing.max_element() / edge;
        let per_pixel = (extent.x / width as f64).max(extent.y / height as f64);
        let rows = ((extent.y / per_pixel).ceil() as usize).clamp(1, height);
        let middle = (low + high) / 2.0;
        let depth = scene_from_voxel.transform_point3(subject.centre).dot(forward);
        let target = right * middle.x + up * middle.y + forward * depth;
        let distance = DISTANCE * extent.max_element();
        let [x, y] = [width, rows].map(|n| 0.5 * per_pixel * n as f64 / distance);
        let transfer = transfer(subject);
        let [low, high] = transfer.extent();
        Solids {
            media,
            transfer,
            range: [low, high],
            eye: Eye {
                position: target - forward * distance,
                turn: DMat3::from_cols(right, up, forward).transpose(),
                tangents: [-x, x, y, -y],
            },
            size: [width as u32, rows as u32],
            step: 0.4 * spacing.min_element() / edge,
        }
    }

    /// Returns the height of the images, pixels.
    pub fn height(&self) -> usize {
        self.size[1] as usize
    }

    /// Draws one view over `background` by ray marching.
    pub fn draw(&self, canvas: &mut Canvas, which: usize, at: [usize; 2], background: Colour) {
        let look = Look {
            table: &Table::new(&self.transfer, self.range),
            functions: &[],
            material: &MATERIAL,
            light: &Light::default(),
            // The whole region is visible: its surface is where the occupancy falls, whatever the intensity.
            dark: 2.0 * self.range[0] - self.range[1],
            planes: &[],
            segments: false,
            gradient_edge: None,
            least_light: 1e-3,
        };
        let image = render(&self.media[which], &self.eye, self.size, &look, &Cells::even(self.step));
        let size = self.size.map(|n| n as usize);
        canvas.image(at, size, |x, y| {
            let [r, g, b, a] = image[y * size[0] + x];
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

fn transfer(subject: &Subject) -> TransferFunction {
    let [low, high] = subject.percentiles.map(f64::from);
    let span = (high - low).max(1.0);
    let at = |share: f64| (low + span * share).clamp(-MAX_INTENSITY, MAX_INTENSITY);
    let colours =
        RAMP.map(|(share, colour)| ColourPoint { intensity: at(share), colour: DVec3::from_array(colour) });
    let opacities = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| {
        let extinction = EXTINCTION[0] + (EXTINCTION[1] - EXTINCTION[0]) * share;
        OpacityPoint { intensity: at(share), opacity: 1.0 - (-extinction).exp() }
    });
    TransferFunction::new("region", colours.to_vec(), opacities.to_vec(), MATERIAL)
        .expect("finite intensities, and opacities between 0 and 1")
}

/// Returns the intensities. Voxels outside the region that touch it get the mean of their neighbours in it,
/// so that what is outside does not colour the surface.
fn continued(size: [usize; 3], values: &[f32], occupancy: &[f32]) -> Vec<f32> {
    let mut out = values.to_vec();
    for (i, value) in out.iter_mut().enumerate().filter(|(i, _)| occupancy[*i] <= 0.0) {
        let at = [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
        let [xs, ys, zs] = [0, 1, 2].map(|k| at[k].saturating_sub(1)..(at[k] + 2).min(size[k]));
        let (mut sum, mut weight) = (0.0, 0.0);
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let near = x + size[0] * (y + size[1] * z);
                    if occupancy[near] > 0.0 && values[near].is_finite() {
                        sum += occupancy[near] * values[near];
                        weight += occupancy[near];
                    }
                }
            }
        }
        if weight > 0.0 {
            *value = sum / weight;
        }
    }
    out
}
