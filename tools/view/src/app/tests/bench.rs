//! What drives the window without a screen.

use super::*;

pub(super) const SCREEN: Rect = Rect { min: Pos2::ZERO, max: pos2(1200.0, 800.0) };

/// An app in a window that is not there.
pub(super) struct Bench {
    pub(super) context: Context,
    pub(super) app: App,
    pub(super) time: f64,
    /// True if the picture has a lower quality than it will have.
    pub(super) draft: bool,
    /// Kind of the splats; `None` if there are none.
    pub(super) kind: Option<SplatKind>,
    /// Error of the splats against the volume, and true if the picture has its colours.
    pub(super) error: Option<ShownError>,
    pub(super) error_shown: bool,
    pub(super) intensities: Vec<Intensities>,
    /// The fit beside the window.
    pub(super) fit: Option<FitStatus>,
    /// The region of the volume.
    pub(super) region: Option<RegionSize>,
    /// Number of splats that are deleted.
    pub(super) deleted: usize,
    /// True if there are splats beside the others, and if there is a volume.
    pub(super) beside: bool,
    pub(super) volume: bool,
    /// True if there is nothing to see.
    pub(super) nothing: bool,
    pub(super) dropped: Vec<egui::DroppedFileHandle>,
    pub(super) shapes: Vec<egui::epaint::ClippedShape>,
}

impl Bench {
    pub(super) fn new() -> Self {
        let mut state = ViewState::new(&PRESETS[0].over([-1000.0, 2000.0]));
        state.files.splats = vec!["a.ply".into()];
        state.objects = vec![Object::new(0, Some(1), "liver"), Object::new(0, Some(2), "aorta")];
        let mut settings = Settings::default();
        settings.notice_seen = true;
        let mut bench = Bench {
            context: Context::default(),
            app: App::new(state, None, settings),
            time: 0.0,
            draft: false,
            kind: Some(SplatKind::Field),
            error: None,
            error_shown: false,
            intensities: Vec::new(),
            fit: None,
            region: None,
            deleted: 0,
            beside: false,
            volume: true,
            nothing: false,
            dropped: Vec::new(),
            shapes: Vec::new(),
        };
        // Panels know their size after the first frame.
        bench.rest();
        bench
    }

    /// Returns a frame with these events. The scene is a ball of 100 mm seen at its nearest point.
    pub(super) fn frame(&mut self, events: Vec<Event>, modifiers: Modifiers) -> Vec<Action> {
        self.time += 0.05;
        let events = [vec![Event::ModifiersChanged(modifiers)], events].concat();
        let dropped_files = std::mem::take(&mut self.dropped);
        let input = RawInput {
            screen_rect: Some(SCREEN),
            time: Some(self.time),
            events,
            dropped_files,
            ..RawInput::default()
        };
        let distance = self.app.state.orbit.distance_mm;
        let depth = move |_: DVec2| Some(distance - 100.0);
        let info = PanelInfo {
            bounds: (!self.nothing).then_some([DVec3::splat(-100.0), DVec3::splat(100.0)]),
            range: [-1000.0, 2000.0],
            unit: " HU",
            splats: self.kind.map(|_| 1000),
            kind: self.kind,
            error: self.error.as_ref().map_or(Measured::Nothing, Measured::Found),
            error_shown: self.error_shown,
            has_region: self.kind == Some(SplatKind::Grid),
            sigma_mm: self.kind.map(|_| 1.5),
            beside: self.beside,
            volume: self.volume,
            object_splats: &[600, 400],
            object_intensities: &self.intensities,
            draft: self.draft,
            depth: &depth,
            sample: &|x| Some(x.y),
            sample_beside: &|_| Some(77.0),
            fit: self.fit.as_ref(),
            region: self.region,
            deleted: self.deleted,
            volume_bounds: Some([DVec3::splat(-150.0), DVec3::splat(150.0)]),
            sample_whole: &|x| Some((x.y, f64::from(u8::from(x.x > 0.0)))),
            ..PanelInfo::default()
        };
        let mut actions = Vec::new();
        let output = self.context.run_ui(input, |ui| actions.extend(self.app.ui(ui, &info)));
        self.shapes.clone_from(&output.shapes);
        output.drop_without_applying_deltas();
        actions
    }

    pub(super) fn rest(&mut self) {
        self.frame(Vec::new(), Modifiers::NONE);
        self.frame(Vec::new(), Modifiers::NONE);
    }

    pub(super) fn press(&mut self, key: Key, modifiers: Modifiers) -> Vec<Action> {
        let event = |pressed| Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
        let actions = self.frame(vec![event(true)], modifiers);
        self.frame(vec![event(false)], Modifiers::NONE);
        self.rest();
        actions
    }

    pub(super) fn button(
        &mut self,
        pos: Pos2,
        button: PointerButton,
        pressed: bool,
        modifiers: Modifiers,
    ) -> Vec<Action> {
        let event = Event::PointerButton { pos, button, pressed, modifiers };
        self.frame(vec![Event::PointerMoved(pos), event], modifiers)
    }

    pub(super) fn click(&mut self, at: Pos2) -> Vec<Action> {
        self.frame(vec![Event::PointerMoved(at)], Modifiers::NONE);
        self.button(at, PointerButton::Primary, true, Modifiers::NONE);
        let actions = self.button(at, PointerButton::Primary, false, Modifiers::NONE);
        // The next click must not become part of a double click.
        self.time += 1.0;
        self.rest();
        actions
    }

    /// Drags in ten moves.
    pub(super) fn drag(&mut self, from: Pos2, by: egui::Vec2, button: PointerButton, modifiers: Modifiers) {
        self.frame(vec![Event::PointerMoved(from)], modifiers);
        self.button(from, button, true, modifiers);
        for i in 1..=10 {
            self.frame(vec![Event::PointerMoved(from + by * (i as f32 / 10.0))], modifiers);
        }
        self.button(from + by, button, false, modifiers);
        self.rest();
    }

    /// Returns the middle of a text on the screen.
    pub(super) fn find(&self, text: &str) -> Pos2 {
        self.place_of(text).unwrap_or_else(|| panic!("{text:?} is not on the screen"))
    }

    pub(super) fn place_of(&self, text: &str) -> Option<Pos2> {
        self.places_of(text).first().copied()
    }

    pub(super) fn places_of(&self, text: &str) -> Vec<Pos2> {
        let of = |clipped: &egui::epaint::ClippedShape| match &clipped.shape {
            Shape::Text(shape) if shape.galley.text() == text => Some(shape.visual_bounding_rect().center()),
            _ => None,
        };
        self.shapes.iter().filter_map(of).collect()
    }

    pub(super) fn middle(&self) -> Pos2 {
        self.app.picture().center()
    }
}
