//! Pointing with the hands: at the panel, on which they click and whose frame they carry, or at the patient,
//! whose intensity they read and on whom they measure. Rays, cursors, readings, distances, outlines and notices
//! are marks in the room.

use egui::{Rect, pos2};
use engine::Result;
use engine::gpu::{Buffer, Gpu, Recorder};
use engine::render::{Hit, Intensities, Look, Probe};
use engine::splat::SplatSet;
use glam::{DQuat, DVec3};
use shaders_glsl::types::View;
use view::model::actions::Action;
use view::model::histogram::Histogram;
use view::model::panel_info::PanelInfo;
use view::model::state::Distance;

use crate::controls::{Button, Controls};
use crate::feedback::{CLICK, GRAB};
use crate::headset::{Description, FrameImages, HOLDS, Hand, Hands, Pose};
use crate::marks::{Marks, POINT};
use crate::outline::outline;
use crate::palm::Palms;
use crate::panel::{CARD, FRAME, Mark, Panel, PanelContent, Pointer, Request, SIZE, notice_middle, scrolled};
use crate::placement::Placement;
use crate::sheets::{Plane, Sheets};

/// Distance of the middle of the panel and of the card from a head, and how far it is below its eyes, metres.
const BESIDE: (f64, f64) = (0.65, 0.08);
/// Least and greatest angle from straight ahead to the panel's middle, radians.
const ASIDE: [f64; 2] = [0.45, 1.1];
/// The same for the card, which is read at once: at most of headsets half of it is seen without turning the head.
const CARD_ASIDE: [f64; 2] = [0.35, 0.8];
/// Angle between the patient and the panel or the card, radians.
const GAP: f64 = 0.06;
/// Length of a ray that meets nothing, metres.
const BEAM: f64 = 1.5;
/// Greatest number of distances that are drawn; the list on the panel has all.
const DISTANCES: usize = 8;
/// Time for which a notice is shown, seconds.
const NOTICE: f64 = 2.0;
/// Place of a notice before a head: distance, and how far below its eyes, metres.
const NOTICE_AT: (f64, f64) = (0.6, 0.13);
/// All letters that anything shows, so that they are drawn before the first frame.
const LETTERS: std::ops::RangeInclusive<char> = ' '..='~';

/// Data of the splats on the host that tell what a ray hits, and their histogram.
pub struct PickData {
    probe: Probe,
    histogram: Option<Histogram>,
    intensities: Vec<Intensities>,
}

impl PickData {
    /// Computes the data of the splats that are shown.
    pub fn of(set: &SplatSet) -> Self {
        PickData {
            probe: Probe::new(set),
            histogram: Histogram::of_splats(set),
            intensities: Intensities::of_objects(set),
        }
    }
}

/// What the hands aim at in a frame.
#[derive(Clone, Copy, Default)]
struct Aim {
    /// Ray of the active hand.
    ray: Option<Pose>,
    /// Distance along it to the panel or its frame, metres.
    panel: Option<f64>,
    /// Pointer on the panel.
    pointer: Option<Pointer>,
    /// True if a hand points at the frame.
    frame: bool,
}

/// Words that are shown for a while.
struct Notice {
    text: String,
    /// Time at which they go, seconds.
    until: f64,
    /// Where they are in the room, metres.
    at: DVec3,
}

/// State of pointing.
pub struct Pointing {
    panel: Panel,
    sheets: Sheets,
    pick: Option<PickData>,
    object_splats: Vec<usize>,
    /// Box around the patient, mm RAS.
    bounds: [DVec3; 2],
    /// Plane of the panel, while it is shown.
    place: Option<Plane>,
    /// Planes of the panel and the marks.
    planes: Vec<Plane>,
    toggle: [Button; 2],
    palms: Palms,
    select: [Button; 2],
    /// True while a pull of the trigger has done what it was for.
    spent: [bool; 2],
    grasp: [Button; 2],
    /// The hand that carries the panel, and its ray in the frame before.
    carrying: Option<(usize, Pose)>,
    /// The hand that points: the one that clicked last.
    active: usize,
    /// The first end of a distance, mm RAS, if there is one yet; the outer option is set while the measuring
    /// tool is in use.
    measuring: Option<Option<DVec3>>,
    /// The hit of the active hand's ray.
    hit: Option<Hit>,
    aim: Aim,
    notice: Option<Notice>,
    /// Place of the card of what hands do, while it is shown.
    card: Option<DVec3>,
    card_seen: bool,
}

