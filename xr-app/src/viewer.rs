//! The loop: from a headset's call for a frame to the frame.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use engine::Result;
use engine::budget::{Controller, budget_ms};
use engine::gpu::{Format, Gpu, Hitches, Image};
use engine::render::{DecodeOptions, Fov, Frames, QualityLevel, Scene, Settings, Triangle, level_costs};
use engine::volume::edges::Edges;
use glam::DVec3;
use view::io::loader::LoadedVolume;

use crate::bodies;
use crate::composer::Composer;
use crate::controls::Controls;
use crate::feedback::Feedback;
use crate::headset::{Blend, Event, Eye, FrameImages, Headset, Pose, SessionState, Timing};
use crate::keeping::Keeper;
use crate::onlooker::Onlooker;
use crate::placement::Placement;
use crate::pointing::{PickData, Pointing};
use crate::rods::{Rod, Rods};
use crate::sight::Sight;
use crate::start::{Start, view_of};
use crate::statistics::{SessionReport, Statistics};

/// Options of the view.
#[derive(Clone, Debug)]
pub struct Options {
    /// Quality levels, the best first.
    pub levels: Vec<QualityLevel>,
    /// Device time of a frame, ms; `None` derives it from the display's rate.
    pub budget_ms: Option<f64>,
    /// Level that is always used; `None` lets the controller choose.
    pub level: Option<usize>,
    /// Colour behind everything, display-referred, unless the headset shows the room there.
    pub background: [f32; 3],
    /// Number of frames after which the session ends.
    pub frames: Option<u64>,
    /// True if the panel is shown from the start.
    pub panel: bool,
    /// Edges of the views' pictures, as a part of the eyes', with foveation ([`Sight`]); `None` for no
    /// foveation.
    pub foveation: Option<f64>,
    /// [`Settings::decoding`].
    pub decoding: DecodeOptions,
    /// What was given up to save memory, in words.
    pub given_up: Option<String>,
    /// True if the card of what hands do is shown at the start.
    pub card: bool,
    /// The view to begin with; `None` for the look that the scene has.
    pub start: Option<Start>,
}

impl Options {
    /// Returns options with these quality levels, on black, with nothing else asked for.
    pub fn of_levels(levels: Vec<QualityLevel>) -> Self {
        Options {
            levels,
            budget_ms: None,
            level: None,
            background: [0.0; 3],
            frames: None,
            panel: false,
            foveation: None,
            decoding: DecodeOptions::default(),
            given_up: None,
            card: false,
            start: None,
        }
    }
}

/// Fields of view and distances, metres, that are rendered once before the first frame, so that later ones
/// find their buffers large enough: the whole patient, and nearer.
const WARM_UP: [f64; 3] = [0.6, 0.35, 0.2];

/// Time from one look for events to the next while no frames are wanted.
const IDLE: Duration = Duration::from_millis(10);
/// Frames that show words before a scene is made ready, and the time that is waited for them.
const WORDS_FRAMES: u32 = 3;
const WORDS_TIME: Duration = Duration::from_secs(1);
/// Words while other edges are made.
const EDGING: &str = "Making the edges …";

/// Shows a scene in a headset.
pub struct Viewer {
    gpu: Gpu,
    scene: Scene,
    frames: Frames,
    composer: Composer,
    controller: Controller,
    options: Options,
    controls: Controls,
    pointing: Pointing,
    rods: Rods,
    /// Bodies of the hands in the last frame.
    bodies: Vec<Rod>,
    sight: Sight,
    onlooker: Option<Box<dyn Onlooker>>,
    /// Pose of the head in the last frame.
    head: Pose,
    /// The turn of the last frame.
    slot: usize,
    statistics: Statistics,
    /// True if the patient is to be placed before the viewer again.
    place: bool,
    /// What is behind the picture.
    blend: Blend,
    over: bool,
    shown_size: [u32; 2],
    /// True if what was rendered last is below the best quality level.
    is_draft: bool,
    /// Counts before the first frame.
    before: Hitches,
    /// What keeps the session, if anything does.
    keeper: Option<Keeper>,
    /// The volume that is shown, where it is no splats.
    volume: Option<LoadedVolume>,
    /// Edges that are shown.
    edges: Edges,
}

