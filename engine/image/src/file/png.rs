//! PNG and animated PNG, through the crate `png`. Numbers are sRGB-encoded, and files say so; other colour
//! spaces that a file may name (gAMA, iCCP) are not converted.

use std::io::{self, Write};
use std::path::Path;

use png::{
    BitDepth, ColorType, Decoder, DecodingError, Encoder, PixelDimensions, SrgbRenderingIntent,
    Transformations, Unit,
};

use super::format::{Format, Picture, WriteOptions};
use super::source::{Source, expect};
use crate::Image;
use crate::image::{check_size, room};
use base::{Error, Kind, Result};

pub(super) const FORMAT: Format =
    Format { name: "png", depth: false, dpi: true, magic: b"\x89PNG\r\n\x1a\n", read, write };

const METRES_PER_INCH: f64 = 0.0254;
/// Most bytes of a palette, of 256 colours.
const MOST_PALETTE: usize = 3 * 256;

/// Size and timing of an animation.
#[derive(Clone, Copy, Debug)]
pub struct Animation {
    /// Width and height of each frame, pixels.
    pub size: [usize; 2],
    /// Number of frames, at least one.
    pub frames: u32,
    /// Frames each second, at least one.
    pub frames_per_second: u16,
    /// Number of times it is shown; 0 is endlessly.
    pub loops: u32,
}

/// Writes an animated PNG atomically. `frame` returns one frame at a time, so that only one is in memory.
///
/// A viewer without animation shows the first frame. The file has no opacity if all frames are opaque, which
/// `options.background` decides.
///
/// # Errors
/// Errors of `frame`, with nothing written; [`Kind::Usage`] for no frames or no frame rate; those of
/// [`write_atomic`](base::output::write_atomic).
///
/// # Panics
/// If a frame has another size than `animation` says.
pub fn write_animation(
    path: impl AsRef<Path>,
    animation: &Animation,
    options: &WriteOptions,
    mut frame: impl FnMut(u32) -> Result<Image>,
) -> Result<()> {
    let path = path.as_ref();
    check_size(animation.size).map_err(|e| e.file(path))?;
    if animation.frames == 0 || animation.frames_per_second == 0 {
        let message = "an animation needs at least one frame and one frame each second";
        return Err(Error::new(Kind::Usage, "VGS-IMG-020", message).file(path));
    }
    let mut stopped = None;
    let written = base::output::write_atomic(path, options.force, |out| {
        let opaque = options.background.is_some();
        let mut encoder = encoder(out, animation.size, opaque, options.dpi);
        encoder.set_animated(animation.frames, animation.loops)?;
        encoder.set_frame_delay(1, animation.frames_per_second)?;
        let mut writer = encoder.write_header()?;
        for index in 0..animation.frames {
            let mut image = frame(index).map_err(|error| {
                stopped = Some(error);
                io::Error::other("a frame could not be made")
            })?;
            assert_eq!(image.size, animation.size, "frames of one size");
            if let Some(background) = options.background {
                image = image.over(background);
            }
            writer.write_image_data(&bytes(&image, opaque))?;
        }
        writer.finish()?;
        Ok(())
    });
    stopped.map_or(written, Err)
}

fn write(image: &Image, _: Option<&[f32]>, dpi: Option<f64>, out: &mut dyn Write) -> io::Result<()> {
    encode_for_print(image, dpi, out)
}

/// Writes a PNG of 8 bits to a stream, with opacity if any pixel is not opaque.
///
/// # Errors
/// Errors of `out`, and an error for a picture without pixels.
pub fn encode(image: &Image, out: &mut dyn Write) -> io::Result<()> {
    encode_for_print(image, None, out)
}

fn encode_for_print(image: &Image, dpi: Option<f64>, out: &mut dyn Write) -> io::Result<()> {
    let opaque = image.pixels.iter().all(|pixel| pixel[3] >= 1.0);
    let mut writer = encoder(out, image.size, opaque, dpi).write_header()?;
    writer.write_image_data(&bytes(image, opaque))?;
    writer.finish()?;
    Ok(())
}

