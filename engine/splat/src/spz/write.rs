//! The SPZ writer.

use std::io::{self, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use super::{AXES, COLOUR_STEPS, FIT, HAS_EXTENSIONS, MARK, ZSTD_HEADER};
use crate::activation::{Activations, normalised};
use crate::ordinary::Ordinary;
use crate::{Splat, SplatSet, WriteOptions, vgs};
use base::error::{Error, Kind, Result};
use base::output::counted;

/// The version that is written, and the one with the fit.
const VERSION: u32 = 3;
const LIVE_VERSION: u32 = 4;
/// The level of a zstd stream; ruzstd has no other that packs. Of 3382 splats of degree 2 the streams take 8 % more than in
/// gzip. Those of the C library would take 1 % less than in gzip, 10 % at its level 19; it is not in every build.
const LEVEL: CompressionLevel = CompressionLevel::Fastest;
/// Most bits of a coordinate behind the point, where all fit: steps of a micrometre within 8 m.
const MOST_FRACTION_BITS: i32 = 20;

/// Writes `set` atomically, in version 3; with [`WriteOptions::live`] in version 4.
///
/// # Errors
/// As [`Ordinary::new`], and as [`vgs::encode`] for the fit; also [`Kind::Usage`] for places that 24 bits do not hold in
/// metres.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let made = Encoder::new(set, options).map_err(|error| error.file(path))?;
    base::output::write_atomic(path, options.force, |out| made.encode(out))
}

/// Returns the size in bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, options: &WriteOptions) -> Result<u64> {
    let made = Encoder::new(set, options)?;
    Ok(counted(|out| made.encode(out)))
}

struct Encoder {
    set: Ordinary,
    /// Bits of a coordinate behind the point.
    fraction_bits: i32,
    /// The fit as a `.vgs`.
    fit: Option<Vec<u8>>,
}

impl Encoder {
    fn new(set: &SplatSet, options: &WriteOptions) -> Result<Self> {
        let set = Ordinary::new(set, &AXES)?;
        let far = |mean: [f32; 3]| (DVec3::from_array(mean.map(f64::from)) + set.origin).abs().max_element();
        let far = set.splats.iter().map(|splat| far(splat.mean)).fold(0.0, f64::max);
        let fraction_bits =
            (0..=MOST_FRACTION_BITS).rev().find(|&bits| far * f64::from(bits).exp2() < 8_388_607.0);
        let fraction_bits = fraction_bits.ok_or_else(|| {
            let message = format!("a splat lies {far:.0} m from the origin, and an SPZ file ends at 8388 km");
            Error::new(Kind::Usage, "VGS-SPLAT-008", message).help("write a .glb or a .ply")
        })?;
        let fit = options.live.map(fit).transpose()?;
        Ok(Encoder { set, fraction_bits, fit })
    }

    fn encode(&self, out: &mut dyn Write) -> io::Result<()> {
        let sections = self.sections();
        let Some(fit) = &self.fit else {
            let mut out = GzEncoder::new(out, Compression::default());
            out.write_all(&self.header(VERSION, [0, 0])?)?;
            sections.iter().try_for_each(|section| out.write_all(section))?;
            return out.finish().map(drop);
        };
        // There is no stream without bytes.
        let sections: Vec<_> = sections.iter().filter(|section| !section.is_empty()).collect();
        let streams: Vec<_> = sections.iter().map(|section| compress_to_vec(&section[..], LEVEL)).collect();
        let length = u32::try_from(fit.len()).map_err(io::Error::other)?;
        let table = length.checked_add(ZSTD_HEADER + 8).ok_or(io::ErrorKind::FileTooLarge)?;
        out.write_all(&self.header(LIVE_VERSION, [HAS_EXTENSIONS, streams.len() as u8])?)?;
        out.write_all(&table.to_le_bytes())?;
        out.write_all(&[0; ZSTD_HEADER as usize - 20])?;
        out.write_all(&[FIT, length].map(u32::to_le_bytes).concat())?;
        out.write_all(fit)?;
        for (section, stream) in sections.iter().zip(&streams) {
            out.write_all(&[stream.len(), section.len()].map(|size| (size as u64).to_le_bytes()).concat())?;
        }
        streams.iter().try_for_each(|stream| out.write_all(stream))
    }

    /// Returns the 16 bytes that the header has in each version; `last` are its flags and its last byte.
    fn header(&self, version: u32, last: [u8; 2]) -> io::Result<Vec<u8>> {
        let count = u32::try_from(self.set.splats.len()).map_err(io::Error::other)?;
        let numbers = [version, count].map(u32::to_le_bytes).concat();
        Ok([MARK, &numbers[..], &[self.set.colours.degree, self.fraction_bits as u8], &last].concat())
    }

    /// Returns places, opacities, colours, widths, rotations and harmonics, each of all splats.
    fn sections(&self) -> [Vec<u8>; 6] {
        let Ordinary { splats, colours, origin } = &self.set;
        let unit = f64::from(self.fraction_bits).exp2();
        let place = |splat: &Splat| {
            let place = (DVec3::from_array(splat.mean.map(f64::from)) + *origin) * unit;
            let [x, y, z] = place.to_array().map(|steps| (steps.round() as i32).to_le_bytes());
            [x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]]
        };
        let rows = || colours.coefficients.chunks_exact(colours.stride());
        let own = |of: &[f32]| [0, 1, 2].map(|channel| byte(of[channel] * COLOUR_STEPS + 127.5));
        [
            splats.iter().flat_map(place).collect(),
            splats.iter().map(|splat| byte(splat.opacity() * 255.0)).collect(),
            rows().flat_map(own).collect(),
            splats.iter().flat_map(|splat| splat.log_scale.map(|log| byte((log + 10.0) * 16.0))).collect(),
            splats.iter().flat_map(|splat| packed_rotation(splat.rotation).to_le_bytes()).collect(),
            rows().flat_map(|of| &of[3..]).map(|c| byte(c * 128.0 + 128.0)).collect(),
        ]
    }
}

