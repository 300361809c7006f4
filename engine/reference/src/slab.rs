//! `project_splats`, `emit_tile_pairs` and `slab`: the splats' field at planes across the view, classified
//! and summed up. The computation is plain: every splat at every plane of every ray, without tiles and
//! blocks.

use glam::{DMat3, DVec3, DVec4};

use super::Splat;
use super::eye::{Appearance, Eye, Gathered, lit, opacity, tinted};
use splat::{Field, Kernel};
use transfer::{Light, Material, Table};

/// A splat in eye space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Centre, mm.
    pub mean: DVec3,
    /// S⁻¹Rᵀ in eye space; takes x - mean to the whitened distance.
    pub whitening: DMat3,
    /// Half size of the box around the support, mm.
    pub extent: DVec3,
    /// a of the weight a κ(q).
    pub amplitude: f64,
    /// Intensity relative to the background.
    pub intensity: f64,
    /// Appearance of its object.
    pub appearance: Appearance,
}

/// Splats whose centre is nearer to the eye than this are not shown, mm.
pub const NEAREST: f64 = 1.0;

/// Transforms a splat (mm, intensity as in the set) into eye space, with the default appearance. Returns
/// `None` if it is behind the eye or too near.
pub fn seen(splat: &Splat, eye: &Eye, kernel: Kernel, background: f64) -> Option<Seen> {
    let mean = eye.seen(splat.mean);
    let axes = eye.turn * DMat3::from_quat(splat.rotation);
    let scale = splat.log_scale.exp();
    let spans = axes * DMat3::from_diagonal(scale);
    let squares = (0..3).map(|k| spans.col(k) * spans.col(k)).sum::<DVec3>();
    (mean.z > NEAREST).then(|| Seen {
        mean,
        whitening: DMat3::from_diagonal(scale.recip()) * axes.transpose(),
        extent: (squares * kernel.support_q()).map(f64::sqrt),
        amplitude: kernel.peak(splat.log_scale.to_array()) / (1.0 + (-splat.opacity_logit).exp()),
        intensity: splat.intensity - background,
        appearance: Appearance::default(),
    })
}

/// Positions of the planes, mm along the viewing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planes {
    /// Start of the first slab; plane k is at first + (k + ½) spacing.
    pub first: f64,
    /// Distance from plane to plane.
    pub spacing: f64,
    /// Number of planes.
    pub count: u32,
}

/// Settings of a picture of the field.
pub struct Look<'a> {
    /// The transfer function.
    pub table: &'a Table,
    /// Transfer functions of objects of their own, which ray marches alone know.
    pub functions: &'a [Table],
    /// Material of what is shaded.
    pub material: &'a Material,
    /// The light.
    pub light: &'a Light,
    /// v0 of the shaded gradient.
    pub dark: f64,
    /// Clip planes: n · x + d < 0 is cut away.
    pub planes: &'a [[f64; 4]],
    /// Mean edge of the CT's voxels, mm, if the opacity depends on the gradient, which ray marches alone know.
    pub gradient_edge: Option<f64>,
    /// True if the transfer function is integrated between planes.
    pub segments: bool,
    /// Rays end where less light than this would pass.
    pub least_light: f64,
}

/// Sums over all splats at a point of eye space, intensities relative to the background.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Σw.
    pub w: f64,
    /// Σwc.
    pub s: f64,
    /// Gradient of Σw, 1/mm.
    pub gw: DVec3,
    /// Gradient of Σwc, per mm.
    pub gs: DVec3,
    /// Σw times the tints of the objects.
    pub tint: DVec4,
    /// Σw times their opacities.
    pub opacity: f64,
}

/// Returns the sums over all splats at a point.
pub fn field_at(splats: &[Seen], kernel: Kernel, x: DVec3) -> Sums {
    let mut sums = Sums::default();
    for splat in splats {
        let u = splat.whitening * (x - splat.mean);
        let q = u.length_squared();
        if q >= kernel.support_q() {
            continue;
        }
        let weight = splat.amplitude * kernel.value(q);
        sums.w += weight;
        sums.s += weight * splat.intensity;
        sums.tint += splat.appearance.tint * weight;
        sums.opacity += splat.appearance.opacity * weight;
        // slope is -2 dκ/dq and dq/dx = 2 (S⁻¹Rᵀ)ᵀ u.
        let gradient = splat.whitening.transpose() * u * (-splat.amplitude * kernel.slope(q));
        sums.gw += gradient;
        sums.gs += gradient * splat.intensity;
    }
    sums
}

/// Gathers what a ray sees at the planes.
pub fn ray(
    splats: &[Seen],
    field: &Field,
    eye: &Eye,
    ray: DVec3,
    planes: &Planes,
    look: &Look<'_>,
) -> Gathered {
    let [epsilon, w0, background] = [field.epsilon, field.occupancy_w0, field.background].map(f64::from);
    let range = eye.clipped(ray, look.planes);
    let mut gathered = Gathered::default();
    let mut before: Option<(f64, f64)> = None;
    for k in 0..planes.count {
        let z = planes.first + (f64::from(k) + 0.5) * planes.spacing;
        let Sums { w, s, gw, gs, tint, opacity: shown } = field_at(splats, field.kernel, ray * z);
        if w <= 0.0 || gathered.clear <= look.least_light || z < range[0] || z > range[1] {
            before = None;
            continue;
        }
        let relative = s / (w + epsilon);
        let (v, full) = (background + relative, w / (w + w0));
        let o = full * shown / w;
        let (colour, extinction, occupancy) = match (look.segments, before) {
            (false, _) => (look.table.point(v).0, look.table.point(v).1, o),
            (true, None) => (look.table.segment(v, v).0, look.table.segment(v, v).1, 0.5 * o),
            (true, Some((vb, ob))) => {
                let (colour, extinction) = look.table.segment(vb, v);
                (colour, extinction, 0.5 * (ob + o))
            }
        };
        // A plane at which nothing shows has no share in the segment behind it.
        before = (o > 0.0).then_some((v, o));
        let opacity = opacity(extinction, occupancy, planes.spacing * ray.length());
        let colour = tinted(colour, tint / w);
        let base = if look.material.shade {
            let slope = (gs - gw * relative) / (w + epsilon);
            let gradient = slope * full + gw * ((v - look.dark) * w0 / (w + w0).powi(2));
            lit(colour, gradient, ray, look.material, &eye.lamp(look.light), 1.0)
        } else {
            colour
        };
        gathered.add(base, opacity, z);
    }
    gathered
}
