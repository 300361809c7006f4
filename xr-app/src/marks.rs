//! Marks in the room beside the panel, each on a plane of its own that faces the viewer.

use egui::Pos2;
use glam::DVec3;

use crate::panel::{LENGTH, Mark, Panel};
use crate::sheets::Plane;

/// Metres per point of the panel.
pub const POINT: f64 = 0.001;
/// Distance from the eye, metres, at which texts are as large as on the panel; elsewhere they look equally
/// large.
const TEXTS: f64 = 0.65;

/// Marks being listed, with their planes: that of the panel comes first.
pub struct Marks {
    head: DVec3,
    /// The marks.
    pub list: Vec<Mark>,
    /// Planes of the panel and of the marks.
    pub planes: Vec<Plane>,
}

impl Marks {
    /// Creates an empty list beside a panel, for a viewer whose head is at a place in the room, metres.
    pub fn new(head: DVec3, panel: Plane) -> Self {
        Marks { head, list: Vec::new(), planes: vec![panel] }
    }

    /// Adds a mark at a place. It faces the viewer, who sees it in one size however far it is.
    pub fn at(&mut self, mark: Mark, at: DVec3) {
        self.centred(mark, at, Panel::anchor(self.list.len()));
    }

    /// Adds a mark as [`Marks::at`] does, with another point of the screen at that place than its anchor.
    pub fn centred(&mut self, mark: Mark, at: DVec3, point: Pos2) {
        let metres = POINT * at.distance(self.head) / TEXTS;
        self.planes.push(Plane::facing(point, at, self.head, metres));
        self.list.push(mark);
    }

    /// Adds a mark on a plane, with its anchor at a place there.
    pub fn on(&mut self, mark: Mark, plane: &Plane, at: DVec3) {
        let anchor = Panel::anchor(self.list.len());
        self.planes.push(Plane::anchored(anchor, at, plane.right, plane.down));
        self.list.push(mark);
    }

    /// Adds a mark from one place to another. Its broad side faces the viewer.
    pub fn line(&mut self, mark: Mark, from: DVec3, to: DVec3) {
        let anchor = Panel::anchor(self.list.len());
        let along = to - from;
        let towards = self.head - (from + to) * 0.5;
        let across = along.cross(towards).try_normalize().unwrap_or(DVec3::Y);
        let metres = POINT * towards.length() / TEXTS;
        self.planes.push(Plane::anchored(anchor, from, along / f64::from(LENGTH), across * metres));
        self.list.push(mark);
    }
}

#[cfg(test)]
mod tests {
    use egui::pos2;

    use super::*;
    use crate::panel::ANCHOR;

    #[test]
    fn lines_go_from_end_to_end() {
        let mut marks = Marks::new(DVec3::new(0.0, 1.6, 0.0), Plane::default());
        let (from, to) = (DVec3::new(0.2, 1.2, -0.3), DVec3::new(-0.1, 1.5, -0.9));
        marks.line(Mark::Line, from, to);
        let plane = marks.planes[1];
        let anchor = Panel::anchor(0);
        assert!(plane.place(anchor).distance(from) < 1e-9);
        assert!(plane.place(pos2(anchor.x + LENGTH, ANCHOR.y)).distance(to) < 1e-9);
        assert!(plane.down.dot(to - from).abs() < 1e-12, "across");
    }
}