fn encoder(
    out: &mut dyn Write,
    [width, height]: [usize; 2],
    opaque: bool,
    dpi: Option<f64>,
) -> Encoder<'static, &mut dyn Write> {
    // At most `MAX_PIXELS`, and no side is zero.
    let mut encoder = Encoder::new(out, width as u32, height as u32);
    encoder.set_color(if opaque { ColorType::Rgb } else { ColorType::Rgba });
    encoder.set_depth(BitDepth::Eight);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder.set_pixel_dims(dpi.map(|dpi| {
        let each_metre = (dpi / METRES_PER_INCH).round() as u32;
        PixelDimensions { xppu: each_metre, yppu: each_metre, unit: Unit::Meter }
    }));
    encoder
}

/// Converts the pixels to those of a PNG: 8 bits, not premultiplied; without opacity if `opaque`.
fn bytes(image: &Image, opaque: bool) -> Vec<u8> {
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8; // NaN becomes 0.
    let mut out = Vec::with_capacity(image.pixels.len() * if opaque { 3 } else { 4 });
    for &[r, g, b, a] in &image.pixels {
        if opaque {
            out.extend([r, g, b].map(byte));
        } else {
            let share = if a > 0.0 { 1.0 / a } else { 0.0 };
            out.extend([r * share, g * share, b * share, a].map(byte));
        }
    }
    out
}

/// Reads a PNG of 1 to 16 bits: grey, colour or palette, with or without opacity. Of an animation it reads
/// the first frame.
fn read(source: &mut Source) -> Result<Picture> {
    let stored = source.stored;
    let mut decoder = Decoder::new(&mut source.reader);
    decoder.set_transformations(Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(failed)?;
    let size = [info.width as usize, info.height as usize];
    check_size(size)?;
    expect(size, info.raw_bytes() as u64, stored)?;
    let mut reader = decoder.read_info().map_err(failed)?;
    // The decoder takes whole colours for granted.
    if let Some(palette) = reader.info().palette.as_deref()
        && (!palette.len().is_multiple_of(3) || palette.len() > MOST_PALETTE)
    {
        let message =
            format!("a damaged PNG: its palette has {} bytes, three for each colour", palette.len());
        return Err(Error::new(Kind::BadData, "VGS-IMG-022", message));
    }
    let length = reader.output_buffer_size().ok_or_else(|| failed(DecodingError::LimitsExceeded))?;
    let mut bytes = room(length)?;
    bytes.resize(length, 0);
    let frame = reader.next_frame(&mut bytes).map_err(failed)?;
    if [frame.width as usize, frame.height as usize] != size {
        let message = "a damaged PNG: its first frame is smaller than the picture";
        return Err(Error::new(Kind::BadData, "VGS-IMG-022", message));
    }

    let mut pixels = room(size[0] * size[1])?;
    let samples = frame.color_type.samples();
    let opacity = matches!(frame.color_type, ColorType::Rgba | ColorType::GrayscaleAlpha);
    let mut push = |of: &dyn Fn(usize) -> f32| {
        let [r, g, b] = if samples < 3 { [0; 3] } else { [0, 1, 2] }.map(of);
        let a = if opacity { of(samples - 1) } else { 1.0 };
        pixels.push([r * a, g * a, b * a, a]);
    };
    if frame.bit_depth == BitDepth::Sixteen {
        for pixel in bytes.chunks_exact(2 * samples) {
            push(&|i| f32::from(u16::from_be_bytes([pixel[2 * i], pixel[2 * i + 1]])) / 65535.0);
        }
    } else {
        for pixel in bytes.chunks_exact(samples) {
            push(&|i| f32::from(pixel[i]) / 255.0);
        }
    }
    Ok(Picture { image: Image { size, pixels }, depth: None })
}

fn failed(error: DecodingError) -> Error {
    match error {
        DecodingError::IoError(e) if e.kind() != io::ErrorKind::UnexpectedEof => {
            Error::new(Kind::Io, "VGS-IMG-021", format!("reading a PNG: {e}"))
        }
        DecodingError::LimitsExceeded => Error::new(Kind::BadData, "VGS-IMG-022", "a damaged PNG"),
        e => Error::new(Kind::BadData, "VGS-IMG-022", format!("a damaged PNG: {e}"))
            .help("the file was cut short or altered; make it again"),
    }
}
