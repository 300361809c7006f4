//! Structures as contours (RTSTRUCT): polygons in the planes of the slices, in mm.
//!
//! A voxel is inside if its centre is: inside of any contour of the structure in its plane, but a contour that lies
//! wholly within another one is a hole in it, one within the hole is not, and so on. Contours of type
//! CLOSEDPLANAR_XOR count by the even-odd rule of all of them. A centre on a contour is inside: programs that make
//! contours of masks lead them through the centres of the outermost voxels. Each slice takes the contours that lie
//! nearest to it, up to half the usual distance of contours away.
//! Format: <https://dicom.nema.org/medical/dicom/current/output/chtml/part03/sect_C.8.8.6.html>.

use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, InMemDicomObject};
use glam::{DVec2, DVec3};

use super::elements as e;
use super::location::{Location, Opened};
use super::polygon::{Polygon, ROUNDING};
use super::structures::{LabelMap, Structure, chosen, none, other_space};
use crate::affine::RAS_FROM_LPS;
use crate::{Grid, ReadOptions, Volume};
use base::{Error, Kind, Result};

/// How far the points of a contour may lie beside its plane, voxels to either side.
const BESIDE: f64 = 0.5;
/// Distance up to which contours count as lying in one plane, voxels.
const SAME_PLANE: f64 = 0.05;

/// What a contour encloses together with the others of its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rule {
    /// All that one of them encloses, less the holes (CLOSED_PLANAR).
    Union,
    /// What an odd number of them enclose (CLOSEDPLANAR_XOR).
    Parity,
}

/// Terms of the standard for closed contours. Some programs write the second with one more underline.
const CLOSED: [(&str, Rule); 3] =
    [("CLOSED_PLANAR", Rule::Union), ("CLOSEDPLANAR_XOR", Rule::Parity), ("CLOSED_PLANAR_XOR", Rule::Parity)];

/// A closed contour.
struct Contour {
    rule: Rule,
    /// Points in voxel space.
    points: Vec<DVec3>,
}

/// A structure of the file.
struct RoiRow {
    /// Number that the file gives it.
    own: i64,
    structure: Structure,
    /// UID of the space of its contours; empty if the file does not name it.
    space: String,
}

/// Returns the structures of a structure set.
///
/// # Errors
/// [`Kind::BadData`] for a damaged file or one without structures.
pub(super) fn structures(location: &Location) -> Result<Vec<Structure>> {
    let Opened { object, .. } = location.open(Some(tags::PIXEL_DATA))?;
    let rois = rois(&object).map_err(|e| e.file(&location.path))?;
    Ok(rois.into_iter().map(|roi| roi.structure).collect())
}

/// Reads the structures of `options.labels`, or all of them, as a map of labels on `options.grid`; a structure
/// that is alone as a mask.
///
/// # Errors
/// [`Kind::Usage`] without a grid; [`Kind::BadData`] for a damaged file, or contours across the slices;
/// [`Kind::HostMemory`].
pub(super) fn read(location: &Location, options: &ReadOptions) -> Result<Volume> {
    read_contours(location, options).map_err(|e| e.or_file(&location.path))
}

fn read_contours(location: &Location, options: &ReadOptions) -> Result<Volume> {
    let Some(grid) = options.grid else {
        let message = "contours become voxels only on the grid of a volume";
        return Err(Error::new(Kind::Usage, "VGS-DCM-018", message)
            .help("give the file as the mask of its scan, with --roi"));
    };
    let Opened { object, oddities } = location.open(Some(tags::PIXEL_DATA))?;
    let rois = rois(&object)?;
    let all: Vec<_> = rois.iter().map(|roi| roi.structure.clone()).collect();
    let wanted = chosen(&all, &options.labels)?;
    let mut map = LabelMap::new(grid, &wanted, options)?;
    let voxel_from_world = grid.world_from_voxel.inverse();
    let mut open = 0;
    let mut notes: Vec<String> = e::of_each_element(&oddities).iter().map(|(_, text)| text.clone()).collect();
    for item in e::ROI_CONTOUR_SEQUENCE.items(&object)?.unwrap_or_default() {
        let number = e::REFERENCED_ROI_NUMBER.needed(e::REFERENCED_ROI_NUMBER.whole(item)?)?;
        let Some(roi) = rois.iter().find(|roi| roi.own == number) else { continue };
        if !wanted.contains(&roi.structure) {
            continue;
        }
        let mut contours = Vec::new();
        for contour in e::CONTOUR_SEQUENCE.items(item)?.unwrap_or_default() {
            let kind = e::CONTOUR_GEOMETRIC_TYPE.needed(e::CONTOUR_GEOMETRIC_TYPE.text(contour)?)?;
            let Some((_, rule)) = CLOSED.iter().find(|(term, _)| *term == kind) else {
                open += 1;
                continue;
            };
            let points = points(contour, &roi.structure.name)?;
            if points.len() > 2 {
                let points = points.into_iter().map(|p| voxel_from_world.transform_point3(p)).collect();
                contours.push(Contour { rule: *rule, points });
            }
        }
        notes.extend(fill(&contours, &roi.structure, &grid, &mut map)?);
        notes.extend(other_space(&roi.space, options).filter(|note| !notes.contains(note)));
    }
    let (volume, note) = map.finish();
    let left_out = (open > 0).then(|| format!("{open} points and open lines enclose nothing: left out"));
    for note in notes.into_iter().chain(note).chain(left_out) {
        tracing::warn!("{}: {note}", location.path.display());
    }
    Ok(volume)
}

