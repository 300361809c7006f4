//! Structures as voxels (DICOM-SEG): for each structure the slices where it is, as bits or as fractions; or
//! slices of labels.
//! Format: <https://dicom.nema.org/medical/dicom/current/output/chtml/part03/sect_C.8.20.2.html>.

use std::borrow::Cow;
use std::collections::BTreeMap;

use dicom_dictionary_std::tags;
use dicom_object::DefaultDicomObject;

use super::elements as e;
use super::geometry::{Arrangement, arrange};
use super::header::{Frame, Skipped, frames};
use super::location::{Location, Opened};
use super::pixels::{self, BIG_ENDIAN};
use super::stacks::{SAME_PLACE_MM, along_normal, are_parallel, normal};
use super::structures::{LabelMap, Structure, chosen, none, other_space};
use crate::affine::RAS_FROM_LPS;
use crate::{Grid, LabelChoice, ReadOptions, Volume};
use base::{Error, Kind, Result};

/// Part of the greatest fraction from which on a voxel belongs to a structure, where it must or must not.
const HALF: f32 = 0.5;

/// Cosine below which two directions count as at a right angle.
const PARALLEL: f64 = 1e-3;
/// Part of the distance of the scan's planes by which a slice may lie beside one of them.
const BESIDE_PLANE: f64 = 0.05;

/// How the voxels of a segmentation are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stored {
    /// A bit for each voxel of a structure.
    Bits,
    /// A part of this greatest number for each voxel of a structure.
    Fractions(f32),
    /// The number of its structure for each voxel; bytes of a number.
    Labels(usize),
}

/// Returns the structures of a segmentation.
///
/// # Errors
/// [`Kind::BadData`] for a damaged file or one without structures.
pub(super) fn structures(location: &Location) -> Result<Vec<Structure>> {
    let Opened { object, .. } = location.open(Some(tags::PIXEL_DATA))?;
    segments(&object).map_err(|e| e.file(&location.path))
}

/// Reads the structures of `options.labels`, or all of them, as a map of labels; a structure that is alone as
/// a mask, soft if it is stored as fractions.
///
/// # Errors
/// [`Kind::BadData`] for a damaged file, slices that do not form one block, or too large a mask;
/// [`Kind::Unavailable`] for pixels that cannot be unpacked; [`Kind::HostMemory`].
pub(super) fn read(location: &Location, options: &ReadOptions) -> Result<Volume> {
    let opened = location.open(None)?;
    let object = &opened.object;
    let named = |e: Error| e.or_file(&location.path);
    let all = segments(object).map_err(named)?;
    let wanted = chosen(&all, &options.labels).map_err(named)?;
    let frames = match frames(location, &opened)? {
        Ok(frames) => frames,
        Err(reason) => return Err(named(placeless(&reason))),
    };
    let stored = stored(object, &frames).map_err(named)?;
    let (arrangement, planes) = planes(&frames, options.grid.as_ref()).map_err(named)?;
    let pixels = bytes(object, location, stored, &frames)?;
    let mask = fill(&frames, &planes, &arrangement, stored, &pixels, &wanted, options).map_err(named)?;
    let (volume, note) = mask;
    let space = &frames[0].file.frame_of_reference;
    let notes = e::of_each_element(&opened.oddities).into_iter().map(|(_, text)| text.clone()).chain(note);
    for note in notes.chain(other_space(space, options)) {
        tracing::warn!("{}: {note}", location.path.display());
    }
    Ok(volume)
}

fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

fn placeless(reason: &Skipped) -> Error {
    let what = match reason {
        Skipped::NoPlace(_) => "its slices have no place in the patient",
        _ => "it has no slices",
    };
    bad("VGS-DCM-004", format!("a segmentation that cannot be read: {what}"))
        .help("export it again, or as NIfTI or NRRD")
}

