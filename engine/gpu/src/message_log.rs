//! The messages of the validation layers.

use std::sync::{Arc, Mutex};

use super::lock;

/// The messages of the validation layers, errors and warnings. Clones are the same list, which outlives the
/// device: only when that is destroyed do the layers tell what was never freed.
#[derive(Clone, Debug, Default)]
pub struct MessageLog(Arc<Mutex<Vec<String>>>);

impl MessageLog {
    /// Returns the messages so far.
    pub fn all(&self) -> Vec<String> {
        lock(&self.0).clone()
    }

    /// Adds a message.
    pub(super) fn push(&self, message: String) {
        lock(&self.0).push(message);
    }
}
