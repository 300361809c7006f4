//! The SOG reader.

use std::io::{BufReader, Cursor, Read, Seek};

use flate2::read::DeflateDecoder;
use image_webp::WebPDecoder;
use serde::Deserialize;
use zip::ZipArchive;
use zip::result::ZipError;

use super::codes::CODES;
use super::{AXES, Beyond, Codebook, LEFT_OUT, META, MOST_ROWS, Meta, ROWS_A_LINE, STEPS, VERSION, of_log};
use crate::activation::Activations;
use crate::harmonics::{MAX_DEGREE, basis_count};
use crate::mend::{Mended, reserve, zeros};
use crate::{Harmonics, ReadOptions, Splat, SplatSet, Summary, Unplaced, ordinary, ply};
use base::error::{Error, Kind, Result};
use base::input::Input;
use base::memory;

/// Longest `meta.json` that is read, bytes. Its three codebooks take some 20 000.
const LONGEST_META: u64 = 1 << 20;
/// What a file of the zip may be larger than it is packed: images are packed already.
const MOST_UNPACKED: u64 = 16;
/// What an image may have without a splat for each pixel, and without bytes for them: others round their sides up, and runs
/// of one colour take 10 bits for 4096 pixels.
const SPARE_PIXELS: u64 = 1 << 20;
const MOST_PIXELS_A_SPLAT: u64 = 4;
const MOST_PIXELS_A_BYTE: u64 = 1 << 16;

/// Returns true if a file begins so: with a zip whose first file is one of SOG.
pub fn sniff(start: &[u8]) -> bool {
    let number = |at: usize| start.get(at..at + 2).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    let (Some(method), Some(length), Some(more), true) =
        (number(8), number(26), number(28), start.starts_with(b"PK\x03\x04"))
    else {
        return false;
    };
    let Some((name, rest)) = start[30..].split_at_checked(length) else { return false };
    if name != META.as_bytes() {
        return name.ends_with(b".webp") && !name.contains(&b'/');
    }
    // Others have files of this name as well.
    let content = rest.get(more..).unwrap_or_default();
    let mut text = Vec::new();
    if method == 0 {
        text.extend(content);
    } else {
        // What is cut off ends with an error, after what there is.
        let _ = DeflateDecoder::new(content).take(SNIFFED).read_to_end(&mut text);
    }
    let has = |word: &[u8]| text.windows(word.len()).any(|window| window == word);
    has(b"\"means\"") || has(b"\"codebook\"")
}

/// Bytes of `meta.json` that are looked at.
const SNIFFED: u64 = 4096;

/// Reads a set with colours.
pub fn read(input: &Input, options: &ReadOptions) -> Result<Unplaced> {
    let Loaded { set, .. } = load(input, options)?;
    Ok(Unplaced { path: input.name().to_owned(), set, rows: None })
}

/// Reads a set and describes what the file holds.
pub fn describe(input: &Input, options: &ReadOptions) -> Result<Summary> {
    let Loaded { set, mended, bytes } = load(input, options)?;
    Ok(Summary {
        encoding: format!("version {VERSION}, lossless WebP"),
        dropped: mended.dropped,
        widened: mended.widened,
        elements: vec![("splat".to_owned(), (set.splats.len() + mended.dropped) as u64)],
        properties: ["means", "quats", "scales", "sh0", "shN"].map(str::to_owned).to_vec(),
        ..Summary::of_set(&set, "sog", ply::ORDINARY, bytes)
    })
}

struct Loaded {
    set: SplatSet,
    mended: Mended,
    /// Size of the file.
    bytes: u64,
}

fn load(input: &Input, options: &ReadOptions) -> Result<Loaded> {
    let path = input.name();
    let file = input.open().map_err(|error| Error::io(path, "reading a splat file", &error))?;
    let bytes = file.length;
    let mut set = decoded(BufReader::new(file), options).map_err(|error| error.file(path))?;
    ordinary::into_world(&mut set, &AXES.transpose());
    let mended = ordinary::finished(&mut set, options.strict).map_err(|error| error.file(path))?;
    mended.tell(path, &set);
    Ok(Loaded { set, mended, bytes })
}

