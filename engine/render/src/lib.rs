//! Rendering: a scene of splats or of a volume, seen through a transfer function.
//!
//! A [`Scene`] holds splats, a volume or both, in one space: world mm RAS less the scene's origin. A [`Look`]
//! says how it is seen and may change at any time. A [`Mode`] turns it into pictures; [`MODES`] lists them.
//! All modes see the same medium, of opacity O(x) α(V(x)) per mm and colour C(V(x)), by emission and
//! absorption (Max 1995), use the same light, and give the same depth; they differ in where V and O come from
//! and in how the integral is taken.
//!
//! Colours are display-referred: numbers of an sRGB picture, added up directly, as in VTK and Slicer.
//!
//! | file | what is there |
//! |---|---|
//! | `scene` | [`Scene`]: the splats and the volume that are rendered, and how they are seen |
//! | `gpu_splats`, `extents` | [`GpuSplats`]: splats on the device; their reach |
//! | `splat_points`, `bumps` | the field at points in the splats, for mode alpha |
//! | `baked` | [`baked()`]: splats with the colours of a transfer function, for programs that know none |
//! | `gpu_volume`, `scale` | [`GpuVolume`]: a volume or a decoded field on the device; its 16-bit fractions |
//! | `detail` | [`FieldBudget`]: bricks that are whole, and coarser ones where memory ends |
//! | `decoded`, `atlas`, `least_squares`, `halving` | [`decode`]: the field of splats on the voxels of a grid |
//! | `look`, `camera`, `visibility_mask` | how a scene is seen, from where, and the parts no eye sees |
//! | `object_change` | [`ObjectChange`]: of the appearance of objects, as a flag has it |
//! | `intensities` | [`Intensities`]: of an object, and whether a transfer function shows them |
//! | `usual_look` | [`UsualLook`]: of several objects, as long as nobody has said how they look |
//! | `settings`, `quality`, `target` | settings of a mode, quality of a frame, pictures of a frame |
//! | `mode`, `modes` | [`Mode`]: a way to render; [`MODES`]: all of them |
//! | `alpha`, `slab`, `raymarch` | the modes; `variants` holds their kernels |
//! | `renderer`, `frames` | [`Renderer`]: one picture after the other; [`Frames`]: without waiting for the device |
//! | `part` | [`Part`]: a band of rows, for pictures that are slower than what else is waiting |
//! | `pick` | [`Probe`]: the field at single points, and where a ray meets something, on the host |
//! | `budget` | which quality frames can afford, from the times of those that have finished |
//! | `splat_kind` | [`SplatKind`]: what splats are meant for |
//! | `quality_levels` | [`quality_levels()`]: the measured ways to trade quality for time, for the frame budget |
#![forbid(unsafe_code)]

mod alpha;
mod atlas;
mod baked;
pub mod budget;
mod bumps;
mod camera;
mod decoded;
mod detail;
mod extents;
mod frames;
mod gpu_splats;
mod gpu_volume;
mod halving;
mod intensities;
mod least_squares;
mod look;
mod mode;
mod modes;
mod object_change;
mod part;
mod pick;
mod quality;
mod quality_levels;
mod raymarch;
mod renderer;
mod scale;
mod scene;
mod settings;
mod slab;
mod splat_kind;
mod splat_points;
mod target;
mod usual_look;
mod variants;
mod visibility_mask;

pub use baked::{Baked, baked};
pub use camera::{Camera, CameraFile, FOV_DEGREES, Fov};
pub use decoded::{DecodeOptions, Decoded, decode, decode_as, decodes_every_voxel};
pub use detail::FieldBudget;
pub use extents::bounds;
pub use frames::{Finished, Frame, Frames, IN_FLIGHT};
pub use gpu_splats::{Decoding, GpuSplats, Precision};
pub use gpu_volume::{GpuVolume, VolumeSource};
pub use intensities::Intensities;
pub use look::{Appearance, Classification, ClipPlane, Look, LookBuffers, PLANES};
pub use mode::Mode;
pub use modes::{MEANWHILE, MODES, ModeRow, Needs, OF_VOLUMES, StepOf, mode};
pub use object_change::{ObjectChange, hex_colour};
pub use part::Part;
pub use pick::{Hit, Probe, Reading};
pub use quality::Quality;
pub use quality_levels::{QualityLevel, level_costs, quality_levels};
pub use renderer::Renderer;
pub use scene::Scene;
pub use settings::{Rays, Settings};
pub use splat_kind::SplatKind;
pub use target::Target;
pub use usual_look::{ObjectLook, UsualLook};
pub use visibility_mask::{Triangle, VisibilityMask};

pub use passes::Work;
