//! Handles of clip planes and of the crop box: their places, the one under the cursor, and the effect of a
//! drag.
//!
//! Places are fractions of the picture, as in [`crate::model::orbit`].

use glam::{DVec2, DVec3};

use crate::model::orbit::Orbit;
use crate::model::state::Clip;

/// Length of the arrow of a plane, as a share of the scene's half diagonal.
const ARROW: f64 = 0.35;
/// Least thickness of the crop box, as a share of the scene's half diagonal.
const THINNEST: f64 = 1e-3;

/// Square of the sine between an axis and the view below which one looks along the axis (10°).
const NARROW_SLANT: f64 = 0.03;

/// Handle of a clip plane or of the crop box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    /// The middle of a plane, by index; moves it along its normal.
    Offset(usize),
    /// The tip of a plane's arrow, by index; turns it about its middle.
    Normal(usize),
    /// A face of the crop box; moves along its axis.
    Face {
        /// Axis: 0 left to right, 1 back to front, 2 foot to head.
        axis: usize,
        /// True if it is the face at the upper end.
        high: bool,
    },
}

/// Handle and its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// The handle.
    pub handle: Handle,
    /// Place, mm RAS.
    pub at_mm: DVec3,
}

/// Returns the middle and half diagonal of a box, mm.
fn ball([low, high]: [DVec3; 2]) -> (DVec3, f64) {
    ((low + high) * 0.5, (high - low).length() * 0.5)
}

/// Returns the middle of a plane, which is its point nearest to the middle of the scene, and the tip of its
/// arrow, mm RAS.
fn arrow(clip: &Clip, index: usize, bounds: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let plane = clip.planes.get(index)?;
    let (middle, radius) = ball(bounds);
    let foot = middle - plane.normal * (plane.normal.dot(middle) - plane.offset_mm);
    Some([foot, foot + plane.normal * (ARROW * radius)])
}

/// Returns the handles of the planes and of the crop box that are on.
pub fn handles(clip: &Clip, bounds: [DVec3; 2]) -> Vec<Placed> {
    let mut placed = Vec::new();
    for (i, _) in clip.planes.iter().enumerate().filter(|(_, plane)| plane.on) {
        if let Some([foot, tip]) = arrow(clip, i, bounds) {
            placed.push(Placed { handle: Handle::Offset(i), at_mm: foot });
            placed.push(Placed { handle: Handle::Normal(i), at_mm: tip });
        }
    }
    if let Some(crop) = clip.crop.filter(|crop| crop.on) {
        let middle = (crop.low_mm + crop.high_mm) * 0.5;
        for axis in 0..3 {
            for (high, end) in [(false, crop.low_mm[axis]), (true, crop.high_mm[axis])] {
                let mut at_mm = middle;
                at_mm[axis] = end;
                placed.push(Placed { handle: Handle::Face { axis, high }, at_mm });
            }
        }
    }
    placed
}

/// Returns the handle that is seen at a place, within `reach` (a fraction of the picture's height); of
/// several the one nearest to the viewer.
pub fn hit(placed: &[Placed], orbit: &Orbit, aspect: f64, place: DVec2, reach: f64) -> Option<Handle> {
    let seen = placed.iter().filter_map(|p| {
        let (at, depth) = orbit.seen(p.at_mm, aspect)?;
        let away = (at - place) * DVec2::new(aspect, 1.0);
        (away.length() <= reach).then_some((p.handle, depth))
    });
    seen.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(handle, _)| handle)
}

