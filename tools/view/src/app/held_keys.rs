//! Keeps track of the keys that are held down. A key is known by its place on the keyboard: one that is
//! pressed with Shift and released without it has two names, and would by name seem held for ever.

use std::collections::BTreeSet;

use egui::{Event, Key, RawInput};

/// Keys that are held down.
#[derive(Clone, Debug, Default)]
pub struct HeldKeys(BTreeSet<Key>);

impl HeldKeys {
    /// Follows the input of a frame. When the window loses the keyboard, no key counts as held.
    pub fn follow(&mut self, input: &RawInput) {
        for event in &input.events {
            match *event {
                Event::Key { key, physical_key, pressed, .. } => {
                    let place = physical_key.unwrap_or(key);
                    if pressed {
                        self.0.insert(place)
                    } else {
                        self.0.remove(&place)
                    };
                }
                Event::WindowFocused(false) => self.0.clear(),
                _ => {}
            }
        }
        if !input.focused {
            self.0.clear();
        }
    }

    /// Returns true if a key is held.
    pub fn any(&self) -> bool {
        !self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use egui::Modifiers;

    use super::*;

    fn event(key: Key, place: Key, pressed: bool, modifiers: Modifiers) -> Event {
        Event::Key { key, physical_key: Some(place), pressed, repeat: false, modifiers }
    }

    fn after(events: &[Event]) -> bool {
        let mut keys = HeldKeys::default();
        keys.follow(&RawInput { events: events.to_vec(), ..RawInput::default() });
        keys.any()
    }

    #[test]
    fn a_key_that_is_released_under_another_name_is_not_held() {
        let down = event(Key::Questionmark, Key::Slash, true, Modifiers::SHIFT);
        let up = event(Key::Slash, Key::Slash, false, Modifiers::NONE);
        assert!(after(std::slice::from_ref(&down)));
        assert!(!after(&[down.clone(), up]));
        assert!(!after(&[down, Event::WindowFocused(false)]));
    }
}
