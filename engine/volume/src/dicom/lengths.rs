//! The lengths of a DICOM file's elements, checked before the library takes memory for them: it takes what an
//! element claims, up to 4 GiB, before it reads a byte of it. Its parser stops before each value, so the parser goes
//! through the file alone first; whatever is damaged, it goes the same way twice.

use std::cell::Cell;
use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};
use std::rc::Rc;

use dicom_core::VR;
use dicom_encoding::{TransferSyntax, TransferSyntaxIndex};
use dicom_object::Tag;
use dicom_parser::dataset::{DataSetReader, DataToken};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
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
const GROUP_LENGTH: Tag = Tag(2, 0);
const SYNTAX: Tag = Tag(2, 0x10);
const PIXELS: Tag = Tag(0x7fe0, 0x10);

/// An element that claims more bytes than there are, or a part of a number.
#[derive(Debug, PartialEq)]
pub(super) struct TooLong {
    tag: Tag,
    claimed: u32,
    left: u64,
    /// Bytes of a number, of which only a part is there; 0 if that is not the fault.
    unit: u32,
}

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let TooLong { tag: Tag(group, number), claimed, left, unit } = self;
        if *unit > 0 {
            return write!(
                f,
                "element ({group:04x},{number:04x}) has {claimed} bytes, where a number takes {unit}"
            );
        }
        write!(f, "element ({group:04x},{number:04x}) claims {claimed} bytes where {left} are left")
    }
}

impl std::error::Error for TooLong {}

/// Goes through the elements of a file of `size` bytes, whose magic ends at byte `begin`, and returns the first one that
/// is too long. Stops before the pixels if only what stands before them will be read. Damage of other kinds is the
/// library's to tell.
///
/// # Errors
/// That of the source.
pub(super) fn too_long(
    source: &mut (impl Read + Seek),
    begin: u64,
    size: u64,
    before_pixels: bool,
) -> io::Result<Option<TooLong>> {
    source.seek(SeekFrom::Start(begin))?;
    let (name, end) = match first_group(source, begin, size)? {
        FirstGroup::TooLong(found) => return Ok(Some(found)),
        FirstGroup::Refused => return Ok(None),
        FirstGroup::Read { syntax, end } => (syntax, end),
    };
    let Some(syntax) = TransferSyntaxRegistry.get(&name) else { return Ok(None) };
    if !PACKED.contains(&syntax.uid()) {
        return Ok(too_long_element(source, syntax, size.saturating_sub(end), before_pixels));
    }
    // Where the stream is damaged, the library reads up to there.
    let mut unpacked = DeflateDecoder::new(&mut *source);
    let _ = io::copy(&mut unpacked, &mut io::sink());
    let size = unpacked.total_out();
    source.seek(SeekFrom::Start(end))?;
    Ok(too_long_element(DeflateDecoder::new(source), syntax, size, before_pixels))
}

/// What the first group of elements says.
enum FirstGroup {
    /// One of its elements is too long.
    TooLong(TooLong),
    /// The library refuses it.
    Refused,
    /// The transfer syntax of the other elements, and where they begin.
    Read { syntax: String, end: u64 },
}

/// Goes through the first group, from byte `at` on. It ends where its length says, whatever its elements are.
fn first_group(source: &mut impl Read, mut at: u64, size: u64) -> io::Result<FirstGroup> {
    let mut end = None;
    let mut syntax = String::new();
    while end.is_none_or(|end| at < end) {
        let mut head = [0; 8];
        source.read_exact(&mut head)?;
        at += 8;
        let short = |i: usize| u16::from_le_bytes([head[i], head[i + 1]]);
        let tag = Tag(short(0), short(2));
        let claimed = if tag.0 == MARKS {
            u32::from_le_bytes([head[4], head[5], head[6], head[7]])
        } else if SHORT.contains(&&[head[4], head[5]]) {
            short(6).into()
        } else {
            let mut length = [0; 4];
            source.read_exact(&mut length)?;
            at += 4;
            u32::from_le_bytes(length)
        };
        let left = size.saturating_sub(at);
        if claimed == UNTOLD || end.is_none() && (tag, claimed) != (GROUP_LENGTH, 4) {
            return Ok(FirstGroup::Refused);
        }
        if u64::from(claimed) > left {
            return Ok(FirstGroup::TooLong(TooLong { tag, claimed, left, unit: 0 }));
        }
        at += u64::from(claimed);
        let mut value = source.take(claimed.into());
        if end.is_none() {
            let mut length = [0; 4];
            value.read_exact(&mut length)?;
            end = Some(at + u64::from(u32::from_le_bytes(length)));
        } else if tag == SYNTAX {
            let mut name = Vec::new();
            value.read_to_end(&mut name)?;
            syntax = String::from_utf8_lossy(&name).into_owned();
        } else {
            io::copy(&mut value, &mut io::sink())?;
        }
    }
    Ok(FirstGroup::Read { syntax, end: at })
}

