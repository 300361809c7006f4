//! Pointing with the hands: at the panel, on which they click, or at the patient, whose intensity they read
//! and on whom they measure. Rays, cursors, readings and distances are marks in the room.

use egui::{Rect, pos2};
use engine::Result;
use engine::gpu::{Buffer, Gpu, Recorder};
use engine::render::{Intensities, Look};
use engine::splat::SplatSet;
use glam::{DQuat, DVec3};
use shaders_glsl::types::View;
use view::actions::Action;
use view::histogram::Histogram;
use view::panel_info::PanelInfo;
use view::pick::{Hit, Probe};
use view::state::Distance;

use crate::controls::{Button, Controls};
use crate::headset::{Description, FrameImages, Hand, Hands, Pose};
use crate::palm::Palms;
use crate::panel::{LENGTH, Mark, Panel, PanelContent, Pointer, SIZE, scrolled};
use crate::placement::Placement;
use crate::sheets::{Plane, Sheets};

/// Metres per point of the panel.
const POINT: f64 = 0.001;
/// Place of the panel's middle before a head: distance, metres, angle to the left, radians, and offset
/// downwards, metres.
const BEFORE: (f64, f64, f64) = (0.65, 0.45, 0.08);
/// Distance from the eye, metres, at which texts are as large as on the panel; elsewhere they look equally
/// large.
const TEXTS: f64 = 0.65;
/// Length of a ray that meets nothing, metres.
const BEAM: f64 = 1.5;
/// Greatest number of distances that are drawn; the list on the panel has all.
const DISTANCES: usize = 8;

/// Data of the splats on the host that tell what a ray hits, and their histogram.
pub struct PickData {
    probe: Probe,
    histogram: Option<Histogram>,
    intensities: Vec<Intensities>,
    unit: &'static str,
}

impl PickData {
    /// Computes the data of the splats that are shown.
    pub fn of(set: &SplatSet) -> Self {
        let unit = if set.has_intensity { " HU" } else { "" };
        PickData {
            probe: Probe::new(set),
            histogram: Histogram::of_splats(set),
            intensities: Intensities::of_objects(set),
            unit,
        }
    }
}

/// State of pointing.
pub struct Pointing {
    panel: Panel,
    sheets: Sheets,
    pick: Option<PickData>,
    object_splats: Vec<usize>,
    /// Plane of the panel, while it is shown.
    place: Option<Plane>,
    /// Planes of the panel and the marks.
    planes: Vec<Plane>,
    toggle: [Button; 2],
    palms: Palms,
    select: [Button; 2],
    /// The hand that points: the one that clicked last.
    active: usize,
    /// The first end of a distance, mm RAS, if there is one yet; the outer option is set while the measuring
    /// tool is in use.
    measuring: Option<Option<DVec3>>,
    /// The hit of the active hand's ray.
    hit: Option<Hit>,
}

impl Pointing {
    /// Creates the state for a headset, pointing at nothing. `object_splats` are the numbers of splats of the
    /// objects.
    pub fn new(
        gpu: &Gpu,
        about: &Description,
        controls: &mut Controls,
        object_splats: Vec<usize>,
    ) -> Result<Self> {
        let mut pointing = Pointing {
            panel: Panel::new(),
            sheets: Sheets::new(gpu, about.format, about.depth)?,
            pick: None,
            object_splats,
            place: None,
            planes: Vec::new(),
            toggle: Default::default(),
            palms: Palms::default(),
            select: Default::default(),
            active: 1,
            measuring: None,
            hit: None,
        };
        // Glyphs and textures are created once, before the first frame.
        let letters = Mark::Text("0123456789 -.,()mHU".to_owned());
        pointing.lay_out(0.0, true, None, vec![letters], controls)?;
        pointing.lay_out(0.0, false, None, Vec::new(), controls)?;
        let mut recorder = gpu.record()?;
        pointing.sheets.update(&mut recorder)?;
        recorder.submit()?;
        Ok(pointing)
    }

    /// Sets the data for picking, without which nothing is read or measured.
    pub fn set_pick_data(&mut self, pick: PickData) {
        self.pick = Some(pick);
        self.panel.refresh();
    }

    /// Shows the panel before a head, or hides it.
    pub fn toggle(&mut self, head: &Pose) {
        self.place = match self.place {
            Some(_) => None,
            None => Some(panel_before(head)),
        };
    }

    /// Returns the plane of the panel, if it is shown.
    pub fn panel(&self) -> Option<&Plane> {
        self.place.as_ref()
    }

    /// Takes up the measuring tool, or lays it down.
    pub fn measure(&mut self) {
        self.measuring = if self.measuring.is_none() { Some(None) } else { None };
        self.panel.refresh();
    }

    /// Returns the hit of the pointing hand's ray, as the measuring tool shows it.
    pub fn hit(&self) -> Option<&Hit> {
        self.hit.as_ref()
    }

