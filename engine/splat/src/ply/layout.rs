//! The layouts of a PLY: what its numbers stand for.

use std::io::Write;

use super::encode::{Row, encode};
use super::reference;
use crate::{Kernel, Place, SplatSet};
use base::error::Result;

/// A layout of a PLY: what its numbers stand for.
#[derive(Debug)]
pub struct PlyLayout {
    /// Name on the command line and in descriptions of a file.
    pub name: &'static str,
    /// What the layout is and who reads it, in a few words.
    pub about: &'static str,
    /// The kernel that programs which read the layout assume; `None` if the file names it.
    pub kernel: Option<Kernel>,
    /// True if the layout counts in the voxels of a volume, which must be given.
    pub needs_volume: bool,
    /// Fails if a set that can be written otherwise cannot be written in this layout.
    pub(super) check: fn(&SplatSet, Option<&Place>) -> Result<()>,
    /// Writes a set that has been checked.
    pub(super) encode: fn(&SplatSet, Option<&Place>, &mut dyn Write) -> std::io::Result<()>,
    /// Returns what of a set is lost in the file.
    losses: fn(&SplatSet, Option<&Place>) -> Vec<String>,
}

/// Name of the layout of rows of 62 floats.
pub(super) const INRIA: &str = "inria";

/// Every layout that is written; the first is the default.
pub const PLY_LAYOUTS: &[PlyLayout] = &[
    PlyLayout {
        name: "vgs",
        about: "places in mm RAS, and HU as one more property; what every other command and ordinary viewers read",
        kernel: None,
        needs_volume: false,
        check: |_, _| Ok(()),
        encode: |set, _, out| encode(set, Row::Named, out),
        losses: |_, _| Vec::new(),
    },
    PlyLayout {
        name: INRIA,
        about: "the same in rows of 62 floats, for programs that know no other, and HU in a second element",
        kernel: None,
        needs_volume: false,
        check: |_, _| Ok(()),
        encode: |set, _, out| encode(set, Row::Fixed, out),
        losses: |_, _| Vec::new(),
    },
    PlyLayout {
        name: reference::NAME,
        about: "that of the paper's authors, for their viewer: voxel index times spacing, opacity as a probability; \
                commands then need the volume beside it",
        kernel: Some(reference::KERNEL),
        needs_volume: true,
        check: reference::check,
        encode: reference::encode,
        losses: reference::losses,
    },
];

impl PlyLayout {
    /// Returns the layout called `name`.
    pub fn named(name: &str) -> Option<&'static PlyLayout> {
        PLY_LAYOUTS.iter().find(|layout| layout.name == name)
    }

    /// Returns what of `set` is lost in a file of this layout, in words that continue "without ".
    pub fn losses(&self, set: &SplatSet, place: Option<&Place>) -> Vec<String> {
        (self.losses)(set, place)
    }
}
