//! Times of the device: of each pass by its name, and of each submission as a whole.

use std::collections::{BTreeMap, VecDeque};

use ash::vk;

use super::{Context, Gpu, Ticket, check, lock};
use crate::error::Result;

/// Greatest number of finished submissions whose times are kept until somebody asks for them.
const MOST_NEWS: usize = 64;

/// Time and calls of one named pass, from GPU timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassTime {
    /// Number of times that the pass ran.
    pub calls: u64,
    /// Sum over all calls, milliseconds of device time.
    pub total_ms: f64,
    /// The longest single call, milliseconds.
    pub longest_ms: f64,
}

/// Times of submissions that have finished.
#[derive(Default)]
pub(super) struct Times {
    passes: BTreeMap<String, PassTime>,
    /// The latest submissions with their device time, ms.
    news: VecDeque<(Ticket, f64)>,
}

/// Reads the timestamps of a submission that has finished, two for each of its passes.
pub(super) fn read(
    context: &Context,
    ticket: Ticket,
    queries: vk::QueryPool,
    passes: &[String],
) -> Result<()> {
    let mut ticks = vec![0u64; passes.len() * 2];
    // SAFETY: the submission that wrote these queries has finished.
    let read = unsafe {
        context.device.get_query_pool_results(queries, 0, &mut ticks, vk::QueryResultFlags::TYPE_64)
    };
    check("reading timestamps", read)?;
    let ms = |from: u64, to: u64| {
        to.saturating_sub(from) as f64 * f64::from(context.limits.timestamp_period) * 1e-6
    };
    let mut times = lock(&context.times);
    for (name, [from, to]) in passes.iter().zip(ticks.as_chunks::<2>().0) {
        let ms = ms(*from, *to);
        let row = times.passes.entry(name.clone()).or_default();
        row.calls += 1;
        row.total_ms += ms;
        row.longest_ms = row.longest_ms.max(ms);
    }
    if let (Some(&from), Some(&to)) = (ticks.iter().min(), ticks.iter().max()) {
        if times.news.len() == MOST_NEWS {
            times.news.pop_front();
        }
        times.news.push_back((ticket, ms(from, to)));
    }
    Ok(())
}

impl Gpu {
    /// Returns true if the device has finished `ticket`. Does not wait.
    pub fn has_finished(&self, ticket: Ticket) -> Result<bool> {
        Ok(self.0.passed()? >= ticket.0)
    }

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

impl Context {
    /// Returns the value of the last submission that the device has finished.
    pub(super) fn passed(&self) -> Result<u64> {
        // SAFETY: the timeline is live.
        check("asking the timeline", unsafe { self.device.get_semaphore_counter_value(self.timeline) })
    }
}
