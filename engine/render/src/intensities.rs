//! Intensities of an object's splats or coded voxels, and whether a transfer function shows them: what is there and
//! cannot be seen has to be told.

use base::unit::Unit;
use glam::Vec3;
use splat::{Splat, SplatSet};
use transfer::{PRESETS, TransferFunction};
use volume::{Roi, Volume};

/// Opacity per mm below which a structure cannot be told from nothing.
const SEEN: f64 = 0.005;
/// Part of an object's splats that must be seen, or the object counts as unseen: V is a mean of several
/// splats, so that few bright ones among many are not seen either.
const LEAST_SEEN: f64 = 0.25;
/// Number of intensities that are kept of an object.
const KEPT: usize = 101;

/// Splats over which an intensity is averaged; fewer are taken as they are.
const NEIGHBOURS: usize = 8;

/// Returns about what is shown at splats, in no order: V is a mean of several, so an intensity is the mean of those that lie
/// near each other, along a Morton curve. The splats of a noisy scan reach far beyond it.
fn shown(splats: Vec<&Splat>) -> Vec<f32> {
    if splats.len() < 2 * NEIGHBOURS {
        return splats.iter().map(|splat| splat.intensity).collect();
    }
    let low = splats.iter().fold(Vec3::INFINITY, |low, splat| low.min(splat.mean.into()));
    let high = splats.iter().fold(Vec3::NEG_INFINITY, |high, splat| high.max(splat.mean.into()));
    // 1024 places along the longest edge of the box.
    let places = 1023.0 / (high - low).max_element().max(f32::MIN_POSITIVE);
    let code = |splat: &Splat| {
        let at = ((Vec3::from(splat.mean) - low) * places).as_uvec3().to_array();
        (0..10)
            .rev()
            .fold(0_u32, |code, bit| at.iter().fold(code, |code, axis| code << 1 | (axis >> bit & 1)))
    };
    let mut along: Vec<(u32, f32)> = splats.iter().map(|splat| (code(splat), splat.intensity)).collect();
    along.sort_by_key(|(code, _)| *code);
    along
        .windows(NEIGHBOURS)
        .map(|near| near.iter().map(|(_, v)| v).sum::<f32>() / NEIGHBOURS as f32)
        .collect()
}

/// Intensities of an object's splats, evenly chosen from the least to the greatest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intensities(Vec<f32>);

impl Intensities {
    /// Returns those of each object of a set, in the order of [`SplatSet::objects`]; without intensities they
    /// are empty.
    pub fn of_objects(set: &SplatSet) -> Vec<Self> {
        let objects = set.objects();
        if !set.unit.is_physical() {
            return vec![Intensities::default(); objects.len()];
        }
        let mut splats = vec![Vec::new(); 256];
        for (i, splat) in set.splats.iter().enumerate() {
            splats[set.labels.as_ref().map_or(0, |labels| usize::from(labels[i]))].push(splat);
        }
        let mut own: Vec<Vec<f32>> = splats.into_iter().map(shown).collect();
        set.coded().for_each(|(number, v)| own[usize::from(number)].push(v as f32));
        objects.iter().map(|object| Self::of(std::mem::take(&mut own[usize::from(object.number)]))).collect()
    }

    fn of(mut all: Vec<f32>) -> Self {
        all.sort_unstable_by(f32::total_cmp);
        let kept = all.len().min(KEPT);
        Intensities((0..kept).map(|k| all[k * (all.len() - 1) / (kept - 1).max(1)]).collect())
    }

    /// Returns those of several objects as of one.
    pub(super) fn of_all(objects: &[&Self]) -> Self {
        Self::of(objects.iter().flat_map(|object| &object.0).copied().collect())
    }

    /// Returns those of all splats of a set; none without intensities.
    pub fn of_set(set: &SplatSet) -> Self {
        if !set.unit.is_physical() {
            return Intensities::default();
        }
        let mut all = shown(set.splats.iter().collect());
        all.extend(set.coded().map(|(_, v)| v as f32));
        Self::of(all)
    }

    /// Returns those of the voxels of a region.
    pub fn of_region(volume: &Volume, roi: &Roi) -> Self {
        Self::of(roi.members().map(|i| volume.samples[i]).filter(|v| v.is_finite()).collect())
    }

