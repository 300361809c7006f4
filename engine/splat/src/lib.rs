//! Splat sets: parameters, activations, spaces and files.
//!
//! A [`Splat`] holds raw parameters (logit, ln σ, quaternion). A fit works in voxel space, a [`SplatSet`]
//! lives in the world.
//!
//! | file | what it is |
//! |---|---|
//! | `set`, `field` | a set in the world, and the field that its splats add up to |
//! | `activation`, `kernel` | what the raw parameters stand for, and how a splat fades with distance |
//! | `space` | from voxels to the world and back |
//! | `objects`, `labels`, `blocks` | several sets as one ([`join`]), the structures that splats belong to, blocks of one region |
//! | `structures` | what structures are, and in which colours they are usually drawn |
//! | `importance` | an order in which the first n splats represent the set as well as n splats can |
//! | `grid`, `region` | the grid that a set was fitted on, what it is right for, and its voxels that are shown |
//! | `voxels` | intensities of voxels, of a set that has these in place of splats |
//! | `harmonics` | colours of splats that have no intensity |
//! | `far` | which splats lie far from all others |
//! | `packed` | a set in 16 bytes a splat |
//! | `select` | some splats of a set: [`SplatSet::selected`] |
//! | `file`, `format`, `ply`, `vgs` | files: [`FORMATS`], [`read`] and [`read_all`] from paths and readers, [`write`](write()) |
//! | `spz`, `sog`, `glb`, `ordinary` | files for programs that draw splats with colours, in metres |
//! | `place`, `unplaced` | sets without a known place: [`Unplaced`], until a volume gives the [`Place`] |
//! | `defect`, `mend` | which splats a file must not hold, and what is done to those of a file |
#![forbid(unsafe_code)]

pub mod activation;
mod blocks;
mod defect;
mod far;
mod field;
mod file;
mod format;
mod glb;
mod grid;
pub mod harmonics;
mod importance;
pub mod kernel;
mod labels;
mod mend;
mod objects;
mod ordinary;
pub mod packed;
mod place;
pub mod ply;
mod region;
mod select;
mod set;
mod sog;
pub mod space;
mod spz;
mod structures;
mod unplaced;
pub mod vgs;
pub mod voxels;

pub use activation::Activations;
pub use blocks::{Part, block_name, parts, stem};
pub use defect::defect;
pub use far::far_splats;
pub use field::Field;
pub use file::{
    FORMATS, check_held, check_live, describe, file_bytes, is_coloured, is_physical, is_splats, read,
    read_all, read_some, read_unplaced, rounds, write, write_as,
};
pub use format::{Format, ReadOptions, Reader, SNIFF_BYTES, Summary, WriteOptions};
pub use grid::{Form, Grid};
pub use harmonics::Harmonics;
pub use importance::by_importance;
pub use kernel::Kernel;
pub use labels::{LabelCount, label_name};
pub use objects::{MOST_OBJECTS, Object, join};
pub use packed::Packed;
pub use place::Place;
pub use ply::{PLY_LAYOUTS, PlyLayout};
pub use region::{Region, RegionObject};
pub use set::SplatSet;
pub use shader_interface::types::Splat;
pub use structures::{StructureKind, kind_of_structure, usual_colours};
pub use unplaced::Unplaced;
pub use vgs::{Group, Rounding};
pub use voxels::Voxels;
