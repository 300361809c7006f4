//! Regions of interest without a mask: the voxels of a threshold, cleaned.
//!
//! A threshold of bone also includes speckles of noise, the table and contrast agent, and leaves out marrow
//! and thin walls. The steps of a [`Cleaning`] remove the former and fill in the latter.

use super::morphology::{close, fill_holes, keep_pieces};
use super::{Roi, Volume};
use base::memory;
use base::{Error, Kind, Result};

/// The largest radius of a closing, mm: more than any gap in a bone, and a bound on the time and memory of a
/// closing.
const MAX_CLOSE_MM: f64 = 50.0;
/// Part of the least volume that a piece may lack: voxel sizes are rounded in files.
const ROUNDING: f64 = 1e-6;

/// Cleaning steps for the voxels of a threshold, in the order of the fields. The default does nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cleaning {
    /// Least volume of a connected piece, ml; smaller pieces are left out.
    pub min_ml: Option<f64>,
    /// Number of connected pieces to keep, the largest ones.
    pub largest: Option<usize>,
    /// Radius of the ball that closes gaps, mm.
    pub close_mm: Option<f64>,
    /// True if holes that are enclosed on all sides are filled.
    pub fill_holes: bool,
}

impl Cleaning {
    /// Checks the values, which come from flags.
    ///
    /// # Errors
    /// [`Kind::Usage`] if one is negative, not finite or too large, or no piece is to be kept.
    pub fn check(&self) -> Result<()> {
        let refuse = |flag: &str, value: String, needed: &str, help: &str| {
            let message = format!("{flag} is {value}; it must be {needed}");
            Err(Error::new(Kind::Usage, "VGS-ROI-014", message).help(help))
        };
        match *self {
            Cleaning { min_ml: Some(ml), .. } if !(ml.is_finite() && ml >= 0.0) => refuse(
                "--roi-min-ml",
                ml.to_string(),
                "a volume in ml, 0 or more",
                "give the volume of the smallest piece to keep: --roi-min-ml 1",
            ),
            Cleaning { largest: Some(0), .. } => refuse(
                "--roi-largest",
                "0".into(),
                "a number of pieces, 1 or more",
                "leave it out to keep all pieces",
            ),
            Cleaning { close_mm: Some(mm), .. } if !(0.0..=MAX_CLOSE_MM).contains(&mm) => refuse(
                "--roi-close",
                mm.to_string(),
                &format!("a radius from 0 to {MAX_CLOSE_MM} mm"),
                "give half the width of the gaps to close: --roi-close 2",
            ),
            _ => Ok(()),
        }
    }

