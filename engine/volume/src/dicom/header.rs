//! The header of a DICOM file: what it says about its frames.

use std::sync::Arc;

use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, InMemDicomObject, Tag};
use glam::DVec3;

use super::elements::{self as e, Element, Oddity};
use super::location::{Location, Opened};
use super::scale::{Scale, Table, signed_if};
use base::{Error, Kind, Result};

/// Class UID of a DICOMDIR.
const DIRECTORY: &str = "1.2.840.10008.1.3.10";
/// Class UIDs of segmentations: bits of each segment, and maps of labels.
const SEGMENTATIONS: [&str; 2] = ["1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7"];
/// Class UID of an RT structure set.
const STRUCTURE_SET: &str = "1.2.840.10008.5.1.4.1.1.481.3";
/// Number of tiles in a mosaic, and who must have reserved the element.
const MOSAIC_TILES: (Tag, Tag, &str) = (Tag(0x0019, 0x100a), Tag(0x0019, 0x0010), "SIEMENS MR HEADER");

/// More frames than any file has: a segmentation of a hundred structures in a long scan.
const MOST_FRAMES: i64 = 1 << 18;
/// How far a direction may be from a length of 1, and two from a right angle.
const ROUNDED_DIRECTION: f64 = 1e-2;

/// What may distinguish volumes of one series, the most telling first: a name, the functional group that it is in if
/// the file has several frames, and the element.
pub(super) const PHASES: [(&str, Option<Element>, Element); 12] = [
    ("temporal position", None, e::TEMPORAL_POSITION_IDENTIFIER),
    ("temporal index", Some(e::FRAME_CONTENT_SEQUENCE), e::TEMPORAL_POSITION_INDEX),
    ("cardiac phase, %", Some(e::CARDIAC_SYNCHRONIZATION_SEQUENCE), e::NOMINAL_PERCENTAGE_OF_CARDIAC_PHASE),
    (
        "respiratory phase, %",
        Some(e::RESPIRATORY_SYNCHRONIZATION_SEQUENCE),
        e::NOMINAL_PERCENTAGE_OF_RESPIRATORY_PHASE,
    ),
    ("trigger delay", Some(e::CARDIAC_SYNCHRONIZATION_SEQUENCE), e::NOMINAL_CARDIAC_TRIGGER_DELAY_TIME),
    ("trigger time", None, e::TRIGGER_TIME),
    ("echo", None, e::ECHO_NUMBERS),
    ("echo time", None, e::ECHO_TIME),
    ("echo time", Some(e::MR_ECHO_SEQUENCE), e::EFFECTIVE_ECHO_TIME),
    ("b value", Some(e::MR_DIFFUSION_SEQUENCE), e::DIFFUSION_B_VALUE),
    ("acquisition", None, e::ACQUISITION_NUMBER),
    ("image type", None, e::IMAGE_TYPE),
];

/// Times of a frame, by which those at one place are in an order: a name and the element.
pub(super) const TIMES: [(&str, Element); 3] = [
    ("trigger time", e::TRIGGER_TIME),
    ("acquisition time", e::ACQUISITION_TIME),
    ("content time", e::CONTENT_TIME),
];

/// What all frames of a file have in common.
#[derive(Clone, Debug, Default)]
pub(super) struct FileHeader {
    pub location: Location,
    pub instance: String,
    pub series: String,
    /// Number of the series on the scanner.
    pub series_number: i64,
    pub description: String,
    pub modality: String,
    /// UID of the space of the patient's places; empty if the file does not name it.
    pub frame_of_reference: String,
    /// True if the file is a scout view.
    pub localizer: bool,
    /// True if the image is made of all slices of a volume side by side.
    pub mosaic: bool,
    pub photometric: String,
    pub transfer_syntax: String,
    /// Number of bits that hold a value; `high_bit` is the place of the highest one.
    pub bits_stored: u32,
    pub high_bit: u32,
    pub bits_allocated: u32,
    pub samples_per_pixel: i64,
    pub signed: bool,
    /// Range of stored values that mean that nothing was measured.
    pub padding: Option<[i64; 2]>,
    /// Relation of the values and the intensity that was measured; empty if the file does not say.
    pub relationship: String,
    /// True if a part of the file says how its values become physical ones.
    pub real_world: bool,
    /// Place in a concatenation, if the file is a part of one.
    pub part: Option<Part>,
    /// What was read although it is not as it should be.
    pub oddities: Vec<Oddity>,
    /// Number of the image in the series.
    pub instance_number: Option<i64>,
    /// Times of [`TIMES`], as numbers that grow.
    pub times: [Option<f64>; TIMES.len()],
}

