//! Splats with the colours and opacities of a look, for programs that draw splats as they are.
//!
//! Such a program draws α exp(−γ/2) of each splat in the picture, whatever the direction. What it is given is what
//! mode alpha draws, as near as that allows:
//!
//! - **Extinction and colour** of a splat are those of [mode alpha](super::alpha), by the same deconvolution.
//! - **Depth.** Alpha's thickness depends on the length of the ray in the splat. Here it is the mean over all
//!   directions, weighted by how large the splat is on the picture: for an ellipsoid of the volume V and the surface S
//!   that is 4 V / S (Cauchy).
//! - **Profile.** Alpha's 1 − exp(−τ (1 − γ/6)²) becomes the Gaussian that is nearest to it in the least-squares
//!   sense over the picture, whose width depends on τ alone: 0.98 of the splat's σ for a faint splat, 1.66 for an
//!   opaque one, which is flat in the middle.
//! - **Light** that turns with the camera, and highlights, depend on the direction of view, as colours by spherical
//!   harmonics do. They are fitted to both for a viewer whose picture has the patient's head above.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;
use shaders_glsl::types;

use super::look::Look;
use super::scene::Scene;
use base::error::{Error, Kind, Result};
use base::unit::Unit;
use gpu::Gpu;
use passes::Deconvolution;
use splat::harmonics::{MAX_BASIS, SH0, basis, basis_count, luminance};
use splat::{Activations, Field, Form, Harmonics, Kernel, Splat, SplatSet};
use transfer::TransferFunction;

/// Opacity below which no program draws a splat.
const LEAST_OPACITY: f64 = 1.0 / 255.0;
/// Degree of the harmonics that hold the light.
const LIT_DEGREE: u8 = 2;
/// Directions from which a splat is lit to find its harmonics.
const DIRECTIONS: usize = 128;

/// Splats with the colours of a look.
pub struct Baked {
    /// The splats of those that can be seen, as of ordinary 3D Gaussian splatting.
    pub set: SplatSet,
    /// Their rows in the set that they were made of.
    pub rows: Vec<usize>,
    /// Number of splats that the look shows, and of which its transfer function shows nothing; they are left out.
    pub hidden: usize,
}

/// Returns `set` with the colours and opacities that `look` gives it: each object with its own transfer function,
/// colour and opacity. Hidden objects and splats whose means a clip plane cuts away are left out. Labels stay; grid,
/// form, exceptions and intensities are lost. Waits for the device.
///
/// # Errors
/// [`Kind::Usage`] for splats that have colours of their own, and for more splats than mode alpha shows.
pub fn baked(gpu: &Gpu, set: &SplatSet, look: &Look) -> Result<Baked> {
    if set.colours.is_some() {
        let message = "these splats have colours of their own, on which no transfer function acts";
        return Err(Error::new(Kind::Usage, "VGS-RENDER-028", message).help("leave out --tf"));
    }
    let shown = look.shown(set);
    let shown_set = match shown.len() {
        all if all == set.splats.len() => set.clone(),
        _ => set.of_rows(&shown),
    };
    let set = shown_set;
    if set.splats.is_empty() {
        return Ok(Baked { set, rows: Vec::new(), hidden: 0 });
    }
    let label = |i: usize| set.labels.as_ref().map_or(0, |labels| labels[i]);
    let mut scene = Scene::new(gpu, Some(&set), None, look)?;
    let rows = scene.look_buffers().rows.read()?;
    let lamp = scene.look_buffers().facts.shaded.then(|| Lamp::new(&rows[0]));
    let mut functions: Vec<&TransferFunction> = Vec::new();
    for object in set.objects() {
        let function = look.function_of(object.number);
        if !functions.contains(&function) {
            functions.push(function);
        }
    }
    let gaussians = Gaussians::new();
    let mut faces: Vec<Option<Face>> = Vec::new();
    faces.resize_with(set.splats.len(), || None);
    for function in functions {
        let (media, centres) = media(gpu, &mut scene, function)?;
        faces.par_iter_mut().enumerate().for_each(|(i, face)| {
            let number = label(i);
            if look.function_of(number) != function {
                return;
            }
            let appearance = look.objects.get(&number).copied().unwrap_or_default();
            let [r, g, b, extinction] = media[i].map(f64::from);
            let thickness = extinction * path(&set.splats[i]) * f64::from(appearance.opacity.clamp(0.0, 1.0));
            let Some([opacity, width]) = gaussians.of(thickness) else { return };
            let own = (DVec3::new(r, g, b) / extinction).min(DVec3::ONE);
            let tint = appearance.tint.map(|tint| DVec3::from_array(tint.map(f64::from)));
            let colour = tint.unwrap_or(own).clamp(DVec3::ZERO, DVec3::ONE);
            let coefficients = match &lamp {
                Some(lamp) => lamp.coefficients(colour, &centres[i]),
                None => own_colour(colour),
            };
            *face = Some(Face { opacity, width, coefficients });
        });
    }

    let shown_set = SplatSet { region: None, ..set.clone() };
    let mut out = shown_set.selected(|i, _| faces[i].is_some());
    let hidden = set.splats.len() - out.splats.len();
    let rows = shown.iter().zip(&faces).filter_map(|(&row, face)| face.as_ref().map(|_| row)).collect();
    let mut coefficients = Vec::new();
    for (splat, face) in out.splats.iter_mut().zip(faces.into_iter().flatten()) {
        splat.set_opacity(face.opacity as f32);
        splat.log_scale = splat.log_scale.map(|log| log + face.width.ln() as f32);
        splat.intensity = luminance(&face.coefficients);
        coefficients.extend(face.coefficients);
    }
    let degree = if lamp.is_some() { LIT_DEGREE } else { 0 };
    out.colours = Some(Harmonics { degree, coefficients });
    out.unit = Unit::Luminance;
    out.field = Field { kernel: Kernel::Gaussian, ..Field::default() };
    (out.grid, out.form, out.iterations, out.rounding) = (None, Form::Field, None, None);
    Ok(Baked { set: out, rows, hidden })
}

