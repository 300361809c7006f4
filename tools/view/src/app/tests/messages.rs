//! How messages come and go, and what they leave free.

use super::*;

impl Bench {
    /// Returns the places of all texts on the screen that contain `part`.
    pub(super) fn rects_of(&self, part: &str) -> Vec<Rect> {
        let of = |clipped: &egui::epaint::ClippedShape| match &clipped.shape {
            Shape::Text(shape) if shape.galley.text().contains(part) => Some(shape.visual_bounding_rect()),
            _ => None,
        };
        self.shapes.iter().filter_map(of).collect()
    }
}

#[test]
fn what_was_done_fades_and_what_went_wrong_stays() {
    let mut bench = Bench::new();
    bench.app.done("The session is in a.toml.");
    bench.app.report(&Error::new(Kind::Usage, "VGS-X-001", "no such file").help("choose another"));
    bench.rest();
    bench.find("The session is in a.toml.");
    bench.time += 3.0;
    bench.rest();
    bench.find("The session is in a.toml.");
    bench.time += 10.0;
    bench.rest();
    assert_eq!(bench.place_of("The session is in a.toml."), None, "nobody needs it any more");
    bench.find("no such file [VGS-X-001]");
    // Its own button closes it; the list keeps both.
    let close = bench.find("✖");
    bench.click(close);
    assert_eq!((bench.place_of("no such file [VGS-X-001]"), bench.app.messages.latest()), (None, None));
    bench.press(Key::N, Modifiers::NONE);
    bench.find("The session is in a.toml.");
    bench.find("choose another");
    bench.press(Key::Escape, Modifiers::NONE);
    assert_eq!(bench.place_of("choose another"), None);
}

#[test]
fn a_message_that_is_being_read_stays() {
    let mut bench = Bench::new();
    bench.app.done("Written: a.png");
    bench.rest();
    let at = bench.find("Written: a.png");
    for _ in 0..30 {
        bench.time += 0.95;
        bench.frame(vec![Event::PointerMoved(at)], Modifiers::NONE);
    }
    bench.find("Written: a.png");
    bench.frame(vec![Event::PointerMoved(bench.middle())], Modifiers::NONE);
    bench.time += 3.0;
    bench.rest();
    assert_eq!(bench.place_of("Written: a.png"), None);
}

#[test]
fn messages_and_the_word_draft_cover_no_bar() {
    let mut bench = Bench::new();
    bench.draft = true;
    bench.app.state.show.overlay = true;
    for i in 0..9 {
        let text = format!("{i} took the place of a volume with a name that is as long as names can be");
        bench.app.report(&Error::new(Kind::Usage, "VGS-X-001", text).help("say what to do, and at length"));
    }
    bench.rest();
    let told = bench.rects_of("took the place");
    assert_eq!(told.len(), 3, "the latest of many");
    let told = told.into_iter().chain(bench.rects_of("and at length")).chain(bench.rects_of("draft"));
    let told = told.reduce(Rect::union).expect("messages");
    // Letters of the sides, the scale bar, the ends of the colour bar, the cube, frame times.
    let picture = bench.app.picture();
    for text in ["R", "L", "S", "I", " mm", " HU", "A", "fps", "device memory"] {
        for rect in bench.rects_of(text) {
            let whole = picture.contains_rect(rect) && !told.contains_rect(rect);
            assert!(!whole || !told.intersects(rect), "{text}: {rect:?} under {told:?}");
        }
    }
    assert!(picture.contains_rect(told), "{told:?} in {picture:?}");
}

#[test]
fn a_draft_says_so_in_the_corner_of_the_picture() {
    let mut bench = Bench::new();
    assert_eq!(bench.place_of("draft"), None);
    bench.draft = true;
    bench.rest();
    let (at, picture) = (bench.find("draft"), bench.app.picture());
    let corner = at - picture.left_top();
    assert!((0.0..60.0).contains(&corner.x) && (0.0..40.0).contains(&corner.y), "{at} in {picture}");
    bench.draft = false;
    bench.rest();
    assert_eq!(bench.place_of("draft"), None);
}

#[test]
fn what_fails_is_said() {
    let mut bench = Bench::new();
    bench.app.act(Action::Transfer("no such thing".into()), &PanelInfo::default());
    bench.rest();
    assert!(bench.app.messages.latest().is_some_and(|m| m.bad && m.text.contains("VGS-TF-006")));
    let before = bench.app.state.transfer.clone();
    assert_eq!(bench.app.state.transfer, before);
    bench.press(Key::Escape, Modifiers::NONE);
    assert_eq!(bench.app.messages.latest(), None);
}
