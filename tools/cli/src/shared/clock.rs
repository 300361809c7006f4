//! Dates for records: UTC as RFC 3339, from the system clock.

use std::time::{SystemTime, UNIX_EPOCH};

use engine::figures::utc;

/// Returns the current time, as 2026-01-31T12:00:00Z.
pub fn now() -> String {
    // A clock before 1970 counts as 1970: a wrong date is no reason to fail.
    utc(SystemTime::now().duration_since(UNIX_EPOCH).map(|d| d.as_secs()).unwrap_or_default())
}
