//! The picture between the panels: what the mouse does in it, and what is painted over it.

use egui::{Align2, Color32, CursorIcon, PointerButton, Pos2, Response, Sense, TextStyle, Ui, vec2};
use glam::DVec2;

use super::app::App;
use super::drag::{Drag, Target};
use crate::model::actions::Action;
use crate::model::cube;
use crate::model::panel_info::PanelInfo;
use crate::model::state::{Distance, Subject, ViewState};
use crate::panels::annotations::{self, Ink, PictureOverlay, Told};
use crate::panels::handles;
use crate::panels::theme::SIGNAL;
use crate::panels::{self, status::Reading};

/// Length of a drag that turns by a degree, points of the screen.
const POINTS_PER_DEGREE: f64 = 3.0;

/// Length of a drag that changes the window by a factor of e, points of the screen.
const POINTS_PER_E: f64 = 250.0;

/// Greatest distance from which a handle can be grasped, points of the screen.
const REACH: f32 = 9.0;

/// Least distance of the split from the borders, as a share of the picture's width.
const SPLIT_EDGE: f64 = 0.02;

impl App {
    /// Reserves the place of the picture and handles the mouse in it.
    pub(super) fn central(&mut self, ui: &mut Ui, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
        let rect = ui.available_rect_before_wrap();
        self.picture = rect;
        self.pixels_per_point = ui.pixels_per_point();
        if !(rect.width() >= 1.0 && rect.height() >= 1.0) {
            return;
        }
        if info.bounds.is_none() {
            self.reading = None;
            match (info.progress, info.deleted) {
                (Some(_), _) => {}
                (None, 0) => panels::welcome::show(ui, rect, &self.settings.recent, actions),
                (None, _) => panels::welcome::all_deleted(ui, rect, &mut self.state.deleted, info),
            }
            return;
        }
        if let (true, Some(bounds)) = (self.frame_all, info.bounds) {
            self.state.orbit.fit(bounds, self.aspect());
            self.frame_all = false;
        }
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let over = self.grip(ui, &response, info);
        if self.grip.is_none() {
            self.lead(ui, &response);
        }
        self.point(&response, info);
        self.cube(ui, info, actions);
        self.paint(ui, &response, info, over);
        if info.draft {
            // Bars are below, messages follow it.
            let at = rect.left_top() + vec2(10.0, 8.0);
            let font = TextStyle::Body.resolve(ui.style());
            for (by, colour) in [(1.0, Color32::BLACK), (0.0, SIGNAL)] {
                let at = at + egui::Vec2::splat(by);
                ui.painter().text(at, Align2::LEFT_TOP, "draft", font.clone(), colour);
            }
        }
    }

    /// Looks from the side of the cube that is clicked.
    fn cube(&self, ui: &Ui, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
        if !(self.state.show.cube && info.oriented) {
            return;
        }
        let place = annotations::cube_place(self.picture);
        let response = ui.interact(place, ui.id().with("cube"), Sense::click());
        let at = response.hover_pos().map(|at| annotations::in_cube(self.picture, at));
        let Some(side) = at.and_then(|at| cube::hit(&self.state.orbit, at)) else { return };
        if response.on_hover_text(format!("look from the {} side", side.name())).clicked() {
            actions.push(Action::View(side));
        }
    }

    /// Starts and continues drags of handles and of the split. Returns what is dragged or under the cursor.
    fn grip(&mut self, ui: &Ui, response: &Response, info: &PanelInfo<'_>) -> Option<Target> {
        let primary = PointerButton::Primary;
        if response.drag_started_by(primary) && ui.input(|i| !i.modifiers.shift && !i.modifiers.command) {
            // egui reports a drag only after the mouse has moved a little.
            let origin = ui.input(|i| i.pointer.press_origin());
            self.grip = origin.and_then(|at| Some(Drag { what: self.grip_at(at, info)?, at }));
        }
        if !response.dragged_by(primary) {
            self.grip = None;
        }
        let held = self.grip.map(|held| held.what);
        let over = held.or_else(|| response.hover_pos().and_then(|at| self.grip_at(at, info)));
        if over.is_some() {
            let icon =
                if over == Some(Target::Split) { CursorIcon::ResizeHorizontal } else { CursorIcon::Grab };
            ui.ctx().set_cursor_icon(icon);
        }
        let aspect = self.aspect();
        let (Some(held), Some(at)) = (&mut self.grip, response.interact_pointer_pos()) else { return over };
        let before = std::mem::replace(&mut held.at, at);
        let what = held.what;
        let places = [self.place(before), self.place(at)];
        match (what, info.bounds) {
            (Target::Split, _) => self.state.split = Some(places[1].x.clamp(SPLIT_EDGE, 1.0 - SPLIT_EDGE)),
            (Target::Handle(handle), Some(bounds)) => {
                let ViewState { clip, orbit, .. } = &mut self.state;
                handles::drag(clip, handle, bounds, orbit, aspect, places);
            }
            (Target::Handle(_), None) => {}
        }
        over
    }

    /// Returns what can be dragged at a place of the screen.
    fn grip_at(&self, at: Pos2, info: &PanelInfo<'_>) -> Option<Target> {
        let place = self.place(at);
        let size = self.picture.size();
        let reach = f64::from(REACH / size.y);
        let ViewState { clip, orbit, show, split, .. } = &self.state;
        if let (true, Some(bounds)) = (show.handles, info.bounds) {
            let placed = handles::handles(clip, bounds);
            if let Some(handle) = handles::hit(&placed, orbit, self.aspect(), place, reach) {
                return Some(Target::Handle(handle));
            }
        }
        let near = |split: f64| (place.x - split).abs() * f64::from(size.x) < f64::from(REACH);
        split.filter(|_| info.has_two()).is_some_and(near).then_some(Target::Split)
    }

