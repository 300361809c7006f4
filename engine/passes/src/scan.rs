//! Exclusive prefix sum of u32, in three kernels: block sums, offsets of the blocks, offsets of the elements.

use shaders_glsl as glsl;
use shaders_glsl::types::ScanParams;

use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// Elements that one workgroup scans.
const BLOCK: usize = glsl::scan::SCAN_BLOCK as usize;

/// The prefix sum and its scratch buffer.
pub struct Scan {
    sums: Kernel,
    offsets: Kernel,
    apply: Kernel,
    block_sums: Buffer<u32>,
}

impl Scan {
    /// Creates a scan of at most `capacity` elements.
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self> {
        Ok(Scan {
            sums: Kernel::new(gpu, &glsl::SCAN_SUMS, &[])?,
            offsets: Kernel::new(gpu, &glsl::SCAN_OFFSETS, &[])?,
            apply: Kernel::new(gpu, &glsl::SCAN_APPLY, &[])?,
            block_sums: gpu.buffer("scan block sums", "sorting", capacity.div_ceil(BLOCK).max(1))?,
        })
    }

    /// Records `offsets[i] = values[0] + .. + values[i - 1]` for i in 0..=count; `offsets` has one element
    /// more than `values`.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        values: &Buffer<u32>,
        count: usize,
        offsets: &mut Buffer<u32>,
    ) {
        // Without elements there is still one block: it writes the total, 0.
        let blocks = count.div_ceil(BLOCK).max(1);
        assert!(blocks <= self.block_sums.len(), "scan: {count} elements are more than it was made for");
        let params = ScanParams { count: count as u32 };
        recorder
            .pass(&self.sums)
            .read("values", values)
            .write("block_sums", &mut self.block_sums)
            .push(&params)
            .dispatch(blocks as u32);
        recorder
            .pass(&self.offsets)
            .write("block_sums", &mut self.block_sums)
            .push(&ScanParams { count: blocks as u32 })
            .dispatch(1);
        recorder
            .pass(&self.apply)
            .read("values", values)
            .read("block_sums", &self.block_sums)
            .write("offsets", offsets)
            .push(&params)
            .dispatch(blocks as u32);
    }
}