/// A file that is a part of a larger one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    /// UID of the whole.
    pub whole: String,
    /// Number, from 1.
    pub number: i64,
    /// Number of parts, if the file tells it.
    pub of: Option<i64>,
}

/// One frame and its place.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub file: Arc<FileHeader>,
    /// Number of the frame in the file.
    pub number: u32,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Distance of neighbouring columns, then of rows, mm.
    pub spacing: [f64; 2],
    /// Directions (LPS) in which the column number grows, then the row number.
    pub along: [DVec3; 2],
    /// Centre of the first pixel, mm (LPS).
    pub position: DVec3,
    /// Thickness of the slice, mm; 0 if the file does not give it.
    pub thickness: f64,
    /// Distance of slices that the file gives, mm; 0 if it gives none. Only that of a segmentation is used:
    /// places tell it better.
    pub slice_distance: f64,
    /// Number of the segment whose voxels these are, in a segmentation.
    pub segment: Option<i64>,
    /// From stored values to intensities.
    pub scale: Scale,
    /// Units of the intensities; empty if the file does not give them.
    pub units: String,
    /// Values of [`PHASES`]; empty if the file does not give them.
    pub phases: [String; PHASES.len()],
}

/// Reason why a file is not part of a volume.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Skipped {
    /// The file is an index of other files.
    Directory,
    /// The file holds structures, as a mask does.
    Structures(Structures),
    /// The file holds no image.
    NoImage,
    /// The pixels are real numbers or spectra; the text is the file's name.
    NoIntegers(String),
    /// The file holds an image without a place, such as a copy of a screen; the text says what it is.
    NoPlace(String),
}

/// The way in which a file holds structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Structures {
    /// As voxels (DICOM-SEG).
    Voxels,
    /// As contours (RTSTRUCT).
    Contours,
}

/// Content of a file: its frames, or the reason why it has none that can be used.
pub(super) type Content = std::result::Result<Vec<Frame>, Skipped>;

/// Reads everything before the pixels.
///
/// # Errors
/// [`Kind::BadData`] for a damaged file.
pub(super) fn read_header(location: &Location) -> Result<Content> {
    let opened = location.open(Some(tags::PIXEL_DATA))?;
    let of_meta = opened.object.meta().media_storage_sop_class_uid().trim_end_matches('\0').to_owned();
    let class = e::SOP_CLASS_UID.text(&opened.object).map_err(|e| e.file(&location.path))?.unwrap_or(of_meta);
    match class.as_str() {
        DIRECTORY => Ok(Err(Skipped::Directory)),
        STRUCTURE_SET => Ok(Err(Skipped::Structures(Structures::Contours))),
        class if SEGMENTATIONS.contains(&class) => Ok(Err(Skipped::Structures(Structures::Voxels))),
        _ => frames(location, &opened),
    }
}

/// Returns the frames of a file, or why it has none that can be used.
///
/// # Errors
/// [`Kind::BadData`] for an image without pixels, and for elements that cannot be read or are missing.
pub(super) fn frames(location: &Location, opened: &Opened) -> Result<Content> {
    frames_of(location, opened).map_err(|e| e.file(&location.path))
}

