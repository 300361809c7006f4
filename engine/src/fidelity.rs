//! How far what is shown of splats is from the volume that they were fitted to: in figures, voxel by voxel, and in
//! colours for slices and pictures.
//!
//! The figures are those of [`evaluate`](crate::fit::evaluate), the voxels' errors those of
//! [`ErrorMap`]: what `vgs eval` tells. Splats that were fitted for the voxels alone
//! are shown by their decoded field, and measured by it.
//!
//! Colours go from blue, where the splats are too low, over white to red. A picture shows them as objects: each voxel
//! of the decoded field belongs to one of 255 classes of errors, and the class has a tint. Classes are finer near 0,
//! and stay when the range of the colours changes.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3, IVec3};
use rayon::prelude::*;

use crate::error::{Error, Kind, Result};
use crate::fit::errors::ErrorMap;
use crate::fit::evaluate::{
    Evaluation, Metrics, Protocol, between_slices_of, evaluate, evaluate_field, with_slices,
};
use crate::fit::{Measure, Problem};
use crate::gpu::Gpu;
use crate::image::annotate::round_up;
use crate::render::{Appearance, Decoded, Look, decode};
use crate::splat::{Form, Splat, SplatSet};
use crate::volume::{Roi, Volume};

/// The class of an error of 0; those of errors below come before it, those of errors above after it, and class 0
/// has no error.
const ZERO: u8 = 128;
/// Classes above that of 0, and as many below.
const STEPS: f64 = 127.0;
/// Greatest error that has a class of its own, in ranges of the colours at first.
const MOST: f64 = 4.0;
/// Colour of what no error is known of.
const UNKNOWN: [f32; 3] = [0.36; 3];

/// Returns the splats of a set in the voxel space of a volume.
///
/// # Errors
/// [`Kind::BadData`] if none lies there: a measurement would only say how dark the volume is.
pub fn in_volume(set: &SplatSet, volume: &Volume) -> Result<Vec<Splat>> {
    let splats = set.to_voxel(&volume.world_from_voxel);
    let last = DVec3::from_array(volume.size.map(|n| n as f64));
    let inside = |at: DVec3| at.cmpge(DVec3::NEG_ONE).all() && at.cmple(last).all();
    // Of coded voxels, which have no splats, the voxels themselves.
    let coded = set.region.as_ref().zip(set.grid.as_ref()).filter(|_| !set.voxels.is_empty());
    let lies = coded.is_some_and(|(region, grid)| {
        let place = volume.voxel_from_world() * grid.world_from_voxel;
        let at = |voxel: [u32; 3]| DVec3::from_array(voxel.map(f64::from));
        region.voxels().any(|(voxel, _)| inside(place.transform_point3(at(voxel))))
    });
    if lies || splats.iter().any(|s| inside(DVec3::from_array(s.mean.map(f64::from)))) {
        return Ok(splats);
    }
    let message = "no splat lies in the volume: they are of different scans, or one lost its position";
    Err(Error::new(Kind::BadData, "VGS-FIT-041", message))
}

/// Measures what mode decoded shows of a set against a volume, in its region.
///
/// # Errors
/// Returns the errors of [`decode`].
pub fn evaluate_decoded(
    gpu: &Gpu,
    set: &SplatSet,
    volume: &Volume,
    roi: &Roi,
    protocol: &Protocol,
) -> Result<Evaluation> {
    let decoded = decode(gpu, set, 1.0)?;
    // What is shown beyond a region is continued from inside of it, of a scan as well.
    let own = (set.region.is_some() && !roi.soft).then(|| volume.of_region_alone(roi));
    let volume = own.as_ref().unwrap_or(volume);
    Ok(evaluate_field(decoded.in_voxels_of(volume, set.origin_mm), volume, roi, protocol))
}

/// Measures what is shown of the set of a fit, against the volume and region that it was made for: the decoded field if
/// the splats were fitted for the voxels alone. `splats` are those of the fit (voxel space of the working grid, HU).
///
/// # Errors
/// Returns the errors of [`decode`] and [`evaluate`](evaluate()), and an error if memory does not hold finer slices.
pub fn evaluate_fitted(
    gpu: &Gpu,
    problem: &Problem<'_>,
    set: &SplatSet,
    splats: &[Splat],
    (volume, roi): (&Volume, &Roi),
    protocol: &Protocol,
) -> Result<Evaluation> {
    let between = between_slices_of(set, volume);
    with_slices(volume, roi, between, protocol, |volume, roi, protocol| {
        if set.form != Form::Field {
            return evaluate_decoded(gpu, set, volume, roi, protocol);
        }
        // Splats of a working grid are converted to that of the volume, and those of a small file are not those of
        // the fit. Others are there already, and need no conversion, which is not exact.
        let converted = problem.has_own_grid() || set.rounding.is_some();
        let there = converted.then(|| set.to_voxel(&volume.world_from_voxel));
        evaluate(gpu, there.as_deref().unwrap_or(splats), &problem.field(), volume, roi, protocol)
    })
}