/// Returns colour and extinction of each splat under a transfer function, and the centres of the splats.
fn media(
    gpu: &Gpu,
    scene: &mut Scene,
    function: &TransferFunction,
) -> Result<(Vec<[f32; 4]>, Vec<types::Centre>)> {
    scene.set_look(&Look::new(function.clone()))?;
    let look = scene.look_buffers();
    let (faces, _) = scene.expect_splats().faces(gpu)?;
    let Some(points) = &faces.points else {
        return Err(Error::new(Kind::Internal, "VGS-RENDER-029", "splats without points in them"));
    };
    let mut deconvolution = Deconvolution::new(gpu, points)?;
    let mut recorder = gpu.record()?;
    let tables = (&look.rows, &look.points, &look.integrals);
    deconvolution.record(&mut recorder, points, (look.number, tables), u32::MAX);
    recorder.submit()?;
    Ok((deconvolution.media.read()?, faces.centres.read()?))
}

/// What is baked into a splat.
struct Face {
    opacity: f64,
    /// Factor of its standard deviations.
    width: f64,
    coefficients: Vec<f32>,
}

/// Returns the integral of alpha's profile along a ray through the centre of a splat, mm, as the mean over all
/// directions, weighted by the area that the splat has on the picture.
fn path(splat: &Splat) -> f64 {
    // Half of the length of the central ray is r in a ball of radius r, and 3 V / S on the mean in an ellipsoid,
    // whose surface is that of Knud Thomsen's formula, right to 1.1 %.
    const P: f64 = 1.6075;
    let [a, b, c] = splat.scale().map(f64::from);
    let surface = (((a * b).powf(P) + (a * c).powf(P) + (b * c).powf(P)) / 3.0).powf(1.0 / P);
    3.0 * PI / 8.0 * 6f64.sqrt() * a * b * c / surface
}

/// Returns the coefficients of a colour that is the same from everywhere.
fn own_colour(colour: DVec3) -> Vec<f32> {
    colour.to_array().map(|v| (v as f32 - 0.5) / SH0).to_vec()
}

/// Opacities and widths of the Gaussians nearest to 1 − exp(−τ (1 − γ/6)²), over ln τ.
struct Gaussians {
    rows: Vec<[f64; 2]>,
}

impl Gaussians {
    /// ln τ of the first row, and from one row to the next. Beyond the last row the picture is the same.
    const FIRST: f64 = -6.0;
    const STEP: f64 = 0.125;
    const COUNT: usize = 90;

    fn new() -> Self {
        let row = |i: usize| nearest_gaussian((Self::FIRST + Self::STEP * i as f64).exp());
        Gaussians { rows: (0..Self::COUNT).map(row).collect() }
    }

    /// Returns the opacity and the width in standard deviations of a splat; `None` if it cannot be seen.
    fn of(&self, thickness: f64) -> Option<[f64; 2]> {
        // Fainter splats than that of the first row are not drawn; nor is NaN.
        let at = (thickness.ln() - Self::FIRST) / Self::STEP;
        if at.is_nan() || at < 0.0 {
            return None;
        }
        let at = at.min((Self::COUNT - 1) as f64);
        let first = (at as usize).min(Self::COUNT - 2);
        let [a, b] = [self.rows[first], self.rows[first + 1]];
        let share = at - first as f64;
        let [opacity, width] = std::array::from_fn(|k| a[k] * (1.0 - share) + b[k] * share);
        (opacity >= LEAST_OPACITY).then_some([opacity, width])
    }
}

