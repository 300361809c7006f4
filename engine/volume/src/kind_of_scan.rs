//! What the samples of a volume are numbers of: what its file or the user says, or what its name and its values suggest.

use std::path::Path;

use super::{Volume, VoxelSource};
use base::Result;
use base::unit::Unit;

/// HU below which there is air only, or what a scanner puts outside of its field.
const AIR: f32 = -200.0;
/// HU of the densest bone and of most metal: the greatest number of a CT of 12 bits.
const DENSEST: f32 = 4095.0;
/// HU between which the median of a CT without air lies: fat to soft tissue with contrast.
const TISSUE: [f32; 2] = [-150.0, 300.0];
/// HU below which a hundredth of the samples of a CT without air lies: water and fat with noise.
const FAT: f32 = -10.0;
/// Part of the great samples that the least ones exceed in a CT; those that a resampling of an MR leaves below 0 do not.
const OVERSHOOT: f32 = 0.02;
/// Edge of the boxes of a large volume that are looked at, voxels.
const BOX: usize = 128;
/// The most samples that are looked at for the shares below.
const LOOKED_AT: usize = 100_000;

/// Words in the names of files of a CT, and of another scan.
const CT: [&str; 8] = ["ct", "cta", "ctp", "ncct", "cect", "hrct", "ldct", "cbct"];
const OTHER: [&str; 16] = [
    "mr", "mri", "mra", "t1", "t1w", "t2", "t2w", "flair", "dwi", "adc", "swi", "pd", "bold", "pet", "suv",
    "spect",
];

/// A guess of the unit.
struct Guess {
    unit: Unit,
    /// What speaks for it, if that is not enough to be sure.
    doubt: Option<String>,
}

impl Volume {
    /// Returns what the intensities are numbers of: what the file or the user says, else HU if there is air, or values as
    /// of a CT whose air was cut off; nothing else of a volume without a scale of its own.
    pub fn unit(&self) -> Unit {
        self.stated_unit.unwrap_or_else(|| self.guess().unit)
    }

    /// Returns true if intensities are Hounsfield units.
    pub fn is_ct(&self) -> bool {
        self.unit() == Unit::Hu
    }

    /// Returns, as a sentence, what the intensities are taken for and why that is in doubt; `None` if it is not.
    pub fn unit_doubt(&self) -> Option<String> {
        match self.stated_unit {
            Some(_) => None,
            None => self.guess().doubt,
        }
    }

    fn guess(&self) -> Guess {
        let Some((low, high)) = self.min_max() else { return Guess { unit: Unit::Arbitrary, doubt: None } };
        if low < AIR {
            return Guess { unit: Unit::Hu, doubt: None };
        }
        let (least, greatest) = (self.share(0.01), self.share(0.99));
        if high <= DENSEST && least <= FAT && least <= -OVERSHOOT * greatest && greatest - least > 50.0 {
            let doubt = format!(
                "taken as HU: nothing is below {low}, as of a CT without air, and a hundredth is below {least:.0}"
            );
            return Guess { unit: Unit::Hu, doubt: Some(doubt) };
        }
        let could_be = high <= DENSEST && greatest - least > 50.0;
        let doubt = could_be.then(|| format!("taken as no HU, as of an MR: nothing is below {low}"));
        Guess { unit: Unit::Arbitrary, doubt }
    }

    /// Returns the sample below which this part of those lies that are finite and not 0, with which programs fill what
    /// they cut away; 0 if there is none.
    fn share(&self, part: f64) -> f32 {
        // An odd stride does not stay in one column of the grid.
        let stride = (self.len() / LOOKED_AT) | 1;
        let mut seen: Vec<f32> =
            self.samples.iter().step_by(stride).copied().filter(|v| v.is_finite() && *v != 0.0).collect();
        if seen.is_empty() {
            return 0.0;
        }
        let at = (part * (seen.len() - 1) as f64).round() as usize;
        *seen.select_nth_unstable_by(at, f32::total_cmp).1
    }

    /// Takes the unit from the name of the file, if nobody has stated one and the values allow it: the values of a file
    /// that is called CT may also be shifted so that none is below 0, or those of a picture.
    pub(super) fn learn_unit_from(&mut self, path: &Path) {
        let (None, Some(named)) = (self.stated_unit, unit_of_name(path)) else { return };
        let Some((low, high)) = self.min_max().filter(|(low, _)| *low >= AIR) else { return };
        let is_picture = low == 0.0 && high == 255.0;
        let could_be_ct =
            || high <= DENSEST && !is_picture && (TISSUE[0]..=TISSUE[1]).contains(&self.share(0.5));
        if named == Unit::Arbitrary || could_be_ct() {
            self.stated_unit = Some(named);
        }
    }
}

/// Returns what the intensities of a volume at `path` are numbers of, without having all of it in memory: HU if one of
/// its boxes is certainly of a CT, otherwise what most of them look like.
///
/// # Errors
/// Those of the source.
pub fn unit_by_boxes(volume: &dyn VoxelSource, path: &Path) -> Result<Unit> {
    let all = volume.grid().size;
    let counts = all.map(|n| n.div_ceil(BOX));
    let (mut boxes, mut hu) = (0, 0);
    for i in 0..counts.iter().product() {
        let place = [i % counts[0], i / counts[0] % counts[1], i / (counts[0] * counts[1])];
        let first = place.map(|at| at * BOX);
        let size = [0, 1, 2].map(|k| BOX.min(all[k] - first[k]));
        match volume.known(first, size) {
            Some(value) if value < AIR => return Ok(Unit::Hu),
            Some(_) => continue,
            None => {}
        }
        let mut part = volume.read_box(first, size)?;
        part.learn_unit_from(path);
        if part.is_ct() && part.unit_doubt().is_none() {
            return Ok(Unit::Hu);
        }
        boxes += 1;
        hu += usize::from(part.is_ct());
    }
    Ok(if 2 * hu > boxes { Unit::Hu } else { Unit::Arbitrary })
}