/// Returns how an [`Order`](crate::fit::Order) measures its goal by what is shown: with [`evaluate_fitted`] at the
/// voxels, the PSNR over the range of `protocol`.
pub fn measured_as_shown<'a>(gpu: &Gpu, of: (&'a Volume, &'a Roi), protocol: &Protocol) -> Box<Measure<'a>> {
    let (gpu, protocol) = (gpu.clone(), Protocol { offsets: Vec::new(), ..protocol.clone() });
    Box::new(move |problem, set, splats| {
        Ok(evaluate_fitted(&gpu, problem, set, splats, of, &protocol)?.on_grid)
    })
}

/// Returns the colour of a difference from -1 to 1, red, green, blue from 0 to 1: blue below, white at, red above
/// zero; beyond, that of the end.
pub fn diverging(t: f64) -> [f32; 3] {
    let t = t.clamp(-1.0, 1.0);
    let end = if t < 0.0 { [8.0, 76.0, 168.0] } else { [184.0, 24.0, 32.0] };
    let white = 244.0;
    // A little more than linear, so that small errors are visible.
    let share = t.abs().powf(0.8);
    end.map(|c: f64| ((white + (c - white) * share) / 255.0) as f32)
}

/// The error of what is shown of a set, in a region of a volume.
#[derive(Clone, Debug)]
pub struct ShownError {
    /// Figures at the voxel centres.
    pub figures: Metrics,
    /// Number of voxels of the region.
    pub voxels: usize,
    /// Text behind an intensity; see [`Volume::unit`].
    pub unit: &'static str,
    /// Error at which the colours end at first, HU: a round number that 99 % of the region do not exceed.
    pub range: f64,
    /// True if the splats name another volume as the one that they were fitted to.
    pub other_volume: bool,
    /// V̂ − V, HU, at the voxels of a box around the region; NaN outside of it.
    map: Volume,
    voxel_from_world: DAffine3,
}

