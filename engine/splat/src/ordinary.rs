//! What programs hold that draw splats of ordinary 3D Gaussian splatting: colours, and places in metres along
//! axes of their own; how a set becomes that, and comes back.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::harmonics::luminance;
use super::mend::{Mended, ordinary_field};
use super::space::transformed;
use super::{Harmonics, Splat, SplatSet, ply};
use base::error::{Error, Kind, Result};
use base::unit::Unit;

/// Metres of a millimetre.
const METRES: f64 = 1e-3;

/// A set in the units and along the axes of a program.
pub(super) struct Ordinary {
    /// Means in metres, relative to `origin`; ln σ in ln m.
    pub splats: Vec<Splat>,
    pub colours: Harmonics,
    /// Origin of the means, metres.
    pub origin: DVec3,
}

impl Ordinary {
    /// Returns a set with colours in metres; `axes` is the rotation that takes RAS to the axes of the program.
    ///
    /// # Errors
    /// [`Kind::NothingToDo`] without splats, [`Kind::Usage`] for splats that have intensities and no colours.
    pub fn new(set: &SplatSet, axes: &DMat3) -> Result<Self> {
        ply::check(set)?;
        let Some(colours) = &set.colours else {
            let message = "splats with intensities, and this format holds splats with colours";
            return Err(Error::new(Kind::Usage, "VGS-SPLAT-007", message).help(
                "vgs convert SPLATS --tf PRESET -o OUT gives them the colours of a transfer function",
            ));
        };
        let linear = *axes * METRES;
        let splats = set.splats.iter().map(|splat| transformed(splat, &linear, |x| linear * x)).collect();
        Ok(Ordinary { splats, colours: colours.turned(axes), origin: linear * set.origin_mm })
    }
}

/// Takes a set whose means and σ are in metres along the axes of a program to mm RAS; `axes` is the rotation, or
/// reflection, that takes these axes to RAS.
pub(super) fn into_world(set: &mut SplatSet, axes: &DMat3) {
    let linear = *axes * METRES.recip();
    set.splats.par_iter_mut().for_each(|splat| *splat = transformed(splat, &linear, |x| linear * x));
    set.colours = set.colours.take().map(|colours| colours.turned(axes));
}

/// Makes a set with colours what every such set is, after it was read: its splats can be used, their luminance is
/// their intensity, and their field is that of ordinary splatting.
pub(super) fn finished(set: &mut SplatSet, strict: bool) -> Result<Mended> {
    if let Some(colours) = &set.colours {
        for (splat, of) in set.splats.iter_mut().zip(colours.coefficients.chunks_exact(colours.stride())) {
            splat.intensity = luminance(of);
        }
    }
    let mut mended = Mended::of(set, |_| None, strict)?;
    mended.widen(&mut set.splats);
    set.unit = Unit::Luminance;
    set.field = ordinary_field(&set.splats);
    Ok(mended)
}

#[cfg(test)]
pub(super) mod tests {
    use glam::DQuat;

    use super::*;
    use crate::activation::unit_quaternion;
    use crate::{Activations, Field, Kernel};

    /// A splat as a parser of a test finds it, in metres along the axes of the file.
    pub struct Row {
        pub place: DVec3,
        pub rotation: DQuat,
        pub scale: DVec3,
        pub opacity: f64,
        pub coefficients: Vec<f32>,
    }

    /// The greatest errors that are allowed.
    pub struct Errors {
        pub place_mm: f64,
        /// Of the covariance, relative.
        pub shape: f64,
        pub opacity: f64,
        /// From any direction.
        pub colour: f64,
    }

    /// Returns the splats of a set that was read, along RAS.
    pub fn rows(set: &SplatSet) -> Vec<Row> {
        let colours = set.colours.as_ref().expect("colours");
        let row = |(i, splat): (usize, &Splat)| Row {
            place: (DVec3::from_array(splat.mean.map(f64::from)) + set.origin_mm) * METRES,
            rotation: unit_quaternion(splat.rotation),
            scale: DVec3::from_array(splat.scale().map(f64::from)) * METRES,
            opacity: splat.opacity().into(),
            coefficients: colours.of(i).to_vec(),
        };
        set.splats.iter().enumerate().map(row).collect()
    }

