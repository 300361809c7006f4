use egui::{Context, Event, MouseWheelUnit, RawInput, TouchPhase};
use engine::transfer::window_level;

use super::*;

/// The splats' intensities.
const RANGE: [f64; 2] = [-1000.0, 1000.0];

/// An editor in a screen of its own.
struct Bench {
    context: Context,
    editor: Editor,
    transfer: Transfer,
    rect: Rect,
    time: f64,
}

impl Bench {
    fn new() -> Self {
        let ramp = window_level(400.0, 40.0, 0.5).expect("a window");
        let mut bench = Bench {
            context: Context::default(),
            editor: Editor::default(),
            transfer: Transfer::new(&ramp),
            rect: Rect::NOTHING,
            time: 0.0,
        };
        bench.frame(Vec::new(), Modifiers::NONE);
        bench
    }

    fn frame(&mut self, events: Vec<Event>, modifiers: Modifiers) {
        self.time += 0.05;
        let histogram = Histogram { range: RANGE, bins: vec![1.0; 64] };
        let events = [vec![Event::ModifiersChanged(modifiers)], events].concat();
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, vec2(500.0, 300.0)));
        let input = RawInput { screen_rect, time: Some(self.time), events, ..RawInput::default() };
        let output = self.context.run_ui(input, |ui| {
            let backdrop = Backdrop { range: RANGE, splats: Some(&histogram), volume: None };
            self.rect = show(ui, &mut self.editor, &mut self.transfer, &backdrop, 200.0).rect;
        });
        output.drop_without_applying_deltas();
    }

    fn plot(&self) -> Plot {
        let view = self.editor.view(full_range(&self.transfer, RANGE));
        Plot { rect: Rect::from_min_max(self.rect.min, self.rect.max - vec2(0.0, STRIP + AXIS)), view }
    }

    fn button(&mut self, pos: Pos2, button: PointerButton, pressed: bool, modifiers: Modifiers) {
        let event = Event::PointerButton { pos, button, pressed, modifiers };
        self.frame(vec![Event::PointerMoved(pos), event], modifiers);
    }

    fn drag(&mut self, from: Pos2, by: Vec2, button: PointerButton, modifiers: Modifiers) {
        self.frame(vec![Event::PointerMoved(from)], modifiers);
        self.button(from, button, true, modifiers);
        for i in 1..=10 {
            self.frame(vec![Event::PointerMoved(from + by * (i as f32 / 10.0))], modifiers);
        }
        self.button(from + by, button, false, modifiers);
    }

    fn press(&mut self, key: Key, modifiers: Modifiers) {
        let event = |pressed| Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
        self.frame(vec![event(true)], modifiers);
        self.frame(vec![event(false)], Modifiers::NONE);
    }
}

