//! Widget of the editor: the histograms, the curve over them, and points to drag.

use egui::{
    Align2, Color32, CornerRadius, CursorIcon, EventFilter, FontId, InputState, Key, Mesh, Modifiers,
    Painter, PointerButton, Pos2, Rect, Response, Sense, Shape, Stroke, Ui, Vec2, pos2, vec2,
};
use engine::transfer::TransferFunction;

use super::editor::{Editor, full_range, height, opacity, ticks};
use crate::model::histogram::Histogram;
use crate::model::transfer::Transfer;
use crate::panels::theme::{ACCENT, screen};

/// Greatest distance from which a point can be grasped, points of the screen.
const REACH: f32 = 9.0;
/// Height of the strip of colours below the curve.
const STRIP: f32 = 12.0;
/// Height of the axis below the strip.
const AXIS: f32 = 16.0;
/// Share of the visible range by which an arrow key moves; with Shift a tenth of it.
const NUDGE: f64 = 1.0 / 200.0;

/// Range and histograms behind the curve.
pub struct Backdrop<'a> {
    /// Least and greatest intensity of the data, HU for CT.
    pub range: [f64; 2],
    /// Intensities of the splats.
    pub splats: Option<&'a Histogram>,
    /// Intensities of the volume.
    pub volume: Option<&'a Histogram>,
}

/// Converts between intensities and heights and places of the screen.
#[derive(Clone, Copy)]
struct Plot {
    rect: Rect,
    view: [f64; 2],
}

impl Plot {
    fn x(&self, v: f64) -> f32 {
        let [low, high] = self.view;
        self.rect.left() + ((v - low) / (high - low)) as f32 * self.rect.width()
    }

    fn intensity(&self, x: f32) -> f64 {
        let [low, high] = self.view;
        low + f64::from((x - self.rect.left()) / self.rect.width()) * (high - low)
    }

    fn at(&self, v: f64, opacity: f64) -> Pos2 {
        pos2(self.x(v), self.rect.bottom() - height(opacity) as f32 * self.rect.height())
    }

    fn point(&self, transfer: &Transfer, index: usize) -> Pos2 {
        let p = &transfer.points[index];
        self.at(p.intensity + transfer.shift, p.opacity)
    }

    fn opacity(&self, y: f32) -> f64 {
        opacity(f64::from((self.rect.bottom() - y) / self.rect.height()))
    }

    /// Returns the width on the screen as a difference of intensities.
    fn span(&self, points: f32) -> f64 {
        f64::from(points / self.rect.width()) * (self.view[1] - self.view[0])
    }
}

/// Shows the editor over the whole width, `tall` points high.
pub fn show(
    ui: &mut Ui,
    editor: &mut Editor,
    transfer: &mut Transfer,
    backdrop: &Backdrop<'_>,
    tall: f32,
) -> Response {
    let (whole, response) = ui.allocate_exact_size(vec2(ui.available_width(), tall), Sense::click_and_drag());
    let full = full_range(transfer, backdrop.range);
    let rect = Rect::from_min_max(whole.min, whole.max - vec2(0.0, STRIP + AXIS));
    let plot = Plot { rect, view: editor.view(full) };
    mouse(ui, &response, editor, transfer, &plot, full);
    if response.has_focus() {
        let filter = EventFilter { horizontal_arrows: true, vertical_arrows: true, ..EventFilter::default() };
        ui.memory_mut(|memory| memory.set_focus_lock_filter(response.id, filter));
        ui.input_mut(|input| keys(input, editor, transfer, &plot, full));
    }
    if ui.is_rect_visible(whole) {
        let plot = Plot { view: editor.view(full), ..plot };
        paint(&ui.painter_at(whole.expand(1.0)), &plot, whole, editor, transfer, backdrop);
        if response.has_focus() {
            let stroke = Stroke::new(1.0, ACCENT);
            ui.painter().rect_stroke(rect, CornerRadius::same(2), stroke, egui::StrokeKind::Outside);
        }
    }
    response
}

