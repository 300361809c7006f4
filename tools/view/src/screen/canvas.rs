//! Everything on the device for a window: the scenes with their pictures, and the passes that put these and
//! the panels on the window's surface.

use std::sync::Arc;
use std::time::Instant;

use egui::epaint::ClippedPrimitive;
use egui::{Rect, TexturesDelta};
use engine::Result;
use engine::gpu::{Gpu, Surface, Ticket};
use engine::image::Image;
use engine::render::{Camera, DecodeOptions, GpuSplats, Look, Part, Quality, Scene, Settings};
use glam::{DVec2, DVec3};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use crate::model::state::{Subject, ViewState, mode_row};
use crate::screen::composer::{Area, Composer, Composition, Layer};
use crate::screen::painter::{Painter, Painting};
use crate::screen::rendered_scene::{RenderSetup, RenderedScene};

/// Scenes, pictures and surface of a window.
pub struct Canvas {
    // The order matters: what draws on the surface is dropped before it.
    splats: Option<RenderedScene>,
    /// The splats in the colours of their error, and true if these are shown.
    error: Option<RenderedScene>,
    shows_error: bool,
    beside: Option<RenderedScene>,
    volume: Option<RenderedScene>,
    /// Splats that are being prepared to be shown in place of the others.
    next: Option<Scene>,
    composer: Composer,
    painter: Painter,
    /// Changes of textures that no frame has applied yet.
    textures: TexturesDelta,
    /// Subjects of the picture: one, or two with a split between them.
    shown: Vec<(Subject, RenderSetup)>,
    /// The picture on its way.
    rendering: Option<Rendering>,
    surface: Surface,
    gpu: Gpu,
}

/// Device time that a part of a slow picture should take, ms: events and panels find their turn between the parts.
const PART_MS: f64 = 12.0;
/// Device time up to which a picture is rendered at once, ms.
const AT_ONCE_MS: f64 = 16.0;
/// Bands of the second part of a picture of which nothing is known. The first part has one, since it also has what the whole
/// picture needs.
const SECOND_BANDS: u32 = 8;
/// Most that a part grows beyond the one before it.
const GROWTH: f64 = 4.0;

/// A picture that the device renders.
struct Rendering {
    /// Subjects of the picture, as [`Canvas::shown`] will have them.
    subjects: Vec<(Subject, RenderSetup)>,
    /// Those of them that have a scene; the scenes are rendered one after the other.
    setups: Vec<(Subject, RenderSetup)>,
    camera: Camera,
    /// Place in `setups` of the scene that was submitted last.
    at: usize,
    /// Part that was submitted last.
    part: Part,
    /// Bands of the second part of each scene.
    second: u32,
    /// What was submitted and has not been seen finished; the last one is the last to finish.
    tickets: Vec<Ticket>,
    since: Instant,
    /// Device time of all parts that have finished, ms.
    ms: f64,
}

/// Panels of a frame.
pub struct Overlay {
    /// Triangles of the panels, from egui.
    pub primitives: Vec<ClippedPrimitive>,
    /// Pixels per point.
    pub pixels_per_point: f32,
    /// Place of the picture, points.
    pub picture: Rect,
}

/// Returns the subjects that the picture shows and how each is rendered: in the mode that `mode_of` returns for
/// it, with the `quality` at its step. `there` returns true if there are data of a subject.
pub fn render_setups(
    state: &ViewState,
    size: [u32; 2],
    mode_of: impl Fn(Subject) -> &'static str,
    quality: impl Fn(f64) -> Quality,
    there: impl Fn(Subject) -> bool,
) -> Vec<(Subject, RenderSetup)> {
    let setup = |subject| {
        let mode = mode_row(mode_of(subject));
        let step = state.quality.step.unwrap_or(mode.step);
        let settings =
            Settings { depth: true, gradual: true, step, decoding: state.decoding(), ..Settings::new(size) };
        RenderSetup { mode, settings, quality: quality(step) }
    };
    state.subjects(there).into_iter().map(|subject| (subject, setup(subject))).collect()
}

