//! Files of pictures: a format is one module with `read` and `write`, and one row of [`FORMATS`].

mod exr;
mod png;

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

pub use png::{Animation, encode as encode_png, write_animation};

use super::{Image, check_size, room};
use crate::{Error, Kind, Result};

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Colour and opacity.
    pub image: Image,
    /// Distance from the viewer of each pixel, mm, in the order of the pixels; what it is where nothing is seen, the
    /// writer decides (infinity in files of this program).
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
    /// Whether it can hold a depth.
    pub depth: bool,
    /// The bytes with which a file begins.
    magic: &'static [u8],
    read: fn(&mut Source) -> Result<Picture>,
    write: Encode,
}

/// Writes a picture and its depth, which have been checked, to a stream.
type Encode = fn(&Image, Option<&[f32]>, &mut dyn io::Write) -> io::Result<()>;

/// All formats; the first is the usual one.
pub const FORMATS: &[Format] = &[png::FORMAT, exr::FORMAT];

/// DEFLATE, the densest packing in these formats, cannot do better than 1032 : 1, so a longer claim is false before
/// anything is allocated.
const MAX_RATIO: u64 = 1032;

/// An open file.
struct Source {
    reader: BufReader<File>,
    /// Bytes on disk.
    stored: u64,
}

impl Source {
    fn open(path: &Path) -> Result<Self> {
        let failed = |e: &io::Error| Error::io(path, "reading a picture", e);
        let meta = std::fs::metadata(path).map_err(|e| failed(&e))?;
        if !meta.is_file() {
            let message = "is a folder or a device, not a file";
            return Err(Error::new(Kind::BadData, "VGS-IMG-010", message).file(path));
        }
        let file = File::open(path).map_err(|e| failed(&e))?;
        Ok(Source { reader: BufReader::with_capacity(1 << 18, file), stored: meta.len() })
    }
}

/// Refuses a size whose `unpacked` bytes a file of `stored` bytes cannot hold.
fn expect(size: [usize; 2], unpacked: u64, stored: u64) -> Result<()> {
    let most = stored.saturating_mul(MAX_RATIO);
    if unpacked > most {
        let [width, height] = size;
        let message = format!(
            "declares {width} x {height} pixels, {unpacked} bytes, but {stored} bytes hold at most {most}"
        );
        return Err(Error::new(Kind::BadData, "VGS-IMG-011", message)
            .help("the file was cut short or its header is wrong"));
    }
    Ok(())
}

/// Reads a picture; the content of the file decides on the format, not its name.
///
/// # Errors
/// [`Kind::Missing`] without such a file; [`Kind::BadData`] for what is no picture, is damaged, or has more than
/// [`MAX_PIXELS`](super::MAX_PIXELS).
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
/// [`write_atomic`](crate::output::write_atomic).
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
    let over = options.background.map(|background| image.over(background));
    let image = over.as_ref().unwrap_or(image);
    crate::output::write_atomic(path, options.force, |out| (format.write)(image, depth, out))
}

/// The format that the extension of `path` names.
///
/// # Errors
/// [`Kind::Usage`] if there is none: programs ask before they compute anything.
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

#[cfg(test)]
mod tests;