fn damaged(what: impl Into<String>) -> Error {
    Error::new(Kind::BadData, "VGS-SOG-001", what)
        .help("the file is damaged or cut off: get it again from where it was made")
}

/// The files of a zip.
struct Bundle<R>(ZipArchive<R>);

impl<R: Read + Seek> Bundle<R> {
    /// Returns the content of a file.
    fn file(&mut self, name: &str) -> Result<Vec<u8>> {
        let unreadable =
            |error: &dyn std::fmt::Display| damaged(format!("{name} cannot be unpacked: {error}"));
        let mut file = self.0.by_name(name).map_err(|error| match error {
            ZipError::FileNotFound => damaged(format!("{name} is not in the file")),
            error => unreadable(&error),
        })?;
        let (size, packed) = (file.size(), file.compressed_size());
        if size > packed.saturating_mul(MOST_UNPACKED).saturating_add(LONGEST_META) {
            return Err(damaged(format!("{name} claims {size} bytes, packed in {packed}")));
        }
        memory::require(size, name)?;
        let mut content = Vec::new();
        file.by_ref().take(size).read_to_end(&mut content).map_err(|error| unreadable(&error))?;
        // At its end the checksum is compared.
        let more = file.read(&mut [0]).map_err(|error| unreadable(&error))?;
        if content.len() as u64 != size || more > 0 {
            return Err(damaged(format!("{name} has not the {size} bytes that the file says")));
        }
        Ok(content)
    }

    /// Returns `meta.json`.
    fn meta(&mut self) -> Result<Meta> {
        #[derive(Deserialize)]
        struct Version {
            /// Version 1 has none.
            version: Option<u64>,
        }
        let text = self.file(META)?;
        if text.len() as u64 > LONGEST_META {
            return Err(damaged(format!(
                "{META} has {} bytes, at most {LONGEST_META} are of use",
                text.len()
            )));
        }
        let wrong = |error: serde_json::Error| damaged(format!("{META}: {error}"));
        let version = serde_json::from_slice::<Version>(&text).map_err(wrong)?.version.unwrap_or(1);
        if version != VERSION {
            let message = format!("version {version} of SOG, and version {VERSION} is read");
            return Err(Error::new(Kind::BadData, "VGS-SOG-002", message).help(ply::convert_help("sog")));
        }
        serde_json::from_slice(&text).map_err(wrong)
    }

    /// Returns an image with at least `needed` pixels.
    fn image(&mut self, name: &str, needed: u64) -> Result<Image> {
        let file = self.file(name)?;
        let unreadable = |error| damaged(format!("{name} cannot be unpacked: {error}"));
        let mut decoder = WebPDecoder::new(Cursor::new(&file)).map_err(unreadable)?;
        if decoder.is_lossy() || decoder.is_animated() {
            let message = format!(
                "{name} is a picture with losses or several pictures, and numbers need a lossless one"
            );
            return Err(Error::new(Kind::BadData, "VGS-SOG-004", message)
                .help("write the file again with the program that it is from, with lossless WebP"));
        }
        let (width, height) = decoder.dimensions();
        let there = u64::from(width) * u64::from(height);
        if there < needed {
            return Err(damaged(format!("{name} has {width} x {height} pixels, and {needed} are needed")));
        }
        let bytes = file.len() as u64;
        let most = needed.saturating_mul(MOST_PIXELS_A_SPLAT).min(bytes.saturating_mul(MOST_PIXELS_A_BYTE));
        if there > most.saturating_add(SPARE_PIXELS) {
            let what =
                format!("{name} claims {width} x {height} pixels in {bytes} bytes, and {needed} are needed");
            return Err(damaged(what));
        }
        let channels = if decoder.has_alpha() { 4 } else { 3 };
        // Without alpha the decoder has a second copy.
        memory::require(there * if channels == 4 { 4 } else { 7 }, name)?;
        let mut pixels = zeros::<u8>(there as usize * channels)?;
        decoder.read_image(&mut pixels).map_err(unreadable)?;
        Ok(Image { width: width as usize, channels, pixels })
    }
}

