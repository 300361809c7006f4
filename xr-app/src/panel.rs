//! The panel in the room, and marks beside it, drawn by egui. The sections are those of the desktop viewer.
//!
//! Everything is on one screen of egui's. The panel takes its left part; each mark has a rectangle of its own
//! far to the right of it, so that egui's primitives can be told apart by their clip rectangles. egui runs
//! when there is something new: the pointer, the content, or a time that egui has asked for.

use std::time::Duration;

use egui::epaint::ClippedPrimitive;
use egui::{
    Align2, Button, CentralPanel, Color32, Context, CornerRadius, Event, FontId, Id, LayerId, Modifiers,
    MouseWheelUnit, Order, Painter, PointerButton, Pos2, RawInput, Rect, ScrollArea, Stroke, StrokeKind,
    TexturesDelta, TouchPhase, Ui, Vec2, ViewportId, ViewportInfo, pos2, vec2,
};
use view::model::actions::Action;
use view::model::panel_info::PanelInfo;
use view::model::state::ViewState;
use view::panels;
use view::panels::editor::Editor;
use view::panels::theme::{self, ACCENT, SIGNAL};

use crate::card;

/// Width and height of the panel, points; in the room a point is a millimetre.
pub const SIZE: Vec2 = Vec2::new(400.0, 560.0);
/// Texels of a point: as fine as a headset with 25 pixels a degree shows it from 0.9 m.
const PIXELS_PER_POINT: f32 = 1.6;
/// Distance from the start of one mark's rectangle to the next, points.
const APART: f32 = 1000.0;
/// Length of a beam or a line on the screen, points; in the room it is stretched to its real length.
pub const LENGTH: f32 = 800.0;
/// Place of a mark in its rectangle, points: the start of a line, the middle of a cursor, the foot of a text.
pub const ANCHOR: Pos2 = pos2(90.0, 100.0);
/// Movement of a pointer, points, that does not count: hands tremble.
const STILL: f32 = 0.7;
/// Movement during a click, points, that does not make it a drag: a hand that pulls a trigger moves.
const CLICK: f32 = 16.0;
/// Points a second that a thumbstick at its end scrolls.
const SCROLL: f32 = 600.0;

/// Width of the frame around the panel, by which it is carried, points.
pub const FRAME: f32 = 34.0;
/// Width and height of the card of what hands do, points; it is narrow, so that it has room beside the patient.
pub const CARD: Vec2 = Vec2::new(300.0, 510.0);
/// Width of the card's first column, points, and the space to the second.
const COLUMN: f32 = 104.0;
const SPACE: f32 = 10.0;

/// Something that is drawn in the room.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// The ray of a hand.
    Beam,
    /// The end of the ray.
    Cursor,
    /// The line between two ends of a distance.
    Line,
    /// A few words above and beside a place.
    Text(String),
    /// A length, below the middle of its line.
    Length(String),
    /// An edge of a cutting plane's outline.
    Edge,
    /// A few large words around a place.
    Notice(String),
    /// The frame around the panel, whose upper left corner is the place; brighter while a hand points at it
    /// or carries it.
    Frame(bool),
    /// The card of what hands do; its upper left corner is the place.
    Card,
}

/// What a user asks for on the panel.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Something that the desktop viewer knows, too.
    Action(Action),
    /// Puts everything back.
    Reset,
    /// Shows the card of what hands do.
    Card,
}

/// A pointer on the panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pointer {
    /// Place of the pointer, points.
    pub at: Pos2,
    /// True if it clicks.
    pub down: bool,
    /// Scrolling by the thumbstick, points, up positive.
    pub scroll: f32,
}

/// egui's output for the panel and the marks.
pub struct PanelOutput {
    /// Triangles.
    pub primitives: Vec<ClippedPrimitive>,
    /// New and freed textures.
    pub textures: TexturesDelta,
    /// What the user asks for.
    pub requests: Vec<Request>,
}

/// The panel.
pub struct Panel {
    context: Context,
    editor: Editor,
    shown: bool,
    pointer: Option<Pointer>,
    marks: Vec<Mark>,
    /// What was said about the quality, and which steps of the history there were.
    said: (String, [bool; 2]),
    /// Time at which egui wants to run again by itself, seconds.
    again: f64,
}

/// The content of the sections: what they show, and what they change.
pub struct PanelContent<'a> {
    /// The state that is edited.
    pub state: &'a mut ViewState,
    /// Information that is shown.
    pub info: &'a PanelInfo<'a>,
    /// True if the measuring tool is in use.
    pub measuring: bool,
    /// Magnification; 1 is real size.
    pub scale: f64,
    /// What is shown at less than full quality; empty if nothing is.
    pub quality: &'a str,
    /// True if there is a step to undo, and one to redo.
    pub can_go: [bool; 2],
}

