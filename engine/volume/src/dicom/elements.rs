//! The elements that the reader uses, a row for each, and the one way in which their values are taken.
//!
//! A value is there, or it is absent, or it cannot be read, and the last is an error that names the element. A
//! default stands for what is absent alone, and only where the standard has one. Elements are taken by the
//! representation (VR) of the dictionary: archives and converters write UN and others where they know no better
//! (PS3.5, 6.2.2). The rows are a part of docs/design/fields.csv.

use std::io::Cursor;

use dicom_core::header::Header;
use dicom_core::{DataElement, DicomValue, PrimitiveValue, VR};
use dicom_dictionary_std::tags;
use dicom_encoding::TransferSyntaxIndex;
use dicom_encoding::text::SpecificCharacterSet;
use dicom_object::mem::InMemElement;
use dicom_object::{InMemDicomObject, Tag};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;

use super::lengths::too_long_element;
use base::{Error, Kind, Result};

/// The transfer syntax in which values of VR UN are written.
const IMPLICIT: &str = "1.2.840.10008.1.2";
/// Most characters of a value in a message.
const SHOWN: usize = 40;
/// What writers pad text with.
const BLANKS: [char; 6] = [' ', '\0', '\t', '\r', '\n', '\u{a0}'];

/// What it means that an element is absent, or has no value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Absence {
    /// This value, by the standard.
    Is(f64),
    /// Nothing is wrong; the text says what is done then.
    Fine(&'static str),
    /// An error.
    Needed,
    /// The element is for lists of series alone, which show nothing then, also if it cannot be read.
    Shown,
}

use Absence::{Fine, Is, Needed, Shown};

/// An element that the reader uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Element {
    pub tag: Tag,
    /// Name in the standard.
    pub name: &'static str,
    /// Representation by the dictionary; where it depends on the pixels, the unsigned one.
    pub vr: VR,
    pub absence: Absence,
}

macro_rules! elements {
    ($($tag:ident: $vr:ident, $name:literal, $absence:expr;)*) => {
        $(pub(super) const $tag: Element =
            Element { tag: tags::$tag, name: $name, vr: VR::$vr, absence: $absence };)*

        /// All elements that the reader uses, but for the pixels and the file meta information.
        pub(super) const ELEMENTS: &[Element] = &[$($tag),*];
    };
}