    /// Carries out what pointing hands mean, given the time and the frame's duration, seconds. Returns the
    /// hands as everything else should see them.
    pub fn update(
        &mut self,
        hands: &Hands,
        head: &Pose,
        controls: &mut Controls,
        look: &Look,
        (seconds, period): (f64, f64),
    ) -> Result<Hands> {
        let palms = self.palms.shown(hands, head, seconds);
        for (side, hand) in hands.iter().enumerate() {
            if self.toggle[side].pressed(hand.panel || palms[side]) {
                self.toggle(head);
            }
        }
        let clicked = [0, 1].map(|side| self.select[side].pressed(hands[side].select));
        if let Some(side) = clicked.iter().position(|&clicked| clicked) {
            self.active = side;
        }
        let on_panel = [0, 1].map(|side| self.on_panel(&hands[side]));
        // A hand on the panel points, whichever hand it is.
        if on_panel[self.active].is_none() && on_panel[1 - self.active].is_some() {
            self.active = 1 - self.active;
        }
        let ray = hands[self.active].ray();
        let pointed = on_panel[self.active];
        let pointer = pointed.map(|(at, _)| Pointer {
            at,
            down: hands[self.active].select,
            scroll: scrolled(hands[self.active].stick.y, period),
        });
        self.hit = match (&self.pick, self.measuring, ray, pointed) {
            (Some(pick), Some(_), Some(ray), None) => {
                let (from, to) = (
                    controls.placement.patient(ray.position),
                    controls.placement.patient_direction(ray.forward()),
                );
                pick.probe.along(from, to, look)
            }
            _ => None,
        };
        if clicked[self.active] && pointed.is_none() {
            self.place_end(controls);
        }
        let (marks, planes) = self.marks(ray, pointed.map(|(_, distance)| distance), head, controls);
        self.planes = planes;
        self.lay_out(seconds, self.place.is_some(), pointer, marks, controls)?;
        Ok(self.freed(hands, controls, pointed.is_some()))
    }

    /// Returns the hands without what was meant for the panel or the tool: a hand there grabs nothing, unless
    /// it holds the patient already.
    fn freed(&self, hands: &Hands, controls: &Controls, on_panel: bool) -> Hands {
        let mut freed = *hands;
        let hand = &mut freed[self.active];
        let clicks = self.measuring.is_some() && hand.select;
        if (on_panel || clicks) && !controls.holds(self.active) {
            hand.squeeze = 0.0;
        }
        if on_panel {
            hand.stick = Default::default();
        }
        freed
    }

    /// Returns the point of the panel that a hand points at, and its distance, metres.
    fn on_panel(&self, hand: &Hand) -> Option<(egui::Pos2, f64)> {
        let (plane, ray) = (self.place?, hand.ray()?);
        plane.met(&ray).filter(|(at, _)| Rect::from_min_size(pos2(0.0, 0.0), SIZE).contains(*at))
    }

    /// Puts an end of a distance where the ray meets something.
    fn place_end(&mut self, controls: &mut Controls) {
        let (Some(first), Some(hit)) = (self.measuring, self.hit) else { return };
        self.measuring = Some(match first {
            None => Some(hit.at_mm),
            Some(from_mm) => {
                controls.state.distances.push(Distance { from_mm, to_mm: hit.at_mm });
                self.panel.refresh();
                None
            }
        });
    }

    /// Returns everything that is drawn beside the panel, and the planes: the panel's plane comes first.
    fn marks(
        &self,
        ray: Option<Pose>,
        panel: Option<f64>,
        head: &Pose,
        controls: &Controls,
    ) -> (Vec<Mark>, Vec<Plane>) {
        let mut marks =
            Marks { head: head.position, list: Vec::new(), planes: vec![self.place.unwrap_or_default()] };
        let room = |mm: DVec3| controls.placement.room(mm);
        let end = self.hit.map(|hit| room(hit.at_mm));
        if let (Some(ray), true) = (ray, self.place.is_some() || self.measuring.is_some()) {
            let length = panel.or(end.map(|end| end.distance(ray.position))).unwrap_or(BEAM);
            let tip = ray.place(DVec3::NEG_Z * length);
            marks.line(Mark::Beam, ray.position, tip);
            if panel.is_some() || end.is_some() {
                marks.at(Mark::Cursor, tip);
            }
        }
        let begun = self.measuring.flatten().zip(self.hit).map(|(from_mm, hit)| (from_mm, hit.at_mm));
        let begun = begun.map(|(from_mm, to_mm)| Distance { from_mm, to_mm });
        let distances = &controls.state.distances;
        for distance in distances.iter().rev().take(DISTANCES).chain(&begun) {
            let [from, to] = [distance.from_mm, distance.to_mm].map(room);
            marks.line(Mark::Line, from, to);
            marks.at(Mark::Length(format!("{:.1} mm", distance.mm())), (from + to) * 0.5);
        }
        if let (Some(hit), Some(end), None, Some(pick)) = (self.hit, end, &begun, &self.pick) {
            let DVec3 { x, y, z } = hit.at_mm;
            let text = format!("{:.0}{}\n({x:.1}, {y:.1}, {z:.1}) mm", hit.intensity, pick.unit);
            marks.at(Mark::Text(text), end);
        }
        (marks.list, marks.planes)
    }

