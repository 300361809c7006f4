//! Files by which interrupted work goes on. Only the program that wrote one reads it.
//!
//! The file begins with a line that names the kind of the work. Then follow parts, each after its number of bytes (u64,
//! little-endian), and a CRC-32 of everything before it.

use std::io::Read;
use std::path::Path;

use flate2::Crc;

use super::error::{Error, Result};
use super::output::write_atomic;

/// Writes the parts of a state, atomically.
///
/// # Errors
/// Those of [`write_atomic`]: among others an existing file, unless `force` is true.
pub fn write(path: &Path, kind: &str, parts: &[&[u8]], force: bool) -> Result<()> {
    let mut bytes = format!("{kind}\n").into_bytes();
    for part in parts {
        bytes.extend((part.len() as u64).to_le_bytes());
        bytes.extend(*part);
    }
    let sum = crc32(&bytes);
    bytes.extend(sum.to_le_bytes());
    write_atomic(path, force, |out| out.write_all(&bytes))
}

/// Reads the parts of a state; `None` if the file is not a state of this kind with `N` parts, or damaged.
///
/// # Errors
/// Those of reading.
pub fn read<const N: usize>(path: &Path, kind: &str) -> Result<Option<[Vec<u8>; N]>> {
    let mut bytes = Vec::new();
    super::input::open(path)
        .and_then(|mut file| file.read_to_end(&mut bytes))
        .map_err(|e| Error::io(path, "reading the state of interrupted work", &e))?;
    Ok(parse(&bytes, kind))
}

fn parse<const N: usize>(bytes: &[u8], kind: &str) -> Option<[Vec<u8>; N]> {
    let (body, sum) = bytes.split_last_chunk()?;
    if crc32(body) != u32::from_le_bytes(*sum) {
        return None;
    }
    let mut rest = body.strip_prefix(kind.as_bytes())?.strip_prefix(b"\n")?;
    let mut parts = Vec::new();
    while !rest.is_empty() {
        let (length, tail) = rest.split_first_chunk()?;
        let (part, tail) = tail.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        parts.push(part.to_vec());
        rest = tail;
    }
    parts.try_into().ok()
}

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_back_and_damaged_ones_do_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        write(&path, "vgs-test-1", &[b"one", b"", &[7; 100]], false).expect("written");
        assert!(write(&path, "vgs-test-1", &[], false).is_err(), "it exists");
        let parts = read::<3>(&path, "vgs-test-1").expect("read").expect("whole");
        assert_eq!(parts, [b"one".to_vec(), vec![], vec![7; 100]]);
        assert_eq!(read::<2>(&path, "vgs-test-1").expect("read"), None, "another number of parts");
        assert_eq!(read::<3>(&path, "vgs-test-2").expect("read"), None, "another kind");
        let whole = std::fs::read(&path).expect("bytes");
        for cut in 0..whole.len() {
            assert_eq!(parse::<3>(&whole[..cut], "vgs-test-1"), None, "cut at {cut}");
            let mut turned = whole.clone();
            turned[cut] ^= 4;
            assert_eq!(parse::<3>(&turned, "vgs-test-1"), None, "a bit at {cut}");
        }
    }
}
