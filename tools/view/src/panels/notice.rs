//! The notice that users see once, and the question whether to leave what would be lost.

use egui::{Context, Id, Modal};

/// Shows the notice that this is not for diagnosis. Returns true once the user has confirmed it.
pub fn show(context: &Context) -> bool {
    let modal = Modal::new(Id::new("notice")).show(context, |ui| {
        ui.set_max_width(380.0);
        ui.heading("Not for diagnosis");
        ui.label(
            "vgs shows an approximation of medical volumes for research and teaching. It is no medical device. Do not base \
             a diagnosis, a measurement for treatment, or any other clinical decision on what it shows.",
        );
        ui.add_space(6.0);
        ui.button("I understand").on_hover_text("you will only be asked once").clicked()
    });
    modal.inner
}

/// What would be lost if the program ended now, or another session took the place of this one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// True if there are splats of a fit that no file has.
    pub fit: bool,
    /// True if the session has changed since it was opened or saved.
    pub session: bool,
}

impl Loss {
    /// Returns true if something would be lost.
    pub fn any(self) -> bool {
        self.fit || self.session
    }
}

/// Answer of a user who is asked whether to go on although something would be lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaving {
    /// The session is saved first.
    Save,
    /// It goes on, whatever is lost.
    Go,
    /// Everything stays as it is.
    Stay,
}

/// Asks whether to end, or to open another session, although something would be lost. Returns the answer once there is
/// one.
pub fn leave(context: &Context, loss: Loss, ends: bool) -> Option<Leaving> {
    let [go, help, after] = match ends {
        true => [
            "Quit without saving",
            "end the program, and any fit that is running",
            "save it first, then quit",
        ],
        false => ["Open without saving", "discard the changes", "save it first, then open the other session"],
    };
    let modal = Modal::new(Id::new("leave")).show(context, |ui| {
        ui.set_max_width(380.0);
        ui.heading(if loss.fit { "The fit has not been saved" } else { "Unsaved changes" });
        if loss.fit {
            ui.label("Its splats will be lost if the window is closed now.");
        }
        if loss.session {
            ui.label("Settings, deletions and measurements since the last save will be lost.");
        }
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let mut answer = None;
            let mut button = |text: &str, help: &str, what| {
                if ui.button(text).on_hover_text(help).clicked() {
                    answer = Some(what);
                }
            };
            if loss.session {
                button("Save session", after, Leaving::Save);
            }
            button(go, help, Leaving::Go);
            button("Cancel", "change nothing", Leaving::Stay);
            answer
        })
        .inner
    });
    if modal.inner.is_none() && modal.should_close() { Some(Leaving::Stay) } else { modal.inner }
}