fn segments(object: &DefaultDicomObject) -> Result<Vec<Structure>> {
    let mut segments = Vec::new();
    for item in e::SEGMENT_SEQUENCE.items(object)?.unwrap_or_default() {
        let number = e::SEGMENT_NUMBER.needed(e::SEGMENT_NUMBER.whole(item)?)?;
        let name = e::SEGMENT_LABEL.text(item)?.unwrap_or_default();
        // Number 0 of a map of labels is what is around the structures.
        if (1..=i64::from(u16::MAX)).contains(&number) {
            segments.push(Structure { number: number as i32, name });
        }
    }
    if segments.is_empty() { Err(none()) } else { Ok(segments) }
}

fn stored(object: &DefaultDicomObject, frames: &[Frame]) -> Result<Stored> {
    let kind = e::SEGMENTATION_TYPE.needed(e::SEGMENTATION_TYPE.text(object)?)?;
    let bits = frames.first().map_or(0, |frame| frame.file.bits_allocated);
    match (kind.as_str(), bits) {
        ("BINARY", 1) => Ok(Stored::Bits),
        ("FRACTIONAL", 8) => {
            let most = e::MAXIMUM_FRACTIONAL_VALUE;
            match most.needed(most.whole(object)?)? {
                value @ 1..=255 => Ok(Stored::Fractions(value as f32)),
                other => Err(most.wrong(&other.to_string(), "1 to 255")),
            }
        }
        ("LABELMAP", 8 | 16) => Ok(Stored::Labels(bits as usize / 8)),
        _ => Err(bad("VGS-DCM-017", format!("a segmentation of type '{kind}' with {bits} bits for a voxel"))
            .help("BINARY, FRACTIONAL and LABELMAP are read; export it again, or as NIfTI or NRRD")),
    }
}

/// Returns the grid of all slices, and the plane of each frame: frames of several structures share planes. Slices
/// that are empty are left out, so the distance of planes is the one that the file gives, or that of the scan's
/// planes if all slices lie on these, or else their thickness.
fn planes(frames: &[Frame], scan: Option<&Grid>) -> Result<(Arrangement, Vec<usize>)> {
    let first = &frames[0];
    if let Some(other) = frames.iter().find(|frame| !are_parallel(first, frame)) {
        let message = format!("frames 1 and {} of the segmentation are not parallel", other.number + 1);
        return Err(bad("VGS-DCM-009", message).help("export it again on the grid of its series"));
    }
    let normal = normal(first);
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by(|&a, &b| along_normal(&frames[a], normal).total_cmp(&along_normal(&frames[b], normal)));
    let mut places: Vec<Frame> = Vec::new();
    let mut place_of = vec![0; frames.len()];
    for i in order {
        let new = places.last().is_none_or(|last| {
            along_normal(&frames[i], normal) - along_normal(last, normal) >= SAME_PLACE_MM
        });
        if new {
            places.push(frames[i].clone());
        }
        place_of[i] = places.len() - 1;
    }
    let known = [
        Some(first.slice_distance),
        scan.and_then(|scan| distance_of_scan(&places, scan)),
        Some(first.thickness),
    ];
    let distances: Vec<f64> = known.into_iter().flatten().filter(|&mm| mm > 0.0).collect();
    let arrangement = arrange(&places, &distances)?;
    let planes = place_of.into_iter().map(|place| arrangement.planes[place]).collect();
    Ok((arrangement, planes))
}

/// Returns the distance of the planes of a scan along the normal of the frames, mm, if its slices are parallel to
/// them and all of them lie on its planes.
fn distance_of_scan(frames: &[Frame], scan: &Grid) -> Option<f64> {
    let normal = normal(&frames[0]);
    let voxel_from_world = scan.world_from_voxel.inverse();
    let ras_normal = RAS_FROM_LPS * normal;
    let across = (0..3).find(|&axis| {
        let others = (0..3).filter(|&other| other != axis);
        others.into_iter().all(|other| {
            let along = scan.world_from_voxel.matrix3.col(other).normalize();
            along.dot(ras_normal).abs() < PARALLEL
        })
    })?;
    let place = |frame: &Frame| voxel_from_world.transform_point3(RAS_FROM_LPS * frame.position)[across];
    let on_plane = |frame: &Frame| (place(frame) - place(frame).round()).abs() <= BESIDE_PLANE;
    let step = scan.world_from_voxel.matrix3.col(across).dot(ras_normal).abs();
    frames.iter().all(on_plane).then_some(step)
}

