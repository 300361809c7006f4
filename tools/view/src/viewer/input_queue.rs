//! The order of what the user does, kept however much of it comes between two frames.

use egui::Event;

/// Events that no frame has had yet. Egui answers all events of a frame by what was there before it; so a frame ends with
/// each press and each release of a button, and after a key that may open something to type into comes a frame
/// without events, in which that takes the focus.
#[derive(Default)]
pub struct InputQueue {
    waiting: Vec<Event>,
    /// True if the next frame is the one without events.
    pause: bool,
}

impl InputQueue {
    /// Takes the new events and leaves those of the next frame in their place. Returns true if there are more.
    pub fn take(&mut self, events: &mut Vec<Event>) -> bool {
        self.waiting.append(events);
        if std::mem::take(&mut self.pause) {
            return !self.waiting.is_empty();
        }
        let end = self.waiting.iter().position(ends_frame).map_or(self.waiting.len(), |at| at + 1);
        events.extend(self.waiting.drain(..end));
        self.pause =
            events.last().is_some_and(|event| ends_frame(event) && matches!(event, Event::Key { .. }));
        !self.waiting.is_empty()
    }
}

fn ends_frame(event: &Event) -> bool {
    match event {
        Event::PointerButton { .. } => true,
        Event::Key { pressed, modifiers, .. } => *pressed && modifiers.command,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use egui::{Key, Modifiers, PointerButton, pos2};

    use super::*;

    fn key(key: Key, modifiers: Modifiers) -> Event {
        Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
    }

    fn button(pressed: bool) -> Event {
        let (pos, button) = (pos2(1.0, 2.0), PointerButton::Primary);
        Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE }
    }

    #[test]
    fn what_follows_a_button_or_a_command_waits_for_the_next_frame() {
        let all = [
            Event::PointerMoved(pos2(1.0, 2.0)),
            button(true),
            Event::PointerMoved(pos2(9.0, 2.0)),
            button(false),
            key(Key::O, Modifiers::COMMAND),
            Event::Text("a".into()),
            key(Key::A, Modifiers::NONE),
            Event::Text("b".into()),
        ];
        let (mut queue, mut frames) = (InputQueue::default(), Vec::new());
        let mut events = all.to_vec();
        loop {
            let more = queue.take(&mut events);
            frames.push(std::mem::take(&mut events));
            if !more {
                break;
            }
        }
        assert_eq!(frames.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 1, 0, 3]);
        assert_eq!(frames.concat(), all);
        // What comes soon after a command waits, too.
        let mut last = vec![key(Key::O, Modifiers::COMMAND)];
        assert!(!queue.take(&mut last) && last.len() == 1);
        last = vec![Event::Text("c".into())];
        assert!(queue.take(&mut last) && last.is_empty());
        assert!(!queue.take(&mut last) && last.len() == 1);
    }
}
