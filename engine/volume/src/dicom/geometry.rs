//! The planes of a stack in space.

use glam::{DAffine3, DVec3};

use super::header::Frame;
use super::stacks::{along_normal, doubled, name, normal};
use crate::affine::{RAS_FROM_LPS, grid};
use base::{Error, Kind, Result};

/// Part of the plane distance by which a slice may lie beside its plane: writers round positions.
const BESIDE: f64 = 0.05;
/// Part of the plane distance by which some slices may lie beside their planes, with a note.
const OFF: f64 = 0.25;
/// One in so many slices may, and one in any case.
const ONE_OFF_IN: usize = 10;
/// Most parts into which the usual slice distance is divided to find a plane distance for uneven slices.
const PARTS: u32 = 8;
/// Part of a pixel by which slices may shift against the line through the first and the last one.
const SIDEWAYS: f64 = 0.1;
/// Part of a pixel by which they may, with a note.
const OFF_SIDEWAYS: f64 = 0.5;
/// Angle between the line of slices and their normal above which a tilt is reported, degrees.
const TILT_DEGREES: f64 = 0.05;

/// A regular grid on which the slices of a stack lie.
#[derive(Clone, Debug)]
pub(super) struct Arrangement {
    /// Voxel counts along columns, rows and planes.
    pub size: [usize; 3],
    /// Map from voxels to mm RAS.
    pub world_from_voxel: DAffine3,
    /// The plane of each frame, in the order of the frames, ascending. Other planes have no values.
    pub planes: Vec<usize>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Finds the regular planes that all slices of a stack lie on; `frames` are parallel, in the order of their
/// places, and at least one. Planes as far apart as one of `distances`, mm, are tried first, in their order: a mask may
/// leave out slices everywhere.
///
/// # Errors
/// [`Kind::BadData`] if two slices lie at one place, shift sideways, or lie on no regular planes.
pub(super) fn arrange(frames: &[Frame], distances: &[f64]) -> Result<Arrangement> {
    let first = &frames[0];
    let normal = normal(first);
    let mut notes = Vec::new();
    if let Some([a, b]) = doubled(frames) {
        let message =
            format!("two slices lie at one place, {} and {}, and nothing tells them apart", name(a), name(b));
        return Err(bad("VGS-DCM-007", message)
            .help("export one volume of the series (one phase, one echo) into a folder of its own"));
    }
    let positions: Vec<f64> =
        frames.iter().map(|frame| along_normal(frame, normal) - along_normal(first, normal)).collect();
    let given =
        distances.iter().filter(|_| frames.len() > 1).find_map(|&mm| on_planes(&positions, mm, BESIDE));
    let (planes, step) = match given {
        Some(found) => found,
        None => planes(&positions, distances.first().copied().unwrap_or(first.thickness), &mut notes)?,
    };
    let last = planes.last().copied().unwrap_or(0);
    // The line goes through slices that lie where they should: through the first and the last of these.
    let [from, to] = ends(&positions, &planes);
    let step = match planes[to] - planes[from] {
        0 => normal * step,
        count => (frames[to].position - frames[from].position) / count as f64,
    };
    let origin = frames[from].position - step * planes[from] as f64;
    check_line(frames, &planes, origin, step, &mut notes)?;
    let tilt = (step.dot(normal) / step.length()).clamp(-1.0, 1.0).acos().to_degrees();
    if tilt > TILT_DEGREES {
        notes.push(format!(
            "the gantry was tilted by {tilt:.1} degrees: the grid is sheared by it, not resampled"
        ));
    }
    let [columns, rows] = first.size;
    let axes = [first.along[0] * first.spacing[0], first.along[1] * first.spacing[1], step];
    Ok(Arrangement {
        size: [columns, rows, last + 1],
        world_from_voxel: grid(axes, origin, RAS_FROM_LPS),
        planes,
        notes,
    })
}

fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns the plane of each position (mm from the first, ascending), and the distance of planes, mm.
fn planes(positions: &[f64], thickness: f64, notes: &mut Vec<String>) -> Result<(Vec<usize>, f64)> {
    let mut distances: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    distances.sort_by(f64::total_cmp);
    let (Some(&least), Some(&most)) = (distances.first(), distances.last()) else {
        if thickness == 0.0 {
            notes.push("there is one slice, and its thickness is not told: 1 mm is assumed".to_owned());
        }
        return Ok((vec![0], if thickness > 0.0 { thickness } else { 1.0 }));
    };
    let usual = distances[distances.len() / 2];
    for parts in 1..=PARTS {
        let strict = on_planes(positions, usual / f64::from(parts), BESIDE);
        let loose = || on_planes(positions, usual, OFF).filter(|(planes, _)| few_are_off(positions, planes));
        let Some((planes, step)) = strict.or_else(|| (parts == 1).then(loose).flatten()) else { continue };
        let empty = planes.last().copied().unwrap_or(0) + 1 - planes.len();
        if empty == 0 {
            return Ok((planes, step));
        }
        let what = match parts {
            1 => gaps(&planes, step, positions),
            _ => format!("slices are {least:.2} to {most:.2} mm apart"),
        };
        notes.push(format!(
            "{what}: the grid has planes {step:.3} mm apart, {empty} of {} without values",
            empty + planes.len()
        ));
        return Ok((planes, step));
    }
    let message = format!("slices are {least:.2} to {most:.2} mm apart, on no regular planes");
    Err(bad("VGS-DCM-008", message)
        .help("reconstruct or resample the series with one distance, for instance by dcm2niix or 3D Slicer"))
}

/// Returns the plane of each position and the exact distance of planes, mm, if all positions lie on planes
/// about `step` mm apart, but for this part of it; `None` otherwise.
fn on_planes(positions: &[f64], step: f64, beside: f64) -> Option<(Vec<usize>, f64)> {
    // Counted from one to the next, since the error of an inexact step adds up.
    let mut planes = vec![0_usize];
    for pair in positions.windows(2) {
        let count = ((pair[1] - pair[0]) / step).round();
        if !(1.0..1e6).contains(&count) {
            return None;
        }
        planes.push(planes.last()? + count as usize);
    }
    let (exact, off) = off_line(positions, &planes, ends(positions, &planes))?;
    off.iter().all(|off| off.abs() <= beside * exact).then_some((planes, exact))
}

/// Returns the distance of planes, mm, where the line of planes goes through two of the positions, and how far each
/// position lies beyond its plane, mm; `None` for one position.
fn off_line(positions: &[f64], planes: &[usize], [from, to]: [usize; 2]) -> Option<(f64, Vec<f64>)> {
    let count = planes[to].checked_sub(planes[from]).filter(|&count| count > 0)?;
    let step = (positions[to] - positions[from]) / count as f64;
    let off =
        |(at, &plane): (&f64, &usize)| at - positions[from] - step * (plane as f64 - planes[from] as f64);
    Some((step, positions.iter().zip(planes).map(off).collect()))
}

/// Returns the two positions that the line of planes goes through: those at the ends, or the next ones if one at an
/// end alone lies off.
fn ends(positions: &[f64], planes: &[usize]) -> [usize; 2] {
    let last = positions.len() - 1;
    let whole = [0, last];
    if last < 3 {
        return whole;
    }
    // All but the one that lies farthest off count, unless rounding explains that one as well.
    let off = |ends: &[usize; 2]| {
        let Some((step, off)) = off_line(positions, planes, *ends) else { return f64::INFINITY };
        let mut off: Vec<f64> = off.iter().map(|off| off.abs() / step).collect();
        off.sort_by(f64::total_cmp);
        if off[last] <= BESIDE { 0.0 } else { off[last - 1] }
    };
    let by_fit = |a: &[usize; 2], b: &[usize; 2]| off(a).total_cmp(&off(b));
    [whole, [1, last], [0, last - 1]].into_iter().min_by(by_fit).unwrap_or(whole)
}

/// Returns true if no more slices lie beside their planes than a slip explains.
fn few_are_off(positions: &[f64], planes: &[usize]) -> bool {
    let Some((step, off)) = off_line(positions, planes, ends(positions, planes)) else { return false };
    let count = off.iter().filter(|off| off.abs() > BESIDE * step).count();
    positions.len() > 3 && count <= (positions.len() / ONE_OFF_IN).max(1)
}

/// Returns a text that says where slices are missing.
fn gaps(planes: &[usize], step: f64, positions: &[f64]) -> String {
    let pairs = planes.windows(2).zip(positions.windows(2)).enumerate();
    let gaps: Vec<_> = pairs.filter(|(_, (planes, _))| planes[1] - planes[0] > 1).collect();
    let told = gaps.iter().take(3).map(|(i, (_, at))| {
        let (from, to) = (i + 1, i + 2);
        format!("{:.1} mm between slices {from} and {to}", at[1] - at[0])
    });
    let told: Vec<_> = told.collect();
    let more = if gaps.len() > told.len() {
        format!(" and {} more", gaps.len() - told.len())
    } else {
        String::new()
    };
    format!("slices are missing, {}{more}, where {step:.2} mm is usual", told.join(", "))
}

/// Refuses slices that do not lie on one line, and notes those that lie off a little; `step` leads from plane to
/// plane, mm.
fn check_line(
    frames: &[Frame],
    planes: &[usize],
    origin: DVec3,
    step: DVec3,
    notes: &mut Vec<String>,
) -> Result<()> {
    let first = &frames[0];
    let normal = normal(first);
    let pixel = first.spacing[0].min(first.spacing[1]);
    let beside = BESIDE * step.length();
    let mut worst: Option<(f64, &Frame)> = None;
    let mut count = 0;
    for (frame, &plane) in frames.iter().zip(planes) {
        let off = frame.position - origin - step * plane as f64;
        let along = off.dot(normal).abs();
        let sideways = (off - normal * off.dot(normal)).length();
        if sideways > OFF_SIDEWAYS * pixel + beside {
            let message =
                format!("{} lies {:.2} mm beside the line of the other slices", name(frame), off.length());
            return Err(bad("VGS-DCM-009", message).help(
                "the slices do not form one block; export the original series, not a reformatted one",
            ));
        }
        if sideways > SIDEWAYS * pixel + beside || along > beside {
            count += 1;
            if worst.is_none_or(|(most, _)| off.length() > most) {
                worst = Some((off.length(), frame));
            }
        }
    }
    if let Some((off, frame)) = worst {
        notes.push(format!(
            "{count} of {} slices lie beside their places, {} the farthest, {off:.2} mm: they are taken as if they lay \
             there",
            frames.len(),
            name(frame)
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes_of(positions: &[f64]) -> (Vec<usize>, f64, Vec<String>) {
        let mut notes = Vec::new();
        let (planes, step) = planes(positions, 0.0, &mut notes).unwrap();
        (planes, step, notes)
    }

    #[test]
    fn even_slices_have_a_plane_each() {
        let (planes, step, notes) = planes_of(&[0.0, 2.5, 5.0, 7.5]);
        assert_eq!((planes, notes), (vec![0, 1, 2, 3], vec![]));
        assert!((step - 2.5).abs() < 1e-12);
        // Rounded to a tenth: 0.625 mm apart.
        let rounded: Vec<f64> = (0..400).map(|i| (f64::from(i) * 6.25).round() / 10.0).collect();
        assert!(planes_of(&rounded).1 - 0.625 < 1e-3);
    }

    #[test]
    fn what_is_missing_is_told_in_mm() {
        let (planes, step, notes) = planes_of(&[0.0, 5.0, 10.0, 212.5, 217.5]);
        assert_eq!(planes.len(), 5);
        assert!(step > 0.0 && notes.len() == 1, "{notes:?}");
        let (planes, _, notes) = planes_of(&[0.0, 5.0, 10.0, 25.0, 30.0]);
        assert_eq!(planes, [0, 1, 2, 5, 6]);
        assert!(
            notes[0].contains("15.0 mm between slices 3 and 4") && notes[0].contains("2 of 7"),
            "{notes:?}"
        );
    }

    #[test]
    fn uneven_slices_lie_on_finer_planes() {
        let (planes, step, notes) = planes_of(&[0.0, 5.0, 7.5, 12.5, 17.5]);
        assert_eq!(planes, [0, 2, 3, 5, 7]);
        assert!((step - 2.5).abs() < 1e-12 && notes[0].contains("2.50 to 5.00 mm"), "{notes:?}");
        let mut notes = Vec::new();
        let error = planes_error(&[0.0, 1.0, 2.618, 5.236, 6.0, 9.47], &mut notes);
        assert_eq!(error.code, "VGS-DCM-008");
    }

    #[test]
    fn a_slice_a_little_off_is_on_its_plane() {
        let even: Vec<f64> = (0..8).map(|i| 2.5 * f64::from(i)).collect();
        for off in 0..8 {
            for slip in [-0.2, 0.2] {
                let mut places = even.clone();
                places[off] += slip;
                let (planes, step, notes) = planes_of(&places);
                assert_eq!(planes, [0, 1, 2, 3, 4, 5, 6, 7], "{places:?}");
                assert!((step - 2.5).abs() < 1e-9 && notes.is_empty(), "{places:?}: {step} {notes:?}");
            }
        }
    }

    fn planes_error(positions: &[f64], notes: &mut Vec<String>) -> Error {
        planes(positions, 0.0, notes).unwrap_err()
    }
}
