//! `project_quads` and mode alpha: splats as ellipses on a picture, and the picture that they make back to
//! front.
//!
//! The computation is plain: each ellipse comes from the conditional covariance across the ray, and every
//! pixel visits every splat.

use glam::{DMat2, DMat3, DVec2, DVec3, DVec4};
use shader_interface::types::Centre;

use super::Splat;
use super::eye::{Appearance, Eye, Gathered, lit, tinted};
use super::slab::NEAREST;
use super::types::vec3;
use transfer::{Light, Material};

/// A splat is drawn where its opacity is at least this.
pub const LEAST_OPACITY: f64 = 1.0 / 255.0;
/// Greatest opacity of a standard splat.
pub const MOST_OPACITY: f64 = 0.99;
/// q at the edge of what is drawn for a splat.
const DRAWN_Q: f64 = 6.0;

/// Settings of a picture.
pub struct Look<'a> {
    /// Material of what is shaded.
    pub material: &'a Material,
    /// The light.
    pub light: &'a Light,
    /// v0 of the shaded gradient.
    pub dark: f64,
    /// Clip planes: a splat whose centre has n · x + d < 0 is cut away.
    pub planes: &'a [[f64; 4]],
    /// What the variances of standard splats on the picture grow by, pixels².
    pub widening: f64,
}

/// Source of a splat's colour.
pub enum Face<'a> {
    /// The medium that it draws (extinction times colour, extinction, 1/mm), and the gradients at its centre.
    Medium(DVec4, &'a Centre),
    /// Its own colour, towards the viewer: a standard splat.
    Own(DVec3),
}

/// A splat as an eye sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Place of the centre, pixels from the upper left corner.
    pub centre: DVec2,
    /// Covariance of the ellipse, pixels²: γ = d · covariance⁻¹ d.
    pub covariance: DMat2,
    /// Optical depth through the centre; of a standard splat the opacity.
    pub thickness: f64,
    /// True if it is a standard splat.
    pub standard: bool,
    /// z of the centre, mm.
    pub depth: f64,
    /// Colour, not premultiplied.
    pub colour: DVec3,
}

impl Quad {
    /// Returns the opacity at a place of the picture, pixels; 0 below [`LEAST_OPACITY`].
    pub fn opacity(&self, place: DVec2) -> f64 {
        let d = place - self.centre;
        let gamma = d.dot(self.covariance.inverse() * d);
        let opacity = if self.standard {
            (self.thickness * (-0.5 * gamma).exp()).min(MOST_OPACITY)
        } else {
            1.0 - (-self.thickness * (1.0 - gamma / DRAWN_Q).max(0.0).powi(2)).exp()
        };
        if opacity < LEAST_OPACITY { 0.0 } else { opacity }
    }

    /// Returns the γ at which the opacity falls below [`LEAST_OPACITY`].
    pub fn edge(&self) -> f64 {
        if self.standard {
            return 2.0 * (self.thickness / LEAST_OPACITY).ln();
        }
        let least = -(1.0 - LEAST_OPACITY).ln();
        DRAWN_Q * (1.0 - (least / self.thickness).sqrt())
    }
}

/// Projects a splat of an object to its quad on a picture of `size` pixels. Returns `None` if the splat
/// cannot be seen: it is behind the eye or too near, cut away, too faint, or beside the picture.
pub fn quad(
    splat: &Splat,
    face: &Face<'_>,
    object: &Appearance,
    eye: &Eye,
    size: [u32; 2],
    look: &Look<'_>,
) -> Option<Quad> {
    let mean = eye.seen(splat.mean);
    let cut = look.planes.iter().any(|&[x, y, z, d]| DVec3::new(x, y, z).dot(splat.mean) + d < 0.0);
    if mean.z <= NEAREST || cut {
        return None;
    }
    // The precision matrix with the axes: along the ray through the centre per depth, x, y.
    let ray = mean / mean.z;
    let basis = DMat3::from_cols(ray, DVec3::X, DVec3::Y);
    let turned = eye.turn * DMat3::from_quat(splat.rotation);
    let whitening = DMat3::from_diagonal((-splat.log_scale).exp()) * turned.transpose() * basis;
    let precision = whitening.transpose() * whitening;
    // The least q along the ray: the Schur complement of the ray's own entry.
    let [along, ax, ay] = precision.x_axis.to_array();
    let aside = |i: usize, j: usize, a: f64, b: f64| precision.col(i)[j] - a * b / along;
    let across = DMat2::from_cols_array(&[
        aside(1, 1, ax, ax),
        aside(1, 2, ax, ay),
        aside(2, 1, ay, ax),
        aside(2, 2, ay, ay),
    ]);
    // Scale from mm at the depth of the centre to pixels.
    let [left, right, up, down] = eye.tangents;
    let [width, height] = size.map(f64::from);
    let scale = DVec2::new(width / (right - left), height / (down - up));
    let pixels = DMat2::from_diagonal(scale / mean.z);
    let mut covariance = pixels * across.inverse() * pixels;
    let centre = (ray.truncate() - DVec2::new(left, up)) * scale;
    let (thickness, standard, colour) = match face {
        Face::Own(colour) => {
            covariance += DMat2::from_diagonal(DVec2::splat(look.widening));
            let opacity = object.opacity / (1.0 + (-splat.opacity_logit).exp());
            (opacity, true, tinted(*colour, object.tint))
        }
        Face::Medium(medium, field) => {
            let extinction = medium.w;
            let base = tinted((medium.truncate() / extinction).min(DVec3::ONE), object.tint);
            // A factor of the opacity per mm.
            let extinction = -(1.0 - object.opacity * (1.0 - (-extinction).exp())).ln();
            // ∫ (1 - A l²/6)^(3/2) dl with A per mm of ray.
            let path = ray.length() * (DRAWN_Q / along).sqrt() * std::f64::consts::PI * 0.375;
            let gradient = eye.turn * (vec3(field.slope) - vec3(field.occupancy_slope) * look.dark);
            let colour = if look.material.shade {
                lit(base, gradient, ray, look.material, &eye.lamp(look.light), 1.0)
            } else {
                base
            };
            (extinction * path, false, colour)
        }
    };
    let quad = Quad { centre, covariance, thickness, standard, depth: mean.z, colour };
    let edge = quad.edge();
    if edge.is_nan() || edge <= 0.0 {
        return None;
    }
    let reach = DVec2::new(covariance.x_axis.x, covariance.y_axis.y) * edge;
    let reach = reach.map(f64::sqrt);
    let beside =
        (centre + reach).cmplt(DVec2::ZERO).any() || (centre - reach).cmpgt(DVec2::new(width, height)).any();
    (!beside).then_some(quad)
}

/// Returns how far a splat is behind the origin of the scene along the mean of the viewing directions; the
/// splat with the least is in front.
pub fn behind(splat: &Splat, eyes: &[Eye]) -> f64 {
    let forward = |eye: &Eye| eye.turn.row(2);
    let mean = forward(&eyes[0]) + forward(&eyes[eyes.len() - 1]);
    splat.mean.dot(mean.normalize())
}

/// Gathers what a pixel sees of quads, given in order from the nearest to the farthest.
pub fn pixel(nearest_first: &[Quad], place: DVec2) -> Gathered {
    let mut gathered = Gathered::default();
    for quad in nearest_first {
        let opacity = quad.opacity(place);
        if opacity > 0.0 {
            gathered.add(quad.colour, opacity, quad.depth);
        }
    }
    gathered
}
