//! The description of a picture format, and the content of its files.

use std::io;

use super::source::Source;
use crate::Image;
use base::Result;

/// The content of a picture file.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Colour and opacity.
    pub image: Image,
    /// Distance of each pixel from the viewer, mm, in the order of the pixels. For pixels where nothing is
    /// seen the writer chooses the value (infinity in files of this program).
    pub depth: Option<Vec<f32>>,
}

/// How a picture is written.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriteOptions {
    /// The opaque colour behind the picture, display-referred; without one the file keeps the opacity.
    pub background: Option<[f32; 3]>,
    /// Pixels per inch of the printed picture; `None` if the file does not say.
    pub dpi: Option<f64>,
    /// True if an existing file is replaced.
    pub force: bool,
}

/// A file format.
pub struct Format {
    /// Name of the format, which is also its extension.
    pub name: &'static str,
    /// True if it can hold a depth.
    pub depth: bool,
    /// True if it can say how large the picture is printed.
    pub dpi: bool,
    /// The first bytes of a file of this format.
    pub(super) magic: &'static [u8],
    pub(super) read: fn(&mut Source) -> Result<Picture>,
    pub(super) write: Encode,
}

/// Writes a picture and its depth, which have been checked, to a stream; the last number are its pixels per inch.
pub(super) type Encode = fn(&Image, Option<&[f32]>, Option<f64>, &mut dyn io::Write) -> io::Result<()>;