elements! {
    SOP_CLASS_UID: UI, "SOP Class UID", Fine("that of the file meta information counts");
    SOP_INSTANCE_UID: UI, "SOP Instance UID", Fine("the file is no copy of another");
    SERIES_INSTANCE_UID: UI, "Series Instance UID", Fine("files without one are one series");
    SERIES_NUMBER: IS, "Series Number", Fine("listed first");
    SERIES_DESCRIPTION: LO, "Series Description", Fine("no description");
    PATIENT_NAME: PN, "Patient Name", Shown;
    STUDY_DATE: DA, "Study Date", Shown;
    MODALITY: CS, "Modality", Fine("not known");
    IMAGE_TYPE: CS, "Image Type", Fine("no scout view, no mosaic");
    FRAME_OF_REFERENCE_UID: UI, "Frame of Reference UID", Fine("not compared");
    INSTANCE_NUMBER: IS, "Instance Number", Fine("not compared");
    ACQUISITION_NUMBER: IS, "Acquisition Number", Fine("distinguishes nothing");
    ACQUISITION_TIME: TM, "Acquisition Time", Fine("distinguishes nothing");
    CONTENT_TIME: TM, "Content Time", Fine("distinguishes nothing");
    TRIGGER_TIME: DS, "Trigger Time", Fine("distinguishes nothing");
    NOMINAL_CARDIAC_TRIGGER_DELAY_TIME: FD, "Nominal Cardiac Trigger Delay Time", Fine("distinguishes nothing");
    NOMINAL_PERCENTAGE_OF_CARDIAC_PHASE: FL, "Nominal Percentage of Cardiac Phase", Fine("distinguishes nothing");
    NOMINAL_PERCENTAGE_OF_RESPIRATORY_PHASE: FL, "Nominal Percentage of Respiratory Phase", Fine("distinguishes nothing");
    TEMPORAL_POSITION_IDENTIFIER: IS, "Temporal Position Identifier", Fine("distinguishes nothing");
    TEMPORAL_POSITION_INDEX: UL, "Temporal Position Index", Fine("distinguishes nothing");
    ECHO_NUMBERS: IS, "Echo Number(s)", Fine("distinguishes nothing");
    ECHO_TIME: DS, "Echo Time", Fine("distinguishes nothing");
    EFFECTIVE_ECHO_TIME: FD, "Effective Echo Time", Fine("distinguishes nothing");
    DIFFUSION_B_VALUE: FD, "Diffusion b-value", Fine("distinguishes nothing");
    CONCATENATION_UID: UI, "Concatenation UID", Fine("the file is whole");
    IN_CONCATENATION_NUMBER: US, "In-concatenation Number", Needed;
    IN_CONCATENATION_TOTAL_NUMBER: US, "In-concatenation Total Number", Fine("the parts from 1 on without a gap are all");
    ROWS: US, "Rows", Needed;
    COLUMNS: US, "Columns", Needed;
    NUMBER_OF_FRAMES: IS, "Number of Frames", Is(1.0);
    SAMPLES_PER_PIXEL: US, "Samples per Pixel", Needed;
    PHOTOMETRIC_INTERPRETATION: CS, "Photometric Interpretation", Needed;
    BITS_ALLOCATED: US, "Bits Allocated", Needed;
    BITS_STORED: US, "Bits Stored", Needed;
    HIGH_BIT: US, "High Bit", Fine("Bits Stored - 1, as the standard demands");
    PIXEL_REPRESENTATION: US, "Pixel Representation", Needed;
    PIXEL_PADDING_VALUE: US, "Pixel Padding Value", Fine("every pixel was measured");
    PIXEL_PADDING_RANGE_LIMIT: US, "Pixel Padding Range Limit", Fine("one value pads");
    PIXEL_INTENSITY_RELATIONSHIP: CS, "Pixel Intensity Relationship", Fine("linear");
    IMAGE_POSITION_PATIENT: DS, "Image Position (Patient)", Fine("the image has no place, and is left out");
    IMAGE_ORIENTATION_PATIENT: DS, "Image Orientation (Patient)", Fine("the image has no place, and is left out");
    PIXEL_SPACING: DS, "Pixel Spacing", Fine("the image has no place, and is left out");
    SLICE_THICKNESS: DS, "Slice Thickness", Fine("1 mm for a single slice, with a note; of several, places tell more");
    SPACING_BETWEEN_SLICES: DS, "Spacing Between Slices", Fine("places tell it; a segmentation takes the planes of its scan");
    RESCALE_SLOPE: DS, "Rescale Slope", Is(1.0);
    RESCALE_INTERCEPT: DS, "Rescale Intercept", Is(0.0);
    RESCALE_TYPE: LO, "Rescale Type", Fine("HU of a CT; else not known");
    UNITS: CS, "Units", Fine("not known");
    MODALITY_LUT_SEQUENCE: SQ, "Modality LUT Sequence", Fine("slope and intercept count");
    LUT_DESCRIPTOR: US, "LUT Descriptor", Needed;
    LUT_DATA: OW, "LUT Data", Needed;
    MODALITY_LUT_TYPE: LO, "Modality LUT Type", Fine("not known");
    REAL_WORLD_VALUE_MAPPING_SEQUENCE: SQ, "Real World Value Mapping Sequence", Fine("nothing is told of it");
    SHARED_FUNCTIONAL_GROUPS_SEQUENCE: SQ, "Shared Functional Groups Sequence", Fine("frames and file say it");
    PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE: SQ, "Per-Frame Functional Groups Sequence", Fine("the file says it");
    PLANE_POSITION_SEQUENCE: SQ, "Plane Position Sequence", Fine("the file says it");
    PLANE_ORIENTATION_SEQUENCE: SQ, "Plane Orientation Sequence", Fine("the file says it");
    PIXEL_MEASURES_SEQUENCE: SQ, "Pixel Measures Sequence", Fine("the file says it");
    PIXEL_VALUE_TRANSFORMATION_SEQUENCE: SQ, "Pixel Value Transformation Sequence", Fine("the file says it");
    FRAME_CONTENT_SEQUENCE: SQ, "Frame Content Sequence", Fine("the file says it");
    CARDIAC_SYNCHRONIZATION_SEQUENCE: SQ, "Cardiac Synchronization Sequence", Fine("the file says it");
    RESPIRATORY_SYNCHRONIZATION_SEQUENCE: SQ, "Respiratory Synchronization Sequence", Fine("the file says it");
    MR_ECHO_SEQUENCE: SQ, "MR Echo Sequence", Fine("the file says it");
    MR_DIFFUSION_SEQUENCE: SQ, "MR Diffusion Sequence", Fine("the file says it");
    SEGMENT_IDENTIFICATION_SEQUENCE: SQ, "Segment Identification Sequence", Fine("the file says it");
    REFERENCED_SEGMENT_NUMBER: US, "Referenced Segment Number", Needed;
    SEGMENTATION_TYPE: CS, "Segmentation Type", Needed;
    MAXIMUM_FRACTIONAL_VALUE: US, "Maximum Fractional Value", Needed;
    SEGMENT_SEQUENCE: SQ, "Segment Sequence", Fine("an error: there are no structures");
    SEGMENT_NUMBER: US, "Segment Number", Needed;
    SEGMENT_LABEL: LO, "Segment Label", Fine("a structure without a name");
    STRUCTURE_SET_ROI_SEQUENCE: SQ, "Structure Set ROI Sequence", Fine("an error: there are no structures");
    ROI_NUMBER: IS, "ROI Number", Needed;
    ROI_NAME: LO, "ROI Name", Fine("a structure without a name");
    REFERENCED_FRAME_OF_REFERENCE_UID: UI, "Referenced Frame of Reference UID", Fine("not compared");
    ROI_CONTOUR_SEQUENCE: SQ, "ROI Contour Sequence", Fine("structures without a contour");
    REFERENCED_ROI_NUMBER: IS, "Referenced ROI Number", Needed;
    CONTOUR_SEQUENCE: SQ, "Contour Sequence", Fine("a structure without a contour");
    CONTOUR_GEOMETRIC_TYPE: CS, "Contour Geometric Type", Needed;
    CONTOUR_DATA: DS, "Contour Data", Needed;
}

