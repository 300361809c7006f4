//! The region of interest: the voxels that are fitted.
//!
//! A mask file may be binary, soft, or a map of labels, and may lie on another grid of the same space. All of
//! these become one weight for every voxel of the volume, zero where the volume itself has no finite value.
//! Errors here name no file, since volumes do not know theirs; the program adds that of the mask.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::Volume;
use super::label_choice::{FORMS, LabelChoice, present_labels, resolve, there_are};
use super::mask_values::{ROUNDING, between_labels, is_whole, label_of};
use base::{Error, Kind, Result};

/// Greatest distance of corners, in voxels, of grids that count as the same: writers round affines to f32 and
/// less.
const SAME_GRID_VOXELS: f64 = 1e-3;
/// How far the values of a soft mask may lie outside [0, 1], as after resampling and in float files.
const OVERSHOOT: f32 = 1e-3;
/// Part of the greatest weight above which a voxel belongs to the region.
const MEMBER: f32 = 0.01;
/// Distinct values up to which whole numbers are taken for labels, unasked; an image of bytes has more.
const FEW_LABELS: usize = 150;

/// A region of interest on the grid of its volume.
#[derive(Clone, Debug)]
pub struct Roi {
    /// Voxel counts along x, y, z; equal to the volume's.
    pub size: [usize; 3],
    /// Membership in [0, 1] of every voxel, x fastest.
    pub weight: Vec<f32>,
    /// True if the mask was soft (any weight strictly between 0 and 1).
    pub soft: bool,
}

impl Roi {
    /// Creates a region with these weights on the grid of `volume`. Voxels whose sample is NaN or infinite
    /// are excluded, and counted in a warning.
    ///
    /// # Errors
    /// [`Kind::NothingToDo`] if no weight is positive; [`Kind::BadData`] if a weight is not in [0, 1] or more
    /// than half of the region has no finite sample.
    ///
    /// # Panics
    /// If there is not one weight for every voxel.
    pub fn new(mut weight: Vec<f32>, volume: &Volume) -> Result<Roi> {
        assert_eq!(weight.len(), volume.len(), "one weight for every voxel");
        if weight.iter().any(|w| !(0.0..=1.0).contains(w)) {
            return Err(Error::new(Kind::BadData, "VGS-ROI-002", "a weight is not in [0, 1]"));
        }
        let voxels = weight.iter().filter(|&&w| w > 0.0).count();
        if voxels == 0 {
            return Err(empty());
        }
        let mut excluded = 0;
        for (w, v) in weight.iter_mut().zip(&volume.samples) {
            if *w > 0.0 && !v.is_finite() {
                *w = 0.0;
                excluded += 1;
            }
        }
        if 2 * excluded > voxels {
            let message =
                format!("{excluded} of {voxels} voxels of the region have no finite value in the volume");
            return Err(Error::new(Kind::BadData, "VGS-ROI-004", message)
                .help("repair the volume, or choose a region where it holds values"));
        }
        if excluded > 0 {
            tracing::warn!(
                "{excluded} of {voxels} voxels of the region of interest are NaN or infinite: excluded"
            );
        }
        let soft = weight.iter().any(|&w| w > 0.0 && w < 1.0);
        Ok(Roi { size: volume.size, weight, soft })
    }

    /// Returns the region that `mask` marks in `volume`: binary, soft in [0, 1], or chosen labels. A mask on
    /// another grid is resampled, nearest for binary masks and labels, linear for soft ones, with a warning.
    ///
    /// # Errors
    /// [`Kind::Usage`] if labels must be chosen or the choice does not fit the mask; [`Kind::BadData`] if the
    /// values are no mask or the boxes are disjoint; and those of [`Roi::new`].
    pub fn from_mask(mask: &Volume, labels: &LabelChoice, volume: &Volume) -> Result<Roi> {
        let (weight, soft) = mask_weights(mask, labels)?;
        if let Some(2) = distinct_up_to(&volume.samples, 2) {
            tracing::warn!("the volume has 2 distinct values: were volume and mask swapped?");
        }
        let on_mask_grid = Roi { size: mask.size, weight, soft };
        if on_mask_grid.voxel_count() == 0 {
            return Err(Error::new(Kind::NothingToDo, "VGS-ROI-003", "the mask is zero everywhere")
                .help("check the mask or the label"));
        }
        let weight = match relate(mask, volume)? {
            Grids::Same => on_mask_grid.weight,
            Grids::Assumed => {
                tracing::warn!(
                    "volume or mask has no orientation: they are taken to be on one grid, since their sizes agree"
                );
                on_mask_grid.weight
            }
            Grids::Differ => resample(&on_mask_grid, mask, volume)?,
        };
        Roi::new(weight, volume)
    }