impl Canvas {
    /// Creates a canvas for a window of `size` pixels. The device must have been booted for its display.
    pub fn new<W>(gpu: &Gpu, window: Arc<W>, size: [u32; 2]) -> Result<Self>
    where
        W: HasDisplayHandle + HasWindowHandle + 'static,
    {
        let surface = Surface::new(gpu, window, size)?;
        let format = surface.format();
        Ok(Canvas {
            splats: None,
            error: None,
            shows_error: false,
            beside: None,
            volume: None,
            next: None,
            composer: Composer::new(gpu, format)?,
            painter: Painter::new(gpu, format)?,
            textures: TexturesDelta::default(),
            shown: Vec::new(),
            rendering: None,
            surface,
            gpu: gpu.clone(),
        })
    }

    /// Returns the device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Resizes the surface to the window's `size`, pixels.
    pub fn resize(&mut self, size: [u32; 2]) {
        self.surface.resize(size);
    }

    /// Returns the scene of a subject, if it is on the device.
    pub fn scene_of(&self, subject: Subject) -> Option<&RenderedScene> {
        match subject {
            Subject::Splats if self.shows_error => self.error.as_ref(),
            Subject::Splats => self.splats.as_ref(),
            Subject::Beside => self.beside.as_ref(),
            Subject::Volume => self.volume.as_ref(),
        }
    }

    /// Returns the splats of a subject, if they are on the device.
    pub fn splats_of(&self, subject: Subject) -> Option<&GpuSplats> {
        self.scene_of(subject)?.scene.splats.as_ref()
    }

    fn scene_mut(&mut self, subject: Subject) -> &mut Option<RenderedScene> {
        match subject {
            Subject::Splats if self.shows_error => &mut self.error,
            Subject::Splats => &mut self.splats,
            Subject::Beside => &mut self.beside,
            Subject::Volume => &mut self.volume,
        }
    }

    /// Sets or removes the scene of a subject. A picture of others stays; the colours of the error go.
    pub fn set_scene(&mut self, subject: Subject, scene: Option<Scene>) {
        self.set_error(None);
        self.give_up();
        let shown_scene = scene.map(|scene| RenderedScene::new(&self.gpu, scene));
        *self.scene_mut(subject) = shown_scene;
        if self.shown.iter().any(|(shown, _)| *shown == subject) {
            self.shown.clear();
        }
    }

    /// Sets or removes the scene of the splats in the colours of their error. It is shown once
    /// [`Canvas::show_error`] says so.
    pub fn set_error(&mut self, scene: Option<Scene>) {
        self.show_error(false);
        self.give_up();
        self.error = scene.map(|scene| RenderedScene::new(&self.gpu, scene));
    }

    /// Returns true if there is such a scene.
    pub fn has_error(&self) -> bool {
        self.error.is_some()
    }

    /// Returns true if it can be shown at once.
    pub fn error_is_decoded(&self, decoding: DecodeOptions) -> bool {
        let splats = self.error.as_ref().and_then(|error| error.scene.splats.as_ref());
        splats.is_some_and(|splats| splats.has_decoded(decoding))
    }

    /// Shows the splats in the colours of their error, or as they are.
    pub fn show_error(&mut self, shown: bool) {
        if std::mem::replace(&mut self.shows_error, shown) != shown {
            self.give_up();
            if self.shown.iter().any(|(shown, _)| *shown == Subject::Splats) {
                self.shown.clear();
            }
        }
    }

    /// Keeps splats that will be shown in place of the others once they are prepared, so that no picture lacks
    /// anything meanwhile; or drops them.
    pub fn set_next(&mut self, scene: Option<Scene>) {
        self.next = scene;
    }

    /// Returns the splats that are being prepared.
    pub fn next(&self) -> Option<&Scene> {
        self.next.as_ref()
    }

    /// Takes the splats that were being prepared.
    pub fn take_next(&mut self) -> Option<Scene> {
        self.next.take()
    }

    /// Changes the look of a subject.
    pub fn set_look(&mut self, subject: Subject, look: &Look) -> Result<()> {
        self.scene_mut(subject).as_mut().map_or(Ok(()), |shown_scene| shown_scene.set_look(look))
    }

    /// Limits the number of splats that are rendered; `None` renders all.
    pub fn set_splat_budget(&mut self, budget: Option<u64>) -> Result<()> {
        let budget = budget.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let mut sets = [&mut self.splats, &mut self.beside].into_iter().flatten();
        sets.try_for_each(|shown_scene| shown_scene.scene.set_splat_budget(budget))
    }