/// Returns the opacity α ≤ 1 and the width s for which α exp(−γ / 2s²) is nearest to 1 − exp(−τ (1 − γ/6)²): the
/// integral of the squared difference over γ, which is the area of the picture, is least.
fn nearest_gaussian(thickness: f64) -> [f64; 2] {
    const STEPS: usize = 600;
    let drawn = |gamma: f64| 1.0 - (-thickness * (1.0 - gamma / 6.0).powi(2)).exp();
    // ∫ drawn(γ) exp(−rate γ) dγ by the midpoints.
    let overlap = |rate: f64| -> f64 {
        let step = 6.0 / STEPS as f64;
        let at = |i: usize| (i as f64 + 0.5) * step;
        (0..STEPS).map(|i| drawn(at(i)) * (-rate * at(i)).exp() * step).sum()
    };
    let best = |width: f64| {
        let rate = 0.5 / (width * width);
        let overlap = overlap(rate);
        let opacity = (2.0 * rate * overlap).min(1.0);
        // Without ∫ drawn², which is the same for all.
        (opacity * opacity / (2.0 * rate) - 2.0 * opacity * overlap, opacity)
    };
    let (mut low, mut high) = (0.5f64, 3.0f64);
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    while high - low > 1e-6 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if best(a).0 < best(b).0 { high = b } else { low = a }
    }
    let width = (low + high) / 2.0;
    [best(width).1, width]
}

/// The light of mode alpha, seen from many directions.
struct Lamp<'a> {
    look: &'a types::Look,
    directions: Vec<Direction>,
}

/// A direction of view, all of it in the world.
struct Direction {
    light: DVec3,
    fill: DVec3,
    halfway: DVec3,
    /// The harmonics there, times the solid angle that the direction stands for.
    weights: [f64; MAX_BASIS],
}

impl<'a> Lamp<'a> {
    fn new(look: &'a types::Look) -> Self {
        let direction = |i: usize| {
            // A spiral of equal areas.
            let z = 1.0 - (2.0 * i as f64 + 1.0) / DIRECTIONS as f64;
            let angle = i as f64 * PI * (5f64.sqrt() - 1.0);
            let radius = (1.0 - z * z).sqrt();
            let forward = DVec3::new(radius * angle.cos(), radius * angle.sin(), z);
            let right = forward.cross(DVec3::Z).normalize();
            let own = DVec3::from_array(look.light.map(f64::from));
            let light = match look.light_turns {
                1 => own,
                _ => right * own.x + right.cross(forward) * own.y + forward * own.z,
            };
            // Mirrored from left to right, as the viewer sees it.
            let fill = light - 2.0 * light.dot(right) * right;
            let weights = basis(forward.to_array()).map(|y| y * 2.0 * TAU / DIRECTIONS as f64);
            Direction { light, fill, halfway: (light - forward).normalize(), weights }
        };
        Lamp { look, directions: (0..DIRECTIONS).map(direction).collect() }
    }