    /// Returns true if a file that may be either is rather a mask than an image, by its values: all from 0 to 1,
    /// or few whole numbers from 0 on.
    pub fn has_values_of_mask(file: &Volume) -> bool {
        match file.min_max() {
            Some((low, high)) if low >= -ROUNDING && low < high => {
                let whole = || file.samples.iter().all(|&v| is_whole(v));
                let few = || present_labels(file).is_some_and(|labels| labels.len() <= FEW_LABELS);
                high <= 1.0 + ROUNDING || whole() && few()
            }
            _ => false,
        }
    }

    /// Returns true if a mask can be taken as it is for a region of `volume`: their grids agree to a thousandth
    /// of a voxel, or their sizes do and one of them has no orientation. The samples of both are not looked at.
    pub fn is_on_grid_of(mask: &Volume, volume: &Volume) -> bool {
        matches!(relate(mask, volume), Ok(Grids::Same | Grids::Assumed))
    }

    /// Returns the volume of the region in ml, on the grid of `volume`: a voxel counts by its weight.
    pub fn ml(&self, volume: &Volume) -> f64 {
        self.weight_sum() * volume.world_from_voxel.matrix3.determinant().abs() / 1000.0
    }

    /// Returns the part of a mask that this region, which was made from it on the grid of `volume`, holds, by
    /// their volumes in mm³: much less than 1 if most of the mask lies outside the volume or where it has no
    /// values.
    ///
    /// # Errors
    /// Those of [`Roi::from_mask`] for the mask and the labels.
    pub fn share_of(&self, mask: &Volume, labels: &LabelChoice, volume: &Volume) -> Result<f64> {
        let whole: f64 = mask_weights(mask, labels)?.0.iter().map(|&w| f64::from(w)).sum();
        let voxel = |of: &Volume| of.world_from_voxel.matrix3.determinant().abs();
        // Without orientation the grids are taken to be one, whatever their spacing.
        let same = !mask.oriented || !volume.oriented;
        let scale = if same { 1.0 } else { voxel(volume) / voxel(mask) };
        Ok(self.weight_sum() * scale / whole.max(f64::MIN_POSITIVE))
    }