struct Image {
    width: usize,
    channels: usize,
    pixels: Vec<u8>,
}

impl Image {
    /// Returns red, green, blue, alpha of the pixels, row by row.
    fn pixels(&self) -> impl Iterator<Item = [u8; 4]> {
        let pixel = |p: &[u8]| [p[0], p[1], p[2], p.get(3).copied().unwrap_or(u8::MAX)];
        self.pixels.chunks_exact(self.channels).map(pixel)
    }
}

/// A codebook, complete.
struct Codes<'a> {
    /// What it is of.
    name: &'a str,
    codes: Vec<f32>,
}

impl<'a> Codes<'a> {
    fn of(name: &'a str, codebook: &Codebook) -> Result<Self> {
        let mut codes = Vec::new();
        let wrong = || damaged(format!("{META}: the codebook of {name} is not of 1 to {CODES} numbers"));
        for (i, code) in codebook.iter().enumerate() {
            codes.push(match (code, codebook.get(1), codebook.last()) {
                (Some(code), ..) => *code,
                // Some writers lose the first number; their programs take this one.
                (None, Some(Some(second)), Some(Some(last))) if i == 0 => second + (second - last) / 255.0,
                _ => return Err(wrong()),
            });
        }
        if codes.is_empty() || codes.len() > CODES { Err(wrong()) } else { Ok(Codes { name, codes }) }
    }

    fn get(&self, byte: u8) -> Result<f32> {
        self.codes.get(usize::from(byte)).copied().ok_or_else(|| {
            let Codes { name, codes } = self;
            damaged(format!("{name}: number {byte} of a codebook of {}", codes.len()))
        })
    }
}

/// Reads a set in metres along the axes of the file.
fn decoded(source: impl Read + Seek, options: &ReadOptions) -> Result<SplatSet> {
    let zip = ZipArchive::new(source).map_err(|error| damaged(format!("not readable as a zip: {error}")))?;
    let mut bundle = Bundle(zip);
    let meta = bundle.meta()?;
    let degree = meta.beyond.as_ref().map_or(0, |beyond| beyond.bands);
    if degree > MAX_DEGREE {
        return Err(damaged(format!("{META}: harmonics of degree {degree}, {MAX_DEGREE} is the highest")));
    }
    let count = meta.count;
    if count > options.max_splats {
        let message = format!("{count} splats, at most {} are allowed", options.max_splats);
        return Err(
            Error::new(Kind::BadData, "VGS-SOG-003", message).help("divide the file into smaller ones")
        );
    }
    if let Some(model) = meta.model.as_deref().filter(|&model| model != "default") {
        tracing::warn!("the splats are for the model {model}, and are taken for ordinary ones");
    }
    // Colours are there twice while they are turned.
    let floats = 2 * 3 * basis_count(degree) as u64;
    let bytes = count.saturating_mul(size_of::<Splat>() as u64 + 4 * floats);
    memory::require(bytes, &format!("{count} splats"))?;
    let mut splats = means(&mut bundle, &meta)?;
    let image = bundle.image(&meta.quats.files[0], count)?;
    for (i, (splat, pixel)) in splats.iter_mut().zip(image.pixels()).enumerate() {
        splat.rotation = unpacked_rotation(pixel).ok_or_else(|| {
            let [name] = &meta.quats.files;
            damaged(format!("{name}: splat {i} has alpha {}, and rotations have 252 to 255", pixel[3]))
        })?;
    }
    let codes = Codes::of("scales", &meta.scales.codebook)?;
    let image = bundle.image(&meta.scales.files[0], count)?;
    for (splat, [x, y, z, _]) in splats.iter_mut().zip(image.pixels()) {
        splat.log_scale = [codes.get(x)?, codes.get(y)?, codes.get(z)?];
    }
    let codes = Codes::of("sh0", &meta.sh0.codebook)?;
    let image = bundle.image(&meta.sh0.files[0], count)?;
    let stride = 3 * basis_count(degree);
    let mut coefficients = zeros::<f32>(splats.len().saturating_mul(stride))?;
    for ((splat, own), [r, g, b, opacity]) in
        splats.iter_mut().zip(coefficients.chunks_exact_mut(stride)).zip(image.pixels())
    {
        splat.set_opacity(f32::from(opacity) / 255.0);
        own[..3].copy_from_slice(&[codes.get(r)?, codes.get(g)?, codes.get(b)?]);
    }
    drop(image);
    if let Some(beyond) = meta.beyond.as_ref().filter(|beyond| beyond.bands > 0) {
        harmonics(&mut bundle, beyond, count, &mut coefficients)?;
    }
    Ok(SplatSet { splats, colours: Some(Harmonics { degree, coefficients }), ..SplatSet::default() })
}

