//! Messages: what was done, what went wrong, and the list of those of the session.

use std::collections::VecDeque;
use std::time::Instant;

use egui::{Area, Context, Frame, Id, Order, Rect, RichText, ScrollArea, Ui, Window, vec2};
use engine::Error;

use crate::panels::theme::SIGNAL;
use engine::figures;

/// Greatest number of messages that are kept, and of those that are shown at a time.
const MOST: [usize; 2] = [50, 3];
/// Time that a message stays, seconds: at least, for each letter, and at most. People read some 15 letters a second.
const STAYS: [f64; 3] = [4.0, 0.07, 12.0];
/// Time in which it fades, seconds.
const FADES: f64 = 0.5;
/// Greatest width of a message, points of the screen.
const WIDE: f32 = 460.0;
/// Place of the first one, from the upper left corner of the picture, points of the screen: bars, letters, cube and frame
/// times are elsewhere, and the word *draft* stands above.
const PLACE: egui::Vec2 = vec2(10.0, 30.0);

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

/// How long a message is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shown {
    /// From the next frame on.
    Soon,
    /// Until this time of the frames, seconds.
    Until(f64),
    /// Until it is closed.
    Stays,
    /// No more.
    Past,
}

struct Told {
    message: Message,
    at: Instant,
    shown: Shown,
}

/// Messages of the session. What was done fades after some seconds; what went wrong stays until it is closed.
#[derive(Default)]
pub struct Messages {
    told: VecDeque<Told>,
    /// True if the list of all is open.
    pub listed: bool,
}

impl Messages {
    /// Tells the user something. What is shown already is not shown twice.
    pub fn tell(&mut self, message: Message) {
        self.told.iter_mut().filter(|told| told.message == message).for_each(|told| told.shown = Shown::Past);
        if self.told.len() == MOST[0] {
            self.told.pop_front();
        }
        let shown = if message.bad { Shown::Stays } else { Shown::Soon };
        self.told.push_back(Told { message, at: Instant::now(), shown });
    }

    /// Returns the latest message that is shown.
    pub fn latest(&self) -> Option<&Message> {
        self.told.iter().rev().find(|told| told.shown != Shown::Past).map(|told| &told.message)
    }

    /// Returns the number of messages that are kept.
    pub fn count(&self) -> usize {
        self.told.len()
    }

    /// Closes what is shown. The list keeps it.
    pub fn close(&mut self) {
        self.told.iter_mut().for_each(|told| told.shown = Shown::Past);
        self.listed = false;
    }

    /// Shows the messages over a picture, the latest first, and the list if it is open.
    pub fn show(&mut self, context: &Context, picture: Rect) {
        let now = context.input(|i| i.time);
        for told in &mut self.told {
            if told.shown == Shown::Soon {
                let letters = told.message.text.chars().count() + told.message.help.chars().count();
                let [least, each, most] = STAYS;
                told.shown = Shown::Until(now + (least + each * letters as f64).min(most));
            }
            match told.shown {
                Shown::Until(end) if end <= now => told.shown = Shown::Past,
                Shown::Until(end) => {
                    // A frame when it begins to fade, and then many.
                    let wait = if end - now > FADES { end - now - FADES } else { 0.03 };
                    context.request_repaint_after_secs(wait as f32);
                }
                _ => {}
            }
        }
        if self.told.iter().any(|told| told.shown != Shown::Past) {
            let wide = (0.5 * picture.width() - 40.0).clamp(200.0, WIDE);
            Area::new(Id::new("messages"))
                .order(Order::Foreground)
                .fixed_pos(picture.left_top() + PLACE)
                .constrain(false)
                .show(context, |ui| self.shown(ui, now, wide));
        }
        self.list(context, picture);
    }

    fn shown(&mut self, ui: &mut Ui, now: f64, wide: f32) {
        let shown = self.told.iter_mut().rev().filter(|told| told.shown != Shown::Past);
        for Told { message, shown, .. } in shown.take(MOST[1]) {
            let fading = match shown {
                Shown::Until(end) => ((*end - now) / FADES).clamp(0.0, 1.0),
                _ => 1.0,
            };
            let mut closed = false;
            let response = ui
                .scope(|ui| {
                    ui.multiply_opacity(fading as f32);
                    Frame::popup(ui.style()).show(ui, |ui| {
                        ui.set_max_width(wide);
                        if message.bad {
                            ui.horizontal(|ui| {
                                ui.label(RichText::new("Something went wrong").color(SIGNAL));
                                closed = ui.small_button("✖").on_hover_text("close (Esc)").clicked();
                            });
                        }
                        text(ui, message);
                    })
                })
                .inner
                .response;
            if let Shown::Until(end) = shown
                && ui.rect_contains_pointer(response.rect)
            {
                // It is being read.
                *end = end.max(now + 2.0);
            }
            if closed {
                *shown = Shown::Past;
            }
        }
    }

    /// Shows all messages that are kept, the latest first.
    fn list(&mut self, context: &Context, picture: Rect) {
        let Messages { told, listed } = self;
        if !*listed {
            // At once: egui would let it fade.
            return;
        }
        Window::new("Messages")
            .open(listed)
            .default_pos(picture.center() - vec2(0.5 * WIDE, 140.0))
            .default_size(vec2(WIDE, 280.0))
            .collapsible(false)
            .show(context, |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    if told.is_empty() {
                        ui.weak("none yet");
                    }
                    for Told { message, at, .. } in told.iter().rev() {
                        let ago =
                            format!("{} ago", figures::seconds(at.elapsed().as_secs_f64().floor().max(1.0)));
                        let colour = if message.bad { SIGNAL } else { ui.visuals().weak_text_color() };
                        ui.small(RichText::new(ago).color(colour));
                        text(ui, message);
                        ui.separator();
                    }
                });
            });
    }
}

fn text(ui: &mut Ui, message: &Message) {
    ui.label(&message.text);
    if !message.help.is_empty() {
        ui.weak(&message.help);
    }
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

    #[test]
    fn what_was_said_is_kept_once_and_not_for_ever() {
        let told = |text: &str| Message { text: text.to_owned(), help: String::new(), bad: false };
        let mut messages = Messages::default();
        assert_eq!((messages.latest(), messages.count()), (None, 0));
        for i in 0..200 {
            messages.tell(told(&i.to_string()));
        }
        assert_eq!((messages.latest(), messages.count()), (Some(&told("199")), MOST[0]));
        messages.tell(told("198"));
        assert_eq!(messages.latest(), Some(&told("198")));
        messages.close();
        assert_eq!((messages.latest(), messages.count()), (None, MOST[0]));
    }
}