impl Viewer {
    /// Creates a viewer of a scene in a headset. Renders once in advance, so that later frames find their
    /// buffers large enough.
    pub fn new(gpu: &Gpu, scene: Scene, headset: &dyn Headset, options: Options) -> Result<Self> {
        let about = headset.description();
        let sight = Sight::new(about.eye_size, options.foveation, about.lenses);
        let settings = Settings { decoding: options.decoding, ..sight.settings(about.depth) };
        let frames = Frames::new(gpu, &scene, &settings, &options.levels)?;
        let foveated = sight.insets().is_some();
        let composer =
            Composer::new(gpu, about.format, about.depth, about.blend, options.background, foveated)?;
        let edges = options.decoding.edges;
        let budget = options.budget_ms.unwrap_or_else(|| budget_ms(about.rate_hz.unwrap_or(72.0)));
        let start = options.start.clone().unwrap_or_else(|| {
            let range = scene.splats.as_ref().map_or([0.0, 1.0], |splats| splats.range);
            view_of(scene.look(), scene.objects(), range)
        });
        let mut controls = Controls::new(placed(&scene, &Pose::IDENTITY), start);
        let object_splats = scene.objects().iter().map(|object| object.splats).collect();
        let pointing = Pointing::new(gpu, about, &mut controls, object_splats, scene.bounds())?;
        let mut viewer = Viewer {
            gpu: gpu.clone(),
            frames,
            composer,
            controller: Controller::new(level_costs(&options.levels), budget),
            options,
            controls,
            pointing,
            rods: Rods::new(gpu, about.format, about.depth)?,
            bodies: Vec::new(),
            sight,
            onlooker: None,
            head: Pose::IDENTITY,
            slot: 0,
            statistics: Statistics::default(),
            place: true,
            blend: about.blend,
            over: false,
            shown_size: about.eye_size,
            is_draft: false,
            before: Hitches::default(),
            keeper: None,
            volume: None,
            edges,
            scene,
        };
        viewer.warm_up()?;
        viewer.before = gpu.hitches();
        Ok(viewer)
    }

    /// Sets the data for picking, without which hands read and measure nothing.
    pub fn set_pick_data(&mut self, pick: PickData) {
        self.pointing.set_pick_data(pick);
    }

    /// Sets the volume of which the scene's was made, without which its edges stay as they are.
    pub fn set_volume(&mut self, volume: LoadedVolume) {
        self.volume = Some(volume);
    }

    /// Adds an onlooker who is shown what the eyes see, too, and who ends the session by leaving.
    pub fn add_onlooker(&mut self, onlooker: Box<dyn Onlooker>) {
        self.onlooker = Some(onlooker);
    }

    /// Keeps what is made in the session from now on.
    pub fn set_keeper(&mut self, keeper: Keeper) {
        self.keeper = Some(keeper);
    }

    /// Keeps what was made to the end. Returns the file, if there is one.
    ///
    /// # Errors
    /// Returns the errors of [`Keeper::finish`].
    pub fn finish_keeping(&mut self) -> Result<Option<PathBuf>> {
        self.keeper.as_mut().map_or(Ok(None), |keeper| keeper.finish(self.controls.session()))
    }

    /// Notes that the session begins only now, or has ended before it began.
    pub fn begin(&mut self, over: bool) {
        self.before = self.gpu.hitches();
        self.over = over;
    }

    /// Returns the number of frames that the onlooker was shown, and of those for which there was no picture.
    pub fn onlooker_counts(&self) -> Option<[u64; 2]> {
        self.onlooker.as_ref().map(|onlooker| onlooker.counts())
    }

    fn warm_up(&mut self) -> Result<()> {
        for distance in WARM_UP {
            let position = self.controls.placement.position + DVec3::Z * distance;
            let fov = Fov { left: -1.0, right: 1.0, up: 1.0, down: -1.0 };
            let eye = Eye { pose: Pose { position, ..Pose::IDENTITY }, fov };
            self.update_visibility_masks(&Default::default(), &[eye; 2]);
            let cameras = self.sight.cameras(&self.controls.placement, &[eye; 2]);
            self.frames.warm_up(&self.scene, &cameras)?;
        }
        self.sight.forget();
        Ok(())
    }

