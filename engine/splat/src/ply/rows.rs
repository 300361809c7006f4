//! Reading of the payload of a PLY file: from rows of one element to rows of f32.
//!
//! Binary rows are read in slabs and picked apart by byte offsets; the plain case, little-endian floats, has
//! a loop of its own. ASCII rows are read line by line. Sizes were checked against the file before any of
//! this runs.

use std::io::{BufRead, Read};

use ply_rs::ply::{ElementDef, Encoding, PropertyType, ScalarType};

use super::header::{Header, bad, quoted, scalar_bytes, stride};
use base::error::{Error, Kind, Result};

/// Bytes of binary rows that are read at a time: small enough to stay in the cache.
const SLAB_BYTES: usize = 256 * 1024;

/// Longest line of an ASCII payload; 62 values of 25 characters take 1.6 kB.
const LINE_LIMIT: u64 = 64 * 1024;

/// One wanted property: its position in the element and the slot of the output row that takes its value.
pub(super) struct Column {
    pub property: usize,
    pub slot: usize,
}

/// Reads every row of `element` and passes the wanted values to `each`, `N` slots per row; slots without a
/// column are zero. `source` must be at the first row and is left behind the last.
pub(super) fn read<const N: usize>(
    source: &mut impl BufRead,
    header: &Header,
    element: &ElementDef,
    columns: &[Column],
    each: impl FnMut(usize, &[f32; N]),
) -> Result<()> {
    match header.encoding {
        Encoding::Ascii => read_ascii(source, element, columns, each),
        Encoding::BinaryLittleEndian => read_binary::<N, true>(source, element, columns, each),
        Encoding::BinaryBigEndian => read_binary::<N, false>(source, element, columns, each),
    }
}

/// Moves `source` past the rows of an element that is not needed.
pub(super) fn skip(source: &mut impl BufRead, header: &Header, element: &ElementDef) -> Result<()> {
    match header.encoding {
        Encoding::Ascii => {
            let mut line = Vec::new();
            (0..element.count).try_for_each(|row| next_line(source, element, row, &mut line))
        }
        // Lists before a needed element were refused, so the stride exists.
        _ => {
            let bytes = element.count as u64 * stride(element).unwrap_or(0) as u64;
            let skipped = std::io::copy(&mut source.take(bytes), &mut std::io::sink()).map_err(failed)?;
            if skipped == bytes { Ok(()) } else { Err(failed(std::io::ErrorKind::UnexpectedEof.into())) }
        }
    }
}

fn failed(error: std::io::Error) -> Error {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => bad("VGS-PLY-009", "the file ended before its last row"),
        _ => Error::new(Kind::Io, "VGS-PLY-008", format!("reading PLY rows: {error}")),
    }
}

fn read_binary<const N: usize, const LITTLE: bool>(
    source: &mut impl Read,
    element: &ElementDef,
    columns: &[Column],
    mut each: impl FnMut(usize, &[f32; N]),
) -> Result<()> {
    let mut stride = 0;
    let layout: Vec<_> = element
        .properties
        .values()
        .map(|property| {
            let offset = stride;
            stride += scalar_bytes(&property.data_type).unwrap_or(0);
            (offset, &property.data_type)
        })
        .collect();
    let plain = LITTLE
        && columns.iter().all(|column| *layout[column.property].1 == PropertyType::Scalar(ScalarType::Float));
    // Offset, slot and type of each wanted value.
    let wanted: Vec<(usize, usize, &PropertyType)> =
        columns.iter().map(|c| (layout[c.property].0, c.slot, layout[c.property].1)).collect();

    let rows_per_slab = (SLAB_BYTES / stride.max(1)).clamp(1, element.count.max(1));
    let mut slab = vec![0u8; rows_per_slab * stride];
    let mut first = 0;
    while first < element.count {
        let rows = rows_per_slab.min(element.count - first);
        let slab = &mut slab[..rows * stride];
        source.read_exact(slab).map_err(failed)?;
        for (index, row) in slab.chunks_exact(stride).enumerate() {
            let mut values = [0.0; N];
            if plain {
                for &(offset, slot, _) in &wanted {
                    values[slot] = f32::from_le_bytes(bytes_at(row, offset));
                }
            } else {
                for &(offset, slot, data_type) in &wanted {
                    values[slot] = value_at::<LITTLE>(row, offset, data_type);
                }
            }
            each(first + index, &values);
        }
        first += rows;
    }
    Ok(())
}

