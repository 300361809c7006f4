//! Deletions: which splats the user has taken out of the picture. The files of the splats stay as they are.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A part of the splats that is deleted. What counts is where the mean of a splat lies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Deletion {
    /// The splats inside of a box, its faces included.
    Inside(Bounds),
    /// The splats outside of a box.
    Outside(Bounds),
    /// The splats of an object.
    Object(Target),
}

/// A box, and the files that it acts on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Corner at the patient's left, back and feet, mm RAS.
    pub low_mm: DVec3,
    /// The opposite corner, mm RAS.
    pub high_mm: DVec3,
    /// Number of files that were open when the box deleted: what is opened later is left whole.
    pub files: usize,
}

/// An object: a file, or one label of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Index of the file among those that are open.
    pub file: usize,
    /// Label, if the file has labels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<u8>,
}

impl Bounds {
    fn contains(&self, mean_mm: DVec3) -> bool {
        mean_mm.cmpge(self.low_mm).all() && mean_mm.cmple(self.high_mm).all()
    }

    fn is_sound(&self, files: usize) -> bool {
        let finite = self.low_mm.is_finite() && self.high_mm.is_finite();
        finite && self.low_mm.cmple(self.high_mm).all() && (1..=files).contains(&self.files)
    }
}

impl Deletion {
    /// Returns true if it deletes the splat of an object with this mean, mm RAS.
    pub fn takes(&self, object: Target, mean_mm: DVec3) -> bool {
        match self {
            Deletion::Inside(bounds) => object.file < bounds.files && bounds.contains(mean_mm),
            Deletion::Outside(bounds) => object.file < bounds.files && !bounds.contains(mean_mm),
            Deletion::Object(target) => *target == object,
        }
    }

    /// Takes a file out of what it names; returns false if nothing is left that it could delete.
    pub(crate) fn survives_without(&mut self, gone: usize) -> bool {
        match self {
            Deletion::Inside(bounds) | Deletion::Outside(bounds) => {
                bounds.files -= usize::from(gone < bounds.files);
                bounds.files > 0
            }
            Deletion::Object(target) => {
                let was = target.file;
                target.file -= usize::from(gone < was);
                was != gone
            }
        }
    }

    /// Returns true if its numbers are finite and in order, and it names none but the first `files` files.
    pub(crate) fn is_sound(&self, files: usize) -> bool {
        match self {
            Deletion::Inside(bounds) | Deletion::Outside(bounds) => bounds.is_sound(files),
            Deletion::Object(target) => target.file < files,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_act_on_the_files_that_were_open() {
        let bounds = Bounds { low_mm: DVec3::ZERO, high_mm: DVec3::splat(10.0), files: 1 };
        let (inside, outside) = (Deletion::Inside(bounds), Deletion::Outside(bounds));
        let [first, later] = [0, 1].map(|file| Target { file, label: None });
        for (mean, is_inside) in [
            (DVec3::splat(5.0), true),
            (DVec3::splat(10.0), true),
            (DVec3::new(5.0, 5.0, 10.01), false),
            (DVec3::new(-0.01, 5.0, 5.0), false),
        ] {
            assert_eq!(
                (inside.takes(first, mean), outside.takes(first, mean)),
                (is_inside, !is_inside),
                "{mean}"
            );
            assert!(!inside.takes(later, mean) && !outside.takes(later, mean), "{mean}");
        }
        let object = Deletion::Object(Target { file: 1, label: Some(3) });
        assert!(object.takes(Target { file: 1, label: Some(3) }, DVec3::ZERO));
        assert!(!object.takes(later, DVec3::ZERO) && !object.takes(first, DVec3::ZERO));
    }

    #[test]
    fn what_cannot_be_is_not_sound() {
        let bounds = Bounds { low_mm: DVec3::ZERO, high_mm: DVec3::ONE, files: 2 };
        assert!(Deletion::Inside(bounds).is_sound(2) && !Deletion::Inside(bounds).is_sound(1));
        for wrong in [
            Bounds { files: 0, ..bounds },
            Bounds { low_mm: DVec3::new(f64::NAN, 0.0, 0.0), ..bounds },
            Bounds { high_mm: DVec3::INFINITY, ..bounds },
            Bounds { low_mm: DVec3::splat(2.0), ..bounds },
        ] {
            assert!(!Deletion::Outside(wrong).is_sound(2), "{wrong:?}");
        }
        let object = Deletion::Object(Target { file: 1, label: None });
        assert!(object.is_sound(2) && !object.is_sound(1));
    }
}
