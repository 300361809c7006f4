//! The editor of a transfer function: what can be done to its points, and what part of the intensities is in
//! view.
//!
//! Intensities here are those that a user sees, with the shift applied. Heights are from 0 to 1, the square
//! root of the opacity per millimetre: a hundredth is as easily taken hold of as a half.

use glam::DVec3;

use crate::transfer::{Point, Transfer};

/// Fewest points that a function keeps.
const LEAST_POINTS: usize = 2;
/// Points stay apart by this share of the full range.
const APART: f64 = 1e-4;
/// The narrowest view, as a share of the full range.
const NARROWEST: f64 = 1e-3;

/// Which point is chosen, and which intensities are in view.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Editor {
    selected: Option<usize>,
    /// Intensities in view; the full range where nothing is said.
    view: Option<[f64; 2]>,
}

/// Returns the height of an opacity per millimetre.
pub fn height(opacity: f64) -> f64 {
    opacity.max(0.0).sqrt()
}

/// Returns the opacity per millimetre at a height.
pub fn opacity(height: f64) -> f64 {
    height.clamp(0.0, 1.0).powi(2)
}

/// Returns all intensities that can be brought into view, and that points can be moved to: those of the data
/// and a little more, and those that points have already.
pub fn full_range(transfer: &Transfer, data: [f64; 2]) -> [f64; 2] {
    let [low, high] = transfer.window();
    let margin = 0.02 * (data[1] - data[0]).max(1e-3);
    [low.min(data[0] - margin), high.max(data[1] + margin)]
}

impl Editor {
    /// Returns the chosen point; nothing where it is gone, as after an undo.
    pub fn selected(&self, transfer: &Transfer) -> Option<usize> {
        self.selected.filter(|&i| i < transfer.points.len())
    }

    /// Chooses a point, or none.
    pub fn select(&mut self, index: Option<usize>) {
        self.selected = index;
    }

    /// Intensities in view.
    pub fn view(&self, full: [f64; 2]) -> [f64; 2] {
        let Some([low, high]) = self.view else { return full };
        let (low, high) = (low.max(full[0]), high.min(full[1]));
        if low < high { [low, high] } else { full }
    }

    /// Brings all into view.
    pub fn view_all(&mut self) {
        self.view = None;
    }

    /// Shows `factor` times as wide a range of intensities; `about` stays where it is.
    pub fn zoom(&mut self, factor: f64, about: f64, full: [f64; 2]) {
        let [low, high] = self.view(full);
        let widest = full[1] - full[0];
        let width = ((high - low) * factor).clamp(NARROWEST * widest, widest);
        let start = about - (about - low) * width / (high - low);
        self.look_at(start, width, full);
    }

    /// Moves the view by so much.
    pub fn pan(&mut self, by: f64, full: [f64; 2]) {
        let [low, high] = self.view(full);
        self.look_at(low + by, high - low, full);
    }

    fn look_at(&mut self, start: f64, width: f64, full: [f64; 2]) {
        let low = start.clamp(full[0], (full[1] - width).max(full[0]));
        let all = width >= full[1] - full[0];
        self.view = if all || !low.is_finite() { None } else { Some([low, low + width]) };
    }

    /// A new point of the colour that the function has there; chooses it. It is added unless it would lie on
    /// another one.
    pub fn add(&mut self, transfer: &mut Transfer, intensity: f64, opacity: f64, full: [f64; 2]) -> bool {
        let Ok(function) = transfer.function() else { return false };
        let at = intensity.clamp(full[0], full[1]);
        let gap = APART * (full[1] - full[0]);
        let near = |p: &Point| (p.intensity + transfer.shift - at).abs() < gap;
        if transfer.points.iter().any(near) || !at.is_finite() {
            return false;
        }
        let point = Point {
            intensity: at - transfer.shift,
            opacity: opacity.clamp(0.0, 1.0),
            colour: function.at(at).0,
        };
        let index = transfer.points.partition_point(|p| p.intensity < point.intensity);
        transfer.points.insert(index, point);
        self.selected = Some(index);
        true
    }

