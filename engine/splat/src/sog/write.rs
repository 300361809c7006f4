//! The SOG writer.

use std::io::{self, Cursor, Write};
use std::path::Path;

use glam::DVec3;
use image_webp::{ColorType, EncoderParams, WebPEncoder};
use rayon::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::codes::{codebook, nearest};
use super::palette::Palette;
use super::{AXES, Beyond, Coded, Files, LEFT_OUT, META, Means, Meta, ROWS_A_LINE, STEPS, VERSION, log_of};
use crate::activation::{Activations, normalised};
use crate::ordinary::Ordinary;
use crate::vgs::morton;
use crate::{Splat, SplatSet, WriteOptions};
use base::error::{Error, Kind, Result};
use base::output::counted;

/// Most pixels of an image along a side, a multiple of 4 (WebP ends at 16383).
const LONGEST_SIDE: usize = 16380;
/// Height of an image until it is as wide: pixels are compressed by their differences from those above, which are nearer in
/// narrow images, and every GPU takes textures of this height.
const USUAL_HEIGHT: usize = 2048;

/// Writes `set` atomically.
///
/// # Errors
/// As [`Ordinary::new`]; also [`Kind::Usage`] for more splats than an image has pixels.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let made = Encoder::new(set).map_err(|error| error.file(path))?;
    base::output::write_atomic(path, options.force, |out| made.encode(out))
}

/// Returns the size in bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, _options: &WriteOptions) -> Result<u64> {
    let made = Encoder::new(set)?;
    Ok(counted(|out| made.encode(out)))
}

/// Makes the file of an image.
type Make<'a> = Box<dyn Fn() -> io::Result<Vec<u8>> + Sync + 'a>;

struct Encoder {
    set: Ordinary,
    /// Width and height of the images.
    size: [usize; 2],
    /// The splats in the order of the pixels.
    order: Vec<u32>,
    /// Coordinates between `mins` and `maxs`, in [`STEPS`].
    places: Vec<[u16; 3]>,
    mins: [f64; 3],
    maxs: [f64; 3],
    scales: Vec<f32>,
    colours: Vec<f32>,
    /// The palette of harmonics beyond degree 0, and its codebook.
    palette: Option<(Palette, Vec<f32>)>,
}