    /// Returns the voxels of `volume` with `low` ≤ sample ≤ `high` (HU for CT), cleaned. Voxels without a
    /// finite sample stay outside, whatever is around them. The effect of each step is logged.
    ///
    /// The ball of the closing takes the axes of the volume to be at right angles, which those of a scan with
    /// a tilted gantry are not.
    ///
    /// # Errors
    /// [`Kind::NothingToDo`] if no piece is large enough, [`Kind::HostMemory`] if there is no memory for a
    /// step, and those of [`Cleaning::check`] and [`Roi::from_threshold`].
    pub fn region(&self, volume: &Volume, low: f32, high: f32) -> Result<Roi> {
        self.check()?;
        let roi = Roi::from_threshold(volume, low, high)?;
        if *self == Cleaning::default() {
            return Ok(roi);
        }
        memory::require(volume.len() as u64, "the voxels of a threshold")?;
        let mut mask: Vec<bool> = roi.weight.iter().map(|&weight| weight > 0.0).collect();
        // This frees four bytes per voxel, which the steps need more.
        drop(roi);

        let voxel_ml = volume.world_from_voxel.matrix3.determinant().abs() / 1000.0;
        let amount = |voxels: usize| format!("{voxels} voxels ({:.3} ml)", voxels as f64 * voxel_ml);
        let mut said = format!("from {low} to {high}: {}", amount(count(&mask)));
        if self.min_ml.is_some() || self.largest.is_some() {
            let least_ml = self.min_ml.unwrap_or_default();
            let least = (least_ml / voxel_ml * (1.0 - ROUNDING)).ceil() as u64;
            let pieces = keep_pieces(&mut mask, volume.size, least, self.largest.unwrap_or(usize::MAX))?;
            if pieces.kept == 0 {
                let message = format!(
                    "no connected piece from {low} to {high} has {least_ml} ml: the largest of {} has {:.3} ml",
                    pieces.found,
                    pieces.largest as f64 * voxel_ml
                );
                return Err(Error::new(Kind::NothingToDo, "VGS-ROI-015", message)
                    .help("give a smaller --roi-min-ml, or other thresholds"));
            }
            let (kept, found) = (pieces.kept, pieces.found);
            said += &format!("; {kept} of {found} connected pieces kept: {}", amount(count(&mask)));
        }
        if let Some(radius_mm) = self.close_mm {
            close(&mut mask, volume.size, volume.spacing_mm(), radius_mm)?;
            said += &format!("; closed by {radius_mm} mm: {}", amount(count(&mask)));
        }
        if self.fill_holes {
            fill_holes(&mut mask, volume.size)?;
            said += &format!("; holes filled: {}", amount(count(&mask)));
        }
        let mut without = 0;
        for (set, _) in mask.iter_mut().zip(&volume.samples).filter(|(set, v)| **set && !v.is_finite()) {
            *set = false;
            without += 1;
        }
        if without > 0 {
            said += &format!("; {without} of these are NaN or infinite and left out");
        }
        tracing::info!("{said}");
        Roi::new(mask.iter().map(|&set| f32::from(u8::from(set))).collect(), volume)
    }
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|&&set| set).count()
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;

    /// A hollow box of 500 HU with walls of one voxel and a hole in one of them, a small cube, and a speckle;
    /// of voxels of 1 × 1 × 2 mm in air.
    fn phantom() -> Volume {
        let size = [20, 14, 12];
        let within = |p: [usize; 3], low: [usize; 3], high: [usize; 3]| {
            (0..3).all(|a| (low[a]..=high[a]).contains(&p[a]))
        };
        let value = |i: usize| {
            let p = [i % 20, i / 20 % 14, i / 280];
            let shell = within(p, [2; 3], [9; 3]) && !within(p, [3; 3], [8; 3]) && p != [5, 5, 2];
            let bone = shell
                || within(p, [13; 3], [14; 3])
                || within(p, [13, 3, 3], [15, 5, 5])
                || p == [18, 12, 10];
            if bone { 500.0 } else { -1000.0 }
        };
        let affine = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 2.0));
        Volume::new(size, affine, (0..20 * 14 * 12).map(value).collect())
    }

    /// Voxels of the wall of the box, of the cube, and of what is inside the box.
    const WALL: usize = 8 * 8 * 8 - 6 * 6 * 6 - 1;
    const CUBE: usize = 27;
    const INSIDE: usize = 6 * 6 * 6;

    #[test]
    fn each_step_does_what_it_says() {
        let volume = phantom();
        let none = Cleaning::default();
        let rows: [(Cleaning, usize); 8] = [
            (none, WALL + CUBE + 1),
            (Cleaning { largest: Some(1), ..none }, WALL),
            (Cleaning { largest: Some(2), ..none }, WALL + CUBE),
            (Cleaning { largest: Some(9), ..none }, WALL + CUBE + 1),
            // The cube has 27 voxels of 2 mm³.
            (Cleaning { min_ml: Some(0.054), ..none }, WALL + CUBE),
            (Cleaning { min_ml: Some(0.055), ..none }, WALL),
            // The hole is open, and a ball of one voxel closes it.
            (Cleaning { largest: Some(1), fill_holes: true, ..none }, WALL),
            (
                Cleaning { min_ml: Some(0.01), close_mm: Some(1.0), fill_holes: true, ..none },
                WALL + 1 + INSIDE + CUBE,
            ),
        ];
        for (cleaning, voxels) in rows {
            let roi = cleaning.region(&volume, 200.0, 3000.0).unwrap();
            assert_eq!((roi.voxel_count(), roi.soft), (voxels, false), "{cleaning:?}");
        }
        assert_eq!(
            none.region(&volume, 200.0, 3000.0).unwrap().weight,
            Roi::from_threshold(&volume, 200.0, 3000.0).unwrap().weight
        );
    }

    #[test]
    fn voxels_without_a_value_stay_outside() {
        let mut volume = phantom();
        let inside = [volume.index(5, 5, 2), volume.index(5, 5, 5), volume.index(3, 3, 3)];
        for (i, value) in inside.into_iter().zip([f32::NAN, f32::INFINITY, f32::NAN]) {
            volume.samples[i] = value;
        }
        let all = Cleaning { largest: Some(1), min_ml: Some(0.1), close_mm: Some(1.0), fill_holes: true };
        let roi = all.region(&volume, 200.0, f32::INFINITY).unwrap();
        assert_eq!(roi.voxel_count(), WALL + 1 + INSIDE - 3);
        assert!(inside.iter().all(|&i| roi.weight[i] == 0.0));
    }

    #[test]
    fn wrong_values_are_refused() {
        let none = Cleaning::default();
        let volume = phantom();
        for (cleaning, says) in [
            (Cleaning { largest: Some(0), ..none }, "--roi-largest is 0;"),
            (Cleaning { min_ml: Some(-1.0), ..none }, "--roi-min-ml is -1;"),
            (Cleaning { min_ml: Some(f64::NAN), ..none }, "--roi-min-ml is NaN;"),
            (Cleaning { min_ml: Some(f64::INFINITY), ..none }, "--roi-min-ml is inf;"),
            (Cleaning { close_mm: Some(-0.5), ..none }, "--roi-close is -0.5;"),
            (Cleaning { close_mm: Some(50.1), ..none }, "a radius from 0 to 50 mm"),
            (Cleaning { close_mm: Some(f64::NAN), ..none }, "--roi-close is NaN;"),
        ] {
            let error = cleaning.region(&volume, 200.0, 3000.0).unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-ROI-014"), "{cleaning:?}");
            assert!(error.message.contains(says) && !error.help.is_empty(), "{error}");
        }
        let error = Cleaning { min_ml: Some(5.0), ..none }.region(&volume, 200.0, 3000.0).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::NothingToDo, "VGS-ROI-015"));
        assert!(
            error.message.ends_with("from 200 to 3000 has 5 ml: the largest of 3 has 0.590 ml"),
            "{error}"
        );
        // Where nothing is in the range, that is what is said.
        let error = Cleaning { largest: Some(1), ..none }.region(&volume, 5000.0, 6000.0).unwrap_err();
        assert_eq!(error.code, "VGS-ROI-003");
    }
}
