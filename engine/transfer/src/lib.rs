//! Transfer functions: from an intensity to colour and opacity per millimetre.
//!
//! A [`TransferFunction`] has control points over intensity (HU for CT) and is linear between them. Its
//! opacity α per millimetre stands for the extinction τ = −ln(1 − α) in 1/mm. [`presets`] has those with a
//! name, [`window_level`] makes a grey ramp, [`load`] finds either by what a user typed, or reads one of the
//! [`FORMATS`] of other programs, and [`save`] writes one. A [`Table`] is what a renderer uploads and looks
//! up.
//!
//! | file | what is there |
//! |---|---|
//! | `function` | [`TransferFunction`] and its control points |
//! | `light` | [`Light`]: where light comes from |
//! | `presets`, `window` | functions with a name; grey ramps over a window of intensities |
//! | `file` | files of other programs, a row of [`FORMATS`] each |
//! | `table` | [`Table`]: a function as a renderer looks it up |
#![forbid(unsafe_code)]

mod file;
mod function;
mod light;
pub mod presets;
mod table;
mod window;

pub use file::{FORMATS, Format, load, read, save};
pub use function::{ColourPoint, MAX_INTENSITY, MAX_OPACITY, Material, OpacityPoint, TransferFunction};
pub use light::{FixedTo, Light, MOST_FILL};
pub use presets::{FIRST, FIRST_WITHOUT_HU, PRESETS, Preset, first, preset};
pub use table::Table;
pub use window::{WINDOW_OPACITY, WINDOWS, Window, window, window_level};