/// Returns splats at their places.
fn means(bundle: &mut Bundle<impl Read + Seek>, meta: &Meta) -> Result<Vec<Splat>> {
    let [low, high] = &meta.means.files;
    let image = bundle.image(low, meta.count)?;
    let mut splats = Vec::new();
    reserve(&mut splats, meta.count as usize)?;
    let splat = |[x, y, z, _]: [u8; 4]| Splat { mean: [x, y, z].map(f32::from), ..Splat::default() };
    splats.extend(image.pixels().take(meta.count as usize).map(splat));
    let image = bundle.image(high, meta.count)?;
    let (mins, maxs) = (meta.means.mins, meta.means.maxs);
    for (splat, pixel) in splats.iter_mut().zip(image.pixels()) {
        splat.mean = [0, 1, 2].map(|k| {
            let share = (f64::from(splat.mean[k]) + 256.0 * f64::from(pixel[k])) / STEPS;
            of_log(mins[k] + (maxs[k] - mins[k]) * share) as f32
        });
    }
    Ok(splats)
}

/// Fills in the coefficients beyond degree 0.
fn harmonics(
    bundle: &mut Bundle<impl Read + Seek>,
    beyond: &Beyond,
    count: u64,
    coefficients: &mut [f32],
) -> Result<()> {
    let functions = basis_count(beyond.bands) - 1;
    let rows = beyond.count.min(MOST_ROWS as u64) as usize;
    let codes = Codes::of("shN", &beyond.codebook)?;
    let [palette, labels] = &beyond.files;
    let width = ROWS_A_LINE * functions;
    let image = bundle.image(palette, (width * rows.div_ceil(ROWS_A_LINE)) as u64)?;
    if image.width != width {
        let what = format!(
            "{palette} is {} pixels wide, and harmonics of degree {} need {width}",
            image.width, beyond.bands
        );
        return Err(damaged(what));
    }
    let mut table = zeros::<f32>(3 * functions * rows)?;
    for (to, pixel) in table.chunks_exact_mut(3).zip(image.pixels()) {
        to.copy_from_slice(&[codes.get(pixel[0])?, codes.get(pixel[1])?, codes.get(pixel[2])?]);
    }
    let image = bundle.image(labels, count)?;
    let stride = 3 * (functions + 1);
    for (own, [low, high, ..]) in coefficients.chunks_exact_mut(stride).zip(image.pixels()) {
        let label = usize::from(u16::from_le_bytes([low, high]));
        let Some(row) = table.chunks_exact(3 * functions).nth(label) else {
            return Err(damaged(format!("{labels}: row {label} of a palette of {rows}")));
        };
        own[3..].copy_from_slice(row);
    }
    Ok(())
}

/// Returns w, x, y, z of a rotation as the writer packs it; `None` if it is none.
fn unpacked_rotation([a, b, c, which]: [u8; 4]) -> Option<[f32; 4]> {
    let greatest = usize::from(which.checked_sub(LEFT_OUT)?);
    let mut q = [0.0f32; 4];
    let others = (0..4).filter(|&i| i != greatest);
    for (i, byte) in others.zip([a, b, c]) {
        q[i] = (f32::from(byte) / 127.5 - 1.0) * std::f32::consts::FRAC_1_SQRT_2;
    }
    q[greatest] = (1.0 - q.iter().map(|v| v * v).sum::<f32>()).max(0.0).sqrt();
    Some(q)
}

#[cfg(test)]
mod tests;
