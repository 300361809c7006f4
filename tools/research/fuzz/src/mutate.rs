//! The changes of valid files: of bits, numbers and words, of what is where, and of what is compressed.

use std::io::{Cursor, Read, Write};

use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use zip::{CompressionMethod, ZipArchive};

use crate::seeds::dicom::zipped;

/// Longest file that a mutation makes, bytes.
const LONGEST: usize = 1 << 16;
/// Integers at which sizes, counts and signs turn over.
const INTEGERS: [u64; 20] = [
    0,
    1,
    2,
    3,
    7,
    8,
    15,
    16,
    127,
    128,
    255,
    256,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];
/// Numbers as text.
const NUMBERS: [&str; 16] = [
    "0",
    "-0",
    "1",
    "-1",
    "255",
    "65536",
    "2147483648",
    "4294967296",
    "18446744073709551616",
    "99999999999999999999",
    "1e308",
    "-1e-308",
    "1e999",
    "nan",
    "inf",
    "0.1.2",
];
/// Texts that mean something in one format or another.
const WORDS: [&str; 24] = [
    "\n",
    " ",
    "\"",
    "{",
    "}",
    "[",
    "]",
    "<",
    ">",
    "=",
    ":",
    "#",
    "\u{feff}",
    "end_header\n",
    "element vertex 4000000000\n",
    "property list uchar float x\n",
    "encoding: gzip\n",
    "data file: /dev/zero\n",
    "ElementDataFile = LIST\n",
    "ElementDataFile = ../x\n",
    "'shape': (4294967296, 4294967296), ",
    "<plist>",
    "&amp;&a;",
    "\\u0000",
];

/// Returns a changed copy of one of these files.
pub fn mutated(rng: &mut Pcg64Mcg, seeds: &[Vec<u8>]) -> Vec<u8> {
    let seed = &seeds[rng.random_range(0..seeds.len())];
    // What is packed is mostly changed inside: a change of the package seldom gets beyond its checksum.
    if rng.random_range(0..4) > 0
        && let Some(bytes) =
            changed_inside_gzip(rng, seed, seeds).or_else(|| changed_inside_zip(rng, seed, seeds))
    {
        return bytes;
    }
    let mut bytes = seed.clone();
    change(rng, &mut bytes, seeds);
    bytes
}

fn changed_inside_gzip(rng: &mut Pcg64Mcg, seed: &[u8], seeds: &[Vec<u8>]) -> Option<Vec<u8>> {
    if !seed.starts_with(&[0x1f, 0x8b]) {
        return None;
    }
    let mut inner = Vec::new();
    MultiGzDecoder::new(seed).take(LONGEST as u64).read_to_end(&mut inner).ok()?;
    change(rng, &mut inner, seeds);
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&inner).ok()?;
    packed.finish().ok()
}

/// Changes one file of a zip.
fn changed_inside_zip(rng: &mut Pcg64Mcg, seed: &[u8], seeds: &[Vec<u8>]) -> Option<Vec<u8>> {
    if !seed.starts_with(b"PK\x03\x04") {
        return None;
    }
    let mut zip = ZipArchive::new(Cursor::new(seed)).ok()?;
    let mut files = Vec::new();
    for index in 0..zip.len() {
        let mut file = zip.by_index(index).ok()?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).ok()?;
        files.push((file.name().ok()?.into_owned(), bytes));
    }
    let chosen = rng.random_range(0..files.len());
    change(rng, &mut files[chosen].1, seeds);
    Some(zipped(&files, CompressionMethod::Stored))
}

/// Makes one to eight changes.
fn change(rng: &mut Pcg64Mcg, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
    for _ in 0..1 << rng.random_range(0..4) {
        if bytes.is_empty() {
            bytes.push(0);
        }
        // Headers decide the most, so half of the changes are near the beginning.
        let end = if rng.random_range(0..2) == 0 { bytes.len() } else { bytes.len().min(400) };
        let at = rng.random_range(0..end);
        match rng.random_range(0..10) {
            0 => bytes[at] ^= 1 << rng.random_range(0..8),
            1 => bytes[at] = rng.random_range(0..=255),
            2 => integer(rng, bytes, at),
            3 => float(rng, bytes, at),
            4 | 5 => number(rng, bytes, at),
            6 => insert(bytes, at, WORDS[rng.random_range(0..WORDS.len())].as_bytes()),
            7 => {
                let length = rng.random_range(0..=(bytes.len() - at).min(64));
                bytes.drain(at..at + length);
            }
            8 => {
                let part = bytes[at..(at + rng.random_range(0..64)).min(bytes.len())].to_vec();
                let to = rng.random_range(0..=bytes.len());
                insert(bytes, to, &part);
            }
            _ => match rng.random_range(0..3) {
                0 => bytes.truncate(at),
                _ => {
                    let other = &seeds[rng.random_range(0..seeds.len())];
                    bytes.truncate(at);
                    bytes.extend(&other[at.min(other.len())..]);
                }
            },
        }
    }
    bytes.truncate(LONGEST);
}

/// Puts a whole number over the bytes at a place, in 2, 4 or 8 bytes of either order.
fn integer(rng: &mut Pcg64Mcg, bytes: &mut [u8], at: usize) {
    let value = INTEGERS[rng.random_range(0..INTEGERS.len())];
    let width = 2usize << rng.random_range(0..3);
    let little = value.to_le_bytes();
    let mut part = little[..width].to_vec();
    if rng.random_range(0..4) == 0 {
        part.reverse();
    }
    over(bytes, at, &part);
}

/// Puts a float over the bytes at a place, in 4 or 8 bytes.
fn float(rng: &mut Pcg64Mcg, bytes: &mut [u8], at: usize) {
    let values =
        [0.0, -0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-45, 3e38, -3e38, 1e300];
    let value = values[rng.random_range(0..values.len())];
    match rng.random_range(0..2) {
        0 => over(bytes, at, &(value as f32).to_le_bytes()),
        _ => over(bytes, at, &value.to_le_bytes()),
    }
}

/// Replaces the next number that is written as text.
fn number(rng: &mut Pcg64Mcg, bytes: &mut Vec<u8>, at: usize) {
    let is_part = |b: &u8| b.is_ascii_digit() || b"+-.".contains(b);
    let Some(begin) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
    let length = bytes[begin..].iter().take_while(|b| is_part(b)).count();
    let text = NUMBERS[rng.random_range(0..NUMBERS.len())];
    bytes.splice(begin..begin + length, text.bytes());
}

fn over(bytes: &mut [u8], at: usize, part: &[u8]) {
    for (to, from) in bytes[at..].iter_mut().zip(part) {
        *to = *from;
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, part: &[u8]) {
    bytes.splice(at..at, part.iter().copied());
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn the_same_seed_makes_the_same_files_and_most_differ_from_what_they_came_from() {
        let seeds = [b"ply\nelement vertex 5\nend_header\n".to_vec(), vec![0x1f, 0x8b, 8, 0]];
        let make = || {
            let mut rng = Pcg64Mcg::seed_from_u64(7);
            (0..500).map(|_| mutated(&mut rng, &seeds)).collect::<Vec<_>>()
        };
        let made = make();
        assert_eq!(made, make());
        assert!(made.iter().filter(|file| seeds.contains(file)).count() < 50);
        assert!(made.iter().all(|file| file.len() <= LONGEST));
    }
}
