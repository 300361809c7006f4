//! What a format of pictures is, and what its file holds.

use std::io;

use super::source::Source;
use crate::Result;
use crate::image::Image;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Colour and opacity.
    pub image: Image,
    /// Distance from the viewer of each pixel, mm, in the order of the pixels; what it is where nothing is
    /// seen, the writer decides (infinity in files of this program).
    pub depth: Option<Vec<f32>>,
}

/// How a picture is written.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriteOptions {
    /// The opaque colour behind the picture, display-referred; without one the file keeps the opacity.
    pub background: Option<[f32; 3]>,
    /// Replaces an existing file.
    pub force: bool,
}

/// A file format.
pub struct Format {
    /// Its name, which is also the extension.
    pub name: &'static str,
    /// True if it can hold a depth.
    pub depth: bool,
    /// The bytes with which a file begins.
    pub(super) magic: &'static [u8],
    pub(super) read: fn(&mut Source) -> Result<Picture>,
    pub(super) write: Encode,
}

/// Writes a picture and its depth, which have been checked, to a stream.
pub(super) type Encode = fn(&Image, Option<&[f32]>, &mut dyn io::Write) -> io::Result<()>;