impl Encoder {
    fn new(set: &SplatSet) -> Result<Self> {
        let set = Ordinary::new(set, &AXES)?;
        let size = size(set.splats.len())?;
        let place = |splat: &Splat| {
            (DVec3::from_array(splat.mean.map(f64::from)) + set.origin).to_array().map(log_of)
        };
        let ends = |end: fn(f64, f64) -> f64, first: f64| {
            let ends = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| end(a[k], b[k]));
            set.splats.iter().map(place).fold([first; 3], ends)
        };
        let (mins, maxs) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
        let steps = |splat: &Splat| {
            let place = place(splat);
            // Where all lie in a plane, the number is NaN and the step 0.
            [0, 1, 2].map(|k| ((place[k] - mins[k]) / (maxs[k] - mins[k]) * STEPS).round() as u16)
        };
        let places: Vec<[u16; 3]> = set.splats.iter().map(steps).collect();
        let mut order: Vec<u32> = (0..set.splats.len() as u32).collect();
        order.par_sort_by_cached_key(|&i| (morton::code(places[i as usize].map(u64::from)), i));
        let scales = codebook(set.splats.iter().flat_map(|splat| splat.log_scale).collect());
        let own = |of: &[f32]| [of[0], of[1], of[2]];
        let rows = || set.colours.coefficients.chunks_exact(set.colours.stride());
        let colours = codebook(rows().flat_map(own).collect());
        let palette = (set.colours.degree > 0).then(|| {
            let palette = Palette::of(set.splats.len(), |i| &set.colours.of(i as usize)[3..]);
            let codes = codebook(palette.rows.clone());
            (palette, codes)
        });
        Ok(Encoder { set, size, order, places, mins, maxs, scales, colours, palette })
    }

    fn encode(&self, out: &mut dyn Write) -> io::Result<()> {
        let Encoder { set, places, scales, colours, .. } = self;
        let code = |codes: &[f32], values: &[f32]| [0, 1, 2].map(|k| nearest(codes, values[k]));
        let low = |i: usize| places[i].map(|steps| steps as u8);
        let high = |i: usize| places[i].map(|steps| (steps >> 8) as u8);
        let scale = |i: usize| code(scales, &set.splats[i].log_scale);
        let rotation = |i: usize| packed_rotation(set.splats[i].rotation);
        let colour = |i: usize| {
            let [r, g, b] = code(colours, set.colours.of(i));
            [r, g, b, (set.splats[i].opacity() * 255.0).round().clamp(0.0, 255.0) as u8]
        };
        let mut images: Vec<(&str, Make<'_>)> = vec![
            ("means_l.webp", Box::new(move || self.image(low))),
            ("means_u.webp", Box::new(move || self.image(high))),
            ("quats.webp", Box::new(move || self.image(rotation))),
            ("scales.webp", Box::new(move || self.image(scale))),
            ("sh0.webp", Box::new(move || self.image(colour))),
        ];
        if let Some((palette, codes)) = &self.palette {
            let label = |i: usize| {
                let [low, high] = palette.labels[i].to_le_bytes();
                [low, high, 0]
            };
            let functions = set.colours.stride() / 3 - 1;
            let lines = palette.rows.len().div_ceil(3 * functions * ROWS_A_LINE);
            let size = [ROWS_A_LINE * functions, lines];
            let mut pixels: Vec<u8> = palette.rows.iter().map(|&v| nearest(codes, v)).collect();
            pixels.resize(3 * size[0] * size[1], 0);
            images.push(("shN_centroids.webp", Box::new(move || webp(&pixels, size, ColorType::Rgb8))));
            images.push(("shN_labels.webp", Box::new(move || self.image(label))));
        }
        let made = images.par_iter().map(|(_, image)| image()).collect::<io::Result<Vec<_>>>()?;
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        let meta = serde_json::to_vec(&self.meta())?;
        let images = images.iter().zip(&made).map(|((name, _), image)| (*name, image));
        for (name, content) in std::iter::once((META, &meta)).chain(images) {
            zip.start_file(name, options)?;
            zip.write_all(content)?;
        }
        out.write_all(zip.finish()?.get_ref())
    }

    fn meta(&self) -> Meta {
        let one = |name: &str| [name.to_owned()];
        let coded = |codes: &[f32]| codes.iter().map(|&code| Some(code)).collect();
        let beyond = self.palette.as_ref().map(|(palette, codes)| Beyond {
            count: (palette.rows.len() / (self.set.colours.stride() - 3)) as u64,
            bands: self.set.colours.degree,
            codebook: coded(codes),
            files: ["shN_centroids.webp", "shN_labels.webp"].map(str::to_owned),
        });
        Meta {
            version: VERSION,
            count: self.order.len() as u64,
            model: None,
            means: Means {
                mins: self.mins,
                maxs: self.maxs,
                files: ["means_l.webp", "means_u.webp"].map(str::to_owned),
            },
            scales: Coded { codebook: coded(&self.scales), files: one("scales.webp") },
            quats: Files { files: one("quats.webp") },
            sh0: Coded { codebook: coded(&self.colours), files: one("sh0.webp") },
            beyond,
        }
    }

    /// Returns an image with a pixel for each splat.
    fn image<const N: usize>(&self, of: impl Fn(usize) -> [u8; N]) -> io::Result<Vec<u8>> {
        let mut pixels: Vec<u8> = self.order.iter().flat_map(|&i| of(i as usize)).collect();
        pixels.resize(N * self.size[0] * self.size[1], 0);
        webp(&pixels, self.size, if N == 4 { ColorType::Rgba8 } else { ColorType::Rgb8 })
    }
}