/// A source that counts the bytes that are read of it.
struct Counted<R> {
    source: R,
    count: Rc<Cell<u64>>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.source.read(buffer)?;
        self.count.set(self.count.get() + n as u64);
        Ok(n)
    }
}

/// Goes through the elements of `source`, `size` bytes, and returns the first one that is too long.
pub(super) fn too_long_element(
    source: impl Read,
    syntax: &TransferSyntax,
    size: u64,
    before_pixels: bool,
) -> Option<TooLong> {
    let count = Rc::new(Cell::new(0));
    let counted = Counted { source, count: Rc::clone(&count) };
    let parser = DataSetReader::new_with_ts(counted, syntax).ok()?;
    let mut depth = 0_usize;
    for token in parser {
        // Where the parser fails, the library does.
        let token = token.ok()?;
        let (tag, claimed) = match &token {
            DataToken::ElementHeader(header) => (header.tag, header.len.0),
            DataToken::SequenceStart { tag, .. } => (*tag, 0),
            DataToken::PixelSequenceStart => (PIXELS, 0),
            DataToken::ItemStart { len } => (Tag(MARKS, 0xe000), len.0),
            _ => (Tag(0, 0), 0),
        };
        if before_pixels && depth == 0 && tag >= PIXELS {
            return None;
        }
        match &token {
            DataToken::SequenceStart { .. } | DataToken::PixelSequenceStart => depth += 1,
            DataToken::SequenceEnd => depth = depth.saturating_sub(1),
            _ => {}
        }
        let left = size.saturating_sub(count.get());
        if claimed != UNTOLD && u64::from(claimed) > left {
            return Some(TooLong { tag, claimed, left, unit: 0 });
        }
        // The library would take the rest for the beginning of the next element.
        if let DataToken::ElementHeader(header) = &token {
            let unit = unit(header.vr);
            if claimed % unit != 0 {
                return Some(TooLong { tag, claimed, left, unit });
            }
        }
    }
    None
}

