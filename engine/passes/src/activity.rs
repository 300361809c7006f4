//! The list of the splats that a look can show: marked, limited to a budget if there is one, counted, listed.

use shaders_glsl as glsl;
use shaders_glsl::types::{ActivityParams, Appearance, LimitParams, ListParams, Look};

use super::{Ranking, Scan};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// The list of active splats.
pub struct Activity {
    mark: Kernel,
    list: Kernel,
    scan: Scan,
    flags: Buffer<u32>,
    /// Number of active splats before each splat; the last element is the number of all active splats.
    pub places: Buffer<u32>,
    /// Indices of the active splats, in order.
    pub active: Buffer<u32>,
    /// Objects that the active splats belong to.
    pub active_objects: Buffer<u32>,
    /// Number of active splats, in its only element.
    pub count: Buffer<u32>,
    splat_count: usize,
}

/// Buffers that a listing is made from.
pub struct ActivitySources<'a> {
    /// The row of the look.
    pub look: &'a Buffer<Look>,
    /// Number of visible entries before each entry of the look's table; one more than there are entries.
    pub visible: &'a Buffer<u32>,
    /// Appearance of each object, by its number.
    pub appearances: &'a Buffer<Appearance>,
    /// Least and greatest intensity that each splat may show.
    pub intervals: &'a Buffer<[f32; 2]>,
    /// Number of each splat's object.
    pub objects: &'a Buffer<u32>,
}

impl Activity {
    /// Creates the list for `splat_count` splats.
    pub fn new(gpu: &Gpu, splat_count: usize) -> Result<Self> {
        Ok(Activity {
            mark: Kernel::new(gpu, &glsl::MARK_ACTIVE, &[])?,
            list: Kernel::new(gpu, &glsl::LIST_ACTIVE, &[])?,
            scan: Scan::new(gpu, splat_count)?,
            flags: gpu.buffer("activity", "sorting", splat_count)?,
            places: gpu.buffer("places of active splats", "sorting", splat_count + 1)?,
            active: gpu.buffer("active splats", "splats", splat_count)?,
            active_objects: gpu.buffer("objects of active splats", "splats", splat_count)?,
            count: gpu.buffer("number of active splats", "splats", 1)?,
            splat_count,
        })
    }

    /// Records the listing. With a budget it lists at most that many splats, the first ones of the ranking.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        sources: &ActivitySources<'_>,
        budget: Option<(&mut Ranking, usize)>,
    ) {
        let count = self.splat_count as u32;
        recorder
            .pass(&self.mark)
            .read("look_rows", sources.look)
            .read("visible_before", sources.visible)
            .read("intervals", sources.intervals)
            .read("objects", sources.objects)
            .read("appearances", sources.appearances)
            .write("flags", &mut self.flags)
            .push(&ActivityParams { count })
            .dispatch_over(count);
        if let Some((ranking, budget)) = budget {
            ranking.rows.gather(recorder, &self.flags, &ranking.order, 0, &mut ranking.flags);
            self.scan.record(recorder, &ranking.flags, self.splat_count, &mut self.places);
            recorder
                .pass(&ranking.limit)
                .read("places", &self.places)
                .read("ranks", &ranking.ranks)
                .write("flags", &mut self.flags)
                .push(&LimitParams { count, budget: u32::try_from(budget).unwrap_or(u32::MAX) })
                .dispatch_over(count);
        }
        self.scan.record(recorder, &self.flags, self.splat_count, &mut self.places);
        recorder
            .pass(&self.list)
            .read("places", &self.places)
            .read("objects", sources.objects)
            .write("active_splats", &mut self.active)
            .write("active_objects", &mut self.active_objects)
            .push(&ListParams { count })
            .dispatch_over(count);
        recorder.copy(&self.places, self.splat_count, &mut self.count, 0, 1);
    }
}