impl Panel {
    /// Creates a panel that is not shown.
    pub fn new() -> Self {
        let context = Context::default();
        theme::apply(&context);
        context.all_styles_mut(|style| {
            style.spacing.interact_size.y = 26.0;
            // A glyph has one picture, wherever it is, so that all of them can be made before the first frame.
            style.visuals.text_options.subpixel_binning = false;
        });
        context.options_mut(|options| options.input_options.max_click_dist = CLICK);
        Panel {
            context,
            editor: Editor::default(),
            shown: false,
            pointer: None,
            marks: Vec::new(),
            said: Default::default(),
            again: f64::NEG_INFINITY,
        }
    }

    /// Returns the place of a mark's anchor on the screen, by its number.
    pub fn anchor(mark: usize) -> Pos2 {
        ANCHOR + vec2(APART * (mark + 1) as f32, 0.0)
    }

    /// Returns the sheet of a clip rectangle: 0 for the panel, one more than its number for a mark.
    pub fn sheet(clip: Rect) -> usize {
        (clip.min.x / APART).floor().max(0.0) as usize
    }

    /// Makes egui run again, after something that it shows was changed from outside.
    pub fn refresh(&mut self) {
        self.again = f64::NEG_INFINITY;
    }

    /// Runs egui if there is anything new at this time, seconds. Returns its output if it ran.
    pub fn update(
        &mut self,
        seconds: f64,
        shown: bool,
        pointer: Option<Pointer>,
        marks: Vec<Mark>,
        content: &mut PanelContent<'_>,
    ) -> Option<PanelOutput> {
        let events = self.events(pointer);
        let said = (content.quality, content.can_go) == (self.said.0.as_str(), self.said.1);
        let same = shown == self.shown && marks == self.marks && events.is_empty() && (said || !shown);
        if same && seconds < self.again {
            return None;
        }
        if !said {
            self.said = (content.quality.to_owned(), content.can_go);
        }
        (self.shown, self.marks) = (shown, marks);
        let info = ViewportInfo { native_pixels_per_point: Some(PIXELS_PER_POINT), ..Default::default() };
        let input = RawInput {
            viewports: [(ViewportId::ROOT, info)].into_iter().collect(),
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, SIZE)),
            time: Some(seconds),
            events,
            ..RawInput::default()
        };
        let mut requests = Vec::new();
        let Panel { context, editor, marks, .. } = self;
        let mut output = context.run_ui(input, |ui| {
            if shown {
                CentralPanel::default().show(ui, |ui| sections(ui, editor, content, &mut requests));
            }
            for (number, mark) in marks.iter().enumerate() {
                paint(ui.ctx(), number, mark);
            }
        });
        let delay = output.viewport_output.values().map(|v| v.repaint_delay).min().unwrap_or(Duration::MAX);
        self.again = seconds + delay.as_secs_f64();
        let shapes = std::mem::take(&mut output.shapes);
        let primitives = self.context.tessellate(shapes, output.pixels_per_point);
        let textures = std::mem::take(&mut output.textures_delta);
        Some(PanelOutput { primitives, textures, requests })
    }

    /// Returns the pointer's changes as egui's events.
    fn events(&mut self, now: Option<Pointer>) -> Vec<Event> {
        let before = self.pointer;
        let button = |pos, pressed| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        let mut events = Vec::new();
        let Some(now) = now else {
            if let Some(before) = before {
                events.extend(before.down.then(|| button(before.at, false)));
                events.push(Event::PointerGone);
            }
            self.pointer = None;
            return events;
        };
        let moved = before.is_none_or(|before| (before.at - now.at).length() > STILL);
        let at = before.filter(|_| !moved).map_or(now.at, |before| before.at);
        if moved {
            events.push(Event::PointerMoved(at));
        }
        if now.down != before.is_some_and(|before| before.down) {
            events.push(button(at, now.down));
        }
        if now.scroll != 0.0 {
            events.push(Event::MouseWheel {
                unit: MouseWheelUnit::Point,
                delta: vec2(0.0, now.scroll),
                phase: TouchPhase::Move,
                modifiers: Modifiers::NONE,
            });
        }
        self.pointer = Some(Pointer { at, ..now });
        events
    }
}

impl Default for Panel {
    fn default() -> Self {
        Panel::new()
    }
}

/// Returns the points that a thumbstick scrolls in so many seconds.
pub fn scrolled(stick: f64, seconds: f64) -> f32 {
    SCROLL * (stick * seconds) as f32
}

