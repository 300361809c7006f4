//! The pixels of DICOM files: from stored values to intensities.

use std::panic::{AssertUnwindSafe, catch_unwind};

use dicom_core::{DataElement, PrimitiveValue, VR};
use dicom_dictionary_std::tags;
use dicom_encoding::TransferSyntaxIndex;
use dicom_object::{DefaultDicomObject, Tag};
use dicom_pixeldata::{DecodedPixelData, PixelDecoder};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;

use super::elements;
use super::header::{FileHeader, Frame};
use super::location::{Location, damaged};
use base::{Error, Kind, Result};

/// The transfer syntax with the most significant byte first.
pub(super) const BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";

/// Elements of the windows and tables that a viewer shows the pixels with, which the library reads as well.
const WINDOWS: [Tag; 5] = [
    tags::WINDOW_CENTER,
    tags::WINDOW_WIDTH,
    tags::VOILUT_FUNCTION,
    tags::VOILUT_SEQUENCE,
    tags::WINDOW_CENTER_WIDTH_EXPLANATION,
];

/// Refuses files whose pixels cannot be read as intensities, before any pixel is read.
///
/// # Errors
/// [`Kind::BadData`] for colours, [`Kind::Unavailable`] for an unknown compression.
pub(super) fn check(file: &FileHeader) -> Result<()> {
    if file.mosaic {
        let message = "a mosaic: all slices of a volume side by side in one image (Siemens)";
        return Err(Error::new(Kind::BadData, "VGS-DCM-023", message)
            .file(&file.location.path)
            .help("make a volume of it first: `dcm2niix FOLDER`, and open the .nii that it writes"));
    }
    let intensities = ["MONOCHROME1", "MONOCHROME2"].contains(&file.photometric.as_str());
    if !intensities || file.samples_per_pixel != 1 {
        let message = format!(
            "pixels that are no intensities: {} is {}, {} samples per pixel",
            elements::PHOTOMETRIC_INTERPRETATION,
            file.photometric,
            file.samples_per_pixel
        );
        return Err(Error::new(Kind::BadData, "VGS-DCM-010", message).file(&file.location.path).help(
            "intensities are needed: MONOCHROME1 or MONOCHROME2; choose the original series with --series",
        ));
    }
    let syntax = TransferSyntaxRegistry.get(&file.transfer_syntax);
    // The library swaps the bytes of 16-bit words, and those of longer words only in halves.
    let turned = file.transfer_syntax == BIG_ENDIAN && file.bits_allocated > 16;
    if syntax.is_some_and(|syntax| syntax.can_decode_all()) && !turned {
        return Ok(());
    }
    let name = syntax.map_or(file.transfer_syntax.as_str(), |syntax| syntax.name());
    let message = format!("pixels of {} bits as {name}, which is not read", file.bits_allocated);
    Err(Error::new(Kind::Unavailable, "VGS-DCM-011", message)
        .file(&file.location.path)
        .help("unpack the series first: `dcm2niix`, or `gdcmconv --raw IN OUT` for each file"))
}

/// Reads frames of one file, each into its plane of intensities.
///
/// # Errors
/// [`Kind::BadData`] for damaged pixels, and [`Kind::Io`].
pub(super) fn read_frames(file: &FileHeader, frames: Vec<(&Frame, &mut [f32])>) -> Result<()> {
    let mut object = file.location.open(None)?.object;
    // How a viewer shows the pixels is not asked here, and what is wrong with it does not matter.
    for tag in WINDOWS {
        object.remove_element(tag);
    }
    // The library needs what the standard fixes.
    object.put(DataElement::new(tags::HIGH_BIT, VR::US, PrimitiveValue::from(file.high_bit as u16)));
    let decoded = decode(&object, &file.location)?;
    frames.into_iter().try_for_each(|(frame, plane)| intensities(file, &decoded, frame, plane))
}

/// Unpacks all frames of a file.
///
/// # Errors
/// [`Kind::BadData`] for damaged pixels.
pub(super) fn decode<'a>(
    object: &'a DefaultDicomObject,
    location: &Location,
) -> Result<DecodedPixelData<'a>> {
    // The decoders are foreign code: a damaged stream may break the assumptions of one of them.
    match catch_unwind(AssertUnwindSafe(|| object.decode_pixel_data())) {
        Ok(Ok(decoded)) => Ok(decoded),
        Ok(Err(e)) => Err(damaged(&location.path, &e)),
        Err(_) => Err(damaged(&location.path, &std::io::Error::other("its decoder gave up"))),
    }
}

fn intensities(
    file: &FileHeader,
    decoded: &DecodedPixelData,
    frame: &Frame,
    plane: &mut [f32],
) -> Result<()> {
    let bytes = usize::from(decoded.bits_allocated()).div_ceil(8);
    let length = bytes * plane.len();
    let first = length * frame.number as usize;
    let found = decoded.data().get(first..first.saturating_add(length));
    let same = [decoded.columns(), decoded.rows()].map(|n| n as usize) == frame.size
        && decoded.samples_per_pixel() == 1;
    let (Some(stored), 1 | 2 | 4, true) = (found, bytes, same) else {
        let [columns, rows] = frame.size;
        let message = format!(
            "expected {length} bytes for frame {} of {columns} x {rows} pixels, got {} bytes for all",
            frame.number + 1,
            decoded.data().len()
        );
        return Err(Error::new(Kind::BadData, "VGS-DCM-012", message)
            .file(&file.location.path)
            .help("the file is damaged or cut short; copy it again"));
    };
    let value = Stored::of(file, bytes);
    for (intensity, word) in plane.iter_mut().zip(stored.chunks_exact(bytes)) {
        let stored = value.of_word(word.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte)));
        *intensity = if value.is_padding(stored) { f32::NAN } else { frame.scale.of(stored) as f32 };
    }
    Ok(())
}

/// The bits of a word that hold a value; the other bits may hold anything.
struct Stored {
    shift: u32,
    bits: u32,
    signed: bool,
    padding: Option<[i64; 2]>,
}

impl Stored {
    fn of(file: &FileHeader, bytes: usize) -> Self {
        let most = 8 * bytes as u32;
        let bits = file.bits_stored.min(most);
        let shift = (file.high_bit + 1).saturating_sub(bits).min(most - bits);
        Stored { shift, bits, signed: file.signed, padding: file.padding }
    }

    fn of_word(&self, word: u32) -> i64 {
        let value = i64::from(word >> self.shift) & ((1 << self.bits) - 1);
        if self.signed && value >> (self.bits - 1) == 1 { value - (1 << self.bits) } else { value }
    }

    fn is_padding(&self, value: i64) -> bool {
        self.padding.is_some_and(|[from, to]| (from..=to).contains(&value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_stored_bits_count() {
        let file = |bits_stored, high_bit, signed| FileHeader {
            bits_stored,
            high_bit,
            signed,
            ..Default::default()
        };
        let of = |file: &FileHeader, word| Stored::of(file, 2).of_word(word);
        assert_eq!(of(&file(12, 11, false), 0xf7ff), 0x7ff, "bits above are others'");
        assert_eq!(of(&file(12, 11, true), 0x0fff), -1, "the sign is the highest stored bit");
        assert_eq!(of(&file(12, 15, false), 0x7ff5), 0x7ff, "stored in the upper bits");
        assert_eq!(of(&file(16, 15, true), 0xfc18), -1000);
        assert_eq!(of(&file(16, 15, false), 0xfc18), 64536);
        assert_eq!(Stored::of(&file(16, 15, true), 1).of_word(0x80), -128, "no more bits than there are");
    }
}
