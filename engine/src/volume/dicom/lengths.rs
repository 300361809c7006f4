//! The lengths of a DICOM file's elements, checked before the library takes memory for them: it takes what an
//! element claims, up to 4 GiB, before it reads a byte of it. So the walk goes where the library goes, right or wrong.

use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_object::{StandardDataDictionary, Tag};
use flate2::read::DeflateDecoder;

/// Transfer syntaxes of files whose elements are packed as a whole.
pub(super) const PACKED: [&str; 3] =
    ["1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.4.95", "1.2.840.10008.1.2.4.205"];
/// Kinds of values whose length takes two bytes. That of all others, known or not, takes four, after two that are not
/// used.
const SHORT: [&[u8; 2]; 21] = [
    b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FD", b"FL", b"IS", b"LO", b"LT", b"PN", b"SH", b"SL",
    b"SS", b"ST", b"TM", b"UI", b"UL", b"US",
];
/// A length that is not told: an end mark follows the content.
const UNTOLD: u32 = u32::MAX;
/// Group of the marks of items and of ends.
const MARKS: u16 = 0xfffe;
const ITEM: u16 = 0xe000;
const PIXELS: (u16, u16) = (0x7fe0, 0x10);
const GROUP_LENGTH: (u16, u16) = (2, 0);
const SYNTAX: (u16, u16) = (2, 0x10);

/// Returns the bytes of a number of this kind; 1 of what is no number. The library reads whole numbers, and goes on behind
/// the last one even if the element claims some bytes more.
fn width(kind: [u8; 2]) -> u32 {
    match &kind {
        b"US" | b"SS" | b"OW" => 2,
        b"UL" | b"SL" | b"FL" | b"OL" | b"OF" | b"AT" => 4,
        b"FD" | b"OD" | b"SV" | b"UV" | b"OV" => 8,
        _ => 1,
    }
}

/// Returns the kind that the dictionary has for an element.
fn known_kind((group, number): (u16, u16)) -> [u8; 2] {
    StandardDataDictionary.by_tag(Tag(group, number)).map_or(*b"UN", |entry| entry.vr().relaxed().to_bytes())
}

/// An element that claims more bytes than there are.
#[derive(Debug, PartialEq)]
pub(super) struct TooLong {
    tag: (u16, u16),
    claimed: u32,
    left: u64,
}

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let TooLong { tag: (group, number), claimed, left } = self;
        write!(f, "element ({group:04x},{number:04x}) claims {claimed} bytes where {left} are left")
    }
}

impl std::error::Error for TooLong {}

/// How elements are written.
#[derive(Clone, Copy, PartialEq)]
enum Syntax {
    Implicit,
    Explicit { big: bool },
}

/// What a walk through elements comes to.
enum Walked {
    /// The first element that is too long, if one is.
    Through(Option<TooLong>),
    /// Elements that are packed, from this byte on.
    Packed(u64),
}

/// Walks through the elements of a file, whose magic ends at byte `begin`, and returns the first one that is too long for
/// a file of `size` bytes. `source` may have the first `there` of them alone. Damage of other kinds is the library's to
/// tell.
///
/// # Errors
/// That of the source.
pub(super) fn too_long(
    source: &mut (impl Read + Seek),
    begin: u64,
    there: u64,
    size: u64,
) -> io::Result<Option<TooLong>> {
    let at = source.seek(SeekFrom::Start(begin))?;
    let seek = |source: &mut _, count: u32| Seek::seek_relative(source, count.into());
    let packed = match walk(source, seek, at, [there, size], true)? {
        Walked::Through(found) => return Ok(found),
        Walked::Packed(from) => from,
    };
    source.seek(SeekFrom::Start(packed))?;
    // Where the stream is damaged, the library reads up to there.
    let mut unpacked = DeflateDecoder::new(&mut *source);
    let _ = io::copy(&mut unpacked, &mut io::sink());
    let size = unpacked.total_out();
    source.seek(SeekFrom::Start(packed))?;
    let read = |source: &mut DeflateDecoder<_>, count: u32| {
        io::copy(&mut source.take(count.into()), &mut io::sink()).map(drop)
    };
    match walk(&mut DeflateDecoder::new(source), read, 0, [size; 2], false)? {
        Walked::Through(found) => Ok(found),
        Walked::Packed(_) => Ok(None),
    }
}