/// An element of a DICOM file that is used, as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ElementRow {
    /// Name, tag and representation.
    pub element: String,
    /// What its absence means: the default, or what is done.
    pub absent: String,
    /// What is done if its value cannot be read.
    pub unreadable: &'static str,
}

/// Returns the elements that are used.
pub fn element_rows() -> Vec<ElementRow> {
    let row = |element: &Element| ElementRow {
        element: format!("{} {}, {}", element.name, code(element.tag), element.vr),
        absent: match element.absence {
            Is(value) => format!("{value}"),
            Fine(text) => text.to_owned(),
            Needed => "refused".to_owned(),
            Shown => "not shown".to_owned(),
        },
        unreadable: match element.absence {
            Shown => "not shown",
            _ => "refused",
        },
    };
    ELEMENTS.iter().map(row).collect()
}

fn code(Tag(group, number): Tag) -> String {
    format!("({group:04x},{number:04x})")
}

impl Element {
    /// Returns the value of an element as numbers.
    ///
    /// # Errors
    /// [`Kind::BadData`] if one of them is none, or not finite.
    pub fn numbers(&self, object: &InMemDicomObject) -> Result<Option<Vec<f64>>> {
        let Some(value) = self.value(object)? else { return Ok(None) };
        let numbers: Option<Vec<f64>> = match value {
            PrimitiveValue::Str(text) => text.split('\\').map(number).collect(),
            PrimitiveValue::Strs(texts) => texts.iter().map(|text| number(text)).collect(),
            // Bytes of no known representation, and dates.
            PrimitiveValue::U8(_)
            | PrimitiveValue::Date(_)
            | PrimitiveValue::DateTime(_)
            | PrimitiveValue::Time(_)
            | PrimitiveValue::Tags(_) => None,
            numbers => numbers.to_multi_float64().ok(),
        };
        match numbers.filter(|numbers| numbers.iter().all(|v| v.is_finite())) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(self.wrong(&shown(value), "numbers")),
        }
    }

    /// Returns true if the values are numbers by the dictionary.
    pub fn is_number(&self) -> bool {
        matches!(self.vr, VR::DS | VR::IS | VR::US | VR::UL | VR::FL | VR::FD)
    }

    /// Returns the value of an element as a vector of so many numbers.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is none.
    pub fn vector<const N: usize>(&self, object: &InMemDicomObject) -> Result<Option<[f64; N]>> {
        let Some(numbers) = self.numbers(object)? else { return Ok(None) };
        match <[f64; N]>::try_from(numbers.as_slice()) {
            Ok(vector) => Ok(Some(vector)),
            Err(_) => Err(self.wrong(&format!("{numbers:?}"), &format!("{N} numbers"))),
        }
    }

    /// Returns the value of an element as a number.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is none.
    pub fn number(&self, object: &InMemDicomObject) -> Result<Option<f64>> {
        Ok(self.vector::<1>(object)?.map(|[number]| number))
    }

    /// Returns the value of an element as a whole number, which some writers store as a decimal one.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is none.
    pub fn whole(&self, object: &InMemDicomObject) -> Result<Option<i64>> {
        match self.number(object)? {
            Some(number) if number.fract() != 0.0 || number.abs() > 1e15 => {
                Err(self.wrong(&number.to_string(), "a whole number"))
            }
            number => Ok(number.map(|number| number as i64)),
        }
    }

    /// Returns the value of an element as text, several values with backslashes between them.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is a sequence, or no number where it should be one.
    pub fn text(&self, object: &InMemDicomObject) -> Result<Option<String>> {
        if self.is_number() {
            let numbers = self.numbers(object)?;
            let join = |numbers: Vec<f64>| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join("\\");
            return Ok(numbers.map(join));
        }
        let text = |value: &PrimitiveValue| value.to_str().trim_matches(BLANKS).to_owned();
        Ok(self.value(object)?.map(text))
    }

    /// Returns the items of a sequence; `None` also if there are none.
    ///
    /// # Errors
    /// [`Kind::BadData`] if the element is no sequence.
    pub fn items<'a>(&self, object: &'a InMemDicomObject) -> Result<Option<&'a [InMemDicomObject]>> {
        match object.get(self.tag).map(DataElement::value) {
            None | Some(DicomValue::Primitive(PrimitiveValue::Empty)) => Ok(None),
            Some(DicomValue::Sequence(items)) => Ok(Some(items.items()).filter(|items| !items.is_empty())),
            Some(DicomValue::Primitive(value)) => Err(self.wrong(&shown(value), "a sequence of items")),
            Some(DicomValue::PixelSequence(_)) => Err(self.wrong("pixels", "a sequence of items")),
        }
    }

    /// Returns the value of an element if it is not absent.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is a sequence.
    pub fn value<'a>(&self, object: &'a InMemDicomObject) -> Result<Option<&'a PrimitiveValue>> {
        match object.get(self.tag).map(DataElement::value) {
            None => Ok(None),
            Some(DicomValue::Primitive(value)) => Ok(Some(value).filter(|value| !is_blank(value))),
            Some(_) => Err(self.wrong("a sequence", "a value")),
        }
    }

    /// Returns the value, or what the standard has for its absence.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it has nothing.
    pub fn or_default(&self, value: Option<f64>) -> Result<f64> {
        match (value, self.absence) {
            (Some(value), _) | (None, Is(value)) => Ok(value),
            (None, _) => self.needed(None),
        }
    }

    /// Returns the value, or the error that it is absent.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is.
    pub fn needed<T>(&self, value: Option<T>) -> Result<T> {
        value.ok_or_else(|| {
            let message = format!("{self} is missing, and there is no default for it");
            Error::new(Kind::BadData, "VGS-DCM-022", message)
                .help("export the file again with this element; --lenient leaves such files of a folder out")
        })
    }

    /// Returns the error of a value that cannot be used.
    pub fn wrong(&self, found: &str, needed: &str) -> Error {
        let message = format!("{self} is {found}, where {needed} must stand");
        Error::new(Kind::BadData, "VGS-DCM-021", message).help(
            "correct the element, or export the file again; --lenient leaves such files of a folder out",
        )
    }
}