    /// Returns true if there is no picture to show.
    pub fn is_blank(&self) -> bool {
        self.shown.is_empty()
    }

    /// Returns two corners of the box around all scenes, mm RAS; `None` without a scene.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let shown_scenes = [&self.splats, &self.beside, &self.volume].into_iter().flatten();
        shown_scenes
            .map(|shown_scene| shown_scene.scene.bounds())
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// Begins a picture of some subjects, in place of one that is on its way. `expected` is the device time that it will
    /// take, ms, if that is known. A fast one is shown by the next [`Canvas::present`]: then this returns true. A slow one
    /// is rendered part by part by [`Canvas::go_on`], and shown when it has finished.
    pub fn begin(
        &mut self,
        subjects: Vec<(Subject, RenderSetup)>,
        camera: Camera,
        expected: Option<f64>,
    ) -> Result<bool> {
        self.give_up();
        let part = if expected.is_some_and(|ms| ms <= AT_ONCE_MS) { Part::WHOLE } else { Part::first(1) };
        let second = expected.map_or(SECOND_BANDS, |ms| (f64::from(Part::ALL) * PART_MS / ms) as u32);
        let mut setups = subjects.clone();
        setups.retain(|(subject, _)| self.scene_of(*subject).is_some());
        // Times of what else the device did.
        self.gpu.take_finished()?;
        let at_once = part == Part::WHOLE || setups.is_empty();
        let mut now = Rendering {
            subjects,
            setups,
            camera,
            at: 0,
            part,
            second,
            tickets: Vec::new(),
            since: Instant::now(),
            ms: 0.0,
        };
        if at_once {
            self.shown.clone_from(&now.subjects);
            self.submit_all(&mut now)?;
        }
        self.rendering = Some(now).filter(|now| !now.setups.is_empty());
        Ok(at_once)
    }

    /// Submits all of every scene.
    fn submit_all(&mut self, now: &mut Rendering) -> Result<()> {
        (0..now.setups.len()).try_for_each(|at| {
            now.at = at;
            self.submit(now)
        })
    }

    /// Submits the part that it is at.
    fn submit(&mut self, now: &mut Rendering) -> Result<()> {
        let (subject, setup) = &now.setups[now.at];
        if let Some(scene) = self.scene_mut(*subject) {
            now.tickets.push(scene.submit(setup, now.camera, now.part)?);
        }
        now.since = Instant::now();
        Ok(())
    }

    /// Goes on with the picture on its way: once the device has finished what was submitted, submits the next part.
    /// Returns the device time of the picture, ms, when all of it has finished. Does not wait.
    pub fn go_on(&mut self) -> Result<Option<f64>> {
        if self.is_busy()? {
            return Ok(None);
        }
        let Some(mut now) = self.rendering.take() else { return Ok(None) };
        if now.tickets.is_empty() {
            self.submit(&mut now)?;
            self.rendering = Some(now);
            return Ok(None);
        }
        let times = self.gpu.take_finished()?;
        let timed = times.iter().filter(|(ticket, _)| now.tickets.contains(ticket)).map(|(_, ms)| ms);
        // A device without a clock: by ours.
        let ms = timed.copied().reduce(|a, b| a + b).unwrap_or(now.since.elapsed().as_secs_f64() * 1e3);
        now.ms += ms;
        now.tickets.clear();
        if now.part == Part::WHOLE {
            if !self.settle(&now.setups)? {
                return Ok(Some(now.ms));
            }
            self.submit_all(&mut now)?;
            self.rendering = Some(now);
            return Ok(None);
        }
        let grown = (f64::from(now.part.bands()) * (PART_MS / ms).min(GROWTH)) as u32;
        let bands = if now.part.is_first() { now.second } else { grown };
        if let Some(part) = now.part.next(bands) {
            now.part = part;
        } else if self.settle(&now.setups[now.at..=now.at])? {
            now.part = Part::first(1);
        } else if now.at + 1 < now.setups.len() {
            (now.at, now.part) = (now.at + 1, Part::first(1));
        } else {
            self.shown = now.subjects;
            return Ok(Some(now.ms));
        }
        self.submit(&mut now)?;
        self.rendering = Some(now);
        Ok(None)
    }

