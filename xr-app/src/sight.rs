//! The views that show what the eyes see, and the visibility masks of their pictures.
//!
//! Without foveation there is a view for each eye. With it there are two views for each eye, with pictures of
//! one size, a part of the eye's: the surround is all that the eye sees, at fewer pixels, and the inset is
//! the middle around the axis straight ahead, at full resolution. Nothing is rendered of the surround where
//! the inset covers it, nor of either where the lenses hide it.

use engine::render::{Camera, Fov, Settings, Triangle, VisibilityMask};
use glam::{DVec2, DVec3};

use crate::headset::Eye;
use crate::placement::Placement;

/// Part of an inset's edges over which it fades into the surround.
pub const FADING: f64 = 0.1;

/// Place of an inset in the picture of an eye: its left, upper, right and lower edge as parts of the
/// picture's.
pub type Inset = [f64; 4];

/// Place of the mark of a draft in the picture of an eye: its middle and its half-axes as parts of the
/// picture's edges.
pub type Mark = [f64; 4];

/// Offset of the mark below straight ahead, and its radius; tangents.
const MARK: [f64; 2] = [0.36, 0.009];

/// The views that are rendered for the eyes.
pub struct Sight {
    eye_size: [u32; 2],
    /// Width and height of the pictures of views, pixels.
    size: [u32; 2],
    foveated: bool,
    /// True if lenses hide something.
    lenses: bool,
    /// Fields of view of the last frame.
    fovs: Option<[Fov; 2]>,
    insets: [Inset; 2],
    marks: [Mark; 2],
    /// Fields of view and insets for which the masks were computed.
    made_for: Option<([Fov; 2], [Inset; 2])>,
    masks: Vec<VisibilityMask>,
    hidden: [f64; 2],
}

impl Sight {
    /// Creates the views for eyes with pictures of `eye_size` pixels, behind lenses that may hide something.
    /// With foveation, the edges of the views' pictures are such a part of the eyes'.
    pub fn new(eye_size: [u32; 2], foveation: Option<f64>, lenses: bool) -> Self {
        let part = foveation.unwrap_or(1.0);
        let size = eye_size.map(|n| ((f64::from(n) * part).round() as u32).clamp(1, n));
        Sight {
            eye_size,
            size,
            foveated: foveation.is_some(),
            lenses,
            fovs: None,
            insets: [inset(DVec2::splat(0.5), size, eye_size); 2],
            marks: [[0.0; 4]; 2],
            made_for: None,
            masks: Vec::new(),
            hidden: [0.0; 2],
        }
    }

    /// Returns the settings of the renderer of the views.
    pub fn settings(&self, depth: bool) -> Settings {
        let (views, masked) = (if self.foveated { 4 } else { 2 }, self.foveated || self.lenses);
        Settings { views, depth, masked, gradual: true, ..Settings::new(self.size) }
    }

    /// Returns the width and height of the pictures of the eyes, pixels.
    pub fn eye_size(&self) -> [u32; 2] {
        self.eye_size
    }

    /// Returns the places of the frame's insets, if there are any.
    pub fn insets(&self) -> Option<&[Inset; 2]> {
        self.foveated.then_some(&self.insets)
    }

    /// Returns the place of the mark of a draft for each eye: in one direction, so that both see one mark.
    pub fn marks(&self) -> &[Mark; 2] {
        &self.marks
    }

    /// Moves the insets of the next frame straight ahead of the eyes of the last. It must be called before
    /// the next frame is recorded, when its eyes are not yet known; the insets stay there from then on.
    pub fn aim(&mut self) {
        if let Some(fovs) = self.fovs {
            self.insets = fovs.map(|fov| {
                let ahead = DVec2::new(fov.left / (fov.left - fov.right), fov.up / (fov.up - fov.down));
                inset(ahead, self.size, self.eye_size)
            });
        }
    }

    /// Forgets the lenses, so that the visibility masks are recomputed.
    pub fn forget(&mut self) {
        self.made_for = None;
    }

