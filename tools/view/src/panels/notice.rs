//! The notice that users see once, and messages.

use egui::{Align2, Context, Id, Modal, RichText, Window, vec2};
use engine::Error;

use crate::theme::SIGNAL;

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
        ui.button("I understand").on_hover_text("this is asked once").clicked()
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
            "ends the program, and a fit that runs",
            "asks for its file, and then ends the program",
        ],
        false => [
            "Open without saving",
            "drops what has changed",
            "asks for its file, and then opens the other session",
        ],
    };
    let modal = Modal::new(Id::new("leave")).show(context, |ui| {
        ui.set_max_width(380.0);
        ui.heading(if loss.fit { "The fit is in no file" } else { "The session has changed" });
        if loss.fit {
            ui.label("Its splats are lost if the window is closed now.");
        }
        if loss.session {
            ui.label("No session file has what was set, deleted or measured since it was last saved.");
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
            button("Cancel", "everything stays as it is", Leaving::Stay);
            answer
        })
        .inner
    });
    if modal.inner.is_none() && modal.should_close() { Some(Leaving::Stay) } else { modal.inner }
}

/// Message to the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Description of what happened.
    pub text: String,
    /// Advice on what to do; may be empty.
    pub help: String,
    /// True if something went wrong.
    pub bad: bool,
}

/// Flags of the command line that errors name, and what is called so in the window.
const IN_WINDOW: [(&str, &str); 8] = [
    ("--roi-min-ml", "Pieces from"),
    ("--roi-largest", "Largest"),
    ("--roi-close", "Close gaps"),
    ("--roi-fill", "Fill holes"),
    ("--roi-threshold", "Threshold"),
    ("--roi-label", "Labels"),
    ("--roi", "Mask"),
    ("--series", "Choose series…"),
];

/// Returns a text with the window's words for flags. Those that the window has none for stay, as flags.
fn in_window(text: &str) -> String {
    let words = IN_WINDOW.iter().fold(text.to_owned(), |text, (flag, word)| text.replace(flag, word));
    if words.contains("--") { words + " (on the command line)" } else { words }
}

impl From<&Error> for Message {
    fn from(error: &Error) -> Self {
        let file = error.file.as_ref().map(|file| format!("{}: ", file.display())).unwrap_or_default();
        let text = format!("{file}{} [{}]", in_window(&error.message), error.code);
        Message { text, help: in_window(&error.help), bad: true }
    }
}

/// Shows a message until it is closed. Returns true if it was closed.
pub fn message(context: &Context, message: &Message) -> bool {
    let mut open = true;
    let title =
        if message.bad { RichText::new("It did not work").color(SIGNAL) } else { RichText::new("Done") };
    Window::new(title)
        .id(Id::new("message"))
        .open(&mut open)
        .anchor(Align2::LEFT_BOTTOM, vec2(12.0, -40.0))
        .resizable(false)
        .collapsible(false)
        .show(context, |ui| {
            ui.set_max_width(460.0);
            ui.label(&message.text);
            if !message.help.is_empty() {
                ui.weak(&message.help);
            }
        });
    !open
}

#[cfg(test)]
mod tests {
    use engine::Kind;

    use super::*;

    #[test]
    fn errors_speak_of_the_window() {
        let message = |message: &str, help: &str| {
            Message::from(&Error::new(Kind::Usage, "VGS-X-001", message.to_owned()).help(help))
        };
        let pieces =
            message("--roi-min-ml 5 leaves nothing", "give a smaller --roi-min-ml, or other thresholds");
        assert_eq!(pieces.text, "Pieces from 5 leaves nothing [VGS-X-001]");
        assert_eq!(pieces.help, "give a smaller Pieces from, or other thresholds");
        let labels = message("several", "choose --roi-label N|name,...: 1 bone; or another --roi");
        assert_eq!(labels.help, "choose Labels N|name,...: 1 bone; or another Mask");
        assert_eq!(message("a", "raise --max-bytes").help, "raise --max-bytes (on the command line)");
        assert_eq!(message("a", "copy it again").help, "copy it again");
        let named = Error::new(Kind::Usage, "VGS-X-001", "--series is none").file("a--roi.nii");
        assert_eq!(Message::from(&named).text, "a--roi.nii: Choose series… is none [VGS-X-001]");
    }
}