    /// Returns the voxels of `volume` with `low` ≤ sample ≤ `high` (HU for CT).
    ///
    /// # Errors
    /// [`Kind::Usage`] if the bounds are NaN or in the wrong order, and those of [`Roi::new`].
    pub fn from_threshold(volume: &Volume, low: f32, high: f32) -> Result<Roi> {
        if !matches!(low.partial_cmp(&high), Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)) {
            let message = format!("the threshold range {low}..{high} is empty");
            return Err(Error::new(Kind::Usage, "VGS-ROI-005", message).help("give the lower bound first"));
        }
        let inside = |v: &f32| f32::from(u8::from(v.is_finite() && (low..=high).contains(v)));
        Roi::new(volume.samples.iter().map(inside).collect(), volume)
    }

    /// Returns the weight of a voxel; 0 if the volume does not have it. The samples of a fit go on beyond the
    /// faces of the volume ([`super::Bricks::around_and_beyond`]), so the indices of a sample's voxel may be
    /// negative or too large.
    pub fn at(&self, voxel: IVec3) -> f32 {
        let size = IVec3::from_array(self.size.map(|n| n as i32));
        if voxel.cmplt(IVec3::ZERO).any() || voxel.cmpge(size).any() {
            return 0.0;
        }
        let [x, y, z] = voxel.to_array().map(|c| c as usize);
        self.weight[(z * self.size[1] + y) * self.size[0] + x]
    }

    /// Returns the number of voxels with a positive weight.
    pub fn voxel_count(&self) -> usize {
        self.weight.iter().filter(|&&w| w > 0.0).count()
    }

    /// Returns the sum of the weights, in voxels.
    pub fn weight_sum(&self) -> f64 {
        self.weight.iter().map(|&w| f64::from(w)).sum()
    }

    /// Returns the voxels that belong to the region: those whose weight is above a hundredth of the greatest.
    /// For a binary mask these are all voxels with a weight; the faint margin of a soft mask is left out.
    pub fn members(&self) -> impl Iterator<Item = usize> + '_ {
        let least = MEMBER * self.weight.iter().copied().fold(0.0, f32::max);
        self.weight.iter().enumerate().filter(move |&(_, &w)| w > least).map(|(i, _)| i)
    }

    /// Returns the least and greatest finite sample of `volume`, which has the region's grid, among the
    /// region's [members](Roi::members); `None` if none is finite.
    pub fn range(&self, volume: &Volume) -> Option<[f32; 2]> {
        let finite = || self.members().map(|i| volume.samples[i]).filter(|v| v.is_finite());
        Some([finite().reduce(f32::min)?, finite().reduce(f32::max)?])
    }

    /// Returns the trilinear weight at a point in voxel space. Voxels outside the grid count as zero, so the
    /// weight fades over one voxel beyond the outermost centres and is zero from there on.
    pub fn trilinear(&self, voxel: DVec3) -> f64 {
        let low = voxel.floor();
        let f = voxel - low;
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut share = 1.0;
            let mut index = 0;
            for axis in (0..3).rev() {
                let far = corner >> axis & 1;
                let at = low[axis] + f64::from(far);
                share *= if far == 1 { f[axis] } else { 1.0 - f[axis] };
                if !(0.0..self.size[axis] as f64).contains(&at) {
                    share = 0.0;
                    break;
                }
                index = index * self.size[axis] + at as usize;
            }
            if share > 0.0 {
                sum += share * f64::from(self.weight[index]);
            }
        }
        sum
    }

    /// Returns the weight of the nearest voxel, zero outside the grid's box.
    fn nearest(&self, voxel: DVec3) -> f32 {
        if !in_box(voxel, self.size) {
            return 0.0;
        }
        // The far face of the box rounds up to one past the last voxel.
        let at = |axis: usize| ((voxel[axis] + 0.5) as usize).min(self.size[axis] - 1);
        self.weight[at(0) + self.size[0] * (at(1) + self.size[1] * at(2))]
    }
}

/// Returns the error of a region without voxels.
pub(super) fn empty() -> Error {
    Error::new(Kind::NothingToDo, "VGS-ROI-003", "the region of interest is empty")
        .help("check the mask, the label or the thresholds")
}

/// Returns true if a point in voxel space lies in the box of all voxels.
pub(super) fn in_box(voxel: DVec3, size: [usize; 3]) -> bool {
    (0..3).all(|a| voxel[a] >= -0.5 && voxel[a] <= size[a] as f64 - 0.5)
}

