//! The header of a PLY file, parsed within fixed limits.
//!
//! The grammar is the PLY crate's. Around it stand the checks that it leaves out: a cap on the header's size
//! (it reads lines of any length), unique names (it lets a second property of the same name take the place of
//! the first, which shifts every row), and text that is not UTF-8 (old programs write Latin-1 comments).
//! Comments are untrusted text: they are compared with our own keys and otherwise never interpreted; what an
//! error quotes is escaped.

use std::collections::HashSet;
use std::io::{Read, Seek, SeekFrom};

use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{DefaultElement, ElementDef, Encoding, PropertyType, ScalarType};

use base::error::{Error, Kind, Result};

/// Longest header that is read. 62 properties and our comments take 2 KiB.
const HEADER_LIMIT: u64 = 64 * 1024;

/// Longest quotation from a file in an error, in characters.
const QUOTE_CHARS: usize = 60;

pub(super) fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns `text` shortened and with every control character escaped, for messages.
pub(super) fn quoted(text: &str) -> String {
    let mut chars = text.chars();
    let mut quote: String = chars.by_ref().take(QUOTE_CHARS).flat_map(char::escape_debug).collect();
    if chars.next().is_some() {
        quote.push('…');
    }
    quote
}

/// A PLY header: the elements of the payload and where it begins.
pub(super) struct Header {
    pub encoding: Encoding,
    /// Elements in file order.
    pub elements: Vec<ElementDef>,
    pub comments: Vec<String>,
    /// Offset of the payload in the file.
    pub payload_start: u64,
}

impl Header {
    /// Reads and checks the header and leaves `source` at the start of the payload.
    pub fn read(source: &mut (impl Read + Seek)) -> Result<Header> {
        let mut bytes = Vec::new();
        let failed = |error| Error::new(Kind::Io, "VGS-PLY-008", format!("reading the PLY header: {error}"));
        source.by_ref().take(HEADER_LIMIT).read_to_end(&mut bytes).map_err(failed)?;
        if !super::names::sniff(&bytes) {
            return Err(bad("VGS-PLY-001", "not a PLY file: it does not begin with a line `ply`"));
        }
        let length = header_length(&bytes).ok_or_else(|| {
            bad("VGS-PLY-002", format!("no `end_header` line in the first {} bytes", bytes.len()))
                .help("the file is cut off or no PLY; headers beyond 64 KiB are refused")
        })?;
        bytes.truncate(length);
        let payload_start = length as u64;
        source.seek(SeekFrom::Start(payload_start)).map_err(failed)?;

        let text = String::from_utf8(bytes)
            .unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect());
        check_unique_names(&text)?;
        let header = Parser::<DefaultElement>::new()
            .read_header(&mut Reader::new(text.as_bytes()))
            .map_err(|error| malformed(&text, error.line()))?;
        if (header.version.major, header.version.minor) != (1, 0) {
            return Err(bad("VGS-PLY-003", format!("PLY version {}, 1.0 was expected", header.version)));
        }
        let elements: Vec<_> = header.elements.into_values().collect();
        if let Some(bare) = elements.iter().find(|e| e.properties.is_empty() && e.count > 0) {
            let name = quoted(&bare.name);
            return Err(bad(
                "VGS-PLY-004",
                format!("element `{name}` has {} rows without a property", bare.count),
            ));
        }
        Ok(Header { encoding: header.encoding, elements, comments: header.comments, payload_start })
    }

    /// Returns the element called `name`, with its position.
    pub fn element(&self, name: &str) -> Option<(usize, &ElementDef)> {
        self.elements.iter().enumerate().find(|(_, element)| element.name == name)
    }

    /// Fails if the rows that are read, up to those of the element `last`, do not fit into a file of `bytes` bytes, or others
    /// follow and it is `strict`.
    pub fn check_rows(&self, last: usize, bytes: u64, strict: bool) -> Result<()> {
        let payload_bytes = bytes.saturating_sub(self.payload_start);
        self.check_size(last, payload_bytes)?;
        match self.trailing_bytes(payload_bytes) {
            0 => {}
            extra if strict => {
                return Err(bad("VGS-PLY-023", format!("{extra} bytes follow the last row")));
            }
            extra => tracing::warn!(extra, "bytes behind the last row of a PLY file were ignored"),
        }
        Ok(())
    }

    /// Fails if any element up to and including `last`, the last one that is needed, cannot fit into
    /// `payload_bytes`. Nothing is allocated from a count before this check.
    fn check_size(&self, last: usize, payload_bytes: u64) -> Result<()> {
        let mut needed = 0u128;
        for element in &self.elements[..=last] {
            let row = match self.encoding {
                // A value takes at least one digit and one separator.
                Encoding::Ascii => 2 * element.properties.len(),
                _ => stride(element).ok_or_else(|| {
                    let name = quoted(&element.name);
                    bad("VGS-PLY-005", format!("element `{name}` with a list stands before the splats"))
                        .help("write the splats as the first element, or the file as ASCII")
                })?,
            };
            needed += element.count as u128 * row as u128;
        }
        // The last line of an ASCII file may lack its line feed.
        let missing_separator = u128::from(self.encoding == Encoding::Ascii);
        if needed > u128::from(payload_bytes) + missing_separator {
            return Err(bad(
                "VGS-PLY-006",
                format!("the header declares {needed} bytes of data or more, the file holds {payload_bytes}"),
            )
            .help("the file is cut off or its header is wrong"));
        }
        Ok(())
    }

    /// Returns the bytes of a binary file after its last row; 0 for files with lists and in ASCII, where they
    /// are unknown.
    pub fn trailing_bytes(&self, payload_bytes: u64) -> u64 {
        let sizes = self.elements.iter().map(|e| Some(e.count as u128 * stride(e)? as u128));
        match sizes.sum::<Option<u128>>() {
            Some(declared) if self.encoding != Encoding::Ascii => {
                u64::try_from(u128::from(payload_bytes).saturating_sub(declared)).unwrap_or(u64::MAX)
            }
            _ => 0,
        }
    }
}

