//! Files of transfer functions, also those of other programs, and the names by which a user may ask for one.
//!
//! A file may hold several functions. All readers share `curve` (what lies between two control points when
//! that is no straight line) and the rules here: a size limit, numbers with a point whatever the locale, and
//! errors that name the function and the place.
//!
//! | file | what is there |
//! |---|---|
//! | `formats` | [`FORMATS`], a row per format; [`load`], [`read`] and [`save`] by them |
//! | `entry` | what a reader makes of a file, and the rules for all readers |
//! | `vp`, `vp_json`, `slicer_xml`, `paraview` | the formats |
//! | `list`, `curve`, `colour_space` | lists of numbers, curved pieces, colours of ParaView |

mod colour_space;
mod curve;
mod entry;
mod formats;
mod list;
mod paraview;
mod slicer_xml;
mod vp;
mod vp_json;

pub use formats::{FORMATS, Format, load, read, save};

#[cfg(test)]
mod tests;
