//! Binning of splats into the tiles and blocks of planes that they reach: projection, pairs sorted by (view,
//! tile, block), and the first pair of each.

use shaders_glsl as glsl;
pub use shaders_glsl::tiles::TILE;
use shaders_glsl::types::{EmitParams, HiddenParams, ProjectParams, Projected, TileGrid};

use super::pair_lists::{PairLists, key_bits};
use super::{SplatRows, Views, Work};
use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Kernel, Recorder};
use splat;

/// Greatest number of rows of projected splats: a pair keeps the rest of its bits for the parts of a tile.
const MOST_ROWS: usize = 1 << glsl::tiles::ROW_BITS;

/// Sorts the splats of all views into tiles and blocks.
pub struct TileBinner {
    gpu: Gpu,
    /// Kernel that marks parts of tiles hidden by the lens; `None` without visibility masks.
    hidden: Option<Kernel>,
    project: Kernel,
    emit: Kernel,
    pairs: PairLists,
    /// Splats as each view sees them, [view][index among the active ones].
    pub projected: Buffer<Projected>,
    boxes: Buffer<[u32; 4]>,
    needed: Buffer<u32>,
    /// Parts of each tile that are hidden by the lens, a bit each, by view and tile; a single word without
    /// visibility masks.
    pub hidden_parts: Buffer<u32>,
    /// Number of (view, tile, block) lists of the grid that was recorded last.
    lists: usize,
    /// Number of rows of projected splats that were recorded last.
    rows: usize,
    views: u32,
    splat_count: usize,
}