    /// Runs until the headset ends the session, or until `stop` is set and the headset has ended it.
    pub fn run(&mut self, headset: &mut dyn Headset, stop: &AtomicBool) -> Result<()> {
        let mut asked = false;
        while !self.over {
            for event in headset.poll()? {
                self.handle_event(event);
            }
            let enough = self.options.frames.is_some_and(|n| self.statistics.frames() >= n);
            let gone = self.onlooker.as_ref().is_some_and(|onlooker| onlooker.gone());
            if (enough || gone || stop.load(Ordering::Relaxed)) && !std::mem::replace(&mut asked, true) {
                self.over |= !headset.running();
                headset.request_exit()?;
            }
            match headset.running() {
                // A session that is asked to end wants frames until it does, but no more pictures.
                true if asked => {
                    let timing = headset.wait()?;
                    headset.end(&timing, None)?;
                }
                true => {
                    self.frame(headset)?;
                    self.follow_edges(headset)?;
                }
                false if self.over => {}
                false => std::thread::sleep(IDLE),
            }
        }
        self.gpu.wait_idle()?;
        self.note_finished()
    }

    /// Shows the scene and a few words before the eyes, in a few frames. Returns true if the session has ended
    /// meanwhile.
    pub fn show_words(&mut self, headset: &mut dyn Headset, words: &str) -> Result<bool> {
        let begun = Instant::now();
        let mut frames = 0;
        while !self.over && frames < WORDS_FRAMES && begun.elapsed() < WORDS_TIME {
            for event in headset.poll()? {
                self.handle_event(event);
            }
            if headset.running() {
                self.controls.feedback.say(words);
                self.frame(headset)?;
                frames += 1;
            } else if !self.over {
                std::thread::sleep(IDLE);
            }
        }
        self.gpu.wait_idle()?;
        Ok(self.over)
    }

    /// Makes what is shown with the edges of the state, if it has others and nothing on the panel is dragged any more. A
    /// runtime shows the last frame until the next one; frames meanwhile would use the device's queue beside what is
    /// made, which Vulkan forbids.
    fn follow_edges(&mut self, headset: &mut dyn Headset) -> Result<()> {
        let wanted = self.controls.state.edges;
        if wanted == self.edges || self.controls.dragging || !self.controls.has_region {
            return Ok(());
        }
        // Others are not tried again before they change.
        self.edges = wanted;
        if self.show_words(headset, EDGING)? {
            return Ok(());
        }
        match self.make_edges(wanted) {
            Ok(()) => self.frames.renew(&self.scene),
            Err(error) => {
                self.controls.feedback.say(format!("The edges were not changed: {}", error.message))
            }
        }
        Ok(())
    }

    fn make_edges(&mut self, edges: Edges) -> Result<()> {
        let decoding = DecodeOptions { edges, ..self.options.decoding };
        if let Some(splats) = &self.scene.splats {
            splats.decoding(&self.gpu, decoding)?(&mut |_| ())?;
        } else if let Some(volume) = &self.volume {
            self.scene.set_volume(&volume.source(&volume.shown(edges)))?;
        }
        Ok(())
    }

    fn handle_event(&mut self, event: Event) {
        match event {
            Event::State(SessionState::Over | SessionState::Lost) => self.over = true,
            Event::State(_) => {}
            Event::Recentred => self.place = true,
            Event::Lenses => self.sight.forget(),
            Event::Rate(hz) if self.options.budget_ms.is_none() => {
                self.controller.set_budget_ms(budget_ms(hz))
            }
            Event::Rate(_) => {}
        }
    }