/// Returns the unit that the words of a file's name suggest; `None` if they suggest none, or two.
fn unit_of_name(path: &Path) -> Option<Unit> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let has = |known: &[&str]| name.split(|c: char| !c.is_alphanumeric()).any(|word| known.contains(&word));
    match (has(&CT), has(&OTHER)) {
        (true, false) => Some(Unit::Hu),
        (false, true) => Some(Unit::Arbitrary),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::Grid;

    fn volume(value: impl Fn(usize) -> f32) -> Volume {
        Volume::new([20, 20, 20], DAffine3::IDENTITY, (0..8000).map(value).collect())
    }

    /// Half of the voxels filled, the rest spread evenly from `low` to `high`.
    fn spread(fill: f32, low: f32, high: f32) -> Volume {
        volume(|i| if i % 2 == 0 { fill } else { (low + (high - low) * i as f32 / 8000.0).round() })
    }

    /// A file, whose boxes do not know what the others have.
    struct File(Volume);

    impl VoxelSource for File {
        fn grid(&self) -> Grid {
            self.0.grid()
        }

        fn read_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<Volume> {
            Ok(Volume { stated_unit: None, ..self.0.cropped(first, size) })
        }
    }

    #[test]
    fn one_box_of_air_tells_that_a_large_volume_is_a_ct() {
        let soft = |i: usize| 1.0 + (i * 7919 % 500) as f32;
        let at = |air: bool, i: usize| if air && i % 300 > 290 { -1000.0 } else { soft(i) };
        for (air, unit) in [(true, Unit::Hu), (false, Unit::Arbitrary)] {
            let samples = (0..120_000).map(|i| at(air, i)).collect();
            let file = File(Volume::new([300, 20, 20], DAffine3::IDENTITY, samples));
            let first = file.read_box([0; 3], [128, 20, 20]).unwrap();
            assert_eq!(first.unit(), Unit::Arbitrary, "the first box has no air");
            assert_eq!(unit_by_boxes(&file, Path::new("scan.zarr")).unwrap(), unit);
            assert_eq!(unit_by_boxes(&file, Path::new("ct.zarr")).unwrap(), Unit::Hu, "by its name");
        }
        let brain = File(spread(0.0, -25.0, 85.0));
        assert_eq!(unit_by_boxes(&brain, Path::new("a.nii")).unwrap(), Unit::Hu);
    }

    #[test]
    fn values_tell_a_ct_also_without_air() {
        for (what, volume, unit, doubted) in [
            ("air", spread(-1000.0, -1000.0, 2000.0), Unit::Hu, false),
            ("clipped for the abdomen", spread(-175.0, -120.0, 250.0), Unit::Hu, true),
            ("a brain without its skull", spread(0.0, -25.0, 85.0), Unit::Hu, true),
            ("an MR", spread(0.0, 1.0, 900.0), Unit::Arbitrary, true),
            (
                "an MR after a spline",
                volume(|i| if i % 50 == 0 { -12.0 } else { (i % 900) as f32 }),
                Unit::Arbitrary,
                true,
            ),
            ("z-scores", volume(|i| (i % 100) as f32 / 20.0 - 2.5), Unit::Arbitrary, false),
            ("16 bits", spread(0.0, 0.0, 30_000.0), Unit::Arbitrary, false),
            ("a mask", volume(|i| (i % 2) as f32), Unit::Arbitrary, false),
            ("nothing", volume(|_| f32::NAN), Unit::Arbitrary, false),
        ] {
            assert_eq!(
                (volume.unit(), volume.unit_doubt().is_some()),
                (unit, doubted),
                "{what}: {:?}",
                volume.unit_doubt()
            );
        }
    }

    #[test]
    fn what_is_stated_counts() {
        let mut brain = spread(0.0, 1.0, 80.0);
        assert!(!brain.is_ct());
        brain.stated_unit = Some(Unit::Hu);
        assert!(brain.is_ct() && brain.unit_doubt().is_none());
        let mut phase = spread(-4096.0, -4096.0, 4095.0);
        phase.stated_unit = Some(Unit::Arbitrary);
        assert!(!phase.is_ct());
    }

    #[test]
    fn names_tell_what_values_leave_open() {
        let learnt = |name: &str, mut volume: Volume| {
            volume.learn_unit_from(Path::new(name));
            volume.stated_unit
        };
        let brain = || spread(0.0, 1.0, 80.0);
        for name in ["ct.nii.gz", "a/Head-CT_brain.nrrd", "s0001 NCCT.mha"] {
            assert_eq!(learnt(name, brain()), Some(Unit::Hu), "{name}");
        }
        for name in ["T1w.nii.gz", "sub-01_FLAIR.nii"] {
            assert_eq!(learnt(name, brain()), Some(Unit::Arbitrary), "{name}");
        }
        for name in ["doctor.nii", "ct_to_mr.nii", "scan.nii", "ct/scan.nii"] {
            assert_eq!(learnt(name, brain()), None, "{name}");
        }
        assert_eq!(learnt("ct.nii", spread(0.0, 900.0, 1200.0)), None, "shifted by 1024");
        assert_eq!(learnt("ct.nii", spread(0.0, 0.0, 255.0)), None, "a picture");
        assert_eq!(learnt("t1.nii", spread(-1000.0, -1000.0, 2000.0)), None, "air counts more than a name");
    }
}