fn frames_of(location: &Location, Opened { object, oddities }: &Opened) -> Result<Content> {
    let (rows, columns) = (e::ROWS.whole(object)?, e::COLUMNS.whole(object)?);
    // Pixels of a size that nobody tells are an image all the same.
    if rows.is_none() && columns.is_none() && e::BITS_ALLOCATED.whole(object)?.is_none() {
        return Ok(Err(Skipped::NoImage));
    }
    let (rows, columns) = (e::ROWS.needed(rows)?, e::COLUMNS.needed(columns)?);
    let name = location.path.file_name().unwrap_or_default().to_string_lossy();
    let no_place = || -> Result<Content> {
        let what = [e::MODALITY.text(object)?, e::SERIES_DESCRIPTION.text(object)?];
        let what: Vec<String> = what.into_iter().flatten().collect();
        Ok(Err(Skipped::NoPlace(format!("{name} ({})", what.join(" ")))))
    };
    let size = [columns, rows].map(|n| usize::try_from(n).unwrap_or(0));
    let count = e::NUMBER_OF_FRAMES.or_default(e::NUMBER_OF_FRAMES.whole(object)?.map(|n| n as f64))? as i64;
    if size.contains(&0) || !(1..=MOST_FRAMES).contains(&count) {
        let message = format!("an image of {columns} x {rows} pixels, {count} frames");
        return Err(
            Error::new(Kind::BadData, "VGS-DCM-003", message).help("the file is damaged; copy it again")
        );
    }
    let shared = e::SHARED_FUNCTIONAL_GROUPS_SEQUENCE.items(object)?.and_then(|items| items.first());
    let each = e::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE.items(object)?.unwrap_or_default();
    let groups = |number: usize| Groups { own: each.get(number), shared, file: object, alone: count == 1 };
    // Before anything else of them is read: images without a place may be anything.
    for number in 0..count as usize {
        if !groups(number).has_place()? {
            return no_place();
        }
    }
    // Such a file has not the elements that say how integers are stored.
    let others = [tags::FLOAT_PIXEL_DATA, tags::DOUBLE_FLOAT_PIXEL_DATA, tags::SPECTROSCOPY_DATA];
    if others.into_iter().any(|tag| object.get(tag).is_some()) {
        return Ok(Err(Skipped::NoIntegers(name.into_owned())));
    }
    let file = Arc::new(file_header(location, object, oddities)?);
    let frames = (0..count as u32).map(|number| groups(number as usize).frame(&file, number, size));
    Ok(Ok(frames.collect::<Result<Vec<_>>>()?))
}