/// Returns the sides of an image of so many pixels or a few more. They are multiples of 4, as PlayCanvas writes them.
fn size(count: usize) -> Result<[usize; 2]> {
    let square = (count as f64).sqrt().ceil() as usize;
    let width = count.div_ceil(USUAL_HEIGHT).min(square).next_multiple_of(4);
    let height = count.div_ceil(width.max(1)).next_multiple_of(4);
    if width.max(height) > LONGEST_SIDE {
        let message =
            format!("{count} splats, and the images of a SOG file have at most {LONGEST_SIDE}² pixels");
        return Err(Error::new(Kind::Usage, "VGS-SOG-005", message)
            .help("write a .spz, or a part: vgs convert --box or --object"));
    }
    Ok([width, height])
}

/// Returns a lossless image, with or without differences of neighbours, whichever is smaller.
fn webp(pixels: &[u8], [width, height]: [usize; 2], colours: ColorType) -> io::Result<Vec<u8>> {
    let encoded = |differences: bool| -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        let mut params = EncoderParams::default();
        params.use_predictor_transform = differences;
        let mut encoder = WebPEncoder::new(&mut out);
        encoder.set_params(params);
        encoder.encode(pixels, width as u32, height as u32, colours).map_err(io::Error::other)?;
        Ok(out)
    };
    let (with, without) = rayon::join(|| encoded(true), || encoded(false));
    let (with, without) = (with?, without?);
    Ok(if without.len() < with.len() { without } else { with })
}

