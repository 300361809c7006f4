//! Editor of a transfer function: changes its points and the visible range of intensities.
//!
//! Intensities here are those that a user sees, with the shift applied. Heights are from 0 to 1, the square
//! root of the opacity per millimetre: a hundredth is as easily grasped as a half.

use glam::DVec3;

use crate::model::transfer::{Point, Transfer};

/// Least number of points of a function.
const LEAST_POINTS: usize = 2;
/// Least distance of points, as a share of the full range.
const APART: f64 = 1e-4;
/// Width of the narrowest visible range, as a share of the full range.
const NARROWEST: f64 = 1e-3;

/// Selected point and visible range of intensities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Editor {
    selected: Option<usize>,
    /// Visible range of intensities; `None` for the full range.
    view: Option<[f64; 2]>,
}

/// Returns the height that stands for an opacity per millimetre.
pub fn height(opacity: f64) -> f64 {
    opacity.max(0.0).sqrt()
}

/// Returns the opacity per millimetre that a height stands for.
pub fn opacity(height: f64) -> f64 {
    height.clamp(0.0, 1.0).powi(2)
}

/// Returns the range of intensities that can be shown and that points can be moved to: that of the data and a
/// little more, and that of the points.
pub fn full_range(transfer: &Transfer, data: [f64; 2]) -> [f64; 2] {
    let [low, high] = transfer.window();
    let margin = 0.02 * (data[1] - data[0]).max(1e-3);
    [low.min(data[0] - margin), high.max(data[1] + margin)]
}

impl Editor {
    /// Returns the index of the selected point; `None` if it is gone, as after an undo.
    pub fn selected(&self, transfer: &Transfer) -> Option<usize> {
        self.selected.filter(|&i| i < transfer.points.len())
    }

    /// Selects a point, or none.
    pub fn select(&mut self, index: Option<usize>) {
        self.selected = index;
    }

    /// Returns the visible range of intensities, within the range `full`.
    pub fn view(&self, full: [f64; 2]) -> [f64; 2] {
        let Some([low, high]) = self.view else { return full };
        let (low, high) = (low.max(full[0]), high.min(full[1]));
        if low < high { [low, high] } else { full }
    }

    /// Shows the full range.
    pub fn view_all(&mut self) {
        self.view = None;
    }

    /// Makes the visible range `factor` times as wide; `about` stays where it is.
    pub fn zoom(&mut self, factor: f64, about: f64, full: [f64; 2]) {
        let [low, high] = self.view(full);
        let widest = full[1] - full[0];
        let width = ((high - low) * factor).clamp(NARROWEST * widest, widest);
        let start = about - (about - low) * width / (high - low);
        self.look_at(start, width, full);
    }

    /// Moves the visible range by `by`.
    pub fn pan(&mut self, by: f64, full: [f64; 2]) {
        let [low, high] = self.view(full);
        self.look_at(low + by, high - low, full);
    }

    fn look_at(&mut self, start: f64, width: f64, full: [f64; 2]) {
        let low = start.clamp(full[0], (full[1] - width).max(full[0]));
        let all = width >= full[1] - full[0];
        self.view = if all || !low.is_finite() { None } else { Some([low, low + width]) };
    }

    /// Adds a point with the colour that the function has there, and selects it. Returns false if it was not
    /// added, since it would lie on another point.
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

    /// Adds a point halfway between the selected one and the next. If the selected point is the last, the new
    /// point goes before it; if none is selected, into the middle of the visible range.
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

    /// Removes the selected point and selects the one before. Returns false if nothing was removed, since too
    /// few points would be left.
    pub fn remove(&mut self, transfer: &mut Transfer) -> bool {
        let Some(index) = self.selected(transfer) else { return false };
        if transfer.points.len() <= LEAST_POINTS {
            return false;
        }
        transfer.points.remove(index);
        self.selected = Some(index.saturating_sub(1));
        true
    }

    /// Moves the selected point as far as its neighbours and the range allow.
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

    /// Moves the selected point by `by` in intensity and by `up` in height.
    pub fn nudge(&mut self, transfer: &mut Transfer, by: f64, up: f64, full: [f64; 2]) {
        let Some(index) = self.selected(transfer) else { return };
        let point = transfer.points[index];
        let new = if up == 0.0 { point.opacity } else { opacity(height(point.opacity) + up) };
        self.move_to(transfer, point.intensity + transfer.shift + by, new, full);
    }

    /// Sets the colour of the selected point.
    pub fn colour(&mut self, transfer: &mut Transfer, colour: DVec3) {
        if let Some(index) = self.selected(transfer) {
            transfer.points[index].colour = colour.clamp(DVec3::ZERO, DVec3::ONE);
        }
    }

    /// Selects the next point, or the previous one; the first if none is selected.
    pub fn select_next(&mut self, transfer: &Transfer, forward: bool) {
        let last = transfer.points.len().saturating_sub(1);
        self.selected = Some(match self.selected(transfer) {
            None => 0,
            Some(i) if forward => (i + 1).min(last),
            Some(i) => i.saturating_sub(1),
        });
    }
}

/// Returns the intensities at which the axis is labelled: multiples of a round number, at most `count` of
/// them.
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