/// Returns the structures with the numbers that the file gives them. If one of these cannot be a label, all are
/// numbered anew, in the order of the file.
fn rois(object: &DefaultDicomObject) -> Result<Vec<RoiRow>> {
    let mut rois = Vec::new();
    for item in e::STRUCTURE_SET_ROI_SEQUENCE.items(object)?.unwrap_or_default() {
        let own = e::ROI_NUMBER.needed(e::ROI_NUMBER.whole(item)?)?;
        let name = e::ROI_NAME.text(item)?.unwrap_or_default();
        let space = e::REFERENCED_FRAME_OF_REFERENCE_UID.text(item)?.unwrap_or_default();
        let number =
            i32::try_from(own).ok().filter(|own| (1..=i32::from(u16::MAX)).contains(own)).unwrap_or(0);
        rois.push(RoiRow { own, structure: Structure { number, name }, space });
    }
    if rois.iter().any(|roi| roi.structure.number == 0) {
        rois.iter_mut().zip(1..).for_each(|(roi, number)| roi.structure.number = number);
    }
    if rois.is_empty() { Err(none()) } else { Ok(rois) }
}

/// Returns the points of a contour, mm RAS.
fn points(contour: &InMemDicomObject, name: &str) -> Result<Vec<DVec3>> {
    let numbers = e::CONTOUR_DATA.needed(e::CONTOUR_DATA.numbers(contour)?)?;
    if !numbers.len().is_multiple_of(3) {
        let message = format!("a contour of '{name}' has {} numbers, which are no points", numbers.len());
        return Err(
            Error::new(Kind::BadData, "VGS-DCM-019", message).help("the file is damaged; copy it again")
        );
    }
    let point = |p: &[f64]| RAS_FROM_LPS * DVec3::new(p[0], p[1], p[2]);
    Ok(numbers.chunks_exact(3).map(point).collect())
}