    fn lay_out(
        &mut self,
        seconds: f64,
        shown: bool,
        pointer: Option<Pointer>,
        marks: Vec<Mark>,
        controls: &mut Controls,
    ) -> Result<()> {
        let pick = self.pick.as_ref();
        let info = PanelInfo {
            range: controls.range,
            unit: pick.map_or("", |pick| pick.unit),
            object_splats: &self.object_splats,
            object_intensities: pick.map_or(&[], |pick| &pick.intensities),
            splat_histogram: pick.and_then(|pick| pick.histogram.as_ref()),
            ..PanelInfo::default()
        };
        let scale = controls.placement.scale;
        let measuring = self.measuring.is_some();
        let mut content = PanelContent { state: &mut controls.state, info: &info, measuring, scale };
        let Some(made) = self.panel.update(seconds, shown, pointer, marks, &mut content) else {
            return Ok(());
        };
        self.sheets.take(&made.primitives, made.textures, Panel::sheet);
        for action in made.actions {
            match action {
                Action::Transfer(name) => controls.choose(&name)?,
                Action::Measure => self.measure(),
                // The sections of this panel ask for no other actions.
                _ => {}
            }
        }
        Ok(())
    }

    /// Records updates of the textures from which egui draws.
    pub fn prepare(&mut self, recorder: &mut Recorder) -> Result<()> {
        self.sheets.update(recorder)
    }

    /// Records the panel and the marks over the pictures of the eyes. `turn` is the frame's turn with its
    /// views; `room` is the placement of the patient, with the scene's origin, mm RAS.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder,
        turn: (usize, &Buffer<View>),
        room: (&Placement, DVec3),
        eyes: &mut FrameImages<'_>,
    ) -> Result<()> {
        self.sheets.draw(recorder, turn, room, &self.planes, eyes)
    }
}

/// Returns a plane for the panel before a head: upright, to the left of the viewing direction.
pub fn panel_before(head: &Pose) -> Plane {
    let (distance, left, below) = BEFORE;
    let level = (head.forward() * DVec3::new(1.0, 0.0, 1.0)).try_normalize().unwrap_or(DVec3::NEG_Z);
    let ahead = DQuat::from_rotation_y(left) * level;
    let middle = head.position + ahead * distance - DVec3::Y * below;
    let eye = DVec3::new(head.position.x, middle.y, head.position.z);
    Plane::facing((SIZE * 0.5).to_pos2(), middle, eye, POINT)
}

/// Marks being listed, with their planes.
struct Marks {
    head: DVec3,
    list: Vec<Mark>,
    planes: Vec<Plane>,
}

impl Marks {
    /// Adds a mark at a place. It faces the viewer, who sees it in one size however far it is.
    fn at(&mut self, mark: Mark, at: DVec3) {
        let anchor = Panel::anchor(self.list.len());
        let metres = POINT * at.distance(self.head) / TEXTS;
        self.planes.push(Plane::facing(anchor, at, self.head, metres));
        self.list.push(mark);
    }

    /// Adds a mark from one place to another. Its broad side faces the viewer.
    fn line(&mut self, mark: Mark, from: DVec3, to: DVec3) {
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
    use super::*;
    use crate::panel::ANCHOR;

    #[test]
    fn the_panel_stands_before_the_head_in_real_size() {
        let head = Pose { position: DVec3::new(1.0, 1.7, 2.0), orientation: DQuat::from_rotation_y(0.8) };
        let plane = panel_before(&head);
        let corner = |x: f32, y: f32| plane.place(pos2(x * SIZE.x, y * SIZE.y));
        let (width, height) =
            (corner(0.0, 0.0).distance(corner(1.0, 0.0)), corner(0.0, 0.0).distance(corner(0.0, 1.0)));
        assert!((width - 0.4).abs() < 1e-9 && (height - 0.56).abs() < 1e-9, "{width} x {height} m");
        let middle = corner(0.5, 0.5) - head.position;
        assert!((middle.length() - 0.655).abs() < 1e-2 && middle.dot(head.forward()) > 0.5);
        assert!(middle.dot(head.orientation * DVec3::NEG_X) > 0.2, "to the left");
        assert!(corner(0.0, 0.0).y > corner(0.0, 1.0).y, "upright");
        let right = corner(1.0, 0.5) - corner(0.0, 0.5);
        assert!(right.dot(head.orientation * DVec3::X) > 0.3, "not mirrored");
    }

    #[test]
    fn lines_go_from_end_to_end() {
        let mut marks = Marks { head: DVec3::new(0.0, 1.6, 0.0), list: Vec::new(), planes: Vec::new() };
        let (from, to) = (DVec3::new(0.2, 1.2, -0.3), DVec3::new(-0.1, 1.5, -0.9));
        marks.line(Mark::Line, from, to);
        let plane = marks.planes[0];
        let anchor = Panel::anchor(0);
        assert!(plane.place(anchor).distance(from) < 1e-9);
        assert!(plane.place(pos2(anchor.x + LENGTH, ANCHOR.y)).distance(to) < 1e-9);
        assert!(plane.down.dot(to - from).abs() < 1e-12, "across");
    }
}