#[test]
fn a_point_follows_the_mouse() {
    let mut bench = Bench::new();
    let plot = bench.plot();
    let from = plot.point(&bench.transfer, 1) + vec2(3.0, -2.0);
    bench.drag(from, vec2(60.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    let moved = bench.transfer.points[1];
    let expected = plot.intensity(plot.x(240.0) + 60.0);
    assert!((moved.intensity - expected).abs() < 0.1, "{} {expected}", moved.intensity);
    let expected = opacity(height(0.5) - 30.0 / f64::from(plot.rect.height()));
    assert!((moved.opacity - expected).abs() < 1e-4, "{} {expected}", moved.opacity);
    assert_eq!(bench.transfer.points[0].intensity, -160.0, "the other one stays");
    // Beyond the edge and back: it comes back to the pointer.
    let from = bench.plot().point(&bench.transfer, 1);
    bench.frame(vec![Event::PointerMoved(from)], Modifiers::NONE);
    bench.button(from, PointerButton::Primary, true, Modifiers::NONE);
    for by in [vec2(50.0, 0.0), vec2(2000.0, 0.0), vec2(20.0, 0.0)] {
        bench.frame(vec![Event::PointerMoved(from + by)], Modifiers::NONE);
    }
    let back = plot.intensity(from.x + 20.0);
    assert!((bench.transfer.points[1].intensity - back).abs() < 0.1);
}

#[test]
fn shift_is_ten_times_finer() {
    let mut bench = Bench::new();
    let plot = bench.plot();
    let from = plot.point(&bench.transfer, 1);
    bench.drag(from, vec2(60.0, 0.0), PointerButton::Primary, Modifiers::SHIFT);
    let by = bench.transfer.points[1].intensity - 240.0;
    assert!((by - plot.span(6.0)).abs() < 0.2 * plot.span(6.0), "{by}");
}

#[test]
fn a_double_click_adds_and_delete_removes() {
    let mut bench = Bench::new();
    let at = bench.plot().at(600.0, 0.25);
    for _ in 0..2 {
        bench.button(at, PointerButton::Primary, true, Modifiers::NONE);
        bench.button(at, PointerButton::Primary, false, Modifiers::NONE);
    }
    assert_eq!(bench.transfer.points.len(), 3);
    let point = bench.transfer.points[2];
    assert!((point.intensity - 600.0).abs() < 3.0 && (point.opacity - 0.25).abs() < 0.01, "{point:?}");
    bench.press(Key::Delete, Modifiers::NONE);
    assert_eq!(bench.transfer.points.len(), 2);
    bench.press(Key::Delete, Modifiers::NONE);
    assert_eq!(bench.transfer.points.len(), 2, "two stay");
    bench.press(Key::Insert, Modifiers::NONE);
    assert_eq!(bench.transfer.points.len(), 3);
}

#[test]
fn arrows_move_the_chosen_point() {
    let mut bench = Bench::new();
    let plot = bench.plot();
    let at = plot.point(&bench.transfer, 1);
    bench.button(at, PointerButton::Primary, true, Modifiers::NONE);
    bench.button(at, PointerButton::Primary, false, Modifiers::NONE);
    let step = (plot.view[1] - plot.view[0]) * NUDGE;
    bench.press(Key::ArrowRight, Modifiers::NONE);
    assert!((bench.transfer.points[1].intensity - 240.0 - step).abs() < 1e-9);
    bench.press(Key::ArrowLeft, Modifiers::SHIFT);
    assert!((bench.transfer.points[1].intensity - 240.0 - 0.9 * step).abs() < 1e-9);
    bench.press(Key::ArrowDown, Modifiers::NONE);
    assert!((height(bench.transfer.points[1].opacity) - height(0.5) + 0.02).abs() < 1e-9);
    bench.press(Key::Home, Modifiers::NONE);
    assert_eq!(bench.editor.selected(&bench.transfer), Some(0));
}

#[test]
fn the_right_button_is_window_and_level_and_the_wheel_zooms() {
    let mut bench = Bench::new();
    let plot = bench.plot();
    let empty = plot.at(600.0, 0.8);
    bench.drag(empty, vec2(50.0, 0.0), PointerButton::Secondary, Modifiers::NONE);
    let [low, high] = bench.transfer.window();
    // The first of the ten moves is what tells a drag from a click.
    let wider = high - low - 400.0;
    assert!((plot.span(45.0) - 1.0..plot.span(50.0) + 1.0).contains(&wider), "{wider}");
    assert!(((low + high) * 0.5 - 40.0).abs() < 1e-6, "{}", (low + high) * 0.5);
    assert_eq!(bench.editor.selected(&bench.transfer), None);
    let wheel = Event::MouseWheel {
        unit: MouseWheelUnit::Line,
        delta: vec2(0.0, 4.0),
        phase: TouchPhase::Move,
        modifiers: Modifiers::NONE,
    };
    bench.frame(vec![Event::PointerMoved(empty), wheel], Modifiers::NONE);
    for _ in 0..20 {
        bench.frame(Vec::new(), Modifiers::NONE);
    }
    let near = bench.plot();
    assert!(near.view[1] - near.view[0] < 0.9 * (plot.view[1] - plot.view[0]), "{:?}", near.view);
    assert!(
        (near.intensity(empty.x) - plot.intensity(empty.x)).abs() < 1.0,
        "what is under the cursor stays"
    );
    bench.drag(empty, vec2(-40.0, 0.0), PointerButton::Primary, Modifiers::NONE);
    assert!(bench.plot().view[0] > near.view[0], "an empty place drags the view");
}