impl Pointing {
    /// Creates the state for a headset, pointing at nothing. `object_splats` are the numbers of splats of the
    /// objects; `bounds` is the box around the patient, mm RAS.
    pub fn new(
        gpu: &Gpu,
        about: &Description,
        controls: &mut Controls,
        object_splats: Vec<usize>,
        bounds: [DVec3; 2],
    ) -> Result<Self> {
        let mut pointing = Pointing {
            panel: Panel::new(),
            sheets: Sheets::new(gpu, about.format, about.depth)?,
            pick: None,
            object_splats,
            bounds,
            place: None,
            planes: Vec::new(),
            toggle: Default::default(),
            palms: Palms::default(),
            select: Default::default(),
            spent: [false; 2],
            grasp: Default::default(),
            carrying: None,
            active: 1,
            measuring: None,
            hit: None,
            aim: Aim::default(),
            notice: None,
            card: None,
            card_seen: false,
        };
        // Glyphs and textures are created once, before the first frame.
        let letters: String = LETTERS.collect();
        let marks = vec![Mark::Text(letters.clone()), Mark::Notice(letters), Mark::Card];
        pointing.paint(0.0, (true, marks), "", &Pose::IDENTITY, controls)?;
        pointing.paint(0.0, (false, Vec::new()), "", &Pose::IDENTITY, controls)?;
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

    /// Shows the panel before a head, beside the patient; or hides it.
    pub fn toggle(&mut self, head: &Pose, placement: &Placement) {
        self.place = match self.place {
            Some(_) => None,
            None => Some(panel_beside(head, &corners(self.bounds).map(|mm| placement.room(mm)))),
        };
        self.carrying = None;
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

    /// Shows a few words before a head, from a time on, seconds.
    pub fn notify(&mut self, text: String, seconds: f64, head: &Pose) {
        self.notice = Some(Notice { text, until: seconds + NOTICE, at: before(head, NOTICE_AT) });
    }

    /// Returns the words that are shown.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_ref().map(|notice| notice.text.as_str())
    }

    /// Shows the card of what hands do before a head, beside patient and panel, until a trigger is pulled.
    pub fn show_card(&mut self, head: &Pose, placement: &Placement) {
        let patient = corners(self.bounds).map(|mm| placement.room(mm));
        self.card = Some(card_beside(head, &patient, self.place.as_ref()));
    }

    /// Returns true if the card is shown, and true if it was shown and closed.
    pub fn card(&self) -> [bool; 2] {
        [self.card.is_some(), self.card_seen]
    }

    /// Finds what hands point at, and carries out what they mean there, given the time and the frame's
    /// duration, seconds. Returns the hands as everything else should see them.
    pub fn point(
        &mut self,
        hands: &Hands,
        head: &Pose,
        controls: &mut Controls,
        look: &Look,
        (seconds, period): (f64, f64),
    ) -> Hands {
        let palms = self.palms.shown(hands, head, seconds);
        for (side, hand) in hands.iter().enumerate() {
            if self.toggle[side].pressed(hand.panel || palms[side]) {
                self.toggle(head, &controls.placement);
            }
        }
        let mut hands = *hands;
        let clicked = self.clicked(&mut hands);
        if let Some(side) = clicked.iter().position(|&clicked| clicked) {
            self.active = side;
        }
        let mut met = [0, 1].map(|side| self.met(&hands[side]));
        self.carry(&hands, &met, head, controls);
        if let Some((side, _)) = self.carrying {
            met[side] = self.met(&hands[side]);
        }
        // A hand on the panel points, whichever hand it is.
        if met[self.active].is_none() && met[1 - self.active].is_some() {
            self.active = 1 - self.active;
        }
        let hand = hands[self.active];
        let ray = hand.ray();
        let pointed = met[self.active];
        let inside = pointed.filter(|met| !met.on_frame && self.carrying.is_none());
        self.aim = Aim {
            ray,
            panel: pointed.map(|met| met.distance),
            pointer: inside.map(|met| Pointer {
                at: met.at,
                down: hand.select,
                scroll: scrolled(hand.stick.y, period),
            }),
            frame: self.carrying.is_some() || met.iter().flatten().any(|met| met.on_frame),
        };
        controls.dragging = self.aim.pointer.is_some_and(|pointer| pointer.down);
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
        if clicked[self.active] {
            if pointed.is_none() {
                self.place_end(controls);
            } else if inside.is_some() {
                controls.feedback.pulse(self.active, CLICK);
            }
        }
        self.freed(&hands, controls, pointed.is_some())
    }

    /// Returns which hands have just pulled the trigger. Such a pull closes the card, and is for nothing else
    /// then: the hands are without it.
    fn clicked(&mut self, hands: &mut Hands) -> [bool; 2] {
        let mut clicked = [0, 1].map(|side| self.select[side].pressed(hands[side].select));
        if clicked.contains(&true) && self.card.take().is_some() {
            self.card_seen = true;
            self.spent = clicked;
            clicked = [false; 2];
        }
        for (hand, spent) in hands.iter_mut().zip(&mut self.spent) {
            *spent &= hand.select;
            hand.select &= !*spent;
        }
        clicked
    }

    /// Carries the panel with a hand that took hold of its frame.
    fn carry(&mut self, hands: &Hands, met: &[Option<Met>; 2], head: &Pose, controls: &mut Controls) {
        let began = [0, 1].map(|side| self.grasp[side].pressed(hands[side].squeeze >= HOLDS));
        let takes = |&side: &usize| began[side] && met[side].is_some_and(|met| met.on_frame);
        if let (None, Some(side)) = (self.carrying, [0, 1].into_iter().find(takes)) {
            self.carrying = hands[side].ray().map(|ray| (side, ray));
            self.active = side;
            controls.feedback.pulse(side, GRAB);
            return;
        }
        let (Some((side, from)), Some(panel)) = (self.carrying, self.place) else { return };
        self.carrying = hands[side].ray().filter(|_| hands[side].squeeze >= HOLDS * 0.5).map(|to| (side, to));
        if let Some((_, to)) = self.carrying {
            let turn = to.orientation * from.orientation.inverse();
            let middle = panel.place((SIZE * 0.5).to_pos2());
            self.place = Some(upright(to.position + turn * (middle - from.position), head));
        }
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
        if let Some((side, _)) = self.carrying {
            freed[side].squeeze = 0.0;
        }
        freed
    }

    /// Returns the point of the panel or its frame that a hand points at.
    fn met(&self, hand: &Hand) -> Option<Met> {
        let (plane, ray) = (self.place?, hand.ray()?);
        let (at, distance) = plane.met(&ray)?;
        let panel = Rect::from_min_size(pos2(0.0, 0.0), SIZE);
        let met = Met { at, distance, on_frame: !panel.contains(at) };
        panel.expand(FRAME).contains(at).then_some(met)
    }

    /// Puts an end of a distance where the ray meets something.
    fn place_end(&mut self, controls: &mut Controls) {
        let (Some(first), Some(hit)) = (self.measuring, self.hit) else { return };
        controls.feedback.pulse(self.active, CLICK);
        self.measuring = Some(match first {
            None => Some(hit.at_mm),
            Some(from_mm) => {
                controls.state.distances.push(Distance { from_mm, to_mm: hit.at_mm });
                self.panel.refresh();
                None
            }
        });
    }

    /// Lays out the panel and the marks for a head at a time, seconds, and carries out what the user asks for
    /// on the panel. `quality` says what is shown at less than full quality, if anything is.
    pub fn lay_out(
        &mut self,
        seconds: f64,
        head: &Pose,
        controls: &mut Controls,
        quality: &str,
    ) -> Result<()> {
        self.notice.take_if(|notice| notice.until <= seconds);
        let Marks { list, planes, .. } = self.marks(head, controls);
        self.planes = planes;
        self.paint(seconds, (self.place.is_some(), list), quality, head, controls)
    }

    /// Returns everything that is drawn beside the panel.
    fn marks(&self, head: &Pose, controls: &Controls) -> Marks {
        let mut marks = Marks::new(head.position, self.place.unwrap_or_default());
        let room = |mm: DVec3| controls.placement.room(mm);
        let end = self.hit.map(|hit| room(hit.at_mm));
        if let Some(panel) = &self.place {
            marks.on(Mark::Frame(self.aim.frame), panel, panel.place(pos2(0.0, 0.0)));
        }
        if let (Some(ray), true) = (self.aim.ray, self.place.is_some() || self.measuring.is_some()) {
            let length = self.aim.panel.or(end.map(|end| end.distance(ray.position))).unwrap_or(BEAM);
            let tip = ray.place(DVec3::NEG_Z * length);
            marks.line(Mark::Beam, ray.position, tip);
            if self.aim.panel.is_some() || end.is_some() {
                marks.at(Mark::Cursor, tip);
            }
        }
        let [low, high] = self.bounds;
        for (plane, hand) in controls.planes() {
            let corners = outline(&plane, self.bounds, hand.unwrap_or((low + high) * 0.5));
            for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
                marks.line(Mark::Edge, room(*from), room(*to));
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
        if let (Some(hit), Some(end), None) = (self.hit, end, &begun) {
            let DVec3 { x, y, z } = hit.at_mm;
            let text = format!("{:.0}{}\n({x:.1}, {y:.1}, {z:.1}) mm", hit.intensity, controls.unit);
            marks.at(Mark::Text(text), end);
        }
        if let Some(Notice { text, at, .. }) = &self.notice {
            marks.centred(Mark::Notice(text.clone()), *at, notice_middle(marks.list.len()));
        }
        if let Some(at) = self.card {
            let middle = Panel::anchor(marks.list.len()) + CARD * 0.5;
            marks.centred(Mark::Card, at, middle);
        }
        marks
    }

    /// Paints the panel, if it is shown, and marks.
    fn paint(
        &mut self,
        seconds: f64,
        (shown, marks): (bool, Vec<Mark>),
        quality: &str,
        head: &Pose,
        controls: &mut Controls,
    ) -> Result<()> {
        let pick = self.pick.as_ref();
        let info = PanelInfo {
            range: controls.range,
            unit: controls.unit,
            has_region: controls.has_region,
            object_splats: &self.object_splats,
            object_intensities: pick.map_or(&[], |pick| &pick.intensities),
            splat_histogram: pick.and_then(|pick| pick.histogram.as_ref()),
            draft: !quality.is_empty(),
            ..PanelInfo::default()
        };
        let (scale, can_go) = (controls.placement.scale, controls.can_go());
        let measuring = self.measuring.is_some();
        let mut content =
            PanelContent { state: &mut controls.state, info: &info, measuring, scale, quality, can_go };
        let pointer = self.aim.pointer;
        let Some(made) = self.panel.update(seconds, shown, pointer, marks, &mut content) else {
            return Ok(());
        };
        self.sheets.take(&made.primitives, made.textures, Panel::sheet);
        for request in made.requests {
            match request {
                Request::Action(Action::Transfer(name)) => controls.choose(&name)?,
                Request::Action(Action::Measure) => self.measure(),
                Request::Action(Action::Undo) => controls.undo(),
                Request::Action(Action::Redo) => controls.redo(),
                // The sections of this panel ask for no other actions.
                Request::Action(_) => {}
                Request::Reset => controls.reset(),
                Request::Card => self.show_card(head, &controls.placement),
            }
            self.panel.refresh();
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

/// Where a ray meets the panel or its frame.
#[derive(Clone, Copy)]
struct Met {
    /// Point of the screen.
    at: egui::Pos2,
    /// Distance from the hand, metres.
    distance: f64,
    /// True on the frame.
    on_frame: bool,
}

/// Returns the corners of a box.
fn corners([low, high]: [DVec3; 2]) -> [DVec3; 8] {
    std::array::from_fn(|n| DVec3::select(glam::BVec3::new(n & 1 > 0, n & 2 > 0, n & 4 > 0), high, low))
}

/// Returns a direction without its part up or down; -z if nothing is left.
fn level(direction: DVec3) -> DVec3 {
    (direction * DVec3::new(1.0, 0.0, 1.0)).try_normalize().unwrap_or(DVec3::NEG_Z)
}

/// Returns the place so far before a head, and so far below its eyes, metres.
fn before(head: &Pose, (distance, below): (f64, f64)) -> DVec3 {
    head.position + level(head.forward()) * distance - DVec3::Y * below
}

/// Returns a plane for the panel with its middle at a place: upright, towards a head.
fn upright(middle: DVec3, head: &Pose) -> Plane {
    let eye = DVec3::new(head.position.x, middle.y, head.position.z);
    Plane::facing((SIZE * 0.5).to_pos2(), middle, eye, POINT)
}

/// Returns the angles from straight ahead to the rightmost and to the leftmost of the places that are before a
/// head, radians, positive to the left; the first is above the second if there are none.
fn span(head: &Pose, places: &[DVec3]) -> [f64; 2] {
    let ahead = level(head.forward());
    let left = DVec3::Y.cross(ahead);
    let to = places.iter().map(|place| *place - head.position).filter(|to| to.dot(ahead) > 0.0);
    to.map(|to| to.dot(left).atan2(to.dot(ahead)))
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], angle| [low.min(angle), high.max(angle)])
}

/// Returns half of the angle that so many points take up for an eye that they face, radians.
fn half_angle(points: f32) -> f64 {
    (0.5 * f64::from(points) * POINT / BESIDE.0).atan()
}

/// Returns the place of the panel's or the card's middle before a head, at an angle to the left, radians.
fn aside(head: &Pose, angle: f64) -> DVec3 {
    let (distance, below) = BESIDE;
    let direction = DQuat::from_rotation_y(angle) * level(head.forward());
    head.position + direction * distance - DVec3::Y * below
}

/// Returns a plane for the panel: upright before a head, at the left of the patient, who is within these
/// corners in the room, metres. Of a patient who is wider than the eyes see, some may be behind the panel.
pub fn panel_beside(head: &Pose, patient: &[DVec3]) -> Plane {
    let [_, edge] = span(head, patient);
    let angle = (edge + GAP + half_angle(SIZE.x)).clamp(ASIDE[0], ASIDE[1]);
    upright(aside(head, angle), head)
}

/// Returns a place for the card's middle: before a head, beside the patient, who is within these corners in the
/// room, metres, and beside the panel, if it is shown. It is at the right of both, or at the left where a head
/// turns less to see it. Of what fills the view, some is behind the card.
fn card_beside(head: &Pose, patient: &[DVec3; 8], panel: Option<&Plane>) -> DVec3 {
    let frame = Rect::from_min_size(pos2(0.0, 0.0), SIZE).expand(FRAME);
    let ends = [frame.left_top(), frame.right_top()];
    let panel = panel.iter().flat_map(|panel| ends.map(|end| panel.place(end)));
    let others: Vec<DVec3> = patient.iter().copied().chain(panel).collect();
    let [right, left] = span(head, &others);
    let away = |edge: f64| (edge + GAP + half_angle(CARD.x)).max(CARD_ASIDE[0]);
    let (right, left) = (away(-right), away(left));
    // A patient in the middle has the card at the right: the panel comes at the left.
    let angle = if left + GAP < right { left } else { -right };
    aside(head, angle.clamp(-CARD_ASIDE[1], CARD_ASIDE[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: DVec3 = DVec3::new(1.0, 1.7, 2.0);

    fn patient(head: &Pose, half: f64) -> [DVec3; 8] {
        let middle = head.position + level(head.forward()) * 0.7;
        corners([middle - half, middle + half])
    }

    #[test]
    fn the_panel_stands_before_the_head_in_real_size() {
        let head = Pose { position: HEAD, orientation: DQuat::from_rotation_y(0.8) };
        let plane = panel_beside(&head, &patient(&head, 0.02));
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
    fn the_panel_hides_nothing_of_the_patient() {
        for (turn, half) in [(0.0, 0.05), (0.8, 0.12), (-2.0, 0.2)] {
            let head = Pose { position: HEAD, orientation: DQuat::from_rotation_y(turn) };
            let patient = patient(&head, half);
            let plane = panel_beside(&head, &patient);
            let angle = |place: DVec3| {
                let to = head.orientation.inverse() * (place - head.position);
                to.x.atan2(-to.z)
            };
            let rightmost = angle(plane.place(pos2(SIZE.x, 0.0)));
            let leftmost = patient.iter().map(|place| angle(*place)).fold(f64::INFINITY, f64::min);
            assert!(
                rightmost < leftmost,
                "{half} m: the panel up to {rightmost}, the patient from {leftmost}"
            );
        }
        let head = Pose { position: HEAD, ..Pose::IDENTITY };
        let behind = panel_beside(&head, &[HEAD + DVec3::Z]);
        assert!(behind.place((SIZE * 0.5).to_pos2()).z < HEAD.z - 0.5, "ahead, wherever the patient is");
        let around = panel_beside(&head, &corners([HEAD - 2.0, HEAD + 2.0]));
        assert!(around.place((SIZE * 0.5).to_pos2()).z < HEAD.z - 0.25, "never beside the head");
    }
    /// Returns the angles to the right and to the left edge of the card at a place, as a head sees them, radians,
    /// positive to the right, and the angle of a letter's height.
    fn seen(head: &Pose, at: DVec3) -> ([f64; 2], f64) {
        let mut marks = Marks::new(head.position, Plane::default());
        marks.centred(Mark::Card, at, Panel::anchor(0) + CARD * 0.5);
        let plane = marks.planes[1];
        let corner = |x: f32, y: f32| plane.place(Panel::anchor(0) + CARD * egui::vec2(x, y));
        let towards = (at - head.position).normalize();
        let normal = plane.right.cross(plane.down).normalize();
        assert!(normal.dot(towards) > 1.0 - 1e-9, "it is turned towards the eyes");
        let point = (corner(0.5, 1.0) - corner(0.5, 0.0)).length() / f64::from(CARD.y);
        let letter = (13.0 * point / at.distance(head.position)).atan();
        ([0.0, 1.0].map(|x| angle(head, corner(x, 0.5))), letter)
    }

    fn angle(head: &Pose, place: DVec3) -> f64 {
        let to = head.orientation.inverse() * (place - head.position);
        to.x.atan2(-to.z)
    }

    #[test]
    fn the_card_stands_beside_the_patient_and_the_panel() {
        for (turn, half) in [(0.0, 0.02), (0.8, 0.12), (-2.0, 0.18)] {
            let head = Pose { position: HEAD, orientation: DQuat::from_rotation_y(turn) };
            let ahead = DVec3::NEG_Z * 0.7;
            let patient = corners([ahead - half, ahead + half]).map(|place| head.place(place));
            let left = panel_beside(&head, &patient);
            // The same panel, carried to the other side of the patient.
            let mirrored = |place: DVec3| {
                let to = head.orientation.inverse() * (place - head.position);
                head.place(DVec3::new(-to.x, to.y, to.z))
            };
            let right = upright(mirrored(left.place((SIZE * 0.5).to_pos2())), &head);
            // Who looks at the panel clicks there, and sees the card beside it.
            let at_panel =
                Pose { orientation: DQuat::from_rotation_y(turn + 0.5 * (ASIDE[0] + ASIDE[1])), ..head };
            for (name, head, panel, side) in [
                ("no panel", head, None, 1.0),
                ("a panel at the left", head, Some(&left), 1.0),
                ("a panel at the right", head, Some(&right), -1.0),
                ("looking at the panel", at_panel, Some(&left), -1.0),
            ] {
                let place = card_beside(&head, &patient, panel);
                let ([from, to], letter) = seen(&head, place);
                let what = format!("{name}, {half} m: the card from {from} to {to}");
                assert!(side * (from + to) > 0.0, "{what}");
                assert!((0.5 * (from + to)).abs() <= CARD_ASIDE[1] + 1e-3, "{what}");
                assert!(letter.to_degrees() > 1.1, "{letter}: as large as on the panel");
                let panel = panel
                    .iter()
                    .flat_map(|panel| [-FRAME, SIZE.x + FRAME].map(|x| panel.place(pos2(x, 0.0))));
                for other in patient.iter().copied().chain(panel).map(|place| angle(&head, place)) {
                    assert!(other < from || other > to, "{what} hides what is at {other}");
                }
            }
        }
    }

    #[test]
    fn the_card_is_in_view_wherever_the_patient_is() {
        let head = Pose { position: HEAD, ..Pose::IDENTITY };
        for (what, patient) in [
            ("behind", [HEAD + DVec3::Z; 8]),
            ("around the head", corners([HEAD - 2.0, HEAD + 2.0])),
            ("nowhere", [DVec3::NAN; 8]),
        ] {
            let ([from, to], _) = seen(&head, card_beside(&head, &patient, None));
            assert!(from > 0.1 && from + to < 2.0 * CARD_ASIDE[1] + 1e-2, "{what}: from {from} to {to}");
        }
    }
}
