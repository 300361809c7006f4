//! What the numbers of a PLY stand for: [`PLY_LAYOUTS`].

use std::io::Write;

use super::encode::encode;
use super::reference;
use crate::error::Result;
use crate::splat::{Kernel, Place, SplatSet};

/// What the numbers of a PLY stand for.
#[derive(Debug)]
pub struct PlyLayout {
    /// Name on the command line and in what is told of a file.
    pub name: &'static str,
    /// In a few words, who reads it.
    pub about: &'static str,
    /// What programs that read it take κ to be; nothing where the file names it.
    pub kernel: Option<Kernel>,
    /// Fails where a set that could be written otherwise cannot be in this layout.
    pub(super) check: fn(&SplatSet, Option<&Place>) -> Result<()>,
    /// Writes a set that was checked.
    pub(super) encode: fn(&SplatSet, Option<&Place>, &mut dyn Write) -> std::io::Result<()>,
    /// What of a set does not come into the file.
    losses: fn(&SplatSet, Option<&Place>) -> Vec<String>,
}

/// Every layout that is written; the first is the usual one.
pub const PLY_LAYOUTS: &[PlyLayout] = &[
    PlyLayout {
        name: "vgs",
        about: "places in mm RAS and HU in a second element; what every other command and ordinary viewers read",
        kernel: None,
        check: |_, _| Ok(()),
        encode: |set, _, out| encode(set, out),
        losses: |_, _| Vec::new(),
    },
    PlyLayout {
        name: "reference",
        about: "that of the paper's authors, for their viewer: voxel index times spacing, opacity as a probability; \
                commands then need the volume beside it",
        kernel: Some(reference::KERNEL),
        check: reference::check,
        encode: reference::encode,
        losses: reference::losses,
    },
];

impl PlyLayout {
    /// The layout of this name.
    pub fn named(name: &str) -> Option<&'static PlyLayout> {
        PLY_LAYOUTS.iter().find(|layout| layout.name == name)
    }

    /// What of `set` does not come into a file of this layout, in words that go on after "without ".
    pub fn losses(&self, set: &SplatSet, place: Option<&Place>) -> Vec<String> {
        (self.losses)(set, place)
    }
}