    /// Recomputes the visibility masks of a frame with these eyes behind such lenses; returns them if they
    /// changed. Keeps the fields of view for [`Self::aim`].
    pub fn update(&mut self, lenses: &[Vec<Triangle>; 2], eyes: &[Eye; 2]) -> Option<&[VisibilityMask]> {
        let fovs = eyes.map(|eye| eye.fov);
        self.fovs = Some(fovs);
        self.marks = marks(eyes);
        let wanted = (fovs, self.insets);
        if !(self.foveated || self.lenses) || self.made_for.replace(wanted) == Some(wanted) {
            return None;
        }
        self.masks = [0, 1].map(|eye| VisibilityMask::of(&fovs[eye], &lenses[eye])).to_vec();
        self.hidden = [0, 1].map(|eye: usize| self.masks[eye].share());
        if self.foveated {
            let of = |eye: usize, fov: &Fov, more: &[Triangle]| {
                VisibilityMask::of(fov, &[&lenses[eye][..], more].concat())
            };
            let within = |eye: usize| of(eye, &inner(&fovs[eye], &self.insets[eye]), &[]);
            let around = |eye: usize| of(eye, &fovs[eye], &covered(&fovs[eye], &self.insets[eye]));
            self.masks = vec![around(0), around(1), within(0), within(1)];
        }
        Some(&self.masks)
    }

    /// Returns the views of these eyes, in the order of the pictures' layers: first those of both eyes, then
    /// their insets.
    pub fn cameras(&self, placement: &Placement, eyes: &[Eye; 2]) -> Vec<Camera> {
        let insets = self.insets().into_iter().flatten();
        let within = eyes.iter().zip(insets).map(|(eye, inset)| Eye { fov: inner(&eye.fov, inset), ..*eye });
        eyes.iter().copied().chain(within).map(|eye| placement.camera(&eye)).collect()
    }

    /// Returns the part of each eye's picture that lenses hide.
    pub fn hidden(&self) -> [f64; 2] {
        self.hidden
    }
}

/// Returns the mark in the direction straight ahead of both eyes together and somewhat down.
fn marks(eyes: &[Eye; 2]) -> [Mark; 2] {
    let mean = |axis: DVec3| (eyes[0].pose.orientation * axis + eyes[1].pose.orientation * axis).normalize();
    let [below, radius] = MARK;
    let toward = mean(DVec3::NEG_Z) + below * mean(DVec3::NEG_Y);
    eyes.map(|Eye { pose, fov }| {
        let here = pose.orientation.inverse() * toward;
        let [wide, high] = [fov.right - fov.left, fov.up - fov.down];
        let at = [(here.x / -here.z - fov.left) / wide, (fov.up - here.y / -here.z) / high];
        [at[0], at[1], radius / wide, radius / high]
    })
}

/// Returns an inset of `size` pixels around a place of a picture, or as near to it as the picture's edges
/// allow, on whole pixels.
fn inset(middle: DVec2, size: [u32; 2], of: [u32; 2]) -> Inset {
    let [x, y] = [0, 1].map(|axis| {
        let [wide, all] = [size[axis], of[axis]].map(f64::from);
        let first = (middle[axis] * all - 0.5 * wide).round().clamp(0.0, all - wide);
        (first / all, (first + wide) / all)
    });
    [x.0, y.0, x.1, y.1]
}

/// Returns the part of a field of view that an inset shows.
fn inner(fov: &Fov, &[left, up, right, down]: &Inset) -> Fov {
    let across = |part: f64| fov.left + (fov.right - fov.left) * part;
    let along = |part: f64| fov.up + (fov.down - fov.up) * part;
    Fov { left: across(left), right: across(right), up: along(up), down: along(down) }
}