/// Changes the clip planes or the crop box as a drag of a handle from one place to another says.
pub fn drag(
    clip: &mut Clip,
    handle: Handle,
    bounds: [DVec3; 2],
    orbit: &Orbit,
    aspect: f64,
    [from, to]: [DVec2; 2],
) {
    match handle {
        Handle::Offset(index) => {
            let Some([foot, _]) = arrow(clip, index, bounds) else { return };
            let plane = &mut clip.planes[index];
            plane.offset_mm += along(orbit, aspect, foot, plane.normal, [from, to]);
        }
        Handle::Normal(index) => {
            let Some([foot, tip]) = arrow(clip, index, bounds) else { return };
            let plane = &mut clip.planes[index];
            // The tip moves over a ball about the foot, on the half on which it is.
            let (at, _) = orbit.seen(tip, aspect).unwrap_or_default();
            let Some(normal) = on_ball(orbit, aspect, foot, tip, at + to - from) else { return };
            plane.normal = normal;
            plane.offset_mm = normal.dot(foot);
        }
        Handle::Face { axis, high } => {
            let (_, radius) = ball(bounds);
            let Some(crop) = &mut clip.crop else { return };
            let mut at = (crop.low_mm + crop.high_mm) * 0.5;
            at[axis] = if high { crop.high_mm[axis] } else { crop.low_mm[axis] };
            let new = at[axis] + along(orbit, aspect, at, DVec3::AXES[axis], [from, to]);
            let least = THINNEST * radius;
            if high {
                crop.high_mm[axis] = new.max(crop.low_mm[axis] + least);
            } else {
                crop.low_mm[axis] = new.min(crop.high_mm[axis] - least);
            }
        }
    }
}

/// Returns the distance along `axis` (a unit vector) through `at` that a drag leads to, mm: from the point of
/// the axis nearest to the ray through `from`, to that nearest to the ray through `to`. If one looks along
/// the axis, upwards is away from the viewer.
fn along(orbit: &Orbit, aspect: f64, at: DVec3, axis: DVec3, [from, to]: [DVec2; 2]) -> f64 {
    let eye = orbit.eye_mm();
    let between = at - eye;
    let slant = axis.dot(between.normalize_or_zero());
    if 1.0 - slant * slant < NARROW_SLANT {
        return (from.y - to.y) * orbit.height_mm() * slant.signum();
    }
    let nearest = |place: DVec2| {
        let ray = (orbit.at_pivot(place, aspect) - eye).normalize();
        let across = axis.dot(ray);
        // Beside the handle a ray may run along the axis after all; then its nearest point is nowhere, or far
        // away.
        (ray.dot(between) * across - axis.dot(between)) / (1.0 - across * across).max(0.1 * NARROW_SLANT)
    };
    nearest(to) - nearest(from)
}

/// Returns the direction from `middle` to the point of the ball about `middle` through `tip` that is seen at
/// a place: on the nearer half of the ball if the tip is there, on its outline if the place is beside the
/// ball.
fn on_ball(orbit: &Orbit, aspect: f64, middle: DVec3, tip: DVec3, place: DVec2) -> Option<DVec3> {
    let eye = orbit.eye_mm();
    let radius = tip.distance(middle);
    let ray = (orbit.at_pivot(place, aspect) - eye).normalize();
    // The point of the ray nearest to the middle, and half the chord within the ball.
    let foot = eye + ray * ray.dot(middle - eye);
    let chord = (radius * radius - foot.distance_squared(middle)).max(0.0).sqrt();
    let near = (tip - middle).dot(eye - middle) >= 0.0;
    (foot + ray * if near { -chord } else { chord } - middle).try_normalize()
}

/// Returns the corners of the part of a plane that lies in a box, in order around it, mm RAS; empty if they
/// do not meet.
pub fn outline(normal: DVec3, offset: f64, [low, high]: [DVec3; 2]) -> Vec<DVec3> {
    let mut corners: Vec<DVec3> = edges([low, high])
        .into_iter()
        .filter_map(|[a, b]| {
            let (from, to) = (normal.dot(a) - offset, normal.dot(b) - offset);
            ((from > 0.0) != (to > 0.0)).then(|| a + (b - a) * (from / (from - to)))
        })
        .collect();
    let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let angle = |x: &DVec3| (x - middle).dot(v).atan2((x - middle).dot(u));
    corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    corners
}

/// Returns the twelve edges of a box.
pub fn edges([low, high]: [DVec3; 2]) -> [[DVec3; 2]; 12] {
    let corner = |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { high[axis] } else { low[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    std::array::from_fn(|i| {
        let (axis, rest) = (i / 4, i % 4);
        // These are the two bits that are not the edge's own.
        let start = match axis {
            0 => rest << 1,
            1 => rest & 1 | (rest & 2) << 1,
            _ => rest,
        };
        [corner(start), corner(start | 1 << axis)]
    })
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
