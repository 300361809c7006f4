//! What of the pictures no eye sees, kept up to date with the fields of view and with what the headset says of its lenses.

use engine::render::{Blind, Fov, Triangle};

use crate::headset::Eye;

/// Keeps up with the eyes.
#[derive(Default)]
pub struct Sight {
    /// Fields of view for which it is known.
    known: Option<[Fov; 2]>,
    blind: [Blind; 2],
}

impl Sight {
    /// What is known is no longer so.
    pub fn forget(&mut self) {
        self.known = None;
    }

    /// What is blind of the pictures of these eyes behind such lenses, where that is other than it was.
    pub fn update(&mut self, lenses: &[Vec<Triangle>; 2], eyes: &[Eye; 2]) -> Option<&[Blind]> {
        let fovs = eyes.map(|eye| eye.fov);
        if self.known.replace(fovs) == Some(fovs) {
            return None;
        }
        self.blind = [0, 1].map(|eye| Blind::of(&fovs[eye], &lenses[eye]));
        Some(&self.blind)
    }

    /// Part of each eye's picture that lenses hide.
    pub fn hidden(&self) -> [f64; 2] {
        self.blind.each_ref().map(Blind::share)
    }
}