/// Returns `B` bytes of `row` from `offset`; the layout keeps them inside the row.
fn bytes_at<const B: usize>(row: &[u8], offset: usize) -> [u8; B] {
    let mut bytes = [0; B];
    bytes.copy_from_slice(&row[offset..offset + B]);
    bytes
}

/// Returns the value of type `data_type` at `offset` as f32. A list, which never gets here, would be NaN.
fn value_at<const LITTLE: bool>(row: &[u8], offset: usize, data_type: &PropertyType) -> f32 {
    macro_rules! number {
        ($type:ty) => {{
            let bytes = bytes_at(row, offset);
            (if LITTLE { <$type>::from_le_bytes(bytes) } else { <$type>::from_be_bytes(bytes) }) as f32
        }};
    }
    match data_type {
        PropertyType::Scalar(scalar) => match scalar {
            ScalarType::Char => number!(i8),
            ScalarType::UChar => number!(u8),
            ScalarType::Short => number!(i16),
            ScalarType::UShort => number!(u16),
            ScalarType::Int => number!(i32),
            ScalarType::UInt => number!(u32),
            ScalarType::Float => number!(f32),
            ScalarType::Double => number!(f64),
        },
        PropertyType::List(..) => f32::NAN,
    }
}

fn read_ascii<const N: usize>(
    source: &mut impl BufRead,
    element: &ElementDef,
    columns: &[Column],
    mut each: impl FnMut(usize, &[f32; N]),
) -> Result<()> {
    let mut slot_of = vec![None; element.properties.len()];
    for column in columns {
        slot_of[column.property] = Some(column.slot);
    }
    let mut line = Vec::new();
    for row in 0..element.count {
        next_line(source, element, row, &mut line)?;
        let wrong = |what: String| {
            bad("VGS-PLY-010", format!("row {row} of element `{}`: {what}", quoted(&element.name)))
        };
        let text = std::str::from_utf8(&line).map_err(|_| wrong("it is no text".to_owned()))?;
        let mut words = text.split_ascii_whitespace();
        let mut values = [0.0; N];
        for (&slot, property) in slot_of.iter().zip(element.properties.values()) {
            let word = words
                .next()
                .ok_or_else(|| wrong(format!("it ends before property `{}`", quoted(&property.name))))?;
            if let Some(slot) = slot {
                values[slot] = word.parse().map_err(|_| wrong(format!("`{}` is no number", quoted(word))))?;
            }
        }
        if let Some(word) = words.next() {
            return Err(wrong(format!("it goes on after its last property: `{}`", quoted(word))));
        }
        each(row, &values);
    }
    Ok(())
}

/// Reads the next line that is not blank into `line`.
fn next_line(source: &mut impl BufRead, element: &ElementDef, row: usize, line: &mut Vec<u8>) -> Result<()> {
    loop {
        line.clear();
        let length = source.by_ref().take(LINE_LIMIT).read_until(b'\n', line).map_err(failed)?;
        if length == 0 {
            return Err(failed(std::io::ErrorKind::UnexpectedEof.into()));
        }
        if length as u64 == LINE_LIMIT && line.last() != Some(&b'\n') {
            let name = quoted(&element.name);
            return Err(bad("VGS-PLY-010", format!("row {row} of element `{name}` is longer than 64 KiB")));
        }
        if !line.trim_ascii().is_empty() {
            return Ok(());
        }
    }
}
