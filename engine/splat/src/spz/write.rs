//! The SPZ writer.

use std::io::{self, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;

use super::{AXES, COLOUR_STEPS, MARK};
use crate::activation::{Activations, normalised};
use crate::ordinary::Ordinary;
use crate::{SplatSet, WriteOptions};
use base::error::{Error, Kind, Result};
use base::output::counted;

const VERSION: u32 = 3;
/// Most bits of a coordinate behind the point, where all fit: steps of a micrometre within 8 m.
const MOST_FRACTION_BITS: i32 = 20;
/// Writes `set` atomically, in version 3.
///
/// # Errors
/// As [`Ordinary::new`]; also [`Kind::Usage`] for places that 24 bits do not hold in metres.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let made = Encoder::new(set).map_err(|error| error.file(path))?;
    base::output::write_atomic(path, options.force, |out| made.encode(out))
}

/// Returns the size in bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, _options: &WriteOptions) -> Result<u64> {
    let made = Encoder::new(set)?;
    Ok(counted(|out| made.encode(out)))
}

struct Encoder {
    set: Ordinary,
    /// Bits of a coordinate behind the point.
    fraction_bits: i32,
}

impl Encoder {
    fn new(set: &SplatSet) -> Result<Self> {
        let set = Ordinary::new(set, &AXES)?;
        let far = |mean: [f32; 3]| (DVec3::from_array(mean.map(f64::from)) + set.origin).abs().max_element();
        let far = set.splats.iter().map(|splat| far(splat.mean)).fold(0.0, f64::max);
        let fraction_bits =
            (0..=MOST_FRACTION_BITS).rev().find(|&bits| far * f64::from(bits).exp2() < 8_388_607.0);
        let fraction_bits = fraction_bits.ok_or_else(|| {
            let message = format!("a splat lies {far:.0} m from the origin, and an SPZ file ends at 8388 km");
            Error::new(Kind::Usage, "VGS-SPLAT-008", message).help("write a .glb or a .ply")
        })?;
        Ok(Encoder { set, fraction_bits })
    }

    fn encode(&self, out: &mut dyn Write) -> io::Result<()> {
        let Ordinary { splats, colours, origin } = &self.set;
        let mut out = GzEncoder::new(out, Compression::default());
        let count = u32::try_from(splats.len()).map_err(io::Error::other)?;
        out.write_all(MARK)?;
        out.write_all(&VERSION.to_le_bytes())?;
        out.write_all(&count.to_le_bytes())?;
        // Degree of the harmonics, bits behind the point, no flags, a reserved byte.
        out.write_all(&[colours.degree, self.fraction_bits as u8, 0, 0])?;
        let unit = f64::from(self.fraction_bits).exp2();
        for splat in splats {
            let place = (DVec3::from_array(splat.mean.map(f64::from)) + *origin) * unit;
            for steps in place.to_array() {
                out.write_all(&(steps.round() as i32).to_le_bytes()[..3])?;
            }
        }
        for splat in splats {
            out.write_all(&[byte(splat.opacity() * 255.0)])?;
        }
        for of in colours.coefficients.chunks_exact(colours.stride()) {
            out.write_all(&[0, 1, 2].map(|channel| byte(of[channel] * COLOUR_STEPS + 127.5)))?;
        }
        for splat in splats {
            out.write_all(&splat.log_scale.map(|log| byte((log + 10.0) * 16.0)))?;
        }
        for splat in splats {
            out.write_all(&packed_rotation(splat.rotation).to_le_bytes())?;
        }
        for of in colours.coefficients.chunks_exact(colours.stride()) {
            let beyond: Vec<u8> = of[3..].iter().map(|c| byte(c * 128.0 + 128.0)).collect();
            out.write_all(&beyond)?;
        }
        out.finish()?;
        Ok(())
    }
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
