//! From stored values to intensities: by slope and intercept, or by a table (Modality LUT).
//! Source: <https://dicom.nema.org/medical/dicom/current/output/chtml/part03/sect_C.11.html>.

use dicom_object::InMemDicomObject;

use super::elements as e;
use base::Result;

/// Entries of a table whose descriptor has no room for their number.
const MOST_ENTRIES: usize = 1 << 16;

/// The way from stored values to intensities.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum Scale {
    /// The file gives none: stored values are the intensities.
    #[default]
    Stored,
    Line {
        slope: f64,
        intercept: f64,
    },
    Table(Table),
}

/// A table of intensities. Stored values before its first or behind its last entry have the intensity of that.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    /// Stored value of the first entry.
    first: i64,
    entries: Vec<u16>,
}

impl Scale {
    /// Returns the intensity of a stored value.
    pub fn of(&self, stored: i64) -> f64 {
        match self {
            Scale::Stored => stored as f64,
            Scale::Line { slope, intercept } => slope * stored as f64 + intercept,
            Scale::Table(Table { first, entries }) => {
                let last = entries.len() as i64 - 1;
                f64::from(entries[(stored - first).clamp(0, last) as usize])
            }
        }
    }
}

impl Table {
    /// Reads the item of a Modality LUT Sequence. The first stored value is signed if the pixels are.
    ///
    /// # Errors
    /// [`base::Kind::BadData`] if descriptor and data are no table.
    pub fn read(item: &InMemDicomObject, signed: bool) -> Result<Table> {
        let descriptor = e::LUT_DESCRIPTOR.needed(e::LUT_DESCRIPTOR.vector::<3>(item)?)?;
        let [count, first, bits] = descriptor.map(|v| v as i64);
        let count = if count == 0 { MOST_ENTRIES } else { (count as u16).into() };
        if !(1..=16).contains(&bits) {
            let found = format!("of {bits} bits an entry");
            return Err(e::LUT_DESCRIPTOR.wrong(&found, "8 or 16"));
        }
        let data = e::LUT_DATA.needed(e::LUT_DATA.value(item)?)?.to_bytes();
        let words = |bytes: &[u8]| bytes.as_chunks().0.iter().map(|word| u16::from_le_bytes(*word)).collect();
        let entries: Vec<u16> = match data.len() {
            length if length == 2 * count => words(&data),
            // Two entries share a word.
            length if bits <= 8 && length == count.next_multiple_of(2) => {
                data.iter().take(count).map(|&byte| byte.into()).collect()
            }
            length => {
                let found = format!("of {length} bytes");
                return Err(e::LUT_DATA.wrong(&found, &format!("{count} entries of {bits} bits")));
            }
        };
        Ok(Table { first: signed_if(first, signed), entries })
    }
}

/// Returns a value of 16 bits, which a file gives as if it had no sign, with the sign that the pixels have.
pub(super) fn signed_if(value: i64, signed: bool) -> i64 {
    if signed && value > i64::from(i16::MAX) && value <= i64::from(u16::MAX) {
        value - (1 << 16)
    } else {
        value
    }
}
