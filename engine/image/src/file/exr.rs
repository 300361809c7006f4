//! OpenEXR through the crate `exr`: 32-bit floats, the channels R G B A and, with a depth, Z.
//!
//! In an EXR colour is linear and premultiplied, while an [`Image`] has the sRGB-encoded numbers of the
//! display. So each pixel is divided by its opacity, decoded (or encoded) with the curve of IEC 61966-2-1,
//! mirrored for negative and carried on for large values, and multiplied again. A pixel of opacity 0 has no
//! colour. The trip there and back changes some 1e-7 of a value. What another program composites over a
//! background in linear light will look a little different from [`Image::over`], which composites what the
//! display gets.
//!
//! Z is in mm, infinite where nothing is seen; other programs' Z is taken as it is.

use std::cell::Cell;
use std::io::{self, Cursor, Write};

use exr::block;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples};
use exr::meta::attribute::LineOrder;
use exr::prelude::{Compression, ReadChannels, ReadLayers, ReadSpecificChannel, Vec2, WritableImage};

use super::format::{Format, Picture};
use super::source::{Source, expect};
use crate::Image;
use crate::image::{check_size, room};
use base::{Error, Kind, Result};

pub(super) const FORMAT: Format =
    Format { name: "exr", depth: true, dpi: false, magic: &[0x76, 0x2f, 0x31, 0x01], read, write };

/// What a file is decoded into: colours are already display-referred.
struct Decoded {
    width: usize,
    pixels: Vec<[f32; 4]>,
    depth: Option<Vec<f32>>,
    /// Number of pixels decoded so far.
    seen: usize,
    /// The first pixel whose colour or opacity is NaN or infinite.
    broken: Option<[usize; 2]>,
}

fn read(source: &mut Source) -> Result<Picture> {
    let stored = source.stored;
    let chunks = block::read(&mut source.reader, false).map_err(failed)?;
    let mut chosen = None;
    // A layer that will not be read is checked as well: the reader looks at all of them.
    for header in chunks.headers() {
        let size = [header.layer_size.0, header.layer_size.1];
        check_size(size)?;
        let unpacked = (size[0] * size[1]) as u64 * header.channels.bytes_per_pixel as u64;
        expect(size, unpacked, stored)?;
        let has = |name: &str| header.channels.list.iter().any(|channel| channel.name == *name);
        if !header.deep && ["R", "G", "B"].into_iter().all(has) && chosen.is_none() {
            chosen = Some((size, has("Z")));
        }
        if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
            let message = "an EXR whose channels have fewer samples than pixels";
            return Err(Error::new(Kind::BadData, "VGS-IMG-024", message)
                .help("write it with full R, G and B channels"));
        }
    }
    let Some((size, has_depth)) = chosen else {
        let message = "an EXR without a flat layer that has the channels R, G and B";
        return Err(Error::new(Kind::BadData, "VGS-IMG-024", message));
    };

    let count = size[0] * size[1];
    let mut pixels = room(count)?;
    pixels.resize(count, [0.0; 4]);
    let depth = match has_depth {
        true => {
            let mut depth = room(count)?;
            depth.resize(count, 0.0);
            Some(depth)
        }
        false => None,
    };
    let ready = Cell::new(Some(Decoded { width: size[0], pixels, depth, seen: 0, broken: None }));
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("R")
        .required("G")
        .required("B")
        .optional("A", 1.0_f32)
        .optional("Z", 0.0_f32)
        .collect_pixels(|_, _| ready.take(), put)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_chunks(chunks)
        .map_err(failed)?;
    let decoded = image.layer_data.channel_data.pixels.filter(|decoded| decoded.seen == count);
    let Some(Decoded { pixels, depth, broken, .. }) = decoded else {
        return Err(Error::new(Kind::BadData, "VGS-IMG-023", "a damaged EXR: not every pixel is there"));
    };
    if let Some([x, y]) = broken {
        let message = format!("the pixel in column {x} and row {y} is not a number, or infinite");
        return Err(Error::new(Kind::BadData, "VGS-IMG-025", message));
    }
    Ok(Picture { image: Image { size, pixels }, depth })
}

/// Stores one pixel, converted to display-referred colour, and notes the first one that is broken.
fn put(to: &mut Option<Decoded>, Vec2(x, y): Vec2<usize>, (r, g, b, a, z): (f32, f32, f32, f32, f32)) {
    let Some(to) = to else { return };
    let index = y * to.width + x;
    to.seen += 1;
    if ![r, g, b, a].iter().all(|v| v.is_finite()) {
        to.broken.get_or_insert([x, y]);
    }
    to.pixels[index] = each_straight([r, g, b, a.clamp(0.0, 1.0)], display_from_linear);
    if let Some(depth) = &mut to.depth {
        depth[index] = z;
    }
}

/// Writes one layer with its lines in order, so that the same pixels give the same bytes.
fn write(image: &Image, depth: Option<&[f32]>, _: Option<f64>, out: &mut dyn Write) -> io::Result<()> {
    let mut planes = [const { Vec::new() }; 4];
    for &pixel in &image.pixels {
        for (plane, value) in planes.iter_mut().zip(each_straight(pixel, linear_from_display)) {
            plane.push(value);
        }
    }
    let depth = depth.map(|depth| ("Z", depth.to_vec()));
    let channel = |(name, values)| AnyChannel::new(name, FlatSamples::F32(values));
    let channels = ["R", "G", "B", "A"].into_iter().zip(planes).chain(depth).map(channel).collect();
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let [width, height] = image.size;
    let file =
        exr::prelude::Image::from_encoded_channels((width, height), encoding, AnyChannels::sort(channels));
    let mut bytes = Vec::new(); // The encoder goes back to fill in its table; `out` cannot.
    file.write().to_buffered(Cursor::new(&mut bytes)).map_err(|error| match error {
        exr::error::Error::Io(e) => e,
        e => io::Error::other(e.to_string()),
    })?;
    out.write_all(&bytes)
}

/// Applies `of` to each straight colour of a premultiplied pixel and returns the pixel premultiplied again.
fn each_straight([r, g, b, a]: [f32; 4], of: fn(f64) -> f64) -> [f32; 4] {
    if a == 0.0 {
        return [0.0; 4];
    }
    let opacity = f64::from(a);
    let [r, g, b] = [r, g, b].map(|c| (of(f64::from(c) / opacity) * opacity) as f32);
    [r, g, b, a]
}

/// Converts an sRGB-encoded number to linear light.
fn linear_from_display(v: f64) -> f64 {
    let linear = |v: f64| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    linear(v.abs()).copysign(v)
}

/// Converts linear light to an sRGB-encoded number.
fn display_from_linear(v: f64) -> f64 {
    let display = |v: f64| if v <= 0.0031308 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    display(v.abs()).copysign(v)
}

fn failed(error: exr::error::Error) -> Error {
    match error {
        // A damaged table of places sends the reader past the end, or to where no file can be.
        exr::error::Error::Io(e)
            if !matches!(e.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput) =>
        {
            Error::new(Kind::Io, "VGS-IMG-021", format!("reading an EXR: {e}"))
        }
        e => Error::new(Kind::BadData, "VGS-IMG-023", format!("a damaged EXR, or of an unknown kind: {e}"))
            .help("the file was cut short or altered; make it again"),
    }
}