/// Returns the number of bytes of one number of a representation; 1 if it is none of numbers.
fn unit(vr: VR) -> u32 {
    match vr {
        VR::US | VR::SS => 2,
        VR::UL | VR::SL | VR::FL | VR::AT => 4,
        VR::FD => 8,
        _ => 1,
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

    const EXPLICIT: &str = "1.2.840.10008.1.2.1";
    const IMPLICIT: &str = "1.2.840.10008.1.2";

    /// Returns the elements of a first group with their length before them.
    fn group(elements: &[u8]) -> Vec<u8> {
        [element(2, 0, b"UL", 4, &(elements.len() as u32).to_le_bytes()), elements.to_vec()].concat()
    }

    fn syntax(name: &str) -> Vec<u8> {
        let mut name = name.as_bytes().to_vec();
        name.resize(name.len().next_multiple_of(2), 0);
        element(2, 0x10, b"UI", name.len() as u32, &name)
    }

    fn found_in(bytes: Vec<u8>, before_pixels: bool) -> Option<Tag> {
        let size = bytes.len() as u64;
        let walked = too_long(&mut Cursor::new(bytes), 0, size, before_pixels).expect("it is in memory");
        walked.map(|e| e.tag)
    }

    /// Finds the element in a file of these elements in a transfer syntax.
    fn found(name: &str, elements: &[&[u8]]) -> Option<Tag> {
        found_in([group(&syntax(name)), elements.concat()].concat(), false)
    }

    #[test]
    fn elements_that_claim_too_much_are_found_wherever_they_are() {
        const COMMENT: Option<Tag> = Some(Tag(0x20, 0x4000));
        let good = element(8, 0x60, b"CS", 2, b"CT");
        let comment = element(0x20, 0x4000, b"UT", 1_000_000, b"short");
        assert_eq!(found(EXPLICIT, &[&good]), None);
        assert_eq!(found(EXPLICIT, &[&good, &comment]), COMMENT);
        assert_eq!(found("1.2.3", &[&good, &comment]), None, "the library knows no such syntax");
        let unknown = element(8, 0x60, b"\0U", 1_000_000, &[]);
        assert_eq!(found(EXPLICIT, &[&unknown]), Some(Tag(8, 0x60)));
        // In items of sequences, whose lengths are told or not.
        let told = item(comment.len() as u32, &comment);
        assert_eq!(found(EXPLICIT, &[&element(8, 0x1140, b"SQ", told.len() as u32, &told)]), COMMENT);
        let untold = item(UNTOLD, &comment);
        for kind in [b"SQ", b"UN"] {
            assert_eq!(found(EXPLICIT, &[&element(8, 0x1140, kind, UNTOLD, &untold)]), COMMENT);
        }
        // A mark of an item where an element is expected is one, with content that is none.
        let mark = item(8, &element(8, 0x60, b"CS", 2, b"CT")[..8]);
        let inner = [mark, comment.clone()].concat();
        assert_eq!(found(EXPLICIT, &[&element(8, 0x1140, b"SQ", UNTOLD, &item(UNTOLD, &inner))]), COMMENT);
        // Half a number would be taken for the beginning of the next element.
        let half = [b"\x20\0\0\x40UT\0\0".to_vec(), 1_000_000u32.to_le_bytes().to_vec()].concat();
        assert_eq!(found(EXPLICIT, &[&element(0x28, 2, b"UL", 6, &[0; 4]), &half]), Some(Tag(0x28, 2)));
    }

    #[test]
    fn pixels_are_stopped_at_where_the_library_stops() {
        let comment = element(0x20, 0x4000, b"UT", 1_000_000, b"short");
        let pixels = element(0x7fe0, 0x10, b"OW", 1_000_000, &[0; 8]);
        let meta = group(&syntax(EXPLICIT));
        assert_eq!(found_in([&meta[..], &pixels].concat(), false), Some(PIXELS));
        assert_eq!(found_in([&meta[..], &pixels].concat(), true), None, "they are not read");
        // The content of fragments is not elements.
        let fragments = [item(0, &[]), item(8, &[9; 8])].concat();
        let fragments = element(0x7fe0, 0x10, b"OB", UNTOLD, &fragments);
        assert_eq!(found_in([&meta[..], &fragments].concat(), false), None);
        let long = element(0x7fe0, 0x10, b"OB", UNTOLD, &[item(0, &[]), item(1_000_000, &[9; 8])].concat());
        assert_eq!(found_in([&meta[..], &long].concat(), false), Some(Tag(MARKS, 0xe000)));
        // Within a sequence it does not stop, nor in the first group, which ends where its length says.
        let inner = [element(0x7fe0, 0x10, b"OW", 2, &[0; 2]), comment.clone()].concat();
        let nested = element(8, 0x1140, b"SQ", UNTOLD, &item(UNTOLD, &inner));
        assert_eq!(found_in([&meta[..], &nested].concat(), true), Some(Tag(0x20, 0x4000)));
        let misplaced = [syntax(EXPLICIT), element(0x7fe0, 0x10, b"OW", 2, &[0; 2])].concat();
        assert_eq!(found_in([group(&misplaced), comment].concat(), true), Some(Tag(0x20, 0x4000)));
        let meta = [element(2, 1, b"OB", 0x2e31_0000, &[0, 1]), syntax(EXPLICIT)].concat();
        assert_eq!(found_in(group(&meta), true), Some(Tag(2, 1)));
    }

    #[test]
    fn implicit_and_packed_elements_are_looked_at_too() {
        let plain = |group: u8, number: u16, claimed: u32, content: &[u8]| {
            [&[group, 0], &number.to_le_bytes()[..], &claimed.to_le_bytes(), content].concat()
        };
        let long = plain(8, 0x60, 1_000_000, b"CT");
        let modality = Some(Tag(8, 0x60));
        assert_eq!(found(IMPLICIT, &[&long]), modality);
        let told = item(long.len() as u32, &long);
        assert_eq!(
            found(IMPLICIT, &[&plain(8, 0x1140, told.len() as u32, &told)]),
            modality,
            "within a sequence"
        );
        assert_eq!(
            found(IMPLICIT, &[&plain(0x28, 0x10, 3, &[0; 2]), &long]),
            Some(Tag(0x28, 0x10)),
            "half a number"
        );
        let elements =
            [element(8, 0x60, b"CS", 2, b"CT"), element(0x20, 0x4000, b"UT", 1_000_000, b"a")].concat();
        let packed = |elements: &[u8]| {
            let mut out = DeflateEncoder::new(Vec::new(), Compression::fast());
            out.write_all(elements).expect("memory takes it");
            out.finish().expect("memory takes it")
        };
        for name in PACKED {
            assert_eq!(found(name, &[&packed(&elements[..10])]), None, "{name}");
            assert_eq!(found(name, &[&packed(&elements)]), Some(Tag(0x20, 0x4000)), "{name}");
        }
    }
}