/// Returns the weights on the mask's own grid, and true if they are soft.
fn mask_weights(mask: &Volume, labels: &LabelChoice) -> Result<(Vec<f32>, bool)> {
    let bad = mask.samples.iter().filter(|v| !v.is_finite()).count();
    if bad > 0 {
        let message = format!("{bad} voxels of the mask are NaN or infinite");
        return Err(Error::new(Kind::BadData, "VGS-ROI-006", message).help("repair the mask"));
    }
    let (min, max) = mask.min_max().unwrap_or_default();
    let between = mask.samples.iter().filter(|&&v| !is_whole(v)).count();
    match (labels, between == 0) {
        (LabelChoice::Labels(names), true) => {
            let chosen = resolve(names, mask)?;
            let of_name = |asked: &&String| mask.labels.values().filter(|name| name == asked).count();
            for asked in names.iter().filter(|asked| of_name(asked) > 1) {
                tracing::warn!("several labels are called '{asked}', and all of them are taken");
            }
            let weight =
                mask.samples.iter().map(|&v| f32::from(u8::from(chosen.contains(&label_of(v))))).collect();
            Ok((weight, false))
        }
        (LabelChoice::Labels(_), false) if min < -OVERSHOOT || max > 1.0 + OVERSHOOT => {
            Err(between_labels(mask, between))
        }
        (LabelChoice::Labels(_), false) => {
            let message =
                "the mask is soft (its values are not whole numbers), so it has no labels to choose from";
            Err(Error::new(Kind::Usage, "VGS-ROI-007", message).help("leave out --roi-label"))
        }
        (LabelChoice::Whole, true) if min > -0.5 && max < 1.5 => {
            // Adding 0 makes 0 of -0.
            Ok((mask.samples.iter().map(|v| v.round() + 0.0).collect(), false))
        }
        (LabelChoice::Whole, true) => {
            let present = present_labels(mask);
            if min <= -0.5 || present.is_none() {
                return Err(no_mask(min, max));
            }
            Err(Error::new(Kind::Usage, "VGS-ROI-008", "the mask holds labels, of which none was chosen")
                .help(format!("--roi-label: {FORMS}; {}", there_are(mask, ""))))
        }
        (LabelChoice::Whole, false) => {
            // Mostly whole numbers are labels, and those between them come from an interpolation.
            if min > -0.5 && max > 1.0 + OVERSHOOT && 2 * between < mask.len() {
                return Err(between_labels(mask, between));
            }
            if min < -OVERSHOOT || max > 1.0 + OVERSHOOT {
                return Err(no_mask(min, max));
            }
            let outside = mask.samples.iter().filter(|v| !(0.0..=1.0).contains(*v)).count();
            if outside > 0 {
                tracing::warn!("{outside} mask values just outside [0, 1] ({min} to {max}) are clamped");
            }
            Ok((mask.samples.iter().map(|v| v.clamp(0.0, 1.0)).collect(), true))
        }
    }
}

fn no_mask(min: f32, max: f32) -> Error {
    let message =
        format!("values from {min} to {max} are no mask: it must be 0 or 1, soft in [0, 1], or labels");
    Error::new(Kind::BadData, "VGS-ROI-009", message).help("were volume and mask swapped?")
}

/// Returns the number of distinct finite values, or `None` if there are more than `most`.
fn distinct_up_to(samples: &[f32], most: usize) -> Option<usize> {
    let mut seen: Vec<f32> = Vec::with_capacity(most);
    for &v in samples.iter().filter(|v| v.is_finite()) {
        if !seen.contains(&v) {
            if seen.len() == most {
                return None;
            }
            seen.push(v);
        }
    }
    Some(seen.len())
}

/// The relation of the grids of a mask and a volume.
pub(super) enum Grids {
    /// They are the same grid.
    Same,
    /// One of them has no orientation; their sizes agree, so they are taken to be the same.
    Assumed,
    /// They are different grids in the same space.
    Differ,
}

/// Returns how the grids of a mask and a volume relate; they are the same if every corner agrees to a
/// thousandth of a voxel. Fails if one of them has no orientation and their sizes differ.
pub(super) fn relate(mask: &Volume, volume: &Volume) -> Result<Grids> {
    let volume_from_mask = volume.voxel_from_world() * mask.world_from_voxel;
    let apart = mask
        .voxel_corners()
        .into_iter()
        .map(|c| (volume_from_mask.transform_point3(c) - c).abs().max_element())
        .fold(0.0, f64::max);
    if mask.size == volume.size && apart <= SAME_GRID_VOXELS {
        return Ok(Grids::Same);
    }
    if mask.oriented && volume.oriented {
        return Ok(Grids::Differ);
    }
    if mask.size == volume.size {
        return Ok(Grids::Assumed);
    }
    let message = format!(
        "mask ({:?} voxels) and volume ({:?} voxels) cannot be related: one of them has no orientation",
        mask.size, volume.size
    );
    Err(Error::new(Kind::BadData, "VGS-ROI-011", message).help("use a mask on the volume's own grid"))
}