    /// Returns the name of the preset that suits them: the one with which programs begin, or, where that shows next to
    /// nothing of them, the first of their unit that does show them.
    pub fn suiting_preset(&self, unit: Unit) -> &'static str {
        let first = transfer::first(unit);
        let range =
            self.0.first().zip(self.0.last()).map_or([0.0, 1.0], |(&low, &high)| [low.into(), high.into()]);
        let begin = PRESETS.iter().filter(|preset| preset.name == first);
        let mut all = begin.chain(PRESETS.iter().filter(|preset| preset.unit == unit));
        all.find(|preset| self.are_seen(&preset.over(range))).map_or(first, |preset| preset.name)
    }

    /// Returns the intensities between which the middle half of the splats lies; `None` without any.
    pub fn middle_half(&self) -> Option<[f32; 2]> {
        Some([self.of_share(0.25)?, self.of_share(0.75)?])
    }

    /// Returns the intensity that a share of the splats, 0 to 1, does not exceed; `None` without any.
    pub(super) fn of_share(&self, share: f64) -> Option<f32> {
        let last = self.0.len().checked_sub(1)?;
        Some(self.0[(share * last as f64) as usize])
    }

    /// Returns false if a transfer function shows next to nothing of them.
    pub fn are_seen(&self, transfer: &TransferFunction) -> bool {
        let seen = self.0.iter().filter(|&&v| transfer.at(f64::from(v)).1 >= SEEN).count();
        seen as f64 >= LEAST_SEEN * self.0.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_seen_if_a_quarter_of_its_splats_is() {
        let bone = PRESETS.iter().find(|p| p.name == "CT-Bone").expect("a preset").over([-1000.0, 3000.0]);
        let of = |bright: usize| {
            let intensity = |i: usize| if i < bright { 1200.0 } else { -900.0 };
            Intensities::of((0..1000).map(intensity).collect())
        };
        assert!(of(1000).are_seen(&bone) && of(260).are_seen(&bone));
        assert!(!of(0).are_seen(&bone) && !of(240).are_seen(&bone));
        assert_eq!(of(500).middle_half(), Some([-900.0, 1200.0]));
        let none = Intensities::of(Vec::new());
        assert!(none.are_seen(&bone) && none.middle_half().is_none(), "nothing is missing");
        assert_eq!(Intensities::of(vec![7.0]).middle_half(), Some([7.0, 7.0]));
    }

    #[test]
    fn splats_of_noise_count_as_what_they_show() {
        // 80 HU, with splats that reach 150 HU beyond on either side, as in a liver.
        let splat = |i: i32| Splat {
            mean: [(i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32],
            intensity: 80.0 + 150.0 * [1.0, -1.0][(i * 7 % 11 % 2) as usize],
            ..Splat::default()
        };
        let set = SplatSet { splats: (0..1000).map(splat).collect(), unit: Unit::Hu, ..SplatSet::default() };
        let raw = Intensities::of(set.splats.iter().map(|splat| splat.intensity).collect());
        assert_eq!(raw.suiting_preset(Unit::Hu), "CT-Bone");
        assert_eq!(Intensities::of_set(&set).suiting_preset(Unit::Hu), "CT-Soft-Tissue");
    }

    #[test]
    fn a_preset_suits_what_it_shows() {
        for (low, high, wanted) in [
            (300.0, 1500.0, "CT-Bone"),
            (30.0, 90.0, "CT-Soft-Tissue"),
            (-900.0, -700.0, "CT-Lung"),
            (-5000.0, -4000.0, "CT-Bone"),
        ] {
            let all = (0..200).map(|i| low + (high - low) * i as f32 / 199.0).collect();
            assert_eq!(Intensities::of(all).suiting_preset(Unit::Hu), wanted, "{low} to {high}");
        }
        assert_eq!(Intensities::of(vec![0.0, 1.0, 2.0]).suiting_preset(Unit::Arbitrary), "MR-Default");
        assert_eq!(Intensities::default().suiting_preset(Unit::Hu), "CT-Bone", "nothing is missing");
    }

    #[test]
    fn objects_keep_their_order() {
        let splat = |intensity| Splat { intensity, ..Splat::default() };
        let mut set = SplatSet {
            splats: [3.0, 1.0, 2.0].map(splat).into(),
            labels: Some(vec![9, 200, 9]),
            unit: Unit::Hu,
            ..SplatSet::default()
        };
        let of = |all: &[f32]| Intensities(all.to_vec());
        assert_eq!(Intensities::of_objects(&set), [of(&[2.0, 3.0]), of(&[1.0])]);
        set.labels = None;
        assert_eq!(Intensities::of_objects(&set), [of(&[1.0, 2.0, 3.0])]);
        set.unit = Unit::Luminance;
        assert_eq!(Intensities::of_objects(&set), [of(&[])]);
    }
}
