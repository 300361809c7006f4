//! Times that a context keeps until somebody asks for them: of each pass by its name, and of each submission
//! as a whole.

use std::collections::{BTreeMap, VecDeque};

use super::{PassTime, Ticket};

/// Greatest number of finished submissions whose times are kept until somebody asks for them.
const MOST_NEWS: usize = 64;

/// Times of submissions that have finished.
#[derive(Default)]
pub(super) struct Times {
    pub(super) passes: BTreeMap<String, PassTime>,
    /// The latest submissions with their device time, ms.
    pub(super) news: VecDeque<(Ticket, f64)>,
}

impl Times {
    /// Adds a submission that has finished. `ticks` are its timestamps, two for each of its passes; a tick
    /// takes `period_ns` nanoseconds.
    pub(super) fn add(&mut self, ticket: Ticket, passes: &[String], ticks: &[u64], period_ns: f32) {
        let ms = |from: u64, to: u64| to.saturating_sub(from) as f64 * f64::from(period_ns) * 1e-6;
        for (name, [from, to]) in passes.iter().zip(ticks.as_chunks::<2>().0) {
            let ms = ms(*from, *to);
            let row = self.passes.entry(name.clone()).or_default();
            row.calls += 1;
            row.total_ms += ms;
            row.longest_ms = row.longest_ms.max(ms);
        }
        if let (Some(&from), Some(&to)) = (ticks.iter().min(), ticks.iter().max()) {
            if self.news.len() == MOST_NEWS {
                self.news.pop_front();
            }
            self.news.push_back((ticket, ms(from, to)));
        }
    }
}