/// Returns the weights of `roi`, which lies on the grid of `mask`, on the grid of `volume`.
fn resample(roi: &Roi, mask: &Volume, volume: &Volume) -> Result<Vec<f32>> {
    let mask_from_volume = mask.voxel_from_world() * volume.world_from_voxel;
    let [nx, ny, _] = volume.size;
    let place = |i: usize| {
        let voxel = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
        mask_from_volume.transform_point3(voxel)
    };
    if !(0..volume.len()).into_par_iter().any(|i| in_box(place(i), mask.size)) {
        let message =
            format!("mask and volume do not overlap (boxes {} and {})", world_box(mask), world_box(volume));
        return Err(Error::new(Kind::BadData, "VGS-ROI-012", message)
            .help("use a mask of the same scan; converters sometimes lose the origin"));
    }
    let how = if roi.soft { "linearly" } else { "by nearest voxel" };
    // A part of the volume's own grid, as many masks are, loses nothing.
    if !centres_coincide(mask, volume) {
        tracing::warn!(
            "the mask is on another grid ({:?} voxels) than the volume: it is resampled {how}",
            mask.size
        );
    }
    let weight = |i: usize| if roi.soft { roi.trilinear(place(i)) as f32 } else { roi.nearest(place(i)) };
    Ok((0..volume.len()).into_par_iter().map(|i| weight(i).clamp(0.0, 1.0)).collect())
}

/// Returns true if the centres of all voxels of a mask are centres of voxels of the volume, or would be if it
/// went on: the axes may be turned by right angles, and the mask may be smaller or larger.
fn centres_coincide(mask: &Volume, volume: &Volume) -> bool {
    let volume_from_mask = volume.voxel_from_world() * mask.world_from_voxel;
    let far = |axis: usize| (mask.size[axis] - 1) as f64;
    (0..8).all(|corner| {
        let end = DVec3::from_array(std::array::from_fn(|a| if corner >> a & 1 == 1 { far(a) } else { 0.0 }));
        let at = volume_from_mask.transform_point3(end);
        (at - at.round()).abs().max_element() <= SAME_GRID_VOXELS
    }) && (0..3).all(|axis| {
        let step = volume_from_mask.matrix3.col(axis).abs();
        (step.element_sum() - 1.0).abs() <= SAME_GRID_VOXELS
            && (step.max_element() - 1.0).abs() <= SAME_GRID_VOXELS
    })
}

