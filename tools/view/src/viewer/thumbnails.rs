//! Makes the thumbnails of presets, one a frame, so that the window answers meanwhile.

use egui::Context;
use engine::Result;
use engine::render::{MEANWHILE, Quality, Settings};
use engine::transfer::preset;

use super::viewer::Viewer;
use crate::model::state::{DECODED, Subject, mode_row};
use crate::model::thumbnails::{SIZE, Seen};
use crate::model::transfer::Transfer;
use crate::screen::canvas::Canvas;
use crate::screen::rendered_scene::RenderSetup;

impl Viewer {
    /// Makes the next thumbnail, if a list of presets is open that lacks one. Returns true if it was made.
    pub(super) fn make_thumbnail(&mut self, canvas: &mut Canvas, context: &Context) -> Result<bool> {
        let state = &self.app.state;
        let subject = state.shown;
        // Colours of other programs know no transfer function.
        let coloured = self.data.set(subject).is_some_and(|set| set.colours.is_some());
        let Some(scene) = canvas.scene_of(subject).filter(|_| !coloured) else { return Ok(false) };
        let mode = match subject {
            Subject::Volume => state.mode_of(subject),
            _ if scene.scene.splats.as_ref().is_some_and(|s| s.decoded_as().is_some()) => DECODED,
            _ => MEANWHILE,
        };
        let Some(name) = self.thumbnails.next(Seen::of(state, self.data_number)) else { return Ok(false) };
        let mut by_preset = state.clone();
        let preset = Transfer::new(&preset(name)?.over(self.range));
        by_preset.edit_transfer(|state| state.transfer = preset);
        // What is wrong with the state, the picture in the window tells.
        let looks = (self.data.look(subject, &by_preset), self.data.look(subject, state));
        let (Ok(look), Ok(own)) = looks else { return Ok(false) };
        let [look, own] = [look, own].map(|look| self.coloured(subject, look));
        let setup =
            RenderSetup { mode: mode_row(mode), settings: Settings::new(SIZE), quality: Quality::FULL };
        let camera = state.orbit.camera(f64::from(SIZE[0]) / f64::from(SIZE[1]));
        let picture = canvas.picture_by(subject, &setup, camera, [&look, &own])?;
        self.thumbnails.add(context, name, &picture.over(state.background.as_vec3().into()));
        Ok(true)
    }
}