/// Gives the voxels inside the contours of a structure to it. Returns a note if there are fewer planes of contours
/// than slices.
fn fill(
    contours: &[Contour],
    structure: &Structure,
    grid: &Grid,
    map: &mut LabelMap,
) -> Result<Option<String>> {
    let Some(axis) = across(contours) else { return Ok(None) };
    let mut planes: Vec<(f64, Vec<&Contour>)> = Vec::new();
    let mut places = Vec::new();
    for contour in contours {
        let ends = contour.points.iter().map(|p| p[axis]);
        let low = ends.clone().fold(f64::INFINITY, f64::min);
        let high = ends.fold(f64::NEG_INFINITY, f64::max);
        if high - low > 2.0 * BESIDE {
            let message = format!("contours of '{}' lie across the slices of the volume", structure.name);
            return Err(Error::new(Kind::BadData, "VGS-DCM-019", message)
                .help("give the scan on which they were drawn, in its own slices"));
        }
        places.push(((low + high) / 2.0, contour));
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (place, contour) in places {
        match planes.last_mut().filter(|(last, _)| place - *last <= SAME_PLANE) {
            Some((_, plane)) => plane.push(contour),
            None => planes.push((place, vec![contour])),
        }
    }
    let mut distances: Vec<f64> = planes.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    distances.sort_by(f64::total_cmp);
    // Of two the lesser one: a piece far away does not make the others thicker.
    let usual = distances.get(distances.len().saturating_sub(1) / 2).copied().unwrap_or(1.0).max(1.0);
    // Midway between two contours a slice takes the upper one, so that each stands for as many slices.
    let reaches = |place: f64, slice: f64| {
        let beyond = slice - place + ROUNDING;
        -usual / 2.0 <= beyond && beyond < usual / 2.0
    };
    let [first, last] = [planes.first(), planes.last()].map(|plane| plane.map_or(0.0, |plane| plane.0));
    let end = (last + usual).floor().min(grid.size[axis] as f64 - 1.0);
    let mut slice = (first - usual).ceil().max(0.0);
    while slice <= end {
        let within = planes.iter().filter(|(place, _)| reaches(*place, slice));
        if let Some((_, plane)) = within.min_by(|a, b| (a.0 - slice).abs().total_cmp(&(b.0 - slice).abs())) {
            fill_slice(plane, axis, slice as usize, grid, |voxel| map.add(voxel, structure.number));
        }
        slice += 1.0;
    }
    let each = usual.round() as usize;
    Ok((each > 1).then(|| {
        format!(
            "'{}' is drawn on every {} slice of the scan alone: each contour stands for {each} slices",
            structure.name,
            ordinal(each)
        )
    }))
}

fn ordinal(n: usize) -> String {
    let end = match (n % 10, n % 100) {
        (1, tens) if tens != 11 => "st",
        (2, tens) if tens != 12 => "nd",
        (3, tens) if tens != 13 => "rd",
        _ => "th",
    };
    format!("{n}{end}")
}

/// Returns the voxel axis that the contours lie across; `None` if there are none.
fn across(contours: &[Contour]) -> Option<usize> {
    let extent = |axis: usize| {
        contours.iter().map(move |contour| {
            let ends = contour.points.iter().map(|p| p[axis]);
            ends.clone().fold(f64::NEG_INFINITY, f64::max) - ends.fold(f64::INFINITY, f64::min)
        })
    };
    if contours.is_empty() {
        return None;
    }
    (0..3).min_by(|&a, &b| extent(a).sum::<f64>().total_cmp(&extent(b).sum::<f64>()))
}

/// Calls `add` for the voxels of a slice across `axis` that the contours of a plane enclose.
fn fill_slice(contours: &[&Contour], axis: usize, slice: usize, grid: &Grid, mut add: impl FnMut(usize)) {
    let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
    let strides = [1, grid.size[0], grid.size[0] * grid.size[1]];
    let size = [grid.size[u], grid.size[v]];
    let of_rule = |rule: Rule| {
        let own = contours.iter().filter(move |contour| contour.rule == rule);
        own.map(|contour| Polygon::new(contour.points.iter().map(|p| DVec2::new(p[u], p[v])).collect()))
            .collect()
    };
    let mut inside = vec![false; size[0] * size[1]];
    let parity: Vec<Polygon> = of_rule(Rule::Parity);
    let mut mark = |at: usize| inside[at] = true;
    fill_odd(&parity, size, &mut mark);
    parity.iter().for_each(|polygon| polygon.edge_pixels(size, &mut mark));
    let solid = without_doubles(of_rule(Rule::Union));
    let depths = depths(&solid);
    for (i, polygon) in solid.iter().enumerate().filter(|(i, _)| depths[*i].is_multiple_of(2)) {
        let holes = (0..solid.len()).filter(|&j| depths[j] % 2 == 1 && solid[j].is_within(&solid[i]));
        let mut hole = vec![false; inside.len()];
        for j in holes {
            fill_odd(std::slice::from_ref(&solid[j]), size, |at| hole[at] = true);
            // The edge of a hole belongs to what is around it.
            solid[j].edge_pixels(size, |at| hole[at] = false);
        }
        let mut mark = |at: usize| inside[at] |= !hole[at];
        fill_odd(std::slice::from_ref(polygon), size, &mut mark);
        polygon.edge_pixels(size, &mut mark);
    }
    for (at, _) in inside.into_iter().enumerate().filter(|(_, inside)| *inside) {
        add(at % size[0] * strides[u] + at / size[0] * strides[v] + slice * strides[axis]);
    }
}

/// Returns how many contours each one lies within, one within the other.
fn depths(polygons: &[Polygon]) -> Vec<usize> {
    let around: Vec<Vec<usize>> = (0..polygons.len())
        .map(|i| (0..polygons.len()).filter(|&j| j != i && polygons[i].is_within(&polygons[j])).collect())
        .collect();
    let mut depths = vec![0; polygons.len()];
    // A chain of contours is no longer than there are contours.
    for _ in 0..polygons.len() {
        for i in 0..polygons.len() {
            depths[i] = around[i].iter().map(|&j| depths[j] + 1).max().unwrap_or(0);
        }
    }
    depths
}

/// Returns polygons without those that stand there twice: in either direction, begun at any point.
fn without_doubles(polygons: Vec<Polygon>) -> Vec<Polygon> {
    let mut kept: Vec<Polygon> = Vec::with_capacity(polygons.len());
    for polygon in polygons {
        if !kept.iter().any(|other| polygon.is_within(other) && other.is_within(&polygon)) {
            kept.push(polygon);
        }
    }
    kept
}

/// Calls `add` for the pixels of a slice of this size whose centres are inside an odd number of polygons.
fn fill_odd(polygons: &[Polygon], size: [usize; 2], mut add: impl FnMut(usize)) {
    let low = polygons.iter().map(|p| p.low.y).fold(f64::INFINITY, f64::min).ceil().max(0.0);
    let high = polygons.iter().map(|p| p.high.y).fold(f64::NEG_INFINITY, f64::max).floor();
    let high = high.min(size[1] as f64 - 1.0);
    let mut row = low;
    while row <= high {
        let mut crossings: Vec<f64> = polygons.iter().flat_map(|polygon| polygon.crossings(row)).collect();
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let [from, to] = [pair[0], pair[1]].map(|x| x.ceil().clamp(0.0, size[0] as f64) as usize);
            (from..to).for_each(|column| add(column + size[0] * row as usize));
        }
        row += 1.0;
    }
}
