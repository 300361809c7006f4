//! Structures as contours (RTSTRUCT): polygons in the planes of the slices, in mm.
//!
//! A voxel is inside if its centre is, by the even-odd rule of all contours of the structure in its plane, so a
//! contour within another one is a hole. A centre on a contour is inside: programs that make contours of masks
//! lead them through the centres of the outermost voxels. Each slice takes the contours that lie nearest to it, up to half the
//! usual distance of contours away.
//! Format: <https://dicom.nema.org/medical/dicom/current/output/chtml/part03/sect_C.8.8.6.html>.

use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, InMemDicomObject};
use glam::{DVec2, DVec3};

use super::header::{items, numbers, text, whole};
use super::location::Location;
use super::structures::{LabelMap, Structure, chosen, none};
use crate::volume::affine::RAS_FROM_LPS;
use crate::volume::{Grid, ReadOptions, Volume};
use crate::{Error, Kind, Result};

/// How far the points of a contour may lie beside its plane, voxels to either side.
const BESIDE: f64 = 0.5;
/// Distance up to which contours count as lying in one plane, voxels.
const SAME_PLANE: f64 = 0.05;

/// Rounding of places that are written as decimal numbers, voxels.
const ROUNDING: f64 = 1e-3;

/// A contour: points in voxel space.
type Contour = Vec<DVec3>;

/// Returns the structures of a structure set.
///
/// # Errors
/// [`Kind::BadData`] for a damaged file or one without structures.
pub(super) fn structures(location: &Location) -> Result<Vec<Structure>> {
    let object = location.open(Some(tags::PIXEL_DATA))?;
    Ok(rois(&object)
        .map_err(|e| e.file(&location.path))?
        .into_iter()
        .map(|(_, structure)| structure)
        .collect())
}

/// Reads the structures of `options.labels`, or all of them, as a map of labels on `options.grid`; a structure
/// that is alone as a mask.
///
/// # Errors
/// [`Kind::Usage`] without a grid; [`Kind::BadData`] for a damaged file, or contours across the slices;
/// [`Kind::HostMemory`].
pub(super) fn read(location: &Location, options: &ReadOptions) -> Result<Volume> {
    read_contours(location, options).map_err(|e| if e.file.is_some() { e } else { e.file(&location.path) })
}

fn read_contours(location: &Location, options: &ReadOptions) -> Result<Volume> {
    let Some(grid) = options.grid else {
        let message = "contours become voxels only on the grid of a volume";
        return Err(Error::new(Kind::Usage, "VGS-DCM-018", message)
            .help("give the file as the mask of its scan, with --roi"));
    };
    let object = location.open(Some(tags::PIXEL_DATA))?;
    let rois = rois(&object)?;
    let all: Vec<_> = rois.iter().map(|(_, structure)| structure.clone()).collect();
    let wanted = chosen(&all, &options.labels);
    let mut map = LabelMap::new(grid, &wanted, options)?;
    let voxel_from_world = grid.world_from_voxel.inverse();
    let mut open = 0;
    for item in items(&object, tags::ROI_CONTOUR_SEQUENCE).unwrap_or_default() {
        let number = whole(item, tags::REFERENCED_ROI_NUMBER);
        let structure = rois.iter().find(|(own, _)| Some(*own) == number).map(|(_, structure)| structure);
        let Some(structure) = structure.filter(|structure| wanted.contains(structure)) else { continue };
        let mut contours = Vec::new();
        for contour in items(item, tags::CONTOUR_SEQUENCE).unwrap_or_default() {
            if !text(contour, tags::CONTOUR_GEOMETRIC_TYPE).starts_with("CLOSED_PLANAR") {
                open += 1;
                continue;
            }
            let points = points(contour, &structure.name)?;
            if points.len() > 2 {
                contours.push(points.into_iter().map(|p| voxel_from_world.transform_point3(p)).collect());
            }
        }
        fill(&contours, structure, &grid, &mut map)?;
    }
    let (volume, note) = map.finish();
    let left_out = (open > 0).then(|| format!("{open} points and open lines enclose nothing: left out"));
    for note in note.into_iter().chain(left_out) {
        tracing::warn!("{}: {note}", location.path.display());
    }
    Ok(volume)
}

/// Returns the structures with the numbers that the file gives them. If one of these cannot be a label, all are
/// numbered anew, in the order of the file.
fn rois(object: &DefaultDicomObject) -> Result<Vec<(i64, Structure)>> {
    let items = items(object, tags::STRUCTURE_SET_ROI_SEQUENCE).unwrap_or_default();
    let given: Vec<_> = items
        .iter()
        .filter_map(|item| Some((whole(item, tags::ROI_NUMBER)?, text(item, tags::ROI_NAME))))
        .collect();
    let usable = given.iter().all(|(number, _)| (1..=i64::from(u16::MAX)).contains(number));
    let structure = |(i, (own, name)): (usize, (i64, String))| {
        let number = if usable { own as i32 } else { i as i32 + 1 };
        (own, Structure { number, name })
    };
    let rois: Vec<_> = given.into_iter().enumerate().map(structure).collect();
    if rois.is_empty() { Err(none()) } else { Ok(rois) }
}

