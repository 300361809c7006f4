//! The header of a DICOM file: what it says about its frames.

use std::sync::Arc;

use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, InMemDicomObject, Tag};
use glam::DVec3;

use super::location::Location;
use crate::{Error, Kind, Result};

/// Class UID of a DICOMDIR.
const DIRECTORY: &str = "1.2.840.10008.1.3.10";
/// Class UIDs of segmentations: bits of each segment, and maps of labels.
const SEGMENTATIONS: [&str; 2] = ["1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7"];
/// Class UID of an RT structure set.
const STRUCTURE_SET: &str = "1.2.840.10008.5.1.4.1.1.481.3";

/// More frames than any file has: a segmentation of a hundred structures in a long scan.
const MOST_FRAMES: i64 = 1 << 18;

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
    /// True if the file is a scout view.
    pub localizer: bool,
    pub photometric: String,
    pub transfer_syntax: String,
    /// Units of the rescaled values, if the file gives them.
    pub units: String,
    /// Number of bits that hold a value; `high_bit` is the place of the highest one.
    pub bits_stored: u32,
    pub high_bit: u32,
    pub bits_allocated: u32,
    pub signed: bool,
    /// Range of stored values that mean that nothing was measured.
    pub padding: Option<[i64; 2]>,
    /// Names and values of attributes that may distinguish volumes of one series.
    pub phases: Vec<(&'static str, String)>,
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
    /// Slope and intercept from stored values to intensities.
    pub rescale: [f64; 2],
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
    let object = location.open(Some(tags::PIXEL_DATA))?;
    match object.meta().media_storage_sop_class_uid().trim_end_matches('\0') {
        DIRECTORY => Ok(Err(Skipped::Directory)),
        STRUCTURE_SET => Ok(Err(Skipped::Structures(Structures::Contours))),
        class if SEGMENTATIONS.contains(&class) => Ok(Err(Skipped::Structures(Structures::Voxels))),
        _ => frames(location, &object),
    }
}

/// Returns the frames of a file, or why it has none that can be used.
///
/// # Errors
/// [`Kind::BadData`] for an image without pixels.
pub(super) fn frames(location: &Location, object: &DefaultDicomObject) -> Result<Content> {
    let (Some(rows), Some(columns)) = (whole(object, tags::ROWS), whole(object, tags::COLUMNS)) else {
        return Ok(Err(Skipped::NoImage));
    };
    let file = Arc::new(file_header(location, object));
    let size = [columns, rows].map(|n| usize::try_from(n).unwrap_or(0));
    let count = whole(object, tags::NUMBER_OF_FRAMES).unwrap_or(1).max(1);
    if size.contains(&0) || count > MOST_FRAMES {
        let message = format!("an image of {columns} x {rows} pixels, {count} frames");
        return Err(Error::new(Kind::BadData, "VGS-DCM-003", message)
            .file(&location.path)
            .help("the file is damaged; copy it again"));
    }
    let shared = items(object, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE).and_then(|items| items.first());
    let each = items(object, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).unwrap_or_default();
    let frames = (0..count as u32).map(|number| {
        let own = each.get(number as usize);
        let groups = Groups { own, shared, file: object, alone: count == 1 };
        groups.frame(&file, number, size)
    });
    let frames: Option<Vec<_>> = frames.collect();
    let name = location.path.file_name().unwrap_or_default().to_string_lossy();
    Ok(frames.ok_or_else(|| {
        Skipped::NoPlace(format!("{name} ({})", format!("{} {}", file.modality, file.description).trim()))
    }))
}