impl ShownError {
    /// Measures a set against `volume`, in its region, or, if that is `None`, where the occupancy of what is shown is
    /// at least a half. `progress` is told the part that is done, 0 to 1. Returns `None` if that is nowhere, or if the
    /// set has no intensities.
    ///
    /// # Errors
    /// Returns the errors of [`decode`], [`evaluate`](evaluate()) and [`ErrorMap::new`].
    pub fn new(
        gpu: &Gpu,
        set: &SplatSet,
        volume: &Volume,
        roi: Option<&Roi>,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Option<Self>> {
        if set.colours.is_some() || set.is_empty() || volume.is_empty() {
            return Ok(None);
        }
        let other_volume = set.volume_crc32.is_some_and(|fitted| fitted != volume.crc32());
        let of_grid = set.form != Form::Field;
        let decoded = (of_grid || roi.is_none()).then(|| decode(gpu, set, 1.0)).transpose()?;
        progress(0.4);
        let part = match (roi, &decoded) {
            (Some(roi), _) => of_region(volume, roi),
            (None, Some(decoded)) => where_shown(volume, decoded, set.origin_mm)?,
            (None, None) => None,
        };
        let Some((volume, roi)) = part else { return Ok(None) };
        let range = volume.min_max().map_or([0.0, 1.0], |(low, high)| [low, high]);
        let protocol = Protocol { offsets: Vec::new(), range, shell: 0, threshold: 0.0 };
        let splats = set.to_voxel(&volume.world_from_voxel);
        let coded = decoded.as_ref().filter(|_| !set.voxels.is_empty());
        let coded = coded.map(|decoded| {
            ErrorMap::of_field(decoded.in_voxels_of(&volume, set.origin_mm), &volume, &roi).volume()
        });
        let evaluation = match decoded.filter(|_| of_grid) {
            Some(decoded) => {
                evaluate_field(decoded.in_voxels_of(&volume, set.origin_mm), &volume, &roi, &protocol)
            }
            None => evaluate(gpu, &splats, &set.field, &volume, &roi, &protocol)?,
        };
        progress(0.7);
        let mut map = match coded {
            Some(map) => map,
            None => ErrorMap::new(gpu, &splats, &set.field, &volume, &roi)?.volume(),
        };
        map.samples.iter_mut().zip(&roi.weight).filter(|(_, w)| **w <= 0.0).for_each(|(e, _)| *e = f32::NAN);
        progress(1.0);
        Ok(Some(ShownError::of(evaluation.on_grid, evaluation.unit, map, other_volume)))
    }

    /// Creates the error of these figures, with V̂ − V at the voxels of `map`, NaN outside of the region, in `unit`.
    pub fn of(figures: Metrics, unit: &'static str, map: Volume, other_volume: bool) -> Self {
        ShownError {
            figures,
            voxels: map.samples.iter().filter(|error| error.is_finite()).count(),
            unit,
            range: round_up(figures.p99_hu.max(1e-3)).unwrap_or(1.0),
            other_volume,
            voxel_from_world: map.voxel_from_world(),
            map,
        }
    }

    /// Returns V̂ − V, HU, of the voxel that holds a point of the world, mm RAS; `None` outside of the region.
    pub fn at(&self, at_mm: DVec3) -> Option<f64> {
        self.error_of(self.voxel(at_mm))
    }

    fn voxel(&self, at_mm: DVec3) -> IVec3 {
        self.voxel_from_world.transform_point3(at_mm).round().as_ivec3()
    }

    fn error_of(&self, voxel: IVec3) -> Option<f64> {
        let size = IVec3::from_array(self.map.size.map(|n| n as i32));
        if voxel.cmplt(IVec3::ZERO).any() || voxel.cmpge(size).any() {
            return None;
        }
        let [x, y, z] = voxel.to_array().map(|v| v as usize);
        Some(f64::from(self.map.samples[self.map.index(x, y, z)])).filter(|error| error.is_finite())
    }

    /// Returns the class of the error at a point of the world, mm RAS, or at the nearest voxel beside it: what is shown
    /// of splats is a little wider than their region. It is 0 where there is none.
    pub fn class(&self, at_mm: DVec3) -> u8 {
        let voxel = self.voxel(at_mm);
        let beside = (0..27).map(|i| IVec3::new(i % 3, i / 3 % 3, i / 9) - 1);
        let known = beside.filter_map(|by| Some((by.length_squared(), self.error_of(voxel + by)?)));
        match known.min_by_key(|(far, _)| *far) {
            None => 0,
            Some((_, error)) => {
                let share = (error.abs() / (MOST * self.range)).min(1.0).sqrt();
                (f64::from(ZERO) + (STEPS * share).round().copysign(error)) as u8
            }
        }
    }

    /// Returns the look in which the colours of surfaces are those of the error, which end at ±`range`, HU; opacity and
    /// light stay as they are. The numbers of its objects are the classes.
    pub fn look(&self, look: &Look, range: f64) -> Look {
        let error = |class: u8| {
            let share = (f64::from(class) - f64::from(ZERO)) / STEPS;
            MOST * self.range * share * share.abs()
        };
        let tint = |class: u8| match class {
            0 => UNKNOWN,
            _ => diverging(error(class) / range.max(1e-9)),
        };
        let appearance = |class| (class, Appearance { tint: Some(tint(class)), ..Appearance::default() });
        let objects: BTreeMap<u8, Appearance> = (0..=u8::MAX).map(appearance).collect();
        Look { objects, functions: BTreeMap::new(), ..look.clone() }
    }
}

/// Returns the box of a volume around its region, and the region there; `None` if it is empty.
fn of_region(volume: &Volume, roi: &Roi) -> Option<(Volume, Roi)> {
    let [nx, ny, _] = roi.size;
    let (mut low, mut high) = (roi.size, [0; 3]);
    for (i, _) in roi.weight.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
        for (axis, at) in [i % nx, i / nx % ny, i / (nx * ny)].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at + 1));
        }
    }
    if high[0] == 0 {
        return None;
    }
    let size = std::array::from_fn(|axis| high[axis] - low[axis]);
    Some((volume.cropped(low, size), roi.cropped(low, size)))
}

