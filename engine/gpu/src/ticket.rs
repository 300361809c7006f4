//! Tickets of submissions.

/// A submission: the value that the timeline reaches when the device has finished it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(pub(super) u64);
