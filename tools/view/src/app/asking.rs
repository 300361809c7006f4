//! Files are asked for, by the dialog of the desktop where it has one, and else by our own.

use egui::{Context, Key, Modifiers};

use super::app::App;
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::system_dialog::Reply;
use crate::panels::prompt::{Answer, Asked, Prompt, Purpose};

impl App {
    /// Asks for the file that an action needs, if there is something to do with it; others are left alone.
    pub(super) fn ask_for(&mut self, action: &Action, info: &PanelInfo<'_>) {
        match action {
            Action::AskSaveSplats if self.has_splats_to_write(info) => self.ask(Purpose::SaveSplats),
            Action::AskSaveObject(object) if self.has_splats_to_write(info) => {
                self.ask(Purpose::SaveObject(*object))
            }
            Action::AskShare if self.has_splats_to_write(info) => self.ask(Purpose::Share),
            Action::AskPack if self.state.files.all().next().is_none() => {
                self.refuse("There is nothing to pack", "open some files first");
            }
            Action::AskPack => self.ask(Purpose::Pack),
            Action::AskBeside if self.state.files.splats.is_empty() => {
                self.refuse("There are no splats to compare with", "open some");
            }
            Action::AskBeside => self.ask(Purpose::Beside),
            Action::AskMask => self.ask(Purpose::Mask),
            Action::AskKeep => self.ask(Purpose::Keep),
            Action::AskOpen => self.ask(Purpose::Open),
            Action::AskOpenFolder => self.ask(Purpose::OpenFolder),
            Action::AskSave => self.ask(Purpose::Save),
            Action::AskScreenshot => self.ask(Purpose::Screenshot),
            Action::AskRecord => self.ask(Purpose::Record),
            Action::AskTransfer => self.ask(Purpose::Transfer),
            Action::AskSaveTransfer => self.ask(Purpose::SaveTransfer),
            _ => {}
        }
    }

    /// Asks for a file.
    pub(super) fn ask(&mut self, purpose: Purpose) {
        if self.asked.is_some() {
            return self.refuse(
                "A file dialog is already open",
                "it may be behind this window; press Esc here to close it",
            );
        }
        let prompt = self.question(purpose);
        match (&self.system_dialog, prompt.question()) {
            (Some(show), Some(question)) => self.asked = Some(Asked { prompt, answer: show(question) }),
            _ => self.prompt = Some(prompt),
        }
    }

    /// Asks for a file by our own dialog.
    pub(super) fn ask_by_own_dialog(&mut self, purpose: Purpose) {
        self.prompt = Some(self.question(purpose));
    }

    fn question(&self, purpose: Purpose) -> Prompt {
        let size = self.picture.size() * self.pixels_per_point;
        let size = [size.x, size.y].map(|n| (n.round() as u32).max(16));
        let shown = (&self.state.files, self.session.as_deref());
        Prompt::new(purpose, shown, size, &self.settings.recent)
    }

    /// Puts away the question for a file, and what was to be done once the session is saved.
    pub(super) fn end_questions(&mut self) {
        (self.prompt, self.asked, self.saves_to_leave) = (None, None, None);
    }

    /// Shows the question for a file, if there is one, and takes its answer.
    pub(super) fn show_question(&mut self, context: &Context, actions: &mut Vec<Action>) {
        if self.asked.is_some() && context.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
            self.end_questions();
        }
        let reply = self.asked.as_ref().and_then(|asked| asked.answer.reply());
        if let Some((reply, asked)) = reply.and_then(|reply| Some((reply, self.asked.take()?))) {
            // Nothing else brings the frame that shows what comes of it.
            context.request_repaint();
            let answer = self.answer_of(reply, asked.prompt);
            self.take_answer(answer, actions);
        }
        if let Some(prompt) = &mut self.prompt {
            let answer = prompt.show(context);
            self.take_answer(answer, actions);
        }
    }

    /// Returns the answer that the dialog of the desktop has given to a question. While there is none, our own dialog asks.
    fn answer_of(&mut self, reply: Reply, mut prompt: Prompt) -> Answer {
        let answer = match reply {
            Reply::Cancelled => Answer::Cancelled,
            Reply::Chosen(paths) if paths.is_empty() => {
                self.refuse(
                    "The chosen file is not in a local folder",
                    "copy it to this computer and open it there",
                );
                Answer::Cancelled
            }
            Reply::Chosen(paths) => prompt.take(paths),
            Reply::Unavailable => {
                self.system_dialog = None;
                Answer::Open
            }
        };
        if answer == Answer::Open {
            self.prompt = Some(prompt);
        }
        answer
    }

    fn take_answer(&mut self, answer: Answer, actions: &mut Vec<Action>) {
        match answer {
            Answer::Open => {}
            Answer::Cancelled => self.end_questions(),
            Answer::Do(action) => {
                self.prompt = None;
                actions.push(action);
            }
        }
    }
}