/// Returns the box of a volume around what is shown of a decoded field, and the region where its occupancy is at least
/// a half; `None` if that is nowhere in the volume. `origin` is that of the field's scene, mm RAS.
fn where_shown(volume: &Volume, decoded: &Decoded, origin: DVec3) -> Result<Option<(Volume, Roi)>> {
    let from_box = volume.voxel_from_world() * DAffine3::from_translation(origin) * decoded.scene_from_voxel;
    let end = DVec3::from_array(decoded.size.map(f64::from));
    let corners = (0..8).map(|i| {
        let far = [i & 1, i >> 1 & 1, i >> 2].map(f64::from);
        from_box.transform_point3(DVec3::from_array(far) * end)
    });
    let (low, high) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let whole = DVec3::from_array(volume.size.map(|n| n as f64));
    let (low, high) = (low.floor().clamp(DVec3::ZERO, whole), high.ceil().clamp(DVec3::ZERO, whole));
    let size = (high - low).to_array().map(|n| n as usize);
    if size.contains(&0) {
        return Ok(None);
    }
    let part = volume.cropped(low.to_array().map(|n| n as usize), size);
    let shown = decoded.in_voxels_of(&part, origin);
    let weight: Vec<f32> = (0..part.len())
        .into_par_iter()
        .map(|i| {
            let voxel = [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
            let there = shown(DVec3::from_array(voxel.map(|v| v as f64))).1 >= 0.5;
            f32::from(u8::from(there && part.samples[i].is_finite()))
        })
        .collect();
    if weight.iter().all(|w| *w == 0.0) {
        return Ok(None);
    }
    let roi = Roi::new(weight, &part)?;
    Ok(Some((part, roi)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates errors of -300, -20, 0, 20, 300 HU side by side, and a voxel outside of the region.
    fn errors() -> ShownError {
        let samples = [-300.0, -20.0, 0.0, 20.0, 300.0, f32::NAN].to_vec();
        let affine = DAffine3::from_translation(DVec3::new(100.0, 0.0, 0.0));
        let map = Volume::new([6, 1, 1], affine, samples);
        let figures = Metrics {
            offset: [0.0; 3],
            mmse: 0.0,
            psnr_db: 0.0,
            rmse_hu: 0.0,
            mean_error_hu: 0.0,
            p99_hu: 300.0,
            occupancy_rmse: 0.0,
            soft_dice: 1.0,
            weight: 5.0,
            outline: Default::default(),
        };
        ShownError::of(figures, " HU", map, false)
    }

    #[test]
    fn an_error_is_that_of_the_voxel_that_holds_a_point() {
        let errors = errors();
        for (x, wanted) in [(100.0, Some(-300.0)), (101.4, Some(-20.0)), (104.4, Some(300.0)), (105.0, None)]
        {
            assert_eq!(errors.at(DVec3::new(x, 0.2, -0.3)), wanted, "{x}");
        }
        assert_eq!(errors.at(DVec3::new(100.0, 1.0, 0.0)), None);
        assert_eq!(
            errors.class(DVec3::new(105.0, 0.0, 0.0)),
            errors.class(DVec3::new(104.0, 0.0, 0.0)),
            "beside it"
        );
        assert_eq!(errors.class(DVec3::new(109.0, 0.0, 0.0)), 0, "far from it");
    }

    #[test]
    fn classes_have_the_colours_of_their_errors() {
        let errors = errors();
        let transfer = crate::transfer::load("CT-Bone", [-1000.0, 2000.0]).expect("a preset");
        for range in [30.0, 500.0] {
            let look = errors.look(&Look::new(transfer.clone()), range);
            for (x, error) in [-300.0f64, -20.0, 0.0, 20.0, 300.0].into_iter().enumerate() {
                let class = errors.class(DVec3::new(100.0 + x as f64, 0.0, 0.0));
                let found = look.objects[&class].tint.expect("a colour");
                let wanted = diverging(error / range);
                let apart = (0..3).map(|k| (found[k] - wanted[k]).abs()).fold(0.0, f32::max);
                assert!(apart < 0.03, "{error} of {range}: {found:?} instead of {wanted:?}");
            }
            assert_eq!(look.objects[&0].tint, Some(UNKNOWN));
        }
        assert_eq!(diverging(0.0), [244.0 / 255.0; 3].map(|v: f64| v as f32));
        assert_eq!((diverging(-9.0), diverging(9.0)), (diverging(-1.0), diverging(1.0)));
    }
}