/// Returns the stored voxels of all frames, as many bytes as there must be.
fn bytes<'a>(
    object: &'a DefaultDicomObject,
    location: &Location,
    stored: Stored,
    frames: &[Frame],
) -> Result<Cow<'a, [u8]>> {
    let file = &frames[0].file;
    let voxels = frames[0].size.iter().product::<usize>() as u64 * frames.len() as u64;
    let (needed, packed) = match stored {
        Stored::Bits => (voxels.div_ceil(8), true),
        Stored::Fractions(_) => (voxels, false),
        Stored::Labels(bytes) => (voxels * bytes as u64, false),
    };
    let plain = object.element(tags::PIXEL_DATA).ok().and_then(|element| element.value().to_bytes().ok());
    let bytes = match plain {
        // Bits are not what the decoders of pictures know.
        Some(plain) if file.transfer_syntax != BIG_ENDIAN => plain,
        _ if packed => {
            let message = format!("bits packed as {}, which are not read", file.transfer_syntax);
            return Err(Error::new(Kind::Unavailable, "VGS-DCM-011", message)
                .file(&location.path)
                .help("unpack the file first: `gdcmconv --raw IN OUT`"));
        }
        _ => {
            pixels::check(file)?;
            Cow::Owned(pixels::decode(object, location)?.data().to_vec())
        }
    };
    if (bytes.len() as u64) < needed {
        let message = format!("expected {needed} bytes for {} frames, got {}", frames.len(), bytes.len());
        return Err(bad("VGS-DCM-012", message)
            .file(&location.path)
            .help("the file is damaged or cut short; copy it again"));
    }
    Ok(bytes)
}

fn fill(
    frames: &[Frame],
    planes: &[usize],
    arrangement: &Arrangement,
    stored: Stored,
    bytes: &[u8],
    wanted: &[Structure],
    options: &ReadOptions,
) -> Result<(Volume, Option<String>)> {
    let grid = Grid { size: arrangement.size, world_from_voxel: arrangement.world_from_voxel };
    let area = grid.size[0] * grid.size[1];
    let mut map = LabelMap::new(grid, wanted, options)?;
    let by_number: BTreeMap<i64, i32> = wanted.iter().map(|s| (i64::from(s.number), s.number)).collect();
    // A structure that is alone keeps its fractions.
    let soft =
        matches!(stored, Stored::Fractions(_)) && wanted.len() == 1 && options.labels == LabelChoice::Whole;
    let mut fractions = if soft { vec![0.0_f32; map.len()] } else { Vec::new() };
    for (frame, plane) in frames.iter().zip(planes) {
        let start = frame.number as usize * area;
        let own = match (stored, frame.segment) {
            (Stored::Labels(_), _) => None,
            (_, Some(segment)) => match by_number.get(&segment) {
                Some(&number) => Some(number),
                None => continue,
            },
            (_, None) => return e::REFERENCED_SEGMENT_NUMBER.needed(None),
        };
        for pixel in 0..area {
            let at = start + pixel;
            let voxel = plane * area + pixel;
            let number = match stored {
                Stored::Bits => own.filter(|_| bytes[at / 8] >> (at % 8) & 1 == 1),
                Stored::Fractions(most) => {
                    let part = (f32::from(bytes[at]) / most).min(1.0);
                    if soft {
                        fractions[voxel] = part;
                    }
                    own.filter(|_| part >= HALF)
                }
                Stored::Labels(1) => by_number.get(&i64::from(bytes[at])).copied(),
                Stored::Labels(_) => {
                    let word = u16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]]);
                    by_number.get(&i64::from(word)).copied()
                }
            };
            if let Some(number) = number {
                map.add(voxel, number);
            }
        }
    }
    let (mut volume, note) = map.finish();
    if soft {
        volume.samples = fractions;
    }
    Ok((volume, note))
}