/// Fails if there are too many splats.
pub(super) fn check_count(element: &ElementDef, most: u64) -> Result<()> {
    if element.count as u64 > most {
        let message = format!("{} splats, at most {most} are allowed", element.count);
        return Err(bad("VGS-PLY-014", message).help("divide the file into smaller ones"));
    }
    Ok(())
}

/// Returns the bytes of one binary row, or `None` if the element has a list.
pub(super) fn stride(element: &ElementDef) -> Option<usize> {
    element.properties.values().map(|property| scalar_bytes(&property.data_type)).sum()
}

/// Returns the bytes of one binary value, or `None` for a list.
pub(super) fn scalar_bytes(data_type: &PropertyType) -> Option<usize> {
    match data_type {
        PropertyType::Scalar(scalar) => Some(match scalar {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        }),
        PropertyType::List(..) => None,
    }
}

/// Returns the length of the header including its `end_header` line; `None` if there is no such line.
fn header_length(bytes: &[u8]) -> Option<usize> {
    let mut length = 0;
    for line in bytes.split_inclusive(|&b| b == b'\n') {
        length += line.len();
        if line.trim_ascii() == b"end_header" {
            return Some(length);
        }
    }
    None
}

fn check_unique_names(text: &str) -> Result<()> {
    let mut elements = HashSet::new();
    let mut properties = HashSet::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let (known, name) = match words[..] {
            ["element", name, ..] => {
                properties.clear();
                (&mut elements, name)
            }
            ["property", .., name] => (&mut properties, name),
            _ => continue,
        };
        if !known.insert(name) {
            return Err(bad(
                "VGS-PLY-007",
                format!("the header names `{}` twice: {}", quoted(name), quoted(line)),
            ));
        }
    }
    Ok(())
}

fn malformed(text: &str, line: Option<usize>) -> Error {
    let Some(number) = line else { return bad("VGS-PLY-003", "the header has no valid `format` line") };
    let line = text.lines().nth(number.saturating_sub(1)).unwrap_or_default();
    bad("VGS-PLY-003", format!("line {number} of the header is not understood: {}", quoted(line)))
}