    /// Renders one frame, from the headset's call for it to its end.
    fn frame(&mut self, headset: &mut dyn Headset) -> Result<()> {
        let timing = headset.wait()?;
        self.statistics.note_frame(&timing);
        self.update_budget(&timing)?;
        if !timing.visible {
            return headset.end(&timing, None);
        }
        if self.place {
            self.place_patient(headset, &timing)?;
        }
        let hands = headset.hands(&timing)?;
        self.bodies = bodies::rods(&hands);
        let [seconds, period] = [timing.display_ns, timing.period_ns].map(|ns| ns as f64 * 1e-9);
        let (look, time) = (self.scene.look(), (seconds, period));
        let level = self.options.level.unwrap_or_else(|| self.controller.level());
        let hands = self.pointing.point(&hands, &self.head, &mut self.controls, look, time);
        self.controls.act(&hands, period)?;
        let quality = self.quality(level);
        self.pointing.lay_out(seconds, &self.head, &mut self.controls, &quality)?;
        if let Some(look) = self.controls.new_look()? {
            self.scene.set_look(&look)?;
        }
        self.give_feedback(headset, seconds)?;
        if let Some(keeper) = self.keeper.as_mut().filter(|_| !self.controls.dragging) {
            keeper.keep_soon(seconds, || self.controls.session());
        }
        self.sight.aim();
        let mut frame = self.frames.begin(&self.scene, level)?;
        let mut eyes = headset.acquire_images(&mut frame.recorder)?;
        let range = self.controls.placement.depth_range();
        self.pointing.prepare(&mut frame.recorder)?;
        let insets = self.sight.insets();
        let marks = (level > 0).then(|| self.sight.marks());
        let target = &self.frames.target;
        self.composer.compose(&mut frame.recorder, target, frame.size, range, insets, marks, &mut eyes);
        let turn = (frame.slot, self.frames.views(frame.slot));
        let room = (&self.controls.placement, self.scene.origin);
        self.pointing.draw(&mut frame.recorder, turn, room, &mut eyes)?;
        let bodies = (&self.bodies[..], self.head.position);
        self.rods.draw(&mut frame.recorder, turn, room, bodies, &mut eyes)?;
        if let Some(onlooker) = &mut self.onlooker {
            onlooker.take(&mut frame.recorder, eyes.colour)?;
        }
        headset.release_images(&mut frame.recorder)?;
        (self.shown_size, self.slot, self.is_draft) = (frame.size, frame.slot, level > 0);
        // Everything is recorded: only now the poses of the eyes are asked for.
        let seen = headset.eyes(&timing)?;
        self.statistics.note_eyes(&timing, &seen);
        self.head = head(&seen.eyes);
        self.update_visibility_masks(headset.lenses(), &seen.eyes);
        let cameras = self.sight.cameras(&self.controls.placement, &seen.eyes);
        self.frames.submit(frame, &self.scene, &cameras)?;
        headset.end(&timing, Some(&seen.eyes))?;
        self.onlooker.as_mut().map_or(Ok(()), |onlooker| onlooker.show())
    }

    /// Says what a level shows at less than full quality; nothing if it is the best one and nothing was given
    /// up to save memory.
    fn quality(&self, level: usize) -> String {
        let draft = (level > 0).then(|| {
            let last = self.options.levels.len().saturating_sub(1);
            format!("Draft: quality level {level}, of 0 (best) to {last}")
        });
        [draft, self.options.given_up.clone()].into_iter().flatten().collect::<Vec<_>>().join("\n")
    }

    /// Tells the user what the frame has done: in the hands, and in words.
    fn give_feedback(&mut self, headset: &mut dyn Headset, seconds: f64) -> Result<()> {
        let Feedback { pulses, notice } = std::mem::take(&mut self.controls.feedback);
        for (side, pulse) in pulses {
            headset.pulse(side, &pulse)?;
        }
        if let Some(text) = notice {
            self.pointing.notify(text, seconds, &self.head);
        }
        Ok(())
    }

    /// Updates the visibility masks of the pictures of these eyes.
    fn update_visibility_masks(&mut self, lenses: &[Vec<Triangle>; 2], eyes: &[Eye; 2]) {
        if let Some(masks) = self.sight.update(lenses, eyes) {
            self.frames.set_visibility_masks(masks);
        }
    }

    /// Updates the budget by the display's rate, and tells the controller which frames have finished.
    fn update_budget(&mut self, timing: &Timing) -> Result<()> {
        if self.options.budget_ms.is_none() && timing.period_ns > 0 {
            self.controller.set_budget_ms(budget_ms(1e9 / timing.period_ns as f64));
        }
        self.note_finished()
    }

