//! Occupied bricks of a volume: those of which a look can show something, and the distance from each brick to
//! the next of them. A ray march skips empty space by these distances.

use shaders_glsl as glsl;
use shaders_glsl::types::{BrickGrid, Look, OccupancyParams, SpreadParams};

use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// Largest distance, in bricks; it also stands for greater distances and for no visible brick at all.
pub const FARTHEST: u32 = 16;

/// Marks bricks and measures distances between them.
pub struct Occupancy {
    mark: Kernel,
    spread: Kernel,
    /// The bricks.
    pub grid: BrickGrid,
    intervals: Buffer<[f32; 2]>,
    /// For each brick the Chebyshev distance to the nearest brick that can be seen, in bricks; at most
    /// [`FARTHEST`].
    pub distances: Buffer<u32>,
    scratch: Buffer<u32>,
}

impl Occupancy {
    /// Creates the passes for bricks that hold these intervals of intensity, x fastest; an interval that ends
    /// before it begins holds nothing.
    ///
    /// # Panics
    /// If there is not one interval for each brick.
    pub fn new(gpu: &Gpu, grid: BrickGrid, intervals: &[[f32; 2]]) -> Result<Self> {
        let count: usize = grid.bricks.iter().map(|&n| n as usize).product();
        assert_eq!(intervals.len(), count, "one interval for each brick");
        let limits = gpu.limits();
        let most = (limits.storage_range as usize / size_of::<[f32; 2]>())
            .min(limits.workgroups as usize * glsl::OCCUPANCY_MARK.width() as usize)
            .min(u32::MAX as usize);
        if count > most {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-RENDER-020",
                format!("a volume of {count} bricks; this device takes at most {most}"),
            )
            .help("use a smaller region of interest or a coarser volume"));
        }
        Ok(Occupancy {
            mark: Kernel::new(gpu, &glsl::OCCUPANCY_MARK, &[])?,
            spread: Kernel::new(gpu, &glsl::OCCUPANCY_SPREAD, &[])?,
            grid,
            intervals: gpu.upload("intervals of bricks", "volume", intervals)?,
            distances: gpu.buffer("distances of bricks", "volume", count)?,
            scratch: gpu.buffer("distances so far", "volume", count)?,
        })
    }

    /// Records the distances for a look. `visible[i]` is the number of visible entries before entry `i` of
    /// the look's table.
    pub fn record(&mut self, recorder: &mut Recorder, look: &Buffer<Look>, visible: &Buffer<u32>) {
        let count = self.intervals.len();
        recorder
            .pass(&self.mark)
            .read("look_rows", look)
            .read("visible_before", visible)
            .read("intervals", &self.intervals)
            .write("distances", &mut self.scratch)
            .push(&OccupancyParams { count: count as u32, most: FARTHEST })
            .dispatch_over(count as u32);
        let [x, y, z] = self.grid.bricks;
        let (mut from, mut to) = (&mut self.scratch, &mut self.distances);
        for axis in 0..3 {
            recorder
                .pass(&self.spread)
                .read("before", from)
                .write("after", to)
                .push(&SpreadParams { grid: self.grid, axis })
                .dispatch_over_3d([x, y, z]);
            std::mem::swap(&mut from, &mut to);
        }
    }
}