    /// Paints annotations over the picture.
    fn paint(&self, ui: &Ui, response: &Response, info: &PanelInfo<'_>, over: Option<Target>) {
        let Some(bounds) = info.bounds else { return };
        let state = &self.state;
        let painter = ui.painter_at(self.picture);
        let paint = PictureOverlay {
            painter: &painter,
            rect: self.picture,
            orbit: &state.orbit,
            aspect: self.aspect(),
            ink: Ink::on(Some(state.background)),
        };
        if state.show.handles {
            let bright =
                over.and_then(|grip| if let Target::Handle(handle) = grip { Some(handle) } else { None });
            paint.handles(&state.clip, bounds, bright);
        }
        let subjects = state.subjects(|subject| info.has(subject));
        let PanelInfo { oriented, range, unit, fitted, .. } = *info;
        let shown = info.error.found().filter(|_| info.error_shown);
        let error = shown.map(|error| state.errors.range(error));
        paint.tell(state, &Told { oriented, range, unit, subjects: &subjects, fitted, error });
        if let (Some(split), 2) = (state.split, subjects.len()) {
            paint.grip(split);
        }
        if let (true, Some(at_mm)) = (state.slices.shown, state.slices.at_mm) {
            paint.crosshair(at_mm);
        }
        if let Some(from) = self.measuring.flatten() {
            paint.begun(from, self.reading.map(|r| r.at_mm));
        }
        if let (Some(_), Some(reading), Some(cursor)) = (self.measuring, &self.reading, response.hover_pos())
        {
            paint.reading(cursor, reading, info.unit);
        }
    }

    /// Converts a place of the screen to fractions of the picture from its upper left corner.
    fn place(&self, at: Pos2) -> DVec2 {
        let size = self.picture.size();
        let from = at - self.picture.min;
        DVec2::new(f64::from(from.x / size.x), f64::from(from.y / size.y))
    }

    /// Turns, moves and zooms the camera, moves the light, or changes window and level, as the mouse says.
    fn lead(&mut self, ui: &Ui, response: &Response) {
        let aspect = self.aspect();
        let by = response.drag_delta();
        let (x, y) = (f64::from(by.x), f64::from(by.y));
        let size = self.picture.size();
        let (shift, command) = ui.input(|i| (i.modifiers.shift, i.modifiers.command));
        if response.dragged_by(PointerButton::Middle)
            || (shift && response.dragged_by(PointerButton::Primary))
        {
            let by = DVec2::new(x / f64::from(size.x), y / f64::from(size.y));
            self.state.orbit.pan(by, aspect);
        } else if response.dragged_by(PointerButton::Primary) && command && self.state.transfer.material.shade
        {
            let axes = self.state.orbit.axes();
            panels::light::drag(&mut self.state.light, by, 0.5 * size.y, axes);
        } else if response.dragged_by(PointerButton::Primary) {
            self.state.orbit.turn(-x / POINTS_PER_DEGREE, y / POINTS_PER_DEGREE);
        } else if response.dragged_by(PointerButton::Secondary) && by != egui::Vec2::ZERO {
            let [low, high] = self.state.transfer.window();
            let (width, level) = (high - low, (low + high) * 0.5);
            let half = 0.5 * width * (x / POINTS_PER_E).exp();
            let level = level - width * y / POINTS_PER_E;
            self.state.edit_transfer(|state| state.transfer.set_window([level - half, level + half]));
        }
        if let Some(at) = response.hover_pos() {
            let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            let factor = (-f64::from(scroll) / POINTS_PER_E).exp() / f64::from(pinch);
            if factor != 1.0 {
                self.state.orbit.zoom(factor, self.place(at), aspect);
            }
        }
    }

    /// Reads the point under the cursor, measures distances, and moves the pivot.
    fn point(&mut self, response: &Response, info: &PanelInfo<'_>) {
        if self.held && !response.clicked() {
            // The next frame shows another picture: nobody waits for what lies under the cursor in this one.
            self.reading = None;
            return;
        }
        let aspect = self.aspect();
        let hit = |at: Pos2| {
            let place = self.place(at);
            (info.depth)(place).map(|depth| self.state.orbit.at_depth(place, depth, aspect))
        };
        let under = response.hover_pos().and_then(hit);
        let place = response.hover_pos().map(|at| self.place(at));
        let sample = match place.and_then(|place| self.state.subject_at(place.x, |subject| info.has(subject)))
        {
            Some(Subject::Beside) => info.sample_beside,
            _ => info.sample,
        };
        self.reading = under.map(|at_mm| Reading { at_mm, intensity: sample(at_mm) });
        let Some(at_mm) = under else { return };
        if let (Some(first), true) = (self.measuring, response.clicked()) {
            match first {
                None => self.measuring = Some(Some(at_mm)),
                Some(from_mm) => {
                    self.state.distances.push(Distance { from_mm, to_mm: at_mm });
                    self.measuring = Some(None);
                }
            }
        } else if response.double_clicked() {
            self.state.orbit.pivot_mm = at_mm;
        } else if self.state.slices.shown && response.clicked() {
            self.state.slices.at_mm = Some(at_mm);
        }
    }
}