impl TileBinner {
    /// Creates a binner of `splat_count` splats, packed or not, in `views` views of a grid or of grids with
    /// fewer tiles, blocks and splats. With `hidden`, views come with visibility masks, and what the lens
    /// hides gets no pairs.
    pub fn new(
        gpu: &Gpu,
        kernel: splat::Kernel,
        packed: bool,
        grid: &TileGrid,
        views: u32,
        splat_count: usize,
        hidden: bool,
    ) -> Result<Self> {
        let rows = splat_count * views as usize;
        if rows > MOST_ROWS {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-RENDER-010",
                format!("{splat_count} splats in {views} views; there can be {MOST_ROWS} rows in all"),
            )
            .help("render fewer splats, or one view at a time"));
        }
        let lists = lists(grid, views);
        let tiles = if hidden { views * grid.tiles[0] * grid.tiles[1] } else { 1 };
        let flag = u32::from(hidden);
        Ok(TileBinner {
            gpu: gpu.clone(),
            hidden: hidden.then(|| Kernel::new(gpu, &glsl::HIDDEN_PARTS, &[])).transpose()?,
            project: Kernel::new(gpu, &glsl::PROJECT_SPLATS, &[kernel.id(), u32::from(packed), flag])?,
            emit: Kernel::new(gpu, &glsl::EMIT_TILE_PAIRS, &[kernel.id(), flag])?,
            pairs: PairLists::new(gpu, rows, lists)?,
            projected: gpu.buffer("projected splats", "views", rows)?,
            boxes: gpu.buffer("boxes of tiles", "views", rows)?,
            needed: gpu.readback("pairs needed", 1)?,
            hidden_parts: gpu.buffer("hidden parts of tiles", "sorting", tiles as usize)?,
            lists,
            rows: 0,
            views,
            splat_count,
        })
    }

    /// Returns the number of pairs that fit the buffers.
    pub fn capacity(&self) -> usize {
        self.pairs.capacity()
    }

    /// Returns the number of pairs that the last finished frame needed.
    pub fn needed(&self) -> Result<usize> {
        Ok(self.needed.mapped()?[0] as usize)
    }

    /// Grows the buffers to at least `pairs` pairs, with a margin. Nothing may be in flight.
    pub fn grow(&mut self, pairs: usize) -> Result<()> {
        let most = self.pairs.most(self.gpu.limits().storage_range as usize / size_of::<u32>());
        if pairs > most {
            return Err(Error::new(
                Kind::Temporary,
                "VGS-RENDER-011",
                format!(
                    "{pairs} pairs of a splat and a tile are needed at once; this device binds at most {most}"
                ),
            )
            .help("render a smaller picture, fewer splats, or with a greater --step"));
        }
        self.pairs.make_room((pairs + pairs / 4).min(most))
    }

    /// Records the projection and sorting of the active splats.
    ///
    /// # Panics
    /// If the grid has more tiles and blocks, or splats, than this was created for.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        grid: &TileGrid,
        background: f32,
        views: &Views,
        all: &SplatRows,
        (active, count): (&Buffer<u32>, &Buffer<u32>),
    ) {
        self.lists = lists(grid, self.views);
        let starts = &self.pairs.starts;
        assert!(self.lists < starts.len(), "{}: {} lists", starts.name(), self.lists);
        let splats = grid.splat_count as usize;
        assert!(splats <= self.splat_count, "{}: {splats} splats", self.projected.name());
        let rows = splats * self.views as usize;
        self.rows = rows;
        let invocations = [splats as u32, self.views, 1];
        if let Some(hidden) = &self.hidden {
            let tiles = grid.tiles[0] * grid.tiles[1];
            recorder
                .pass(hidden)
                .read("patches", &views.patches)
                .write("hidden_parts", &mut self.hidden_parts)
                .push(&HiddenParams { size: grid.size, tiles: grid.tiles })
                .dispatch_over_3d([tiles, self.views, 1]);
        }
        recorder
            .pass(&self.project)
            .read("views", &views.rows)
            .read("rows", &all.rows)
            .read("chunks", &all.chunks)
            .read("active_splats", active)
            .read("active_count", count)
            .write("projected", &mut self.projected)
            .write("boxes", &mut self.boxes)
            .write("pair_counts", &mut self.pairs.counts)
            .read("hidden_parts", &self.hidden_parts)
            .push(&ProjectParams { grid: *grid, range: all.range, background })
            .dispatch_over_3d(invocations);
        self.pairs.sum(recorder, rows, &mut self.needed, 0);
        let (pair_offsets, keys, values) = self.pairs.input();
        recorder
            .pass(&self.emit)
            .read("views", &views.rows)
            .read("projected", &self.projected)
            .read("boxes", &self.boxes)
            .read("pair_offsets", pair_offsets)
            .write("keys", keys)
            .write("values", values)
            .read("hidden_parts", &self.hidden_parts)
            .push(&EmitParams { grid: *grid })
            .dispatch_over_3d(invocations);
        self.pairs.sort(recorder, rows, key_bits(self.lists), self.lists as u32);
    }

    /// Returns the work of the last frame, except the number of splats that were listed for it. Waits for the
    /// device.
    pub fn work(&self) -> Result<Work> {
        let area = |[left, top, right, bottom]: &[u32; 4]| u64::from(right - left) * u64::from(bottom - top);
        Ok(Work {
            rows: self.rows as u64,
            tiles: self.boxes.read()?[..self.rows].iter().map(area).sum(),
            sorted: self.needed()? as u64,
            lists: self.lists as u64,
            ..self.pairs.work(key_bits(self.lists))
        })
    }

    /// Returns the first pair of each (view, tile, block), and the total.
    pub fn starts(&self) -> &Buffer<u32> {
        &self.pairs.starts
    }

    /// Returns the value of each sorted pair: row of the projected splat, and parts of the tile in the upper
    /// 8 bits.
    pub fn pairs(&self) -> &Buffer<u32> {
        self.pairs.values(key_bits(self.lists))
    }
}

/// Returns the number of (view, tile, block) lists.
fn lists(grid: &TileGrid, views: u32) -> usize {
    (views * grid.tiles[0] * grid.tiles[1] * grid.blocks) as usize
}