/// Returns the `.vgs` of a fit.
fn fit(set: &SplatSet) -> Result<Vec<u8>> {
    if set.colours.is_none() {
        return vgs::encode(set);
    }
    let message = "splats with colours, and a live file also needs the intensities that these were made of";
    Err(Error::new(Kind::Usage, "VGS-SPZ-005", message).help("give splats with HU, or leave out --live"))
}

fn byte(v: f32) -> u8 {
    v.round().clamp(0.0, 255.0) as u8
}

/// Returns the index of the greatest of x, y, z, w in the upper two bits, then the three others, each with its
/// sign and 9 bits of |v| √2.
fn packed_rotation(rotation: [f32; 4]) -> u32 {
    let [w, x, y, z] = normalised(rotation);
    let q = [x, y, z, w];
    let greatest = (1..4).fold(0, |at, i| if q[i].abs() > q[at].abs() { i } else { at });
    (0..4).filter(|&i| i != greatest).fold(greatest as u32, |packed, i| {
        let negative = (q[i] < 0.0) != (q[greatest] < 0.0);
        let steps = (q[i].abs() * (511.0 * std::f32::consts::SQRT_2)).round().min(511.0) as u32;
        packed << 10 | u32::from(negative) << 9 | steps
    })
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use flate2::read::GzDecoder;
    use glam::DQuat;

    use super::*;
    use crate::ordinary::tests::{Errors, Row, check, coloured};

    /// Returns the splats of a file, and the bits behind the point of a coordinate.
    fn parsed(file: &[u8]) -> (Vec<Row>, u8) {
        let mut data = Vec::new();
        GzDecoder::new(file).read_to_end(&mut data).expect("gzip");
        let (header, body) = data.split_at(16);
        assert_eq!(header[..8], *b"NGSP\x03\0\0\0");
        let count = u32::from_le_bytes(header[8..12].try_into().expect("four bytes")) as usize;
        let [degree, bits, flags, reserved] = header[12..] else { panic!("a header of 16 bytes") };
        assert_eq!((degree, flags, reserved), (2, 0, 0));
        let beyond = 24;
        assert_eq!(body.len(), count * (9 + 1 + 3 + 3 + 4 + beyond));
        let (places, rest) = body.split_at(9 * count);
        let (opacities, rest) = rest.split_at(count);
        let (colours, rest) = rest.split_at(3 * count);
        let (scales, rest) = rest.split_at(3 * count);
        let (rotations, harmonics) = rest.split_at(4 * count);
        let row = |i: usize| {
            let coordinate = |k: usize| {
                let [a, b, c] = places[9 * i + 3 * k..][..3] else { panic!("three bytes") };
                f64::from(i32::from_le_bytes([0, a, b, c]) >> 8) / f64::from(bits).exp2()
            };
            // The last of the three is in the lowest bits.
            let packed = u32::from_le_bytes(rotations[4 * i..][..4].try_into().expect("four bytes"));
            let greatest = (packed >> 30) as usize;
            let mut q = [0.0f64; 4];
            let mut shift = 0;
            for at in (0..4).rev().filter(|&at| at != greatest) {
                let field = packed >> shift;
                let size = f64::from(field & 511) / 511.0 * 0.5f64.sqrt();
                q[at] = if field >> 9 & 1 == 1 { -size } else { size };
                shift += 10;
            }
            q[greatest] = (1.0 - q.iter().map(|v| v * v).sum::<f64>()).sqrt();
            let own = colours[3 * i..][..3].iter().map(|&b| (f32::from(b) / 255.0 - 0.5) / 0.15);
            let others = harmonics[beyond * i..][..beyond].iter().map(|&b| (f32::from(b) - 128.0) / 128.0);
            Row {
                place: DVec3::new(coordinate(0), coordinate(1), coordinate(2)),
                rotation: DQuat::from_array(q),
                scale: DVec3::from_array(
                    [0, 1, 2].map(|k| (f64::from(scales[3 * i + k]) / 16.0 - 10.0).exp()),
                ),
                opacity: f64::from(opacities[i]) / 255.0,
                coefficients: own.chain(others).collect(),
            }
        };
        ((0..count).map(row).collect(), bits)
    }

    #[test]
    fn a_file_holds_the_splats_in_metres_along_right_up_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.spz");
        let near = coloured();
        let far = SplatSet { origin_mm: DVec3::new(0.0, 0.0, 100_000.0), ..near.clone() };
        for (set, wanted_bits, place_mm) in [(near, 20, 0.001), (far, 16, 0.02)] {
            crate::write(&path, &set, true).expect("a file");
            let file = std::fs::read(&path).expect("the file");
            assert_eq!(
                crate::file_bytes(&path, &set, &WriteOptions::default()).expect("bytes"),
                file.len() as u64
            );
            let (rows, bits) = parsed(&file);
            assert_eq!(bits, wanted_bits);
            // ln σ in steps of 1/16, so σ² is right to 6.5 %; bytes of opacity and colour; eight more of 1/128.
            let allowed = Errors { place_mm, shape: 0.07, opacity: 0.5 / 255.0 + 1e-6, colour: 0.03 };
            check(&set, &rows, |v| DVec3::new(v.x, -v.z, v.y), &allowed);
        }
        let lost = SplatSet { origin_mm: DVec3::new(0.0, 1e10, 0.0), ..coloured() };
        let error = crate::write(&path, &lost, true).expect_err("24 bits are too few");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-SPLAT-008"));
    }
}