/// Writes name and tag.
impl std::fmt::Display for Element {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.name, code(self.tag))
    }
}

fn number(text: &str) -> Option<f64> {
    text.trim_matches(BLANKS).parse().ok()
}

fn is_blank(value: &PrimitiveValue) -> bool {
    match value {
        PrimitiveValue::Empty => true,
        PrimitiveValue::Str(text) => text.trim_matches(BLANKS).is_empty(),
        PrimitiveValue::Strs(texts) => texts.iter().all(|text| text.trim_matches(BLANKS).is_empty()),
        value => value.multiplicity() == 0,
    }
}

/// Returns a value as a message shows it.
fn shown(value: &PrimitiveValue) -> String {
    let text = value.to_str();
    let text: String = text.chars().map(|c| if c.is_control() { '.' } else { c }).collect();
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("'{}…'", &text[..end]),
        None => format!("'{text}'"),
    }
}

/// Something unusual that was read all the same: the element, and a text for the user.
pub(super) type Oddity = (Tag, String);

/// Returns the texts, the first one for each element.
pub(super) fn of_each_element(oddities: &[Oddity]) -> Vec<&Oddity> {
    let is_first = |(i, (tag, _)): &(usize, &Oddity)| !oddities[..*i].iter().any(|(other, _)| other == tag);
    oddities.iter().enumerate().filter(is_first).map(|(_, oddity)| oddity).collect()
}