/// Returns the points of a contour, mm RAS.
fn points(contour: &InMemDicomObject, name: &str) -> Result<Vec<DVec3>> {
    let numbers = numbers(contour, tags::CONTOUR_DATA).unwrap_or_default();
    if !numbers.len().is_multiple_of(3) || !numbers.iter().all(|v| v.is_finite()) {
        let message = format!("a contour of '{name}' has {} numbers, which are no points", numbers.len());
        return Err(
            Error::new(Kind::BadData, "VGS-DCM-019", message).help("the file is damaged; copy it again")
        );
    }
    let point = |p: &[f64]| RAS_FROM_LPS * DVec3::new(p[0], p[1], p[2]);
    Ok(numbers.chunks_exact(3).map(point).collect())
}

/// Gives the voxels inside the contours of a structure to it.
fn fill(contours: &[Contour], structure: &Structure, grid: &Grid, map: &mut LabelMap) -> Result<()> {
    let Some(axis) = across(contours) else { return Ok(()) };
    let mut planes: Vec<(f64, Vec<&Contour>)> = Vec::new();
    let mut places = Vec::new();
    for contour in contours {
        let ends = contour.iter().map(|p| p[axis]);
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
    let usual = distances.get(distances.len() / 2).copied().unwrap_or(1.0).max(1.0);
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
    Ok(())
}

/// Returns the voxel axis that the contours lie across; `None` if there are none.
fn across(contours: &[Contour]) -> Option<usize> {
    let extent = |axis: usize| {
        contours.iter().map(move |contour| {
            let ends = contour.iter().map(|p| p[axis]);
            ends.clone().fold(f64::NEG_INFINITY, f64::max) - ends.fold(f64::INFINITY, f64::min)
        })
    };
    if contours.is_empty() {
        return None;
    }
    (0..3).min_by(|&a, &b| extent(a).sum::<f64>().total_cmp(&extent(b).sum::<f64>()))
}

/// Calls `add` for the voxels of a slice across `axis` whose centres are inside an odd number of contours, or
/// on one.
fn fill_slice(contours: &[&Contour], axis: usize, slice: usize, grid: &Grid, mut add: impl FnMut(usize)) {
    let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
    let strides = [1, grid.size[0], grid.size[0] * grid.size[1]];
    let [columns, rows] = [grid.size[u], grid.size[v]];
    let index = |column: usize, row: usize| column * strides[u] + row * strides[v] + slice * strides[axis];
    let ends = || contours.iter().flat_map(|contour| contour.iter().map(|p| p[v]));
    let low = ends().fold(f64::INFINITY, f64::min).ceil().max(0.0);
    let high = ends().fold(f64::NEG_INFINITY, f64::max).floor().min(rows as f64 - 1.0);
    let mut row = low;
    let mut crossings = Vec::new();
    while row <= high {
        crossings.clear();
        for contour in contours {
            let previous = contour.iter().cycle().skip(contour.len() - 1);
            for (a, b) in previous.zip(contour.iter()) {
                if (a[v] <= row) != (b[v] <= row) {
                    crossings.push(a[u] + (row - a[v]) / (b[v] - a[v]) * (b[u] - a[u]));
                }
            }
        }
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let from = pair[0].ceil().clamp(0.0, columns as f64) as usize;
            let to = pair[1].ceil().clamp(0.0, columns as f64) as usize;
            for column in from..to {
                add(index(column, row as usize));
            }
        }
        row += 1.0;
    }
    for contour in contours {
        let previous = contour.iter().cycle().skip(contour.len() - 1);
        for (a, b) in previous.zip(contour.iter()) {
            let edge = [[a[u], a[v]], [b[u], b[v]]].map(DVec2::from_array);
            on_edge(edge, [columns, rows], |column, row| add(index(column, row)));
        }
    }
}

/// Calls `add` for the pixels of a slice of this size whose centres are on an edge of a contour.
fn on_edge([a, b]: [DVec2; 2], size: [usize; 2], mut add: impl FnMut(usize, usize)) {
    // Along the longer side of the edge there is at most one pixel for each step.
    let along = usize::from((b - a).abs().y > (b - a).abs().x);
    let across = 1 - along;
    let length = b[along] - a[along];
    let last = size.map(|n| n as f64 - 1.0);
    let end = (a[along].max(b[along]) + ROUNDING).floor().min(last[along]);
    let mut step = (a[along].min(b[along]) - ROUNDING).ceil().max(0.0);
    while step <= end {
        let share = if length == 0.0 { 0.0 } else { ((step - a[along]) / length).clamp(0.0, 1.0) };
        let at = a[across] + share * (b[across] - a[across]);
        let pixel = at.round();
        if (at - pixel).abs() <= ROUNDING && (0.0..=last[across]).contains(&pixel) {
            let mut place = [0; 2];
            (place[along], place[across]) = (step as usize, pixel as usize);
            add(place[0], place[1]);
        }
        step += 1.0;
    }
}