/// Returns the box of a volume in the world, as text.
fn world_box(volume: &Volume) -> String {
    let corners = volume.world_corners();
    let low = corners.into_iter().fold(DVec3::INFINITY, DVec3::min);
    let high = corners.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max);
    let point = |p: DVec3| format!("({:.1}, {:.1}, {:.1})", p.x, p.y, p.z);
    format!("{}..{} mm", point(low), point(high))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::DAffine3;

    use super::*;

    fn volume(size: [usize; 3], value: impl Fn(usize) -> f32) -> Volume {
        Volume::new(size, DAffine3::IDENTITY, (0..size.iter().product()).map(value).collect())
    }

    fn ct() -> Volume {
        volume([4, 3, 2], |i| i as f32 - 10.0)
    }

    fn choice(text: &str) -> LabelChoice {
        text.parse().unwrap()
    }

    #[test]
    fn masks_of_every_kind() {
        let label = choice("2,liver");
        // (mask values, cyclic), choice, expected: weights of the first four voxels and softness, or kind and
        // code.
        type Expected = std::result::Result<([f32; 4], bool), (Kind, &'static str)>;
        let cases: [(&[f32], &LabelChoice, Expected); 22] = [
            (&[0.0, 1.0], &LabelChoice::Whole, Ok(([0.0, 1.0, 0.0, 1.0], false))),
            (&[1.0], &LabelChoice::Whole, Ok(([1.0; 4], false))),
            (&[0.0, 0.5, 1.0, 1.0], &LabelChoice::Whole, Ok(([0.0, 0.5, 1.0, 1.0], true))),
            (&[-0.0005, 0.5, 1.0005, 1.0], &LabelChoice::Whole, Ok(([0.0, 0.5, 1.0, 1.0], true))),
            (&[-0.5, 0.5], &LabelChoice::Whole, Err((Kind::BadData, "VGS-ROI-009"))),
            (&[0.5, 1.5], &LabelChoice::Whole, Err((Kind::BadData, "VGS-ROI-009"))),
            (&[-1000.0, 40.0], &LabelChoice::Whole, Err((Kind::BadData, "VGS-ROI-009"))),
            (&[0.5, f32::NAN], &LabelChoice::Whole, Err((Kind::BadData, "VGS-ROI-006"))),
            (&[1.0, f32::INFINITY], &LabelChoice::Whole, Err((Kind::BadData, "VGS-ROI-006"))),
            (&[0.0, 2.0], &LabelChoice::Whole, Err((Kind::Usage, "VGS-ROI-008"))),
            (&[0.0, 2.0, 5.0, 3.0], &label, Ok(([0.0, 1.0, 1.0, 0.0], false))),
            (&[0.0, 2.0], &label, Err((Kind::Usage, "VGS-ROI-010"))),
            (&[0.0, 0.5], &label, Err((Kind::Usage, "VGS-ROI-007"))),
            // A rounding away from whole numbers, as after scl_slope = 1/255 or a resampling.
            (&[0.0, 0.999_999_9], &LabelChoice::Whole, Ok(([0.0, 1.0, 0.0, 1.0], false))),
            (&[-1e-7, 1.000_000_1], &LabelChoice::Whole, Ok(([0.0, 1.0, 0.0, 1.0], false))),
            (&[0.0, 1.999_999_9, 4.999_999_5, 3.0], &label, Ok(([0.0, 1.0, 1.0, 0.0], false))),
            (&[0.0, 2.000_000_2, 5.0, 2.9999], &label, Ok(([0.0, 1.0, 1.0, 0.0], false))),
            (&[0.0, 1.999_999_9], &LabelChoice::Whole, Err((Kind::Usage, "VGS-ROI-008"))),
            // What an interpolation makes of labels.
            (&[0.0, 2.0, 2.5, 5.0], &label, Err((Kind::BadData, "VGS-ROI-020"))),
            (&[0.0, 2.0, 2.5, 5.0], &LabelChoice::Whole, Err((Kind::BadData, "VGS-ROI-020"))),
            (&[0.0, 0.5, 0.999_999_9, 1.0], &LabelChoice::Whole, Ok(([0.0, 0.5, 0.999_999_9, 1.0], true))),
            (&[0.0], &LabelChoice::Whole, Err((Kind::NothingToDo, "VGS-ROI-003"))),
        ];
        for (values, labels, expected) in cases {
            let mut mask = volume([4, 3, 2], |i| values[i % values.len()]);
            mask.labels = BTreeMap::from([(5, "Liver".into()), (9, "aorta".into())]);
            match (Roi::from_mask(&mask, labels, &ct()), expected) {
                (Ok(roi), Ok((first, soft))) => {
                    assert_eq!(
                        (&roi.weight[..4], roi.soft, roi.size),
                        (&first[..], soft, [4, 3, 2]),
                        "{values:?}"
                    );
                }
                (Err(e), Err(expected)) => assert_eq!((e.kind, e.code), expected, "{values:?}"),
                (found, _) => panic!("{values:?}: {found:?}"),
            }
        }
    }

    #[test]
    fn a_label_map_lists_what_can_be_chosen() {
        let mut mask = volume([4, 3, 2], |i| (i % 3) as f32 * 5.0);
        mask.labels = BTreeMap::from([(5, "liver".into()), (9, "aorta".into())]);
        let expected = "5 liver (8 voxels), 10 (8 voxels)";
        for labels in [LabelChoice::Whole, choice("aorta"), choice("7")] {
            let help = Roi::from_mask(&mask, &labels, &ct()).unwrap_err().help;
            assert!(help.contains(expected), "{help}");
        }
        let roi = Roi::from_mask(&mask, &choice("LIVER, 10"), &ct()).unwrap();
        assert_eq!(roi.voxel_count(), 16);
        for (text, voxels) in [("all", 16), ("1-9", 8), ("li*,10", 16)] {
            assert_eq!(Roi::from_mask(&mask, &choice(text), &ct()).unwrap().voxel_count(), voxels, "{text}");
        }
        for text in ["", "1,,2", "liver,"] {
            assert_eq!(text.parse::<LabelChoice>().unwrap_err().kind, Kind::Usage);
        }
    }

    #[test]
    fn names_with_commas_stand_in_quotes() {
        let mut mask = volume([4, 3, 2], |i| (i % 3) as f32 * 5.0);
        mask.labels = BTreeMap::from([(5, "kidney, left".into())]);
        let roi = Roi::from_mask(&mask, &choice(r#""Kidney, left""#), &ct()).unwrap();
        assert_eq!(roi.voxel_count(), 8);
        for text in ["\"\"", "\"a\",", "a,\"\""] {
            assert_eq!(text.parse::<LabelChoice>().unwrap_err().code, "VGS-ROI-001", "{text}");
        }
    }

    #[test]
    fn an_unknown_label_of_many_is_answered_with_few_words() {
        let mut mask = volume([4, 3, 2], |i| i as f32);
        mask.labels = (1..100).map(|i| (i, format!("rib_left_{i}"))).collect();
        let answer = |text: &str| Roi::from_mask(&mask, &choice(text), &ct()).unwrap_err();
        let mistyped = answer("rib_lft_7");
        assert!(mistyped.help.starts_with("did you mean rib_left_7? `vgs info`"), "{}", mistyped.help);
        assert!(mistyped.help.contains("its 23 labels"), "{}", mistyped.help);
        assert!(answer("rib_left_44").message.contains("no voxel of the label"));
        for text in ["spleen", "rib", "77", "30-40"] {
            let error = answer(text);
            assert!(error.message.len() + error.help.len() < 200, "{error}");
        }
        let undecided = Roi::from_mask(&mask, &LabelChoice::Whole, &ct()).unwrap_err();
        assert!(undecided.help.contains("rib_*") && undecided.help.len() < 260, "{}", undecided.help);
    }

    #[test]
    fn a_mask_on_another_grid_is_resampled() {
        let ct = volume([8, 8, 8], |i| i as f32);
        // Half the resolution, same box: voxel i covers the volume's 2i and 2i + 1.
        let affine = DAffine3 { translation: DVec3::splat(0.5), ..DAffine3::from_scale(DVec3::splat(2.0)) };
        let mut mask = volume([4, 4, 4], |i| f32::from(u8::from(i % 4 == 1)));
        mask.world_from_voxel = affine;
        let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &ct).unwrap();
        assert_eq!((&roi.weight[..8], roi.soft), (&[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0][..], false));
        assert_eq!(roi.voxel_count(), 128);

        mask.samples.iter_mut().for_each(|v| *v *= 0.5);
        let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &ct).unwrap();
        let inner = roi.weight[8 * 8 * 4 + 8 * 4..][..8].to_vec();
        assert_eq!(inner, [0.0, 0.125, 0.375, 0.375, 0.125, 0.0, 0.0, 0.0]);

        // Rounded affines are the same grid; flipped storage of the same space is not.
        let mut near = volume([8, 8, 8], |i| f32::from(u8::from(i == 0)));
        near.world_from_voxel.translation.x = 9e-4;
        assert_eq!(Roi::from_mask(&near, &LabelChoice::Whole, &ct).unwrap().weight[0], 1.0);
        near.world_from_voxel = DAffine3 {
            translation: DVec3::new(7.0, 0.0, 0.0),
            ..DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))
        };
        assert_eq!(Roi::from_mask(&near, &LabelChoice::Whole, &ct).unwrap().weight[7], 1.0);
    }

    #[test]
    fn masks_that_cannot_be_related() {
        let mask = |x: f64, oriented: bool, size| {
            let mut mask = volume(size, |_| 1.0);
            mask.world_from_voxel.translation.x = x;
            mask.oriented = oriented;
            mask
        };
        let error = |m: &Volume| Roi::from_mask(m, &LabelChoice::Whole, &ct()).unwrap_err();
        let far = error(&mask(100.0, true, [4, 3, 2]));
        assert_eq!((far.kind, far.code), (Kind::BadData, "VGS-ROI-012"));
        assert!(far.message.contains("(99.5, -0.5, -0.5)..(103.5, 2.5, 1.5) mm"), "{}", far.message);
        assert_eq!(error(&mask(0.0, false, [3, 3, 2])).code, "VGS-ROI-011");
        // Without orientation an equal size is all there is to go by.
        assert!(Roi::from_mask(&mask(100.0, false, [4, 3, 2]), &LabelChoice::Whole, &ct()).is_ok());
        // They overlap, but nothing that is marked lies in the volume.
        let mut beside = mask(-2.0, true, [4, 3, 2]);
        beside.samples = (0..24).map(|i| f32::from(u8::from(i % 4 == 0))).collect();
        assert_eq!(error(&beside).kind, Kind::NothingToDo);
    }

    #[test]
    fn thresholds_are_inclusive() {
        let roi = Roi::from_threshold(&ct(), -2.0, 3.0).unwrap();
        assert_eq!((roi.voxel_count(), roi.weight_sum(), roi.soft), (6, 6.0, false));
        assert_eq!(Roi::from_threshold(&ct(), 50.0, 60.0).unwrap_err().kind, Kind::NothingToDo);
        for (low, high) in [(3.0, -2.0), (f32::NAN, 1.0), (0.0, f32::NAN)] {
            assert_eq!(Roi::from_threshold(&ct(), low, high).unwrap_err().code, "VGS-ROI-005");
        }
    }

    #[test]
    fn voxels_without_a_value_are_excluded() {
        let with_nan = |n: usize| volume([4, 3, 2], |i| if i < n { f32::NAN } else { 0.0 });
        let mask = volume([4, 3, 2], |i| f32::from(u8::from(i < 10)));
        let from = |n| Roi::from_mask(&mask, &LabelChoice::Whole, &with_nan(n));
        assert_eq!(from(5).unwrap().voxel_count(), 5);
        assert_eq!(from(5).unwrap().weight[4], 0.0);
        assert_eq!(from(6).unwrap_err().code, "VGS-ROI-004");
        // Outside the region they do not matter.
        let outside = volume([4, 3, 2], |i| if i < 10 { 0.0 } else { f32::INFINITY });
        assert_eq!(Roi::from_mask(&mask, &LabelChoice::Whole, &outside).unwrap().voxel_count(), 10);
    }

    #[test]
    fn beyond_the_volume_there_is_no_weight() {
        let roi = Roi::new((0..24).map(|i| (i + 1) as f32 / 24.0).collect(), &ct()).unwrap();
        for (i, &weight) in roi.weight.iter().enumerate() {
            let voxel = IVec3::new(i as i32 % 4, i as i32 / 4 % 3, i as i32 / 12);
            assert_eq!(roi.at(voxel), weight);
            for axis in 0..3 {
                for beyond in [-1, roi.size[axis] as i32] {
                    let mut voxel = voxel;
                    voxel[axis] = beyond;
                    assert_eq!(roi.at(voxel), 0.0, "{voxel}");
                }
            }
        }
    }

    #[test]
    fn trilinear_weight_fades_to_zero_outside() {
        let roi = Roi::new((0..24).map(|i| (i % 4) as f32 / 4.0).collect(), &ct()).unwrap();
        for (x, expected) in
            [(0.0, 0.0), (1.5, 0.375), (3.0, 0.75), (3.5, 0.375), (4.0, 0.0), (-1.0, 0.0), (9.0, 0.0)]
        {
            assert_eq!(roi.trilinear(DVec3::new(x, 1.0, 0.0)), expected, "{x}");
        }
        assert_eq!(roi.trilinear(DVec3::new(3.0, 2.5, 1.5)), 0.1875);
        assert_eq!(roi.trilinear(DVec3::NAN), 0.0);
    }
}