/// Gives all elements of a file the representation of the dictionary, whatever the file says, if their bytes allow
/// it; those that do not are left as they are. Returns what was read although it is not as it should be.
pub(super) fn by_dictionary(object: &mut InMemDicomObject) -> Vec<Oddity> {
    let codes = object.get(tags::SPECIFIC_CHARACTER_SET).and_then(|element| element.to_str().ok());
    let code = codes.as_deref().and_then(|codes| codes.split('\\').next()).unwrap_or_default().to_owned();
    let charset = SpecificCharacterSet::from_code(code.trim_matches(BLANKS)).unwrap_or_default();
    let mut oddities = Vec::new();
    represent(object, &charset, &mut oddities);
    oddities
}

fn represent(object: &mut InMemDicomObject, charset: &SpecificCharacterSet, oddities: &mut Vec<Oddity>) {
    let mut sequences = Vec::new();
    let mut converted = Vec::new();
    let mut blank = Vec::new();
    for element in object.iter() {
        match element.value() {
            DicomValue::Sequence(_) => sequences.push(element.tag()),
            // Nothing is what an absent element has.
            DicomValue::Primitive(value) if is_blank(value) => blank.push(element.tag()),
            DicomValue::Primitive(value) => {
                if let Some(new) = of_dictionary(element, value, charset, oddities) {
                    if matches!(new.value(), DicomValue::Sequence(_)) {
                        sequences.push(new.tag());
                    }
                    converted.push(new);
                }
            }
            DicomValue::PixelSequence(_) => {}
        }
    }
    for tag in blank {
        object.remove_element(tag);
    }
    for element in converted {
        object.put(element);
    }
    for tag in sequences {
        object.update_value(tag, |value| {
            for item in value.items_mut().into_iter().flatten() {
                represent(item, charset, oddities);
            }
        });
    }
}

/// Returns an element by the dictionary; `None` if it is so already, or cannot be.
fn of_dictionary(
    element: &InMemElement,
    value: &PrimitiveValue,
    charset: &SpecificCharacterSet,
    oddities: &mut Vec<Oddity>,
) -> Option<InMemElement> {
    let tag = element.tag();
    let row = ELEMENTS.iter().find(|row| row.tag == tag);
    let given = element.vr();
    let is_bytes = matches!(value, PrimitiveValue::U8(_));
    if is_bytes && (given == VR::UN || row.is_some_and(|row| row.vr != VR::OW && row.vr != given)) {
        return reread(tag, &value.to_bytes(), charset).filter(|new| new.vr() != VR::UN);
    }
    let row = row?;
    let new = |value: PrimitiveValue| Some(InMemElement::new(tag, row.vr, value));
    match (row.vr, value) {
        (VR::DS | VR::IS, PrimitiveValue::Str(_) | PrimitiveValue::Strs(_)) => {
            let text = value.to_str();
            let points = with_points(&text)?;
            oddities.push((tag, format!("{row} is {}, read as {points}", shown(value))));
            new(PrimitiveValue::Str(points))
        }
        // Digits where the file claims binary numbers, of which there are none with such bytes in earnest.
        (VR::DS | VR::IS, PrimitiveValue::F32(_) | PrimitiveValue::F64(_)) => {
            let bytes = value.to_bytes();
            let text = std::str::from_utf8(&bytes).ok()?;
            text.split('\\')
                .all(|part| number(part).is_some())
                .then(|| text.to_owned())
                .and_then(|text| new(text.into()))
        }
        (VR::US, PrimitiveValue::I16(signed)) => {
            new(PrimitiveValue::U16(signed.iter().map(|&v| v as u16).collect()))
        }
        (VR::UL, PrimitiveValue::I32(signed)) => {
            new(PrimitiveValue::U32(signed.iter().map(|&v| v as u32).collect()))
        }
        _ => None,
    }
}