    /// Returns the harmonics of a colour that is lit by the gradients at the centre of its splat.
    fn coefficients(&self, colour: DVec3, centre: &types::Centre) -> Vec<f32> {
        let [slope, occupancy_slope] =
            [centre.slope, centre.occupancy_slope].map(|v| DVec3::from_array(v.map(f64::from)));
        let gradient = slope - occupancy_slope * f64::from(self.look.dark);
        let Some(normal) = gradient.try_normalize() else {
            let mut flat = own_colour(colour);
            flat.resize(3 * basis_count(LIT_DEGREE), 0.0);
            return flat;
        };
        let types::Look { ambient, diffuse, specular, power, fill, .. } = *self.look;
        let [ambient, diffuse, specular, power, fill] =
            [ambient, diffuse, specular, power, fill].map(f64::from);
        let mut sums = vec![DVec3::ZERO; basis_count(LIT_DEGREE)];
        for direction in &self.directions {
            let [key, other] = [direction.light, direction.fill].map(|light| normal.dot(light).abs());
            let lit = ambient + diffuse * (key + (other - key) * fill);
            let shine = specular * normal.dot(direction.halfway).abs().powf(power);
            let seen = (colour * lit + shine).min(DVec3::ONE) - 0.5;
            for (sum, weight) in sums.iter_mut().zip(&direction.weights) {
                *sum += seen * *weight;
            }
        }
        sums.iter().flat_map(|sum| sum.to_array().map(|v| v as f32)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns ∫ (1 − exp(−τ (1 − γ/6)²) − α exp(−γ / 2s²))² dγ.
    fn error(thickness: f64, [opacity, width]: [f64; 2]) -> f64 {
        let step = 1e-3;
        let at = |i: u32| {
            let gamma = (f64::from(i) + 0.5) * step;
            let drawn = 1.0 - (-thickness * (1.0 - gamma / 6.0).max(0.0).powi(2)).exp();
            (drawn - opacity * (-gamma / (2.0 * width * width)).exp()).powi(2) * step
        };
        (0..60_000).map(at).sum()
    }

    #[test]
    fn no_gaussian_is_nearer_than_the_nearest() {
        let gaussians = Gaussians::new();
        for thickness in [0.01, 0.2, 1.0, 5.0, 40.0] {
            let [opacity, width] = gaussians.of(thickness).expect("it can be seen");
            let least = error(thickness, [opacity, width]);
            for (a, s) in [(0.97, 1.0), (1.03, 1.0), (1.0, 0.97), (1.0, 1.03)] {
                let other = [(opacity * a).min(1.0), width * s];
                assert!(error(thickness, other) >= least, "τ = {thickness}: {other:?} is nearer");
            }
        }
        let [faint, thin] = gaussians.of(0.01).expect("it can be seen");
        assert!((faint - 0.0110).abs() < 1e-4 && (thin - 0.984).abs() < 2e-3, "{faint} {thin}");
        let [opaque, wide] = gaussians.of(60.0).expect("it can be seen");
        assert!(opaque == 1.0 && (wide - 1.66).abs() < 0.01, "{opaque} {wide}");
        for unseen in [0.0, 1e-4, 0.003, f64::NAN, -1.0] {
            assert!(gaussians.of(unseen).is_none(), "{unseen}");
        }
        assert!(gaussians.of(1e30).is_some());
    }

    #[test]
    fn a_path_is_the_mean_over_the_directions() {
        for scale in [[1.0f32; 3], [0.5, 1.0, 2.0], [0.2, 2.0, 2.0], [0.3, 0.3, 3.0]] {
            let splat = Splat { log_scale: scale.map(f32::ln), ..Splat::default() };
            let [a, b, c] = scale.map(f64::from);
            let (mut sum, mut whole) = (0.0, 0.0);
            for i in 0..20_000 {
                let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 20_000.0;
                let angle = f64::from(i) * PI * (5f64.sqrt() - 1.0);
                let radius = (1.0 - z * z).sqrt();
                let d = DVec3::new(radius * angle.cos(), radius * angle.sin(), z);
                // Of the ray through the centre, and the splat's area across it.
                let length = (d / DVec3::new(a, b, c)).length().recip();
                let area = (d * DVec3::new(b * c, a * c, a * b)).length();
                sum += length * area;
                whole += area;
            }
            let wanted = 3.0 * PI / 8.0 * 6f64.sqrt() * sum / whole;
            assert!((path(&splat) / wanted - 1.0).abs() < 0.012, "{scale:?}: {} for {wanted}", path(&splat));
        }
    }

    #[test]
    fn a_light_of_the_patient_stays_where_it_is() {
        let row = types::Look { light: [0.0, 1.0, 0.0], light_turns: 1, ..bytemuck::Zeroable::zeroed() };
        assert!(Lamp::new(&row).directions.iter().all(|of| of.light == DVec3::Y));
        // That of the camera goes along.
        let of_camera = types::Look { light_turns: 0, ..row };
        let turned = Lamp::new(&of_camera);
        assert!(turned.directions.iter().any(|of| of.light.dot(DVec3::Y) < 0.5));
    }

    #[test]
    fn a_lit_colour_is_near_to_the_light_from_any_side() {
        let first = transfer::Light::default().direction();
        let light = (first * DVec3::new(1.0, 1.0, -1.0)).as_vec3().to_array();
        let row =
            types::Look { ambient: 0.2, diffuse: 0.8, power: 1.0, light, ..bytemuck::Zeroable::zeroed() };
        let lamp = Lamp::new(&row);
        let seen = |slope: [f32; 3], direction: [f64; 3]| {
            let centre = types::Centre { slope, occupancy_slope: [0.0; 3] };
            let coefficients = lamp.coefficients(DVec3::splat(0.9), &centre);
            Harmonics { degree: LIT_DEGREE, coefficients }.colour(0, direction)[0]
        };
        // A surface that faces the front, seen from there and from the side: |n · l| is 1 / |l| and 0.4 / |l|.
        let length = DVec3::new(0.4, 0.5, 1.0).length();
        let front = seen([0.0, -3.0, 0.0], [0.0, -1.0, 0.0]);
        assert!((front - 0.9 * (0.2 + 0.8 / length)).abs() < 0.1, "{front}");
        let side = seen([0.0, -3.0, 0.0], [1.0, 0.0, 0.0]);
        assert!((side - 0.9 * (0.2 + 0.8 * 0.4 / length)).abs() < 0.15, "{side}");
        let flat = seen([0.0; 3], [0.6, 0.0, 0.8]);
        assert!((flat - 0.9).abs() < 1e-6, "a surface without a direction is not lit: {flat}");
    }
}