/// Returns the index of the point at a place of the screen, if there is one.
fn point_at(transfer: &Transfer, plot: &Plot, at: Pos2) -> Option<usize> {
    let distance = |i: &usize| plot.point(transfer, *i).distance(at);
    let nearest = (0..transfer.points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    (distance(&nearest) <= REACH).then_some(nearest)
}

fn mouse(
    ui: &Ui,
    response: &Response,
    editor: &mut Editor,
    transfer: &mut Transfer,
    plot: &Plot,
    full: [f64; 2],
) {
    let pointer = response.interact_pointer_pos();
    // What is dragged is decided when the button goes down and kept until it goes up, as the distance of the
    // pointer from the point.
    let grip = response.id.with("grip");
    if response.is_pointer_button_down_on() && ui.input(|i| i.pointer.any_pressed()) {
        response.request_focus();
        let primary = ui.input(|i| i.pointer.primary_pressed());
        let hit = pointer.filter(|_| primary).and_then(|at| point_at(transfer, plot, at));
        if primary {
            editor.select(hit);
        }
        let held = pointer.zip(hit).map(|(at, i)| at - plot.point(transfer, i));
        ui.data_mut(|data| data.insert_temp(grip, held));
    }
    let held: Option<Vec2> = ui.data(|data| data.get_temp(grip)).flatten();
    let by = response.drag_delta();
    if let (true, Some(held), Some(at)) = (response.dragged_by(PointerButton::Primary), held, pointer) {
        let fine = ui.input(|i| i.modifiers.shift);
        let held = drag_point(editor, transfer, plot, full, Drag { at, by, held, fine });
        ui.data_mut(|data| data.insert_temp(grip, held));
    } else if response.dragged_by(PointerButton::Secondary) {
        window_level(transfer, plot, by);
    } else if response.dragged() {
        editor.pan(-plot.span(by.x), full);
    }
    if let (true, Some(at)) = (response.double_clicked(), pointer)
        && point_at(transfer, plot, at).is_none()
    {
        editor.add(transfer, plot.intensity(at.x), plot.opacity(at.y), full);
    }
    if let Some(at) = response.hover_pos() {
        let scroll = ui.input_mut(|i| std::mem::take(&mut i.smooth_scroll_delta));
        if scroll.y != 0.0 {
            editor.zoom((-f64::from(scroll.y) / 200.0).exp(), plot.intensity(at.x), full);
        }
        let hand = point_at(transfer, plot, at).is_some();
        ui.ctx().set_cursor_icon(if hand { CursorIcon::Grab } else { CursorIcon::Crosshair });
    }
}

/// Drag of a point: place of the pointer, its movement, its distance from the point when it grasped it, and
/// whether the point follows a tenth as far.
struct Drag {
    at: Pos2,
    by: Vec2,
    held: Vec2,
    fine: bool,
}

/// Moves the selected point with the pointer; returns their distance from now on.
fn drag_point(
    editor: &mut Editor,
    transfer: &mut Transfer,
    plot: &Plot,
    full: [f64; 2],
    drag: Drag,
) -> Option<Vec2> {
    let index = editor.selected(transfer)?;
    let before = plot.point(transfer, index);
    let to = if drag.fine { before + drag.by * 0.1 } else { drag.at - drag.held };
    let opacity = if to.y == before.y { transfer.points[index].opacity } else { plot.opacity(to.y) };
    editor.move_to(transfer, plot.intensity(to.x), opacity, full);
    Some(if drag.fine { drag.at - to } else { drag.held })
}

/// Changes window and level: a drag across widens the window, a drag upwards raises the level.
fn window_level(transfer: &mut Transfer, plot: &Plot, by: Vec2) {
    let [low, high] = transfer.window();
    let (level, half) = ((low + high) * 0.5 - plot.span(by.y), 0.5 * (high - low) + 0.5 * plot.span(by.x));
    transfer.set_window([level - half, level + half]);
}

fn keys(input: &mut InputState, editor: &mut Editor, transfer: &mut Transfer, plot: &Plot, full: [f64; 2]) {
    let [low, high] = plot.view;
    for (modifiers, factor) in [(Modifiers::SHIFT, 0.1), (Modifiers::NONE, 1.0)] {
        let (across, up) = ((high - low) * NUDGE * factor, 0.02 * factor);
        for (key, across, up) in [
            (Key::ArrowLeft, -across, 0.0),
            (Key::ArrowRight, across, 0.0),
            (Key::ArrowUp, 0.0, up),
            (Key::ArrowDown, 0.0, -up),
        ] {
            for _ in 0..input.count_and_consume_key(modifiers, key) {
                editor.nudge(transfer, across, up, full);
            }
        }
    }
    if input.consume_key(Modifiers::NONE, Key::Insert) {
        editor.add_beside(transfer, full);
    }
    if input.consume_key(Modifiers::NONE, Key::Delete) || input.consume_key(Modifiers::NONE, Key::Backspace) {
        editor.remove(transfer);
    }
    for (key, forward) in [(Key::Home, false), (Key::End, true)] {
        if input.consume_key(Modifiers::NONE, key) {
            editor.select_next(transfer, forward);
        }
    }
}

fn paint(
    painter: &Painter,
    plot: &Plot,
    whole: Rect,
    editor: &Editor,
    transfer: &Transfer,
    backdrop: &Backdrop<'_>,
) {
    painter.rect_filled(plot.rect, CornerRadius::same(2), Color32::from_gray(16));
    for share in [0.25, 0.5, 0.75] {
        let y = plot.rect.bottom() - share * plot.rect.height();
        painter.hline(plot.rect.x_range(), y, Stroke::new(1.0, Color32::from_gray(32)));
    }
    let clipped = painter.with_clip_rect(plot.rect);
    if let Some(histogram) = backdrop.volume {
        paint_histogram(&clipped, plot, histogram, Color32::from_gray(70));
    }
    if let Some(histogram) = backdrop.splats {
        paint_histogram(&clipped, plot, histogram, ACCENT.gamma_multiply(0.5));
    }
    paint_axis(painter, plot, whole);
    let Ok(function) = transfer.function() else { return };
    paint_curve(&clipped, plot, whole, &function, painter);
    for (i, point) in transfer.points.iter().enumerate() {
        let at = plot.point(transfer, i);
        let chosen = editor.selected(transfer) == Some(i);
        let (radius, stroke) = if chosen { (6.5, 2.0) } else { (4.5, 1.2) };
        let ring = Stroke::new(stroke, if chosen { ACCENT } else { Color32::from_gray(230) });
        if plot.rect.expand(2.0).x_range().contains(at.x) {
            painter.circle(at, radius, screen(point.colour), ring);
        }
    }
}

/// Paints a histogram as columns of the heights of its bins.
fn paint_histogram(painter: &Painter, plot: &Plot, histogram: &Histogram, colour: Color32) {
    let heights = histogram.heights();
    let [low, high] = histogram.range;
    let width = (high - low) / heights.len() as f64;
    let mut mesh = Mesh::default();
    for (i, &share) in heights.iter().enumerate().filter(|(_, share)| **share > 0.0) {
        let left = plot.x(low + i as f64 * width);
        let right = plot.x(low + (i + 1) as f64 * width);
        if right < plot.rect.left() || left > plot.rect.right() {
            continue;
        }
        let top = plot.rect.bottom() - share * plot.rect.height();
        mesh.add_colored_rect(Rect::from_min_max(pos2(left, top), pos2(right, plot.rect.bottom())), colour);
    }
    painter.add(Shape::mesh(mesh));
}

/// Paints the curve of opacity, filled with the colours of the function, and the strip of colours below it.
fn paint_curve(clipped: &Painter, plot: &Plot, whole: Rect, function: &TransferFunction, painter: &Painter) {
    let columns = plot.rect.width().ceil().max(1.0) as usize;
    let mut line = Vec::with_capacity(columns + 1);
    let (mut fill, mut strip) = (Mesh::default(), Mesh::default());
    let strip_rect = Rect::from_min_max(
        plot.rect.left_bottom() + vec2(0.0, 2.0),
        pos2(whole.right(), plot.rect.bottom() + STRIP),
    );
    for i in 0..=columns {
        let x = plot.rect.left() + plot.rect.width() * i as f32 / columns as f32;
        let (colour, opacity) = function.at(plot.intensity(x));
        let at = plot.at(plot.intensity(x), opacity);
        let colour = screen(colour);
        line.push(pos2(x, at.y));
        column(&mut fill, at, plot.rect.bottom(), colour.gamma_multiply(0.35));
        column(&mut strip, pos2(x, strip_rect.top()), strip_rect.bottom(), colour);
    }
    clipped.add(Shape::mesh(fill));
    painter.add(Shape::mesh(strip));
    clipped.add(Shape::line(line, Stroke::new(1.6, Color32::from_gray(235))));
}

/// Adds a column to a mesh: two vertices, joined to the previous two.
fn column(mesh: &mut Mesh, top: Pos2, bottom: f32, colour: Color32) {
    let next = mesh.vertices.len() as u32;
    mesh.colored_vertex(top, colour);
    mesh.colored_vertex(pos2(top.x, bottom), colour);
    if next >= 2 {
        mesh.add_triangle(next - 2, next - 1, next);
        mesh.add_triangle(next - 1, next, next + 1);
    }
}

fn paint_axis(painter: &Painter, plot: &Plot, whole: Rect) {
    let count = (plot.rect.width() / 55.0).floor().max(1.0) as usize;
    for v in ticks(plot.view, count) {
        let x = plot.x(v);
        painter.vline(x, plot.rect.y_range(), Stroke::new(1.0, Color32::from_gray(38)));
        let align = if x > whole.right() - 16.0 {
            Align2::RIGHT_BOTTOM
        } else if x < whole.left() + 16.0 {
            Align2::LEFT_BOTTOM
        } else {
            Align2::CENTER_BOTTOM
        };
        // Labels are multiples of the step, without the digits that rounding leaves.
        let text = format!("{}", (v * 1e9).round() / 1e9);
        painter.text(
            pos2(x, whole.bottom()),
            align,
            text,
            FontId::proportional(10.0),
            Color32::from_gray(160),
        );
    }
}

#[cfg(test)]
#[path = "tests/widget.rs"]
mod tests;