fn file_header(location: &Location, object: &DefaultDicomObject) -> FileHeader {
    let image_type = text(object, tags::IMAGE_TYPE).to_uppercase();
    let bits_stored = whole(object, tags::BITS_STORED).unwrap_or(16).clamp(1, 32) as u32;
    let padding = whole(object, tags::PIXEL_PADDING_VALUE).map(|from| {
        let to = whole(object, tags::PIXEL_PADDING_RANGE_LIMIT).unwrap_or(from);
        [from.min(to), from.max(to)]
    });
    let phases = [
        ("temporal position", tags::TEMPORAL_POSITION_IDENTIFIER),
        ("echo", tags::ECHO_NUMBERS),
        ("b value", tags::DIFFUSION_B_VALUE),
        ("acquisition", tags::ACQUISITION_NUMBER),
        ("image type", tags::IMAGE_TYPE),
        ("content time", tags::CONTENT_TIME),
    ];
    FileHeader {
        location: location.clone(),
        instance: text(object, tags::SOP_INSTANCE_UID),
        series: text(object, tags::SERIES_INSTANCE_UID),
        series_number: whole(object, tags::SERIES_NUMBER).unwrap_or(0),
        description: text(object, tags::SERIES_DESCRIPTION),
        modality: text(object, tags::MODALITY),
        localizer: image_type.split('\\').any(|part| part.trim() == "LOCALIZER"),
        photometric: text(object, tags::PHOTOMETRIC_INTERPRETATION),
        transfer_syntax: object.meta().transfer_syntax().trim_end_matches('\0').to_owned(),
        units: [tags::RESCALE_TYPE, tags::UNITS].map(|tag| text(object, tag)).concat(),
        bits_stored,
        high_bit: whole(object, tags::HIGH_BIT).map_or(bits_stored - 1, |bit| bit.clamp(0, 31) as u32),
        bits_allocated: whole(object, tags::BITS_ALLOCATED).map_or(16, |bits| bits.clamp(1, 64) as u32),
        signed: whole(object, tags::PIXEL_REPRESENTATION) == Some(1),
        padding,
        phases: phases.map(|(name, tag)| (name, text(object, tag))).into(),
    }
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

impl Groups<'_> {
    /// Returns the numbers of `element` in the functional group `group` of the frame, or else in the file
    /// itself.
    fn numbers(&self, group: Tag, element: Tag) -> Option<Vec<f64>> {
        let of_frame = [self.own, self.shared].into_iter().flatten().find_map(|part| {
            let item = items(part, group)?.first()?;
            numbers(item, element)
        });
        of_frame.or_else(|| {
            numbers(self.file, element).filter(|_| self.alone || element != tags::IMAGE_POSITION_PATIENT)
        })
    }

    fn frame(&self, file: &Arc<FileHeader>, number: u32, size: [usize; 2]) -> Option<Frame> {
        let position = vector(&self.numbers(tags::PLANE_POSITION_SEQUENCE, tags::IMAGE_POSITION_PATIENT)?)?;
        let along = self.numbers(tags::PLANE_ORIENTATION_SEQUENCE, tags::IMAGE_ORIENTATION_PATIENT)?;
        let along = [vector(along.get(..3)?)?, vector(along.get(3..6)?)?];
        let measures = tags::PIXEL_MEASURES_SEQUENCE;
        // Rows come first in the file.
        let spacing = self.numbers(measures, tags::PIXEL_SPACING)?;
        let spacing = [*spacing.get(1)?, *spacing.first()?];
        let unit =
            along.iter().all(|v| (v.length() - 1.0).abs() < 1e-2) && along[0].dot(along[1]).abs() < 1e-2;
        if !unit || !spacing.iter().all(|mm| mm.is_finite() && *mm > 0.0) {
            return None;
        }
        let transformation = tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE;
        let first = |element| Some(*self.numbers(transformation, element)?.first()?);
        let length = |element| {
            let given = self.numbers(measures, element).and_then(|v| v.first().copied());
            given.filter(|mm| mm.is_finite() && *mm > 0.0).unwrap_or(0.0)
        };
        let segment = self
            .numbers(tags::SEGMENT_IDENTIFICATION_SEQUENCE, tags::REFERENCED_SEGMENT_NUMBER)
            .and_then(|numbers| numbers.first().copied());
        Some(Frame {
            file: Arc::clone(file),
            number,
            size,
            spacing,
            along: along.map(DVec3::normalize),
            position,
            thickness: length(tags::SLICE_THICKNESS),
            slice_distance: length(tags::SPACING_BETWEEN_SLICES),
            segment: segment.map(|number| number as i64),
            rescale: [
                first(tags::RESCALE_SLOPE).unwrap_or(1.0),
                first(tags::RESCALE_INTERCEPT).unwrap_or(0.0),
            ],
        })
    }
}

fn vector(numbers: &[f64]) -> Option<DVec3> {
    let vector = DVec3::new(*numbers.first()?, *numbers.get(1)?, *numbers.get(2)?);
    vector.is_finite().then_some(vector)
}

pub(super) fn items(object: &InMemDicomObject, tag: Tag) -> Option<&[InMemDicomObject]> {
    object.get(tag)?.items()
}

pub(super) fn numbers(object: &InMemDicomObject, tag: Tag) -> Option<Vec<f64>> {
    object.get(tag)?.to_multi_float64().ok().filter(|numbers| !numbers.is_empty())
}

/// Returns an integer, which some writers store as a decimal number.
pub(super) fn whole(object: &InMemDicomObject, tag: Tag) -> Option<i64> {
    let element = object.get(tag)?;
    element.to_int::<i64>().ok().or_else(|| element.to_float64().ok().map(|v| v as i64))
}

pub(super) fn text(object: &InMemDicomObject, tag: Tag) -> String {
    let text = object.get(tag).and_then(|element| element.to_str().ok().map(|text| text.into_owned()));
    text.unwrap_or_default().trim_matches(['\0', ' ']).to_owned()
}
