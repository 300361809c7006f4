//! Which splats a look can show: marked, counted, listed.

use shaders_glsl as glsl;
use shaders_glsl::types::{ActivityParams, ListParams, Look};

use super::Scan;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};

/// Invocations of a workgroup of the two kernels.
const GROUP: usize = 64;

/// The list of active splats.
pub struct Activity {
    mark: Kernel,
    list: Kernel,
    scan: Scan,
    flags: Buffer<u32>,
    places: Buffer<u32>,
    /// Indices of the active splats, in order.
    pub active: Buffer<u32>,
    /// How many there are, in its only element.
    pub count: Buffer<u32>,
    splat_count: usize,
}

impl Activity {
    /// For so many splats.
    pub fn new(gpu: &Gpu, splat_count: usize) -> Result<Self> {
        Ok(Activity {
            mark: Kernel::new(gpu, &glsl::MARK_ACTIVE, &[])?,
            list: Kernel::new(gpu, &glsl::LIST_ACTIVE, &[])?,
            scan: Scan::new(gpu, splat_count)?,
            flags: gpu.buffer("activity", "sorting", splat_count)?,
            places: gpu.buffer("places of active splats", "sorting", splat_count + 1)?,
            active: gpu.buffer("active splats", "splats", splat_count)?,
            count: gpu.buffer("number of active splats", "splats", 1)?,
            splat_count,
        })
    }

    /// Records the listing. `visible[i]` is how many entries of the look's table before `i` are visible; `intervals` are
    /// the least and greatest intensity that each splat may show.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        look: &Buffer<Look>,
        visible: &Buffer<u32>,
        intervals: &Buffer<[f32; 2]>,
        labels: &Buffer<u32>,
    ) {
        let count = self.splat_count as u32;
        let groups = self.splat_count.div_ceil(GROUP) as u32;
        recorder
            .pass(&self.mark)
            .read(look)
            .read(visible)
            .read(intervals)
            .read(labels)
            .write(&mut self.flags)
            .push(&ActivityParams { count })
            .dispatch(groups);
        self.scan.record(recorder, &self.flags, self.splat_count, &mut self.places);
        recorder
            .pass(&self.list)
            .read(&self.places)
            .write(&mut self.active)
            .push(&ListParams { count })
            .dispatch(groups);
        recorder.copy(&self.places, self.splat_count, &mut self.count, 0, 1);
    }
}
