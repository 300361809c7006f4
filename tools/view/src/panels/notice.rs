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

/// Asks whether to end although a fit would be lost. Returns the answer once there is one.
pub fn leave(context: &Context) -> Option<bool> {
    let modal = Modal::new(Id::new("leave")).show(context, |ui| {
        ui.set_max_width(380.0);
        ui.heading("The fit is in no file");
        ui.label("Its splats are lost if the window is closed now.");
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let close = ui.button("Close").on_hover_text("stops the fit and ends the program").clicked();
            let stay = ui.button("Stay").on_hover_text("the fit goes on").clicked();
            if close || stay { Some(close) } else { None }
        })
        .inner
    });
    if modal.inner.is_none() && modal.should_close() { Some(false) } else { modal.inner }
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

impl From<&Error> for Message {
    fn from(error: &Error) -> Self {
        Message { text: format!("{error} [{}]", error.code), help: error.help.clone(), bad: true }
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