fn sections(ui: &mut Ui, editor: &mut Editor, content: &mut PanelContent<'_>, requests: &mut Vec<Request>) {
    let PanelContent { state, info, measuring, scale, quality, can_go } = content;
    let mut actions = Vec::new();
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let size = if (*scale - 1.0).abs() < 5e-3 { " (real size)" } else { "" };
        ui.weak(format!("Scale {scale:.2}{size}. For looking, not for diagnosis."));
        if !quality.is_empty() {
            ui.colored_label(SIGNAL, *quality);
        }
        ui.horizontal(|ui| {
            let [undo, redo] = *can_go;
            for (text, enabled, request) in [
                ("Undo", undo, Request::Action(Action::Undo)),
                ("Redo", redo, Request::Action(Action::Redo)),
                ("Reset", true, Request::Reset),
                ("Controls", true, Request::Card),
            ] {
                if ui.add_enabled(enabled, Button::new(text)).clicked() {
                    requests.push(request);
                }
            }
        });
        ui.separator();
        ui.horizontal_wrapped(|ui| panels::transfer::presets(ui, state, info, &mut actions));
        ui.separator();
        panels::transfer::curve(ui, state, editor, info);
        ui.separator();
        panels::measure::show(ui, state, *measuring, &mut actions);
        ui.separator();
        panels::objects::show(ui, state, info, None);
        ui.separator();
        panels::light::response(ui, state);
        if info.has_region {
            ui.separator();
            panels::edges::show(ui, state);
        }
    });
    requests.extend(actions.into_iter().map(Request::Action));
}

/// Paints a mark into its rectangle.
fn paint(context: &Context, number: usize, mark: &Mark) {
    let anchor = Panel::anchor(number);
    let whole = Rect::from_min_size(anchor - ANCHOR.to_vec2(), vec2(APART - 1.0, APART));
    let layer = LayerId::new(Order::Tooltip, Id::new("marks"));
    let painter = Painter::new(context.clone(), layer, whole);
    let line = |width: f32| {
        let half = vec2(0.0, 0.5 * width);
        Rect::from_min_max(anchor - half, anchor + vec2(LENGTH, 0.0) + half)
    };
    match mark {
        Mark::Beam => _ = painter.rect_filled(line(2.0), 0.0, ACCENT.gamma_multiply(0.6)),
        Mark::Cursor => {
            painter.circle_filled(anchor, 5.0, Color32::BLACK);
            painter.circle_filled(anchor, 3.5, Color32::WHITE);
        }
        Mark::Line => {
            painter.rect_filled(line(3.0), 0.0, Color32::from_black_alpha(180));
            painter.rect_filled(line(1.4), 0.0, SIGNAL);
        }
        Mark::Text(text) => {
            words(&painter, anchor + vec2(12.0, -12.0), Align2::LEFT_BOTTOM, (13.0, SIGNAL), text)
        }
        Mark::Length(text) => {
            words(&painter, anchor + vec2(0.0, 12.0), Align2::CENTER_TOP, (13.0, SIGNAL), text)
        }
        Mark::Edge => {
            painter.rect_filled(line(5.0), 0.0, Color32::from_black_alpha(150));
            painter.rect_filled(line(2.6), 0.0, ACCENT);
        }
        // Far enough to the right that half of the words are within the rectangle.
        Mark::Notice(text) => {
            words(&painter, notice_middle(number), Align2::CENTER_CENTER, (22.0, Color32::WHITE), text);
        }
        Mark::Frame(bright) => frame(&painter, anchor, *bright),
        Mark::Card => card(&painter, anchor),
    }
}

/// Returns the place of a notice's middle on the screen, by the number of its mark.
pub fn notice_middle(mark: usize) -> Pos2 {
    Panel::anchor(mark) + vec2(0.5 * LENGTH - ANCHOR.x, 0.0)
}

fn words(painter: &Painter, at: Pos2, align: Align2, (size, colour): (f32, Color32), text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(size), colour);
    let place = align.anchor_size(at, galley.size());
    painter.rect_filled(place.expand(0.4 * size), CornerRadius::same(4), Color32::from_black_alpha(190));
    painter.galley(place.min, galley, colour);
}

/// Paints the frame around the panel, with a bar below, as of a thing that can be carried.
fn frame(painter: &Painter, corner: Pos2, bright: bool) {
    let panel = Rect::from_min_size(corner, SIZE);
    let colour = if bright { ACCENT } else { Color32::from_gray(96) };
    let middle = panel.expand(0.5 * FRAME);
    painter.rect_stroke(middle, CornerRadius::same(12), Stroke::new(3.0, colour), StrokeKind::Middle);
    let bar = Rect::from_center_size(middle.center_bottom(), vec2(120.0, 12.0));
    painter.rect_filled(bar, CornerRadius::same(6), colour);
}