    fn settle(&mut self, setups: &[(Subject, RenderSetup)]) -> Result<bool> {
        let mut again = false;
        for (subject, setup) in setups {
            if let Some(scene) = self.scene_mut(*subject) {
                again |= scene.settle(setup)?;
            }
        }
        Ok(again)
    }

    /// Creates what the next changes of a subject's transfer function may ask for.
    pub fn warm_up(&mut self, subject: Subject) -> Result<()> {
        self.scene_mut(subject).as_mut().map_or(Ok(()), RenderedScene::warm_up)
    }

    /// Returns true if the device has not finished what was submitted of the picture on its way. A frame that is presented now
    /// would have to wait for it, and the thread with it where the display is the CPU's.
    pub fn is_busy(&self) -> Result<bool> {
        let last = self.rendering.as_ref().and_then(|now| now.tickets.last().copied());
        last.map_or(Ok(false), |ticket| Ok(!self.gpu.has_finished(ticket)?))
    }

    /// Returns true if a picture is on its way.
    pub fn is_rendering(&self) -> bool {
        self.rendering.is_some()
    }

    /// Gives up the picture on its way.
    pub fn give_up(&mut self) {
        if self.rendering.take().is_some() {
            let scenes = [&mut self.splats, &mut self.error, &mut self.beside, &mut self.volume];
            scenes.into_iter().flatten().for_each(RenderedScene::give_up);
        }
    }

    /// Renders a scene with the first of two looks, and gives it the second one again. Returns the picture, in
    /// premultiplied colours.
    pub fn picture_by(
        &mut self,
        subject: Subject,
        setup: &RenderSetup,
        camera: Camera,
        [look, own]: [&Look; 2],
    ) -> Result<Image> {
        let size = setup.settings.size.map(|n| n as usize);
        let nothing = Image { size, pixels: vec![[0.0; 4]; size[0] * size[1]] };
        let Some(shown_scene) = self.scene_mut(subject) else { return Ok(nothing) };
        shown_scene.set_look(look)?;
        let pixels = shown_scene.picture_of(setup, camera);
        shown_scene.set_look(own)?;
        Ok(Image { pixels: pixels?, ..nothing })
    }

    /// Returns the depth at a place of the picture (fractions from its upper left corner), mm along the
    /// viewing direction; `None` if nothing is seen there or depth was not kept.
    pub fn depth_at(&self, place: DVec2, split: Option<f64>) -> Option<f64> {
        let right = split.is_some_and(|split| place.x >= split) && self.shown.len() > 1;
        let (subject, setup) = self.shown.get(usize::from(right))?;
        self.scene_of(*subject)?.depth_at(setup, place)
    }

    /// Takes new and freed textures of the panels, for a later frame.
    pub fn take_textures(&mut self, changes: TexturesDelta) {
        self.textures.append(changes);
    }

    /// Draws the picture and the panels on the surface. Calls `before` before presenting. Returns false if
    /// there is no surface, as in a minimised window.
    pub fn present(&mut self, state: &ViewState, overlay: Overlay, before: impl FnOnce()) -> Result<bool> {
        let Some(acquired) = self.surface.acquire()? else { return Ok(false) };
        let mut recorder = self.gpu.record()?;
        self.painter.update(&mut recorder, &mut self.textures)?;
        let size = self.surface.size().map(|n| n as f32);
        let place = pixels(overlay.picture, overlay.pixels_per_point);
        let blank = self.painter.blank();
        let layer = |at: usize| {
            let (subject, setup) = self.shown.get(at)?;
            let shown_scene = match subject {
                Subject::Splats if self.shows_error => self.error.as_ref(),
                Subject::Splats => self.splats.as_ref(),
                Subject::Beside => self.beside.as_ref(),
                Subject::Volume => self.volume.as_ref(),
            };
            shown_scene?.layer(setup)
        };
        let nothing = Layer { picture: blank, layer: 0, part: [1.0; 2] };
        let what = Composition {
            first: layer(0).unwrap_or(nothing),
            second: layer(1),
            split: place[0] + state.split.unwrap_or(1.0) as f32 * (place[2] - place[0]),
            area: [0.0, 0.0, size[0], size[1]],
            place,
            background: state.background.as_vec3().into(),
        };
        let window = self.surface.image(&mut recorder, &acquired);
        self.composer.compose(&mut recorder, &what, window);
        let painting =
            Painting { primitives: &overlay.primitives, points: size.map(|n| n / overlay.pixels_per_point) };
        self.painter.paint(&mut recorder, &painting, window)?;
        before();
        self.surface.present(recorder, acquired)?;
        self.painter.forget(&mut self.textures);
        Ok(true)
    }
}

