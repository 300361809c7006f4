//! The wait for submissions, and what becomes of those that have finished.

use std::sync::atomic::Ordering;

use ash::vk;

use super::submissions::Flight;
use super::{Context, Gpu, Ticket, check, lock};
use base::error::Result;

impl Context {
    /// Returns the value of the last submission that the device has finished.
    pub(super) fn passed(&self) -> Result<u64> {
        // SAFETY: the timeline is live.
        check("asking the timeline", unsafe { self.device.get_semaphore_counter_value(self.timeline) })
    }
}

impl Gpu {
    /// Waits until the device has finished `ticket`. Then reads the timestamps of finished submissions and
    /// deletes dropped objects that they were the last to use.
    pub fn wait(&self, ticket: Ticket) -> Result<()> {
        let context = &self.0;
        context.counters.waits.fetch_add(1, Ordering::Relaxed);
        let semaphores = [context.timeline];
        let values = [ticket.0];
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the timeline is live. No time limit: submissions are kept short, and a hung device is lost.
        check("waiting for the device", unsafe { context.device.wait_semaphores(&info, u64::MAX) })?;
        self.collect()
    }

    /// Waits until the device has finished all submissions.
    pub fn wait_idle(&self) -> Result<()> {
        let last = lock(&self.0.queue).last_value();
        self.wait(Ticket(last))
    }

    /// Returns true if the device has finished `ticket`. Does not wait.
    pub fn has_finished(&self, ticket: Ticket) -> Result<bool> {
        Ok(self.0.passed()? >= ticket.0)
    }

    /// Takes finished submissions out of flight.
    pub(super) fn collect(&self) -> Result<()> {
        let context = &self.0;
        let passed = context.passed()?;
        let done: Vec<Flight> = lock(&context.queue).flying.extract_if(.., |f| f.value <= passed).collect();
        let period = context.limits.timestamp_period;
        let mut failed = Ok(());
        for flight in done {
            if period > 0.0 && !flight.passes.is_empty() {
                match flight.ticks(&context.device) {
                    Ok(ticks) => {
                        lock(&context.times).add(Ticket(flight.value), &flight.passes, &ticks, period);
                    }
                    Err(e) => failed = Err(e),
                }
            }
            // Also without its times, or the slot would never be destroyed.
            lock(&context.queue).free.push(flight.slot);
        }
        lock(&context.memory).delete_passed(&context.device, passed);
        failed
    }
}