/// Walks through elements from byte `at`, where `source` is, as far as it is `there`; `skip` skips bytes of it.
///
/// Pixels are walked over like all else. Where the library stops before them it does so outside of sequences alone, and
/// it is not told here where these end: it counts by lengths that may be wrong.
fn walk<R: Read>(
    source: &mut R,
    skip: impl Fn(&mut R, u32) -> io::Result<()>,
    mut at: u64,
    [there, size]: [u64; 2],
    mut in_meta: bool,
) -> io::Result<Walked> {
    let (mut syntax, mut told) = (Syntax::Explicit { big: false }, None);
    let mut in_fragments = false;
    // The first group ends where its length says, whatever the elements in it; without a length, where another begins.
    let mut meta_end = None;
    loop {
        let mut head = [0; 8];
        if there.saturating_sub(at) < 8 {
            return Ok(Walked::Through(None));
        }
        source.read_exact(&mut head)?;
        if in_meta && meta_end.map_or((head[0], head[1]) != (2, 0), |end| at >= end) {
            in_meta = false;
            match told {
                Some(None) => return Ok(Walked::Packed(at)),
                Some(Some(found)) => syntax = found,
                // The library goes on as before.
                None => {}
            }
        }
        let big = syntax == Syntax::Explicit { big: true };
        let short = |b: [u8; 2]| if big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) };
        let long = |b: [u8; 4]| if big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) };
        let tag = (short([head[0], head[1]]), short([head[2], head[3]]));
        at += 8;
        let is_mark = tag.0 == MARKS;
        let kind = match syntax {
            Syntax::Implicit => known_kind(tag),
            Syntax::Explicit { .. } => [head[4], head[5]],
        };
        let is_long = !SHORT.contains(&&kind);
        let claimed = if is_mark || syntax == Syntax::Implicit {
            long([head[4], head[5], head[6], head[7]])
        } else if is_long {
            let mut length = [0; 4];
            if there.saturating_sub(at) < 4 {
                return Ok(Walked::Through(None));
            }
            source.read_exact(&mut length)?;
            at += 4;
            long(length)
        } else {
            u32::from(short([head[6], head[7]]))
        };
        let left = size.saturating_sub(at);
        if claimed == UNTOLD {
            in_fragments = tag == PIXELS;
            continue;
        }
        if u64::from(claimed) > left {
            return Ok(Walked::Through(Some(TooLong { tag, claimed, left })));
        }
        let is_sequence = kind == *b"SQ" && !is_mark;
        if !in_meta && (is_sequence || is_mark && !(in_fragments && tag.1 == ITEM)) {
            // The content is walked through as well; an end mark has none.
            in_fragments &= !(is_mark && tag.1 != ITEM);
            continue;
        }
        let taken = if is_mark || in_meta { claimed } else { claimed - claimed % width(kind) };
        if tag == GROUP_LENGTH && meta_end.is_none() && taken == 4 {
            let mut length = [0; 4];
            source.read_exact(&mut length)?;
            meta_end = Some(at + 4 + u64::from(u32::from_le_bytes(length)));
        } else if tag == SYNTAX && in_meta {
            let mut name = vec![0; taken as usize];
            source.read_exact(&mut name)?;
            told = match String::from_utf8_lossy(&name).trim_end_matches(['\0', ' ']) {
                "1.2.840.10008.1.2" => Some(Some(Syntax::Implicit)),
                "1.2.840.10008.1.2.2" => Some(Some(Syntax::Explicit { big: true })),
                packed if PACKED.contains(&packed) => Some(None),
                _ => Some(Some(Syntax::Explicit { big: false })),
            };
        } else {
            skip(source, taken)?;
        }
        at += u64::from(taken);
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write};

    use flate2::Compression;
    use flate2::write::DeflateEncoder;

    use super::*;

    fn element(group: u16, number: u16, kind: &[u8; 2], claimed: u32, content: &[u8]) -> Vec<u8> {
        let mut bytes = [group.to_le_bytes(), number.to_le_bytes(), *kind].concat();
        match SHORT.contains(&kind) {
            true => bytes.extend((claimed as u16).to_le_bytes()),
            false => bytes.extend([&[0, 0], &claimed.to_le_bytes()[..]].concat()),
        }
        [bytes, content.to_vec()].concat()
    }

    fn item(claimed: u32, content: &[u8]) -> Vec<u8> {
        [&[0xfe, 0xff, 0, 0xe0], &claimed.to_le_bytes()[..], content].concat()
    }

    const EXPLICIT: &[u8] = b"1.2.840.10008.1.2.1\0";

    fn found(parts: &[Vec<u8>]) -> Option<(u16, u16)> {
        found_before(parts, 0)
    }

    /// Of a file that goes on for so many bytes.
    fn found_before(parts: &[Vec<u8>], more: u64) -> Option<(u16, u16)> {
        let bytes = parts.concat();
        let there = bytes.len() as u64;
        let walked = too_long(&mut Cursor::new(bytes), 0, there, there + more).expect("it is in memory");
        walked.map(|e| e.tag)
    }

    #[test]
    fn elements_that_claim_too_much_are_found_wherever_they_are() {
        let syntax = element(2, 0x10, b"UI", EXPLICIT.len() as u32, EXPLICIT);
        let good = element(8, 0x60, b"CS", 2, b"CT");
        assert_eq!(found(&[syntax.clone(), good.clone()]), None);
        let meta = element(2, 1, b"OB", 0x2e31_0000, &[0, 1]);
        assert_eq!(found(&[meta, syntax.clone()]), Some((2, 1)));
        let comment = element(0x20, 0x4000, b"UT", 1_000_000, b"short");
        assert_eq!(found(&[syntax.clone(), good.clone(), comment.clone()]), Some((0x20, 0x4000)));
        assert_eq!(found(&[good.clone(), comment.clone()]), Some((0x20, 0x4000)), "no syntax is told");
        // In items of sequences, whose lengths are told or not.
        let told = item(comment.len() as u32, &comment);
        let sequence = element(8, 0x1140, b"SQ", told.len() as u32, &told);
        assert_eq!(found(&[syntax.clone(), sequence]), Some((0x20, 0x4000)));
        let untold = element(8, 0x1140, b"SQ", UNTOLD, &item(UNTOLD, &comment));
        assert_eq!(found(&[syntax.clone(), untold]), Some((0x20, 0x4000)));
        let unknown = element(8, 0x60, b"\0U", 1_000_000, &[]);
        assert_eq!(found(&[syntax.clone(), unknown]), Some((8, 0x60)));
        // The content of fragments is not elements.
        let fragments = element(0x7fe0, 0x10, b"OB", UNTOLD, &[item(0, &[]), item(8, &[9; 8])].concat());
        assert_eq!(found(&[syntax.clone(), fragments]), None);
        let pixels = element(0x7fe0, 0x10, b"OW", 1_000_000, &[0; 8]);
        assert_eq!(found(&[syntax.clone(), pixels.clone()]), Some(PIXELS));
        assert_eq!(found_before(&[syntax.clone(), pixels], 1_000_000), None, "they are there");
        // Within a sequence the library does not stop before pixels.
        let inner = [element(0x7fe0, 0x10, b"OW", 2, &[0; 2]), comment.clone()].concat();
        let nested = element(8, 0x1140, b"SQ", UNTOLD, &item(UNTOLD, &inner));
        assert_eq!(found(&[syntax.clone(), nested]), Some((0x20, 0x4000)));
        let implicit = element(2, 0x10, b"UI", 18, b"1.2.840.10008.1.2\0");
        let plain = |group: u8, number: u16, claimed: u32, content: &[u8]| {
            [&[group, 0], &number.to_le_bytes()[..], &claimed.to_le_bytes(), content].concat()
        };
        let long = plain(8, 0x60, 1_000_000, b"CT");
        assert_eq!(found(&[implicit.clone(), long.clone()]), Some((8, 0x60)));
        let told = item(long.len() as u32, &long);
        let sequence = plain(8, 0x1140, told.len() as u32, &told);
        assert_eq!(found(&[implicit.clone(), sequence]), Some((8, 0x60)), "within a sequence");
        // Half a number is left, and taken for the beginning of the next element.
        let half = [b"\x20\0\0\x40UT\0\0".to_vec(), 1_000_000u32.to_le_bytes().to_vec()].concat();
        let number = element(0x28, 2, b"UL", 6, &[0; 4]);
        assert_eq!(found(&[syntax.clone(), number, half]), Some((0x20, 0x4000)));
        let rows = [plain(0x28, 0x10, 3, &[0; 2]), long].concat();
        assert_eq!(found(&[implicit, rows]), Some((8, 0x60)));
        // Pixels in the first group are none, and the group ends where its length says.
        let misplaced = element(0x7fe0, 0x10, b"OW", 2, &[0; 2]);
        let length = (misplaced.len() + syntax.len()) as u32;
        let length = element(2, 0, b"UL", 4, &length.to_le_bytes());
        let meta = [length, misplaced, syntax.clone()].concat();
        assert_eq!(found(&[meta.clone(), comment.clone()]), Some((0x20, 0x4000)));
        let other = element(2, 0x13, b"SH", 2, b"a ");
        assert_eq!(found(&[meta, other, comment.clone()]), Some((0x20, 0x4000)));
        // Packed as a whole.
        for name in PACKED {
            let syntax = element(2, 0x10, b"UI", name.len() as u32, name.as_bytes());
            let packed = |elements: &[u8]| {
                let mut out = DeflateEncoder::new(Vec::new(), Compression::fast());
                out.write_all(elements).expect("memory takes it");
                out.finish().expect("memory takes it")
            };
            assert_eq!(found(&[syntax.clone(), packed(&good)]), None);
            let parts = [good.clone(), comment.clone()].concat();
            assert_eq!(found(&[syntax, packed(&parts)]), Some((0x20, 0x4000)), "{name}");
        }
        // What follows of an unknown kind is read as all else.
        let unknown = element(9, 0x10, b"UN", UNTOLD, &comment);
        assert_eq!(found(&[syntax, unknown]), Some((0x20, 0x4000)));
    }
}