/// Returns the three of w, x, y, z beside the greatest, and which one that is.
fn packed_rotation(rotation: [f32; 4]) -> [u8; 4] {
    let q = normalised(rotation);
    let greatest = (1..4).fold(0, |at, i| if q[i].abs() > q[at].abs() { i } else { at });
    let sign = if q[greatest] < 0.0 { -1.0 } else { 1.0 };
    let mut packed = [LEFT_OUT + greatest as u8; 4];
    for (byte, i) in packed.iter_mut().zip((0..4).filter(|&i| i != greatest)) {
        let share = (sign * q[i] * std::f32::consts::SQRT_2 + 1.0) * 0.5;
        *byte = (share * 255.0).round().clamp(0.0, 255.0) as u8;
    }
    packed
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use glam::DQuat;
    use image_webp::WebPDecoder;
    use serde_json::Value;
    use zip::ZipArchive;

    use super::*;
    use crate::ordinary::tests::{Errors, Row, check, in_order, many};

    /// Returns the splats of a file, by the words of the specification.
    fn parsed(file: &[u8]) -> Vec<Row> {
        let mut zip = ZipArchive::new(Cursor::new(file)).expect("a zip");
        let mut content = |name: &str| {
            let mut content = Vec::new();
            let mut file = zip.by_name(name).expect(name);
            assert_eq!(file.compression(), CompressionMethod::Stored, "{name}");
            file.read_to_end(&mut content).expect(name);
            content
        };
        let meta: Value = serde_json::from_slice(&content("meta.json")).expect("JSON");
        assert_eq!(meta["version"], 2);
        let count = meta["count"].as_u64().expect("a count") as usize;
        let mut image = |of: &str, at: usize| {
            let file = content(meta[of]["files"][at].as_str().expect("a name"));
            let mut decoder = WebPDecoder::new(Cursor::new(file)).expect("WebP");
            let (width, height) = decoder.dimensions();
            let channels = if decoder.has_alpha() { 4 } else { 3 };
            let mut pixels = vec![0; (width * height) as usize * channels];
            decoder.read_image(&mut pixels).expect("an image");
            let pixel = move |i: usize| pixels[channels * i..][..channels].to_vec();
            (width as usize, pixel)
        };
        let number = |value: &Value| value.as_f64().expect("a number");
        let code = |of: &str, byte: u8| number(&meta[of]["codebook"][usize::from(byte)]);
        let ((width, low), (_, high)) = (image("means", 0), image("means", 1));
        assert_eq!(width, 4);
        let (rotations, scales, own) = (image("quats", 0).1, image("scales", 0).1, image("sh0", 0).1);
        let ((line, centroids), (_, labels)) = (image("shN", 0), image("shN", 1));
        let functions = [0, 3, 8, 15][meta["shN"]["bands"].as_u64().expect("a degree") as usize];
        assert_eq!(line, 64 * functions);
        let row = |i: usize| {
            let coordinate = |k: usize| {
                let share = (f64::from(low(i)[k]) + 256.0 * f64::from(high(i)[k])) / 65535.0;
                let [min, max] = ["mins", "maxs"].map(|end| number(&meta["means"][end][k]));
                let v = min + share * (max - min);
                v.signum() * (v.abs().exp() - 1.0)
            };
            let packed = rotations(i);
            let greatest = usize::from(packed[3] - 252);
            let mut q = [0.0; 4];
            for (at, &byte) in (0..4).filter(|&at| at != greatest).zip(&packed) {
                q[at] = (f64::from(byte) / 255.0 - 0.5) * 2f64.sqrt();
            }
            q[greatest] = (1.0 - q.iter().map(|v| v * v).sum::<f64>()).sqrt();
            let label = usize::from(labels(i)[0]) + 256 * usize::from(labels(i)[1]);
            assert!(label < meta["shN"]["count"].as_u64().expect("rows") as usize);
            let centroid = (0..functions).flat_map(|k| centroids(label * functions + k));
            Row {
                place: DVec3::new(coordinate(0), coordinate(1), coordinate(2)),
                rotation: DQuat::from_xyzw(q[1], q[2], q[3], q[0]),
                scale: DVec3::from_array([0, 1, 2].map(|k| code("scales", scales(i)[k]).exp())),
                opacity: f64::from(own(i)[3]) / 255.0,
                coefficients: own(i)[..3]
                    .iter()
                    .map(|&byte| code("sh0", byte) as f32)
                    .chain(centroid.map(|byte| code("shN", byte) as f32))
                    .collect(),
            }
        };
        (0..count).map(row).collect()
    }

    #[test]
    fn a_file_holds_the_splats_in_metres_along_right_down_front() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.sog");
        let near = many();
        let far = SplatSet { origin_mm: DVec3::new(0.0, 0.0, 100_000.0), ..near.clone() };
        for set in [near, far] {
            crate::write(&path, &set, true).expect("a file");
            let file = std::fs::read(&path).expect("the file");
            assert_eq!(
                crate::file_bytes(&path, &set, &WriteOptions::default()).expect("bytes"),
                file.len() as u64
            );
            crate::write(&path, &set, true).expect("a file");
            assert_eq!(std::fs::read(&path).expect("the file"), file, "the same bytes");
            let to_ras = |v: DVec3| DVec3::new(v.x, v.z, -v.y);
            let rows = in_order(&set, parsed(&file), to_ras);
            check(&set, &rows, to_ras, &WITHIN);
        }
    }

    /// Places in 65535 steps of 160 mm along each axis; ln σ by 256 numbers of a range of 4, so σ² is right to 2 %, and rotations
    /// to 0.01; bytes of opacity; colours by 256 numbers, and harmonics off by a 255th, the root of the mean square.
    const WITHIN: Errors =
        Errors { place_mm: 0.0025, shape: 0.035, opacity: 0.5 / 255.0 + 1e-6, colour: 0.03 };

    #[test]
    fn images_hold_all_splats_and_little_more() {
        for count in [1, 3, 16, 17, 1000, 1_000_000, 200_000_000] {
            let [width, height] = size(count).expect("a size");
            assert!(
                width * height >= count && width * (height - 4) < count,
                "{width} x {height} for {count}"
            );
        }
        let error = size(300_000_000).expect_err("too many");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-SOG-005"));
        assert!(crate::write(Path::new("no.sog"), &many().selected(|_, _| false), false).is_err());
    }
}