impl Drop for Canvas {
    fn drop(&mut self) {
        // No frame will apply them any more, and egui would take that for a mistake.
        self.textures.clear();
    }
}

/// Converts a rectangle to whole pixels.
pub fn pixels(rect: Rect, pixels_per_point: f32) -> Area {
    [rect.min.x, rect.min.y, rect.max.x, rect.max.y].map(|n| (n * pixels_per_point).round())
}

/// Returns width and height of a rectangle in whole pixels; `None` if it has no room for a picture.
pub fn size(rect: Rect, pixels_per_point: f32) -> Option<[u32; 2]> {
    let [left, top, right, bottom] = pixels(rect, pixels_per_point);
    let size = [right - left, bottom - top];
    size.iter().all(|n| (1.0..=16384.0).contains(n)).then(|| size.map(|n| n as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> ViewState {
        ViewState::new(&engine::transfer::load("CT-Bone", [-1000.0, 2000.0]).expect("a preset"))
    }

    #[test]
    fn what_is_there_is_shown_in_full_or_fast() {
        let mut state = state();
        let names = |setups: &[(Subject, RenderSetup)]| {
            setups.iter().map(|(_, setup)| setup.mode.name).collect::<Vec<_>>()
        };
        let of_splats = |name| move |subject| if subject == Subject::Volume { "volume" } else { name };
        let full = render_setups(&state, [300, 200], of_splats("slab"), |_| Quality::FULL, |_| true);
        assert_eq!(names(&full), ["slab"]);
        assert_eq!((full[0].1.settings.size, full[0].1.quality), ([300, 200], Quality::FULL));
        // What is usual in each mode, or what the user has chosen.
        let steps = |state: &ViewState| {
            ["slab", "decoded"].map(|name| {
                render_setups(state, [9, 9], of_splats(name), |_| Quality::FULL, |_| true)[0].1.settings.step
            })
        };
        assert_eq!(steps(&state), [0.5, 0.2]);
        state.quality.step = Some(0.7);
        assert_eq!(steps(&state), [0.7; 2]);
        state.split = Some(0.5);
        let coarse = Quality { resolution: 0.25, ..Quality::FULL };
        let no_others = |subject| subject != Subject::Beside;
        let fast = render_setups(&state, [300, 200], of_splats("alpha"), |_| coarse, no_others);
        assert_eq!(names(&fast), ["alpha", "volume"]);
        assert_eq!((fast[1].1.settings.size, fast[1].1.quality), ([300, 200], coarse));
        let only = |one| move |subject| subject == one;
        let volume = render_setups(&state, [9, 9], of_splats("slab"), |_| coarse, only(Subject::Volume));
        assert_eq!(names(&volume), ["volume"]);
        // Each set of splats in the mode that it is shown in.
        let mode_of = |subject| if subject == Subject::Beside { "decoded" } else { "slab" };
        let beside = render_setups(&state, [9, 9], mode_of, |_| coarse, |_| true);
        assert_eq!(beside.iter().map(|(s, _)| *s).collect::<Vec<_>>(), Subject::SETS);
        assert_eq!(names(&beside), ["slab", "decoded"]);
    }

    #[test]
    fn a_picture_without_room_has_no_size() {
        let rect = |w: f32, h: f32| Rect::from_min_size(egui::pos2(10.2, 0.0), egui::vec2(w, h));
        assert_eq!(size(rect(100.0, 50.0), 1.5), Some([150, 75]));
        assert_eq!(size(rect(0.0, 50.0), 1.0), None);
        assert_eq!(size(Rect::NOTHING, 1.0), None);
        assert_eq!(size(rect(f32::NAN, 50.0), 1.0), None);
    }
}
