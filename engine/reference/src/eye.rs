//! Rays, light and the sum along a ray, shared by the reference implementations of all render modes.

use glam::{DMat3, DVec3, DVec4};
use shader_interface::types::View;

use super::types::vec3;
use transfer::{FixedTo, Light, Material};

/// One eye, in f64. Eye space: x to the right, y up, z the distance along the viewing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Position, mm in the space of the scene.
    pub position: DVec3,
    /// Rotation from the scene to eye space.
    pub turn: DMat3,
    /// x/z of the left and the right edge of the picture, y/z of the upper and the lower one.
    pub tangents: [f64; 4],
}

impl From<&View> for Eye {
    fn from(v: &View) -> Self {
        let rows = DMat3::from_cols(vec3(v.right), vec3(v.up), vec3(v.forward));
        Eye { position: vec3(v.eye), turn: rows.transpose(), tangents: v.tangents.map(f64::from) }
    }
}

impl Eye {
    /// Transforms a point of the scene into eye space.
    pub fn seen(&self, x: DVec3) -> DVec3 {
        self.turn * (x - self.position)
    }

    /// Returns the ray through a place of a picture of `size` pixels, in eye space with depth 1. The place is
    /// given in pixels from the upper left corner.
    pub fn ray(&self, place: [f64; 2], size: [u32; 2]) -> DVec3 {
        let [left, right, up, down] = self.tangents;
        let part = |axis: usize| place[axis] / f64::from(size[axis]);
        DVec3::new(left + (right - left) * part(0), up + (down - up) * part(1), 1.0)
    }

    /// Rotates a ray into the scene: the point at depth z is position + z times the result.
    pub fn direction(&self, ray: DVec3) -> DVec3 {
        self.turn.transpose() * ray
    }

    /// Returns a light as this eye has it.
    pub fn lamp(&self, light: &Light) -> Lamp {
        let towards = light.direction();
        let key = match light.fixed_to {
            FixedTo::Camera => DVec3::new(towards.x, towards.y, -towards.z),
            FixedTo::Patient => self.turn * towards,
        };
        Lamp { key, fill: light.fill }
    }

    /// Returns the depths between which a ray is inside all clip planes (n · x + d ≥ 0).
    pub fn clipped(&self, ray: DVec3, planes: &[[f64; 4]]) -> [f64; 2] {
        let direction = self.direction(ray);
        let mut range = [0.0f64, f64::INFINITY];
        for &[x, y, z, d] in planes {
            let normal = DVec3::new(x, y, z);
            let at = normal.dot(self.position) + d;
            let slope = normal.dot(direction);
            if slope > 0.0 {
                range[0] = range[0].max(-at / slope);
            } else if slope < 0.0 {
                range[1] = range[1].min(-at / slope);
            } else if at < 0.0 {
                range[1] = -1.0;
            }
        }
        range
    }
}

/// A light in eye space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Unit vector towards the key light.
    pub key: DVec3,
    /// Share of the fill light, which is mirrored from left to right.
    pub fill: f64,
}

/// Shades a colour after Blinn and Phong; both sides of a surface are lit alike, and the fill light has no highlight.
/// Gradient and ray are in eye space; `light` is the share of the light that arrives, 1 without ambient occlusion.
pub fn lit(base: DVec3, gradient: DVec3, ray: DVec3, material: &Material, lamp: &Lamp, light: f64) -> DVec3 {
    let Some(normal) = gradient.try_normalize() else { return base };
    let halfway = (lamp.key - ray.normalize()).normalize();
    let mirrored = DVec3::new(-lamp.key.x, lamp.key.y, lamp.key.z);
    let diffuse = (1.0 - lamp.fill) * normal.dot(lamp.key).abs() + lamp.fill * normal.dot(mirrored).abs();
    let shine = normal.dot(halfway).abs().powf(material.power);
    let lit = base * (material.ambient + material.diffuse * diffuse) + material.specular * shine;
    (lit * light).min(DVec3::ONE)
}

/// Appearance of a splat's object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// A colour, and the share of the transfer function's colour that it replaces.
    pub tint: DVec4,
    /// Factor of the occupancy.
    pub opacity: f64,
}

impl Default for Appearance {
    /// Returns an appearance that leaves the transfer function's result unchanged.
    fn default() -> Self {
        Appearance { tint: DVec4::ZERO, opacity: 1.0 }
    }
}

/// Blends a colour of the transfer function with a tint; the tint's w is its share, its rgb are
/// premultiplied.
pub fn tinted(colour: DVec3, tint: DVec4) -> DVec3 {
    colour * (1.0 - tint.w) + tint.truncate()
}

/// Returns the opacity of a stretch of ray of length `path`, mm. The occupancy is a factor of the opacity per
/// mm, 1 − exp(−extinction).
pub fn opacity(extinction: f64, occupancy: f64, path: f64) -> f64 {
    1.0 - (path * (1.0 - occupancy * (1.0 - (-extinction).exp())).ln()).exp()
}

/// Light that a ray has gathered, front to back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gathered {
    /// Σ C α T.
    pub colour: DVec3,
    /// T: the light that still passes.
    pub clear: f64,
    /// Σ z α T.
    pub depth: f64,
}

impl Default for Gathered {
    fn default() -> Self {
        Gathered { colour: DVec3::ZERO, clear: 1.0, depth: 0.0 }
    }
}

impl Gathered {
    /// Adds something of this colour and opacity at a depth, behind all that was added before.
    pub fn add(&mut self, colour: DVec3, opacity: f64, depth: f64) {
        let share = self.clear * opacity;
        self.colour += colour * share;
        self.depth += depth * share;
        self.clear -= share;
    }

    /// Returns premultiplied colour and opacity.
    pub fn pixel(&self) -> [f64; 4] {
        [self.colour.x, self.colour.y, self.colour.z, 1.0 - self.clear]
    }
}
