//! The changes of files that libFuzzer does not make by itself: of what is packed in them, and of numbers as text.

use std::io::{Cursor, Read, Write};

use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use zip::{CompressionMethod, ZipArchive};

use crate::seeds::dicom::zipped;

/// Longest content that is changed, bytes.
const LONGEST: usize = 1 << 16;
/// Numbers at which sizes, counts and signs turn over.
const NUMBERS: [&str; 18] = [
    "0",
    "-0",
    "1",
    "-1",
    "255",
    "65536",
    "2147483647",
    "-2147483648",
    "4294967296",
    "18446744073709551616",
    "99999999999999999999",
    "1e308",
    "-1e-308",
    "1e999",
    "nan",
    "inf",
    "0.1.2",
    "",
];

/// Returns a changed copy of a file, or of one of the `valid` ones, of at most `most` bytes. `change` changes a buffer, of
/// whose bytes so many are used, up to a length, and returns the new length.
pub fn mutated(
    seed: u32,
    file: &[u8],
    valid: &[Vec<u8>],
    most: usize,
    change: fn(&mut [u8], usize, usize) -> usize,
) -> Vec<u8> {
    // Most files that went new ways are refused early; what is near to a valid one gets further.
    let file = match valid.get(seed as usize / 64 % valid.len().max(1)) {
        Some(valid) if seed >> 4 & 3 == 0 => valid,
        _ => file,
    };
    let changed = |bytes: &[u8], most: usize| {
        if seed >> 8 & 3 == 0
            && let Some(bytes) = with_number(seed >> 10, bytes).filter(|bytes| bytes.len() <= most)
        {
            return bytes;
        }
        let mut buffer = bytes.to_vec();
        buffer.resize(most.max(bytes.len()), 0);
        let length = change(&mut buffer, bytes.len(), most);
        buffer.truncate(length);
        buffer
    };
    // What is packed is mostly changed inside: a change of the package seldom gets beyond its checksum.
    let packed = if seed.is_multiple_of(4) {
        None
    } else {
        inside_gzip(file, &changed).or_else(|| inside_zip(seed, file, &changed))
    };
    packed.filter(|bytes| bytes.len() <= most).unwrap_or_else(|| changed(file, most))
}

/// Replaces one of the numbers that are written as text; `None` if there is none.
fn with_number(seed: u32, bytes: &[u8]) -> Option<Vec<u8>> {
    let is_part = |b: &u8| b.is_ascii_digit() || b"+-.".contains(b);
    let at = seed as usize % bytes.len().max(1);
    // Numbers stand in the header, if that is short and voxels follow.
    let at = if seed & 1 == 0 { at } else { at.min(at % 400) };
    let begin = at + bytes.get(at..)?.iter().position(u8::is_ascii_digit)?;
    let end = begin + bytes[begin..].iter().take_while(|b| is_part(b)).count();
    let begin = begin - bytes[..begin].iter().rev().take_while(|b| is_part(b)).count();
    let number = NUMBERS[seed as usize / 7 % NUMBERS.len()].as_bytes();
    Some([&bytes[..begin], number, &bytes[end..]].concat())
}

/// Changes what a gzip stream holds that may have other content before it.
fn inside_gzip(file: &[u8], changed: &impl Fn(&[u8], usize) -> Vec<u8>) -> Option<Vec<u8>> {
    let at = file.windows(3).position(|begin| begin == [0x1f, 0x8b, 8])?;
    let mut inner = Vec::new();
    MultiGzDecoder::new(&file[at..]).take(LONGEST as u64).read_to_end(&mut inner).ok()?;
    let mut packed = GzEncoder::new(file[..at].to_vec(), Compression::fast());
    packed.write_all(&changed(&inner, LONGEST)).ok()?;
    packed.finish().ok()
}

/// Changes one file of a zip.
fn inside_zip(seed: u32, file: &[u8], changed: &impl Fn(&[u8], usize) -> Vec<u8>) -> Option<Vec<u8>> {
    if !file.starts_with(b"PK\x03\x04") {
        return None;
    }
    let mut zip = ZipArchive::new(Cursor::new(file)).ok()?;
    let mut files = Vec::new();
    for index in 0..zip.len() {
        let mut file = zip.by_index(index).ok()?;
        let mut bytes = Vec::new();
        (&mut file).take(LONGEST as u64).read_to_end(&mut bytes).ok()?;
        files.push((file.name().ok()?.into_owned(), bytes));
    }
    let chosen = seed as usize / 4 % files.len().max(1);
    let content = &mut files.get_mut(chosen)?.1;
    *content = changed(content, LONGEST);
    Some(zipped(&files, CompressionMethod::Stored))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns the bits of the first byte.
    fn turn(bytes: &mut [u8], length: usize, _: usize) -> usize {
        bytes[0] = !bytes[0];
        length
    }

    #[test]
    fn what_is_packed_is_changed_inside_and_its_checksums_are_right() {
        let mut gzip = GzEncoder::new(b"header\n\n".to_vec(), Compression::fast());
        gzip.write_all(b"voxels").expect("memory takes it");
        let gzip = gzip.finish().expect("memory takes it");
        let mut inner = Vec::new();
        MultiGzDecoder::new(&mutated(1, &gzip, &[], 1000, turn)[8..]).read_to_end(&mut inner).expect("gzip");
        assert_eq!(inner, [&[!b'v'][..], b"oxels"].concat());

        let files = ["a", "b"].map(|name| (name.to_owned(), name.into()));
        let zip = mutated(4 + 1, &zipped(&files, CompressionMethod::Deflated), &[], 1000, turn);
        let mut zip = ZipArchive::new(Cursor::new(zip)).expect("a zip");
        let mut inner = Vec::new();
        zip.by_name("b").expect("a file").read_to_end(&mut inner).expect("a right checksum");
        assert_eq!(inner, [!b'b']);
        // Each fourth change is of the package, and so is one of what does not fit.
        assert_eq!(mutated(4, &gzip, &[], 1000, turn)[0], !b'h');
        assert_eq!(mutated(1, &gzip, &[], 20, turn)[0], !b'h');
    }
}
