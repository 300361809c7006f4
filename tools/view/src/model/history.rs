//! Undo and redo over snapshots. All changes while something is held, as during a drag, are one step.

/// Greatest number of steps that are kept.
const MOST: usize = 200;

/// Past, present and undone snapshots.
#[derive(Clone, Debug)]
pub struct History<T> {
    past: Vec<T>,
    now: T,
    future: Vec<T>,
}

impl<T: Clone + PartialEq> History<T> {
    /// Creates a history that begins here.
    pub fn new(now: T) -> Self {
        History { past: Vec::new(), now, future: Vec::new() }
    }

    /// Takes the current state; to be called after each frame. A change becomes a step as soon as nothing is
    /// `held` any more.
    pub fn observe(&mut self, there: &T, held: bool) {
        if held || *there == self.now {
            return;
        }
        let before = std::mem::replace(&mut self.now, there.clone());
        self.past.push(before);
        if self.past.len() > MOST {
            self.past.remove(0);
        }
        self.future.clear();
    }

    /// Returns the state that was last observed.
    pub fn now(&self) -> &T {
        &self.now
    }

    /// Forgets all steps: `now` is the beginning.
    pub fn restart(&mut self, now: T) {
        *self = History::new(now);
    }

    /// Goes one step back and returns that state; `None` at the beginning. `there` is the current state,
    /// which may not have been observed yet.
    pub fn undo(&mut self, there: &T) -> Option<T> {
        self.observe(there, false);
        let before = self.past.pop()?;
        self.future.push(std::mem::replace(&mut self.now, before));
        Some(self.now.clone())
    }

    /// Goes one step forward again and returns that state; `None` if the last change was no undo.
    pub fn redo(&mut self, there: &T) -> Option<T> {
        self.observe(there, false);
        let after = self.future.pop()?;
        self.past.push(std::mem::replace(&mut self.now, after));
        Some(self.now.clone())
    }

    /// Returns true if there is a step to undo.
    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    /// Returns true if there is a step to redo.
    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_back_and_forth() {
        let mut history = History::new(0);
        for i in 1..=3 {
            history.observe(&i, false);
            history.observe(&i, false);
        }
        assert_eq!(history.undo(&3), Some(2));
        assert_eq!(history.undo(&2), Some(1));
        assert_eq!(history.redo(&1), Some(2));
        history.observe(&7, false);
        assert!(!history.can_redo(), "what was undone is gone after a change");
        assert_eq!(history.undo(&7), Some(2));
        assert_eq!(history.undo(&2), Some(1));
        assert_eq!(history.undo(&1), Some(0));
        assert_eq!(history.undo(&0), None);
        assert!(!history.can_undo() && history.can_redo());
    }

    #[test]
    fn a_drag_is_one_step() {
        let mut history = History::new(0);
        for i in 1..100 {
            history.observe(&i, true);
        }
        assert!(!history.can_undo());
        history.observe(&99, false);
        assert_eq!(history.undo(&99), Some(0));
        assert_eq!(history.redo(&0), Some(99));
        assert_eq!(history.redo(&99), None);
    }

    #[test]
    fn what_was_not_observed_is_undone_first() {
        let mut history = History::new(0);
        history.observe(&1, false);
        history.observe(&5, true);
        assert_eq!(history.undo(&5), Some(1));
        assert_eq!(history.redo(&1), Some(5));
    }

    #[test]
    fn memory_is_bounded() {
        let mut history = History::new(0);
        for i in 1..=10 * MOST {
            history.observe(&i, false);
        }
        let mut there = 10 * MOST;
        let mut steps = 0;
        while let Some(before) = history.undo(&there) {
            (there, steps) = (before, steps + 1);
        }
        assert_eq!((steps, there), (MOST, 9 * MOST));
        history.restart(3);
        assert!(!history.can_undo() && !history.can_redo() && *history.now() == 3);
    }
}
