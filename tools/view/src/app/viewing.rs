//! What actions change of the view, the panels and what is drawn over the picture.

use engine::error::{Error, Kind};
use engine::transfer::PRESETS;

use super::app::App;
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::state::Subject;
use crate::panels;

impl App {
    /// Carries out an action that changes what is seen and nothing else.
    pub(super) fn change_view(&mut self, action: &Action, info: &PanelInfo<'_>) {
        let state = &mut self.state;
        match action {
            Action::Flip => {
                let at = Subject::ALL.iter().position(|subject| *subject == state.shown).unwrap_or(0);
                let (before, after) = Subject::ALL.split_at(at + 1);
                let next = after.iter().chain(before).find(|subject| info.has(**subject));
                next.into_iter().for_each(|subject| state.shown = *subject);
            }
            Action::Split => {
                let both = state.split.is_none() && info.has_two();
                state.split = both.then_some(0.5);
            }
            Action::ToggleSlices => state.slices.shown = !state.slices.shown,
            Action::NextMode => {
                let modes = info.modes();
                let next = modes.iter().position(|m| *m == state.mode).map_or(0, |at| (at + 1) % modes.len());
                modes.get(next).into_iter().for_each(|mode| state.mode = *mode);
            }
            Action::NextPreset => self.step_preset(1, info),
            Action::PreviousPreset => self.step_preset(PRESETS.len() - 1, info),
            Action::SeeAll => self.frame_all = true,
            Action::View(side) => state.orbit.look_from(*side),
            Action::Turn([azimuth, elevation]) => state.orbit.turn(*azimuth, *elevation),
            Action::Measure => {
                self.measuring = if self.measuring.is_none() { Some(None) } else { None };
            }
            Action::Clip => match state.clip.planes.first_mut() {
                Some(plane) => plane.on = !plane.on,
                None => {
                    let plane = panels::clip::across(state, info);
                    state.clip.planes.push(plane);
                }
            },
            Action::Crop => match &mut state.clip.crop {
                Some(crop) => crop.on = !crop.on,
                None => state.clip.crop = Some(panels::clip::around(state, info)),
            },
            Action::TogglePanels => state.show.panels = !state.show.panels,
            Action::ToggleOverlay => state.show.overlay = !state.show.overlay,
            Action::ToggleAnnotations => {
                let show = &mut state.show;
                let on = !(show.orientation || show.scale_bar || show.colour_bar || show.cube);
                (show.orientation, show.scale_bar) = (on, on);
                (show.colour_bar, show.cube) = (on, on);
            }
            Action::ToggleHandles => state.show.handles = !state.show.handles,
            Action::ToggleKeys => self.keys = !self.keys,
            Action::ToggleMessages => self.messages.listed = !self.messages.listed,
            Action::ToggleFit if !info.volume && info.fit.is_none() => self.report(
                &Error::new(Kind::NothingToDo, "VGS-VIEW-041", "there is no volume to fit splats to")
                    .help("open a CT or an MR, or drop one on the window"),
            ),
            Action::ToggleFit => {
                let open = &mut self.fit_form.open;
                *open = !*open;
                if *open {
                    // The region is judged in the slices.
                    (state.slices.shown, state.show.panels) = (true, true);
                }
            }
            // A new action has a place here or in `act`.
            other => debug_assert!(false, "nobody carries out {other:?}"),
        }
    }
}