    /// Creates splats with colours of degree 2, some 900 mm above the origin of the world.
    pub fn coloured() -> SplatSet {
        let mut state = 1u32;
        let mut next = |low: f32, high: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            low + (high - low) * (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut splats = Vec::new();
        let mut coefficients = Vec::new();
        for _ in 0..60 {
            splats.push(Splat {
                mean: std::array::from_fn(|_| next(-80.0, 80.0)),
                opacity_logit: next(-4.0, 4.0),
                rotation: std::array::from_fn(|_| next(-1.0, 1.0)),
                log_scale: std::array::from_fn(|_| next(-1.5, 1.5)),
                intensity: 0.5,
            });
            coefficients.extend((0..3).map(|_| next(-1.5, 1.5)));
            coefficients.extend((3..27).map(|_| next(-0.3, 0.3)));
        }
        SplatSet {
            splats,
            origin_mm: DVec3::new(10.0, -20.0, 900.0),
            colours: Some(Harmonics { degree: 2, coefficients }),
            unit: Unit::Luminance,
            field: Field { kernel: Kernel::Gaussian, ..Field::default() },
            ..SplatSet::default()
        }
    }

    /// Creates more splats than a byte has values, none of which is like another.
    pub fn many() -> SplatSet {
        let mut set = coloured();
        let (splats, colours) = (set.splats.clone(), set.colours.clone().expect("colours"));
        let all = set.colours.as_mut().expect("colours");
        for turn in 1..20 {
            let by = turn as f32;
            set.splats.extend(splats.iter().map(|splat| Splat {
                mean: splat.mean.map(|v| v * (1.0 - by / 50.0)),
                log_scale: splat.log_scale.map(|log| log + by / 40.0),
                rotation: splat.rotation.map(|v| v + by / 100.0),
                ..*splat
            }));
            all.coefficients.extend(colours.coefficients.iter().map(|c| c * (1.0 - by / 30.0)));
        }
        set
    }

    /// Returns the rows of the splats of `set` in its order, by their places.
    pub fn in_order(set: &SplatSet, rows: Vec<Row>, to_ras: fn(DVec3) -> DVec3) -> Vec<Row> {
        let mut rows: Vec<Option<Row>> = rows.into_iter().map(Some).collect();
        let mut ordered = Vec::new();
        for splat in &set.splats {
            let place = DVec3::from_array(splat.mean.map(f64::from)) + set.origin_mm;
            let far = |row: &Option<Row>| {
                row.as_ref().map_or(f64::INFINITY, |row| (to_ras(row.place) * 1e3).distance(place))
            };
            let nearest = rows.iter_mut().min_by(|a, b| far(a).total_cmp(&far(b)));
            ordered.extend(nearest.and_then(Option::take));
        }
        ordered
    }

    /// Checks what a file holds of `set`; `to_ras` takes a direction of the file to RAS.
    pub fn check(set: &SplatSet, rows: &[Row], to_ras: fn(DVec3) -> DVec3, allowed: &Errors) {
        assert_eq!(rows.len(), set.splats.len());
        let colours = set.colours.as_ref().expect("colours");
        for (i, (row, splat)) in rows.iter().zip(&set.splats).enumerate() {
            let place = DVec3::from_array(splat.mean.map(f64::from)) + set.origin_mm;
            let found = to_ras(row.place) * 1e3;
            assert!(found.distance(place) <= allowed.place_mm, "splat {i}: {found} for {place}");
            let covariance = |axes: DMat3, scale: DVec3| {
                let spans = axes * DMat3::from_diagonal(scale);
                spans * spans.transpose()
            };
            let wanted = covariance(splat.axes(), DVec3::from_array(splat.scale().map(f64::from)));
            let axes = DMat3::from_quat(row.rotation);
            let axes = DMat3::from_cols(to_ras(axes.x_axis), to_ras(axes.y_axis), to_ras(axes.z_axis));
            let apart = covariance(axes, row.scale * 1e3) - wanted;
            let norm = |m: DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
            assert!(norm(apart) <= allowed.shape * norm(wanted), "splat {i}: {apart} of {wanted}");
            assert!((row.opacity - f64::from(splat.opacity())).abs() <= allowed.opacity, "splat {i}");
            let one = Harmonics { degree: colours.degree, coefficients: row.coefficients.clone() };
            for direction in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.48, -0.6, 0.64)] {
                let wanted = colours.colour(i, to_ras(direction).to_array());
                let found = one.colour(0, direction.to_array());
                let near = (0..3).all(|c| (wanted[c] - found[c]).abs() <= allowed.colour);
                assert!(near, "splat {i} along {direction}: {found:?} for {wanted:?}");
            }
        }
    }

    #[test]
    fn splats_with_intensities_have_no_colours_to_write() {
        let set = SplatSet { colours: None, unit: Unit::Hu, ..coloured() };
        let error = Ordinary::new(&set, &DMat3::IDENTITY).err().expect("no colours");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-SPLAT-007"));
        let none = coloured().selected(|_, _| false);
        assert_eq!(Ordinary::new(&none, &DMat3::IDENTITY).err().map(|e| e.kind), Some(Kind::NothingToDo));
    }
}
