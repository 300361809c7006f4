//! The picture formats, and the choice of one for a file.

use std::io::{self, Read};
use std::path::Path;

use super::format::{Format, Picture, WriteOptions};
use super::source::Source;
use super::{exr, png};
use crate::Image;
use crate::image::check_size;
use base::{Error, Kind, Result};

/// All formats, the usual one first.
pub const FORMATS: &[Format] = &[png::FORMAT, exr::FORMAT];

/// Reads a picture; the content of the file decides on the format, not its name.
///
/// # Errors
/// [`Kind::Missing`] if there is no such file; [`Kind::BadData`] if it is not a picture, is damaged, or has
/// more than [`MAX_PIXELS`](crate::MAX_PIXELS).
pub fn read(path: impl AsRef<Path>) -> Result<Picture> {
    let path = path.as_ref();
    let mut source = Source::open(path)?;
    let mut head = Vec::new();
    let failed = |e: io::Error| Error::io(path, "reading a picture", &e);
    source.reader.by_ref().take(8).read_to_end(&mut head).map_err(failed)?;
    io::Seek::rewind(&mut source.reader).map_err(failed)?;
    let Some(format) = FORMATS.iter().find(|format| head.starts_with(format.magic)) else {
        let found = if head.is_empty() { "the file is empty" } else { "not a picture of a known format" };
        return Err(Error::new(Kind::BadData, "VGS-IMG-012", found)
            .file(path)
            .help(format!("known formats: {}", names())));
    };
    (format.read)(&mut source).map_err(|error| error.file(path))
}

/// Writes a picture, and its depth where the format has one, atomically; the extension decides on the format.
///
/// # Errors
/// [`Kind::Usage`] if no format has the extension or the format has no depth; those of
/// [`write_atomic`](base::output::write_atomic).
///
/// # Panics
/// If `depth` has not one value for each pixel.
pub fn write(
    path: impl AsRef<Path>,
    image: &Image,
    depth: Option<&[f32]>,
    options: &WriteOptions,
) -> Result<()> {
    let path = path.as_ref();
    let format = of_extension(path)?;
    check_size(image.size).map_err(|e| e.file(path))?;
    let [width, height] = image.size;
    assert_eq!(image.pixels.len(), width * height, "an image has its pixels");
    assert!(depth.is_none_or(|depth| depth.len() == width * height), "each pixel has a depth");
    if depth.is_some() && !format.depth {
        let message = format!("the format {} has no depth", format.name);
        return Err(Error::new(Kind::Usage, "VGS-IMG-013", message)
            .file(path)
            .help("write the depth as .exr"));
    }
    if options.dpi.is_some() && !format.dpi {
        let message = format!("the format {} does not say how large a picture is printed", format.name);
        return Err(Error::new(Kind::Usage, "VGS-IMG-015", message)
            .file(path)
            .help("write it as .png, or leave the pixels per inch out"));
    }
    let over = options.background.map(|background| image.over(background));
    let image = over.as_ref().unwrap_or(image);
    base::output::write_atomic(path, options.force, |out| (format.write)(image, depth, options.dpi, out))
}

/// Returns the format that the extension of `path` names, so that a program can ask before it computes
/// anything.
///
/// # Errors
/// [`Kind::Usage`] if there is none.
pub fn of_extension(path: impl AsRef<Path>) -> Result<&'static Format> {
    let path = path.as_ref();
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    FORMATS.iter().find(|format| format.name.eq_ignore_ascii_case(extension)).ok_or_else(|| {
        Error::new(Kind::Usage, "VGS-IMG-014", format!("no picture format is called {extension:?}"))
            .file(path)
            .help(format!("use one of these extensions: {}", names()))
    })
}

fn names() -> String {
    FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
}