fn file_header(location: &Location, object: &DefaultDicomObject, oddities: &[Oddity]) -> Result<FileHeader> {
    let text = |element: Element| Ok(element.text(object)?.unwrap_or_default());
    let needed = |element: Element| element.needed(element.whole(object)?);
    let image_type = text(e::IMAGE_TYPE)?.to_uppercase();
    let is_type = |kind: &str| image_type.split('\\').any(|part| part.trim() == kind);
    let (tiles, creator, owner) = MOSAIC_TILES;
    let reserved = object.get(creator).and_then(|element| element.to_str().ok());
    let mosaic =
        is_type("MOSAIC") || object.get(tiles).is_some() && reserved.is_some_and(|name| name.trim() == owner);
    let signed = match needed(e::PIXEL_REPRESENTATION)? {
        0 => false,
        1 => true,
        other => return Err(e::PIXEL_REPRESENTATION.wrong(&other.to_string(), "0 or 1")),
    };
    let allocated = needed(e::BITS_ALLOCATED)?;
    if ![1, 8, 16, 32].contains(&allocated) {
        return Err(e::BITS_ALLOCATED.wrong(&allocated.to_string(), "1, 8, 16 or 32"));
    }
    let stored = needed(e::BITS_STORED)?;
    if !(1..=allocated).contains(&stored) {
        return Err(e::BITS_STORED.wrong(&stored.to_string(), &format!("1 to {allocated}")));
    }
    let high = e::HIGH_BIT.whole(object)?.unwrap_or(stored - 1);
    if !(stored - 1..allocated).contains(&high) {
        return Err(e::HIGH_BIT.wrong(&high.to_string(), &format!("{} to {}", stored - 1, allocated - 1)));
    }
    let padding = match e::PIXEL_PADDING_VALUE.whole(object)? {
        Some(from) => {
            let to = e::PIXEL_PADDING_RANGE_LIMIT.whole(object)?.unwrap_or(from);
            let [from, to] = [from, to].map(|value| signed_if(value, signed));
            Some([from.min(to), from.max(to)])
        }
        None => None,
    };
    let part = match e::CONCATENATION_UID.text(object)? {
        Some(whole) => Some(Part {
            whole,
            number: e::IN_CONCATENATION_NUMBER.needed(e::IN_CONCATENATION_NUMBER.whole(object)?)?,
            of: e::IN_CONCATENATION_TOTAL_NUMBER.whole(object)?,
        }),
        None => None,
    };
    let mut times = [None; TIMES.len()];
    for (time, (_, element)) in times.iter_mut().zip(TIMES) {
        // Of the day: hours, minutes and seconds are digits, and grow as a number; older files have colons between them.
        let Some(text) = element.text(object)? else { continue };
        let number = text.replace(':', "").parse().ok().filter(|time: &f64| time.is_finite());
        *time = Some(number.ok_or_else(|| element.wrong(&format!("'{text}'"), "a time"))?);
    }
    Ok(FileHeader {
        location: location.clone(),
        instance: text(e::SOP_INSTANCE_UID)?,
        series: text(e::SERIES_INSTANCE_UID)?,
        series_number: e::SERIES_NUMBER.whole(object)?.unwrap_or(0),
        description: text(e::SERIES_DESCRIPTION)?,
        modality: text(e::MODALITY)?,
        frame_of_reference: text(e::FRAME_OF_REFERENCE_UID)?,
        localizer: is_type("LOCALIZER"),
        mosaic,
        photometric: e::PHOTOMETRIC_INTERPRETATION.needed(e::PHOTOMETRIC_INTERPRETATION.text(object)?)?,
        transfer_syntax: object.meta().transfer_syntax().trim_end_matches('\0').to_owned(),
        bits_stored: stored as u32,
        high_bit: high as u32,
        bits_allocated: allocated as u32,
        samples_per_pixel: needed(e::SAMPLES_PER_PIXEL)?,
        signed,
        padding,
        relationship: text(e::PIXEL_INTENSITY_RELATIONSHIP)?,
        real_world: e::REAL_WORLD_VALUE_MAPPING_SEQUENCE.items(object)?.is_some(),
        part,
        oddities: oddities.to_vec(),
        instance_number: e::INSTANCE_NUMBER.whole(object)?,
        times,
    })
}

/// The parts of a file that may describe a frame: its own functional groups, the shared ones, and the file
/// itself.
struct Groups<'a> {
    own: Option<&'a InMemDicomObject>,
    shared: Option<&'a InMemDicomObject>,
    file: &'a InMemDicomObject,
    /// True if the file has no other frame, so that its attributes are those of the frame.
    alone: bool,
}

