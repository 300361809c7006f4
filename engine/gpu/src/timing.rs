//! Times of the device, for those who ask: of each pass by its name, and of each submission as a whole.

use super::{Gpu, PassTime, Ticket, lock};
use base::error::Result;

impl Gpu {
    /// Returns the submissions that have finished since the last call of this, each with its device time from
    /// the first pass to the end of the last one, ms. Does not wait. Only the latest 64 are kept, and only
    /// those with timed passes.
    pub fn take_finished(&self) -> Result<Vec<(Ticket, f64)>> {
        self.collect()?;
        Ok(lock(&self.0.times).news.drain(..).collect())
    }

    /// Returns the device time by pass since the last call of this or since the start, slowest first.
    pub fn take_profile(&self) -> Vec<(String, PassTime)> {
        let mut rows: Vec<_> = std::mem::take(&mut lock(&self.0.times).passes).into_iter().collect();
        rows.sort_by(|a, b| b.1.total_ms.total_cmp(&a.1.total_ms));
        rows
    }

    /// Returns the device time of one pass since the last [`Gpu::take_profile`].
    pub fn pass_time(&self, name: &str) -> PassTime {
        lock(&self.0.times).passes.get(name).copied().unwrap_or_default()
    }
}