/// Reads the bytes of an element as elements without a representation of their own are read.
fn reread(tag: Tag, bytes: &[u8], charset: &SpecificCharacterSet) -> Option<InMemElement> {
    let syntax = TransferSyntaxRegistry.get(IMPLICIT)?;
    let length = u32::try_from(bytes.len()).ok()?;
    let head = [tag.0.to_le_bytes(), tag.1.to_le_bytes()].concat();
    let whole = [&head[..], &length.to_le_bytes(), bytes].concat();
    if too_long_element(Cursor::new(&whole), syntax, whole.len() as u64, false).is_some() {
        return None;
    }
    let mut object =
        InMemDicomObject::read_dataset_with_ts_cs(whole.as_slice(), syntax, charset.clone()).ok()?;
    object.take(tag)
}

/// Returns numbers with decimal commas as numbers with points; `None` if they have no commas, or what they mean is
/// not certain, as with 1,024.
fn with_points(text: &str) -> Option<String> {
    let point = |part: &str| {
        let part = part.trim_matches(BLANKS);
        let Some((whole, after)) = part.split_once(',') else { return Some(part.to_owned()) };
        let digits = whole.trim_start_matches(['+', '-']);
        let fraction = after.split(['e', 'E']).next().unwrap_or_default();
        let of_thousands = fraction.len() == 3 && digits.len() <= 3 && digits != "0";
        let plain = !digits.is_empty()
            && digits.bytes().all(|b| b.is_ascii_digit())
            && !fraction.is_empty()
            && fraction.bytes().all(|b| b.is_ascii_digit());
        let point = format!("{whole}.{after}");
        (plain && !of_thousands && number(&point).is_some()).then_some(point)
    };
    if !text.contains(',') {
        return None;
    }
    let points: Option<Vec<String>> = text.split('\\').map(point).collect();
    Some(points?.join("\\"))
}

#[cfg(test)]
mod tests {
    use dicom_core::DataDictionary;
    use dicom_core::dictionary::DataDictionaryEntry;
    use dicom_dictionary_std::StandardDataDictionary;

    use super::*;

    #[test]
    fn rows_are_those_of_the_dictionary() {
        for (i, row) in ELEMENTS.iter().enumerate() {
            let entry = StandardDataDictionary.by_tag(row.tag).expect("an element of the standard");
            assert_eq!(entry.vr().relaxed(), row.vr, "{row}");
            let plain = |name: &str| name.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "");
            assert_eq!(plain(entry.alias()), plain(row.name), "{row}");
            assert!(!ELEMENTS[..i].iter().any(|other| other.tag == row.tag), "{row} is there twice");
        }
    }

    #[test]
    fn commas_are_points_where_nothing_else_can_be_meant() {
        for (text, expected) in [
            ("-1024,0", Some("-1024.0")),
            ("0,5\\0,75", Some("0.5\\0.75")),
            ("1\\-2,5 \\3", Some("1\\-2.5\\3")),
            ("0,625", Some("0.625")),
            ("1,5e-3", Some("1.5e-3")),
            ("1,024", None),
            ("1,024,0", None),
            ("-1024", None),
            ("a,5", None),
            ("1.024,0", None),
            (",5", None),
        ] {
            assert_eq!(with_points(text).as_deref(), expected, "{text}");
        }
    }
}