/// Returns the area in which the inset is opaque and nothing of the surround shows.
fn covered(fov: &Fov, &[left, up, right, down]: &Inset) -> [Triangle; 2] {
    // As in `eyes.glsl`: at an edge of the picture an inset does not fade.
    let from = |low: f64, edge: f64| if low > 0.0 { low + edge * FADING } else { 0.0 };
    let to = |high: f64, edge: f64| if high < 1.0 { high - edge * FADING } else { 1.0 };
    let (wide, high) = (right - left, down - up);
    let full = inner(fov, &[from(left, wide), from(up, high), to(right, wide), to(down, high)]);
    let [a, b, c, d] =
        [[full.left, full.up], [full.right, full.up], [full.right, full.down], [full.left, full.down]]
            .map(DVec2::from_array);
    [[a, b, c], [a, c, d]]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::headset::Pose;

    const FOV: Fov = Fov { left: -1.2, right: 0.8, up: 0.75, down: -1.25 };

    fn eyes() -> [Eye; 2] {
        [
            Eye { pose: Pose::IDENTITY, fov: FOV },
            Eye { pose: Pose::IDENTITY, fov: Fov { left: -3.0, right: 0.1, ..FOV } },
        ]
    }

    #[test]
    fn insets_are_straight_ahead_on_whole_pixels_within_the_picture() {
        let mut sight = Sight::new([200, 160], Some(0.5), false);
        let settings = sight.settings(false);
        assert_eq!((settings.size, settings.views, settings.masked), ([100, 80], 4, true));
        assert_eq!(sight.insets().expect("insets")[0], [0.25, 0.25, 0.75, 0.75], "in the middle at first");
        assert!(sight.update(&Default::default(), &eyes()).is_some());
        sight.aim();
        // Straight ahead is at 0.6 and 0.375 of the picture; for the right eye the field ends soon after it.
        let near = |found: Inset, wanted: Inset| found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < 1e-12);
        let [left, right] = *sight.insets().expect("insets");
        assert!(
            near(left, [0.35, 0.125, 0.85, 0.625]) && near(right, [0.5, 0.125, 1.0, 0.625]),
            "{left:?} {right:?}"
        );
        let placement = Placement::before(&Pose::IDENTITY, DVec3::ZERO, 100.0);
        let cameras = sight.cameras(&placement, &eyes());
        let [wide, within] = [cameras[0].fov, cameras[2].fov];
        assert_eq!(wide, FOV);
        assert!((within.left + 0.5).abs() < 1e-12 && (within.right - 0.5).abs() < 1e-12, "{within:?}");
        assert!((within.up - 0.5).abs() < 1e-12 && (within.down + 0.5).abs() < 1e-12, "{within:?}");
        assert!((cameras[3].fov.right - 0.1).abs() < 1e-12);
        assert_eq!(cameras[0].forward(), cameras[3].forward());
    }

    #[test]
    fn masks_are_returned_when_they_change() {
        let none = Default::default();
        assert!(Sight::new([200, 160], None, false).update(&none, &eyes()).is_none(), "nothing ever is");
        let mut sight = Sight::new([200, 160], None, true);
        let half = [DVec2::new(-9.0, -9.0), DVec2::new(-9.0, 9.0), DVec2::new(-0.2, 0.0)];
        let lenses = [vec![half], Vec::new()];
        let [left, right]: [VisibilityMask; 2] =
            sight.update(&lenses, &eyes()).expect("news").to_vec().try_into().expect("two views");
        assert!(left.share() > 0.1 && right == VisibilityMask::default());
        assert_eq!(sight.hidden(), [left.share(), 0.0]);
        assert!(sight.update(&lenses, &eyes()).is_none(), "no news");
        sight.forget();
        assert!(
            sight
                .update(&none, &eyes())
                .is_some_and(|all| *all == [VisibilityMask::default(), VisibilityMask::default()])
        );
        // The middle of the surround is covered: (0.8 · 0.5)² of it, less what is cut at patches.
        let mut sight = Sight::new([640, 640], Some(0.5), false);
        let all = sight.update(&none, &eyes()).expect("news").to_vec();
        let shares: Vec<f64> = all.iter().map(VisibilityMask::share).collect();
        assert!((0.13..=0.16).contains(&shares[0]) && shares[2..] == [0.0, 0.0], "{shares:?}");
        assert_eq!(sight.hidden(), [0.0, 0.0]);
        sight.aim();
        assert!(sight.update(&none, &eyes()).is_some(), "the insets have moved");
    }
}