impl<'a> Groups<'a> {
    /// Returns the part that has `element`: the functional group `group` of the frame, or else the file itself.
    ///
    /// # Errors
    /// [`Kind::BadData`] if the group cannot be read.
    fn part_with(&self, group: Element, element: Element) -> Result<&'a InMemDicomObject> {
        for part in [self.own, self.shared].into_iter().flatten() {
            let item = group.items(part)?.and_then(|items| items.first());
            if let Some(item) = item.filter(|item| item.get(element.tag).is_some()) {
                return Ok(item);
            }
        }
        Ok(self.file)
    }

    fn has_place(&self) -> Result<bool> {
        let rows = [
            (e::PLANE_POSITION_SEQUENCE, e::IMAGE_POSITION_PATIENT),
            (e::PLANE_ORIENTATION_SEQUENCE, e::IMAGE_ORIENTATION_PATIENT),
            (e::PIXEL_MEASURES_SEQUENCE, e::PIXEL_SPACING),
        ];
        for (group, element) in rows {
            let part = self.part_with(group, element)?;
            // The place of a file of several frames is that of the first one at best.
            let is_of_all = std::ptr::eq(part, self.file) && !self.alone;
            if element.numbers(part)?.is_none() || is_of_all && element == e::IMAGE_POSITION_PATIENT {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Returns so many numbers of a frame that has a place.
    fn vector<const N: usize>(&self, group: Element, element: Element) -> Result<[f64; N]> {
        element.needed(element.vector(self.part_with(group, element)?)?)
    }

    fn frame(&self, file: &Arc<FileHeader>, number: u32, size: [usize; 2]) -> Result<Frame> {
        let position = self.vector(e::PLANE_POSITION_SEQUENCE, e::IMAGE_POSITION_PATIENT)?;
        let along: [f64; 6] = self.vector(e::PLANE_ORIENTATION_SEQUENCE, e::IMAGE_ORIENTATION_PATIENT)?;
        let [x, y] = [&along[..3], &along[3..]].map(DVec3::from_slice);
        let off = [x.length() - 1.0, y.length() - 1.0, x.dot(y)];
        if off.iter().any(|v| v.abs() > ROUNDED_DIRECTION) {
            let found = format!("{along:?}");
            return Err(e::IMAGE_ORIENTATION_PATIENT.wrong(&found, "two directions at a right angle"));
        }
        // Rows come first in the file.
        let [rows, columns] = self.vector(e::PIXEL_MEASURES_SEQUENCE, e::PIXEL_SPACING)?;
        if !(rows > 0.0 && columns > 0.0) {
            return Err(e::PIXEL_SPACING.wrong(&format!("{rows}\\{columns}"), "two distances above 0"));
        }
        let length = |element: Element| {
            let given = element.number(self.part_with(e::PIXEL_MEASURES_SEQUENCE, element)?)?;
            // Some scanners give distances against the normal as negative ones.
            Ok::<_, Error>(given.unwrap_or(0.0).abs())
        };
        let identified = self.part_with(e::SEGMENT_IDENTIFICATION_SEQUENCE, e::REFERENCED_SEGMENT_NUMBER)?;
        let (scale, units) = self.scale(file)?;
        let mut phases: [String; PHASES.len()] = Default::default();
        for (phase, (_, group, element)) in phases.iter_mut().zip(PHASES) {
            let part = match group {
                Some(group) => self.part_with(group, element)?,
                None => self.file,
            };
            *phase = element.text(part)?.unwrap_or_default();
        }
        Ok(Frame {
            file: Arc::clone(file),
            number,
            size,
            spacing: [columns, rows],
            along: [x, y].map(DVec3::normalize),
            position: DVec3::from_array(position),
            thickness: length(e::SLICE_THICKNESS)?,
            slice_distance: length(e::SPACING_BETWEEN_SLICES)?,
            segment: e::REFERENCED_SEGMENT_NUMBER.whole(identified)?,
            scale,
            units,
            phases,
        })
    }

    /// Returns the scale of a frame and the units of its intensities. A table comes before slope and intercept.
    fn scale(&self, file: &FileHeader) -> Result<(Scale, String)> {
        let of = |element| self.part_with(e::PIXEL_VALUE_TRANSFORMATION_SEQUENCE, element);
        let slope = e::RESCALE_SLOPE.number(of(e::RESCALE_SLOPE)?)?;
        let intercept = e::RESCALE_INTERCEPT.number(of(e::RESCALE_INTERCEPT)?)?;
        let scale = match (slope, intercept) {
            (None, None) => Scale::Stored,
            _ => Scale::Line {
                slope: match e::RESCALE_SLOPE.or_default(slope)? {
                    0.0 => return Err(e::RESCALE_SLOPE.wrong("0", "another number")),
                    slope => slope,
                },
                intercept: e::RESCALE_INTERCEPT.or_default(intercept)?,
            },
        };
        let units = e::UNITS.text(self.file)?;
        let units = match e::RESCALE_TYPE.text(of(e::RESCALE_TYPE)?)? {
            Some(units) => Some(units),
            None => units,
        };
        if let Some([item, ..]) = e::MODALITY_LUT_SEQUENCE.items(self.file)? {
            let units = e::MODALITY_LUT_TYPE.text(item)?.or(units).unwrap_or_default();
            return Ok((Scale::Table(Table::read(item, file.signed)?), units));
        }
        Ok((scale, units.unwrap_or_default()))
    }
}
