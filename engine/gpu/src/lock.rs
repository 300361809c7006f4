//! The lock of a mutex.

use std::sync::{Mutex, MutexGuard};

/// Locks a mutex, poisoned or not. A poisoned one means that another thread panicked while holding it; its
/// data are counters and handles that stay valid, so going on is right.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