    /// A new point halfway between the chosen one and the next; before it where it is the last, in the middle
    /// of the view where none is chosen.
    pub fn add_beside(&mut self, transfer: &mut Transfer, full: [f64; 2]) -> bool {
        let Ok(function) = transfer.function() else { return false };
        let at = |i: usize| transfer.points[i].intensity + transfer.shift;
        let place = match self.selected(transfer) {
            Some(i) if i + 1 < transfer.points.len() => (at(i) + at(i + 1)) * 0.5,
            Some(i) if i > 0 => (at(i - 1) + at(i)) * 0.5,
            _ => self.view(full).iter().sum::<f64>() * 0.5,
        };
        self.add(transfer, place, function.at(place).1, full)
    }

    /// Removes the chosen point, if enough are left; chooses the one before.
    pub fn remove(&mut self, transfer: &mut Transfer) -> bool {
        let Some(index) = self.selected(transfer) else { return false };
        if transfer.points.len() <= LEAST_POINTS {
            return false;
        }
        transfer.points.remove(index);
        self.selected = Some(index.saturating_sub(1));
        true
    }

    /// Moves the chosen point, as far as its neighbours and the range allow.
    pub fn move_to(&mut self, transfer: &mut Transfer, intensity: f64, opacity: f64, full: [f64; 2]) {
        let Some(index) = self.selected(transfer) else { return };
        if !(intensity.is_finite() && opacity.is_finite()) {
            return;
        }
        let gap = APART * (full[1] - full[0]);
        let at = |p: &Point| p.intensity + transfer.shift;
        let low = index.checked_sub(1).map_or(full[0], |i| at(&transfer.points[i]) + gap);
        let high = transfer.points.get(index + 1).map_or(full[1], |p| at(p) - gap);
        let shift = transfer.shift;
        let point = &mut transfer.points[index];
        point.opacity = opacity.clamp(0.0, 1.0);
        // Neighbours nearer than two gaps, as those of a step, leave no room.
        if low <= high {
            point.intensity = intensity.clamp(low, high) - shift;
        }
    }

    /// Moves the chosen point by so much, in intensity and in height.
    pub fn nudge(&mut self, transfer: &mut Transfer, by: f64, up: f64, full: [f64; 2]) {
        let Some(index) = self.selected(transfer) else { return };
        let point = transfer.points[index];
        let new = if up == 0.0 { point.opacity } else { opacity(height(point.opacity) + up) };
        self.move_to(transfer, point.intensity + transfer.shift + by, new, full);
    }

    /// Gives the chosen point a colour.
    pub fn colour(&mut self, transfer: &mut Transfer, colour: DVec3) {
        if let Some(index) = self.selected(transfer) {
            transfer.points[index].colour = colour.clamp(DVec3::ZERO, DVec3::ONE);
        }
    }

    /// Chooses the next point, or the one before; the first where none is chosen.
    pub fn select_next(&mut self, transfer: &Transfer, forward: bool) {
        let last = transfer.points.len().saturating_sub(1);
        self.selected = Some(match self.selected(transfer) {
            None => 0,
            Some(i) if forward => (i + 1).min(last),
            Some(i) => i.saturating_sub(1),
        });
    }
}

/// Returns where a step of the axis may be labelled: multiples of a round number, at most `count` of them.
pub fn ticks([low, high]: [f64; 2], count: usize) -> Vec<f64> {
    let step = engine::image::annotate::round_up((high - low) / count.max(1) as f64);
    let Some(step) = step else { return Vec::new() };
    let first = (low / step).ceil();
    let last = (high / step).floor();
    (0..=count).map(|i| first + i as f64).filter(|n| *n <= last).map(|n| n * step).collect()
}

#[cfg(test)]
#[path = "tests/points.rs"]
mod tests;