    fn note_finished(&mut self) -> Result<()> {
        for frame in self.frames.finished()? {
            self.controller.finished(frame.level, frame.gpu_ms);
            self.statistics.note_finished(&frame, self.controller.budget_ms());
        }
        Ok(())
    }

    /// Puts the patient before the viewer, as soon as the head's pose is known.
    fn place_patient(&mut self, headset: &mut dyn Headset, timing: &Timing) -> Result<()> {
        let found = headset.eyes(timing)?;
        if found.tracked {
            self.head = head(&found.eyes);
            self.controls.place(placed(&self.scene, &self.head));
            self.place = false;
            if self.options.panel && self.pointing.panel().is_none() {
                self.pointing.toggle(&self.head, &self.controls.placement);
            }
            let [card_shown, _] = self.pointing.card();
            if std::mem::take(&mut self.options.card) || card_shown {
                self.pointing.show_card(&self.head, &self.controls.placement);
            }
        }
        Ok(())
    }

    /// Returns the placement of the patient.
    pub fn placement(&self) -> &Placement {
        &self.controls.placement
    }

    /// Returns the controls: the state that hands have changed.
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// Returns the state of pointing.
    pub fn pointing(&self) -> &Pointing {
        &self.pointing
    }

    /// Returns the state of pointing, to be changed from outside.
    pub fn pointing_mut(&mut self) -> &mut Pointing {
        &mut self.pointing
    }

    /// Returns true if the headset shows the room where the picture is transparent.
    pub fn is_transparent(&self) -> bool {
        self.blend == Blend::Alpha
    }

    /// Renders what both eyes saw last, a layer each, with hands, panel and marks, 8 bits a channel,
    /// premultiplied where it is transparent. Waits for the device.
    pub fn picture(&mut self) -> Result<Image> {
        let format = Format::Rgba8;
        let insets = self.sight.insets();
        let background = self.options.background;
        let blend = if self.is_transparent() { Blend::Alpha } else { Blend::Opaque };
        let composer = Composer::new(&self.gpu, format, false, blend, background, insets.is_some())?;
        let mut eyes = self.gpu.picture("both eyes", "pictures", format, self.sight.eye_size(), 2)?;
        let mut recorder = self.gpu.record()?;
        let range = self.controls.placement.depth_range();
        let mut images = FrameImages { colour: &mut eyes, depth: None };
        let marks = self.is_draft.then(|| self.sight.marks());
        composer.compose(
            &mut recorder,
            &self.frames.target,
            self.shown_size,
            range,
            insets,
            marks,
            &mut images,
        );
        let turn = (self.slot, self.frames.views(self.slot));
        let room = (&self.controls.placement, self.scene.origin);
        self.pointing.draw(&mut recorder, turn, room, &mut images)?;
        let bodies = (&self.bodies[..], self.head.position);
        self.rods.draw(&mut recorder, turn, room, bodies, &mut images)?;
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)?;
        Ok(eyes)
    }

    /// Returns the scene that is shown.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the width and height of the picture that was rendered last, pixels.
    pub fn shown_size(&self) -> [u32; 2] {
        self.shown_size
    }

    /// Returns the frames, with the pictures that were rendered last, before they were composed for the eyes.
    pub fn frames(&self) -> &Frames {
        &self.frames
    }

    /// Returns the report of the session so far.
    pub fn report(&self, headset: &dyn Headset) -> SessionReport {
        let now = self.gpu.hitches();
        let hitches = Hitches {
            allocations: now.allocations - self.before.allocations,
            pipelines: now.pipelines - self.before.pipelines,
            waits: now.waits - self.before.waits,
        };
        let (about, placement) = (headset.description(), &self.controls.placement);
        self.statistics.report(
            &self.gpu,
            about,
            &self.options.levels,
            (placement, self.sight.hidden()),
            hitches,
        )
    }
}

/// Returns the pose between the eyes, looking as the left one does.
fn head(eyes: &[Eye; 2]) -> Pose {
    let [left, right] = eyes.map(|eye| eye.pose);
    Pose { position: (left.position + right.position) * 0.5, ..left }
}

fn placed(scene: &Scene, head: &Pose) -> Placement {
    let [low, high] = scene.bounds();
    Placement::before(head, (low + high) * 0.5, (high - low).length() * 0.5)
}