/// Paints the card: what to do at the left, what it does at the right.
fn card(painter: &Painter, corner: Pos2) {
    let whole = Rect::from_min_size(corner, CARD);
    painter.rect_filled(whole, CornerRadius::same(10), Color32::from_gray(28));
    painter.rect_stroke(whole, CornerRadius::same(10), Stroke::new(1.5, ACCENT), StrokeKind::Inside);
    let inner = whole.shrink(18.0);
    let mut y = inner.top();
    // Paints a text from one edge to another and returns its height.
    let text = |[from, to]: [f32; 2], y: f32, size: f32, colour: Color32, text: &str| {
        let galley = painter.layout(text.to_owned(), FontId::proportional(size), colour, to - from);
        let height = galley.size().y;
        painter.galley(pos2(from, y), galley, colour);
        height
    };
    let both = [inner.left(), inner.right()];
    let first = [inner.left(), inner.left() + COLUMN];
    let second = [first[1] + SPACE, inner.right()];
    let (grey, white) = (Color32::from_gray(190), Color32::WHITE);
    y += text(both, y, 19.0, white, card::HEADING) + 8.0;
    for rows in [&card::CONTROLLERS[..], &card::BARE[..]] {
        for [what, does] in rows {
            let heights = [text(first, y, 13.0, ACCENT, what), text(second, y, 13.0, white, does)];
            y += heights[0].max(heights[1]) + 4.0;
        }
        y += 6.0;
    }
    text(both, y, 13.0, grey, card::CLOSING);
}

#[cfg(test)]
mod tests {
    use engine::transfer::preset;

    use super::*;

    fn state() -> ViewState {
        ViewState::new(&preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]))
    }

    /// Runs a panel once, at a time and with a pointer.
    fn run(
        panel: &mut Panel,
        state: &mut ViewState,
        seconds: f64,
        pointer: Option<Pointer>,
    ) -> Option<PanelOutput> {
        let info = PanelInfo { range: [-1000.0, 2000.0], ..PanelInfo::default() };
        let can_go = [false; 2];
        let mut content =
            PanelContent { state, info: &info, measuring: false, scale: 1.0, quality: "", can_go };
        let notice = Mark::Notice("Keep holding to reset".into());
        let marks = vec![Mark::Text("7 HU".into()), Mark::Cursor, notice, Mark::Frame(true), Mark::Card];
        let mut made = panel.update(seconds, true, pointer, marks, &mut content);
        made.iter_mut().for_each(|made| made.textures.clear());
        made
    }

    #[test]
    fn egui_runs_when_there_is_something_new() {
        let (mut panel, mut state) = (Panel::new(), state());
        // Sizes settle in the first runs.
        let mut at = 0.0;
        let mut step = |panel: &mut Panel, state: &mut ViewState, pointer| {
            at += 0.1;
            run(panel, state, at, pointer)
        };
        (0..4).for_each(|_| _ = step(&mut panel, &mut state, None));
        for _ in 0..20 {
            assert!(step(&mut panel, &mut state, None).is_none(), "nothing is new");
        }
        let pointer = |x, down| Some(Pointer { at: pos2(x, 300.0), down, scroll: 0.0 });
        assert!(step(&mut panel, &mut state, pointer(10.0, false)).is_some(), "a pointer");
        (0..10).for_each(|_| _ = step(&mut panel, &mut state, pointer(10.0, false)));
        assert!(step(&mut panel, &mut state, pointer(10.3, false)).is_none(), "it trembles");
        assert!(step(&mut panel, &mut state, pointer(12.0, false)).is_some(), "it moves");
        panel.refresh();
        assert!(step(&mut panel, &mut state, pointer(12.0, false)).is_some(), "something has changed");
    }

    #[test]
    fn marks_are_told_from_the_panel_by_where_they_are() {
        let (mut panel, mut state) = (Panel::new(), state());
        let made = run(&mut panel, &mut state, 0.0, None).expect("a first run");
        let mut sheets: Vec<usize> = made.primitives.iter().map(|p| Panel::sheet(p.clip_rect)).collect();
        sheets.sort_unstable();
        sheets.dedup();
        assert_eq!(sheets, [0, 1, 2, 3, 4, 5]);
        for primitive in &made.primitives {
            let egui::epaint::Primitive::Mesh(mesh) = &primitive.primitive else { continue };
            let sheet = Panel::sheet(primitive.clip_rect);
            let bounds = mesh.calc_bounds();
            assert!(sheet == 0 || primitive.clip_rect.contains_rect(bounds), "{sheet}: {bounds:?}");
            // The card has room for its words, and little more; its edge is softened over a point.
            if sheet == 5 {
                let card = Rect::from_min_size(Panel::anchor(4), CARD);
                assert!(card.expand(1.0).contains_rect(bounds), "{card:?}: {bounds:?}");
            }
        }
    }
}
