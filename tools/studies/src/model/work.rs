//! The work of a frame, counted: what is on the device anyway, and what shaders count in a run of their own.

use engine::Result;
use engine::render::{self, Renderer};
use serde::{Deserialize, Serialize};

/// Pixels of a part of a tile.
const PART: [usize; 2] = [4, 8];
/// Pixels along the edge of a tile.
const TILE: usize = 16;
const PART_PIXELS: f64 = (PART[0] * PART[1]) as f64;
const TILE_PIXELS: f64 = (TILE * TILE) as f64;

/// Counts of a frame of all its views.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// Name of the mode.
    pub mode: String,
    /// Pictures.
    pub views: f64,
    /// Pixels of all pictures.
    pub pixels: f64,
    /// Bytes of a pixel that are written.
    pub pixel_bytes: f64,
    /// Whether surfaces are lit.
    pub lit: bool,
    /// Whether the transfer function is integrated from plane to plane.
    pub integrated: bool,
    /// Invocations that own a splat.
    pub rows: f64,
    /// Those of them whose splat the look can show.
    pub shown: f64,
    /// Tiles looked at in the boxes around outlines.
    pub tiles: f64,
    /// What is sorted: pairs in mode slab, splats in mode alpha.
    pub sorted: f64,
    /// Most that could be.
    pub room: f64,
    /// Passes of the sort.
    pub digits: f64,
    /// Entries of the sort's table in each pass.
    pub table: f64,
    /// (View, tile, block)s.
    pub lists: f64,
    /// Splats that are drawn in every view.
    pub quads: f64,
    /// What is done for pixels by groups as wide as a part of a tile.
    pub narrow: Pixels,
    /// By groups as wide as a tile.
    pub wide: Pixels,
    /// Fragments that were rasterized, of triangles around the splats' ellipses or of squares.
    pub fragments: f64,
    /// Those of them that were blended.
    pub blended: f64,
}

/// What mode slab does for pixels. A group in lockstep does for all of its pixels what any of them needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pixels {
    /// Splat × plane × pixel.
    pub evaluations: f64,
    /// Plane × pixel.
    pub classified: f64,
    /// Pairs of a splat and a list that groups looked at.
    pub looked: f64,
}

impl Work {
    /// What mode slab does for pixels, by wide groups or by narrow ones.
    pub fn by(&self, wide: bool) -> &Pixels {
        if wide { &self.wide } else { &self.narrow }
    }

    /// Adds the counts of mode slab of a picture of `width` pixels: in each pixel those of its part
    /// ([`render::Settings::counting`]). A wide group goes on as long as any of its parts, so that for pairs and planes it
    /// has the most of its parts; planes that only other parts have are not counted, which makes that a little too few.
    pub fn add_slab(&mut self, counts: &[[f32; 4]], width: usize) {
        let height = counts.len() / width.max(1);
        for top in (0..height).step_by(TILE) {
            for left in (0..width).step_by(TILE) {
                let mut most = [0f64; 4];
                for y in (top..height.min(top + TILE)).step_by(PART[1]) {
                    for x in (left..width.min(left + TILE)).step_by(PART[0]) {
                        // All pixels of a part have the same.
                        let part = counts[y * width + x].map(f64::from);
                        self.narrow.evaluations += PART_PIXELS * part[0];
                        self.narrow.classified += PART_PIXELS * part[2];
                        self.narrow.looked += part[3];
                        most = std::array::from_fn(|k| most[k].max(part[k]));
                    }
                }
                self.wide.evaluations += TILE_PIXELS * most[1];
                self.wide.classified += TILE_PIXELS * most[2];
                self.wide.looked += most[3];
            }
        }
    }

    /// Adds the counts of mode alpha of a picture: in each pixel its fragments, and those that were blended.
    pub fn add_alpha(&mut self, counts: &[[f32; 4]]) {
        self.fragments += counts.iter().map(|c| f64::from(c[0])).sum::<f64>();
        self.blended += counts.iter().map(|c| f64::from(c[1])).sum::<f64>();
    }

    /// Adds what `renderer`'s last frame was made of.
    pub fn add_lists(&mut self, of: render::Work) {
        let render::Work { rows, shown, tiles, sorted, room, digits, table, lists, quads } = of;
        let counts = [rows, shown, tiles, sorted, room, digits, table, lists, quads];
        let [rows, shown, tiles, sorted, room, digits, table, lists, quads] = counts.map(|n| n as f64);
        self.rows += rows;
        self.shown += shown;
        self.tiles += tiles;
        self.sorted += sorted;
        (self.room, self.digits, self.table) = (room, digits, table);
        self.lists += lists;
        self.quads += quads;
    }

    /// Adds what the pixels of a counting renderer's last frame say, which lies in the upper left `size` of its pictures.
    pub fn add_pixels(&mut self, counting: &Renderer, size: [u32; 2]) -> Result<()> {
        let [width, height] = size.map(|n| n as usize);
        let stride = counting.target.size()[0] as usize;
        for view in 0..counting.target.views() {
            let whole = counting.target.read_colour(view)?;
            let rows = whole.chunks(stride).take(height);
            let part: Vec<[f32; 4]> = rows.flat_map(|row| &row[..width]).copied().collect();
            if self.mode == "alpha" { self.add_alpha(&part) } else { self.add_slab(&part, width) }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_group_does_what_its_most_needy_part_needs() {
        // 20 × 17 pixels: four tiles, of which three are cut by the edges.
        let [width, height] = [20, 17];
        let mut counts = vec![[0f32; 4]; width * height];
        // Two parts of the first tile, and the one part of the second that is in the picture.
        let mut fill = |left: usize, top: usize, value: [f32; 4]| {
            for y in top..height.min(top + PART[1]) {
                for x in left..width.min(left + PART[0]) {
                    counts[y * width + x] = value;
                }
            }
        };
        fill(0, 0, [3.0, 10.0, 2.0, 5.0]);
        fill(4, 8, [4.0, 12.0, 1.0, 6.0]);
        fill(16, 0, [1.0, 7.0, 1.0, 2.0]);
        let mut work = Work::default();
        work.add_slab(&counts, width);
        assert_eq!(work.narrow, Pixels { evaluations: 8.0 * 32.0, classified: 4.0 * 32.0, looked: 13.0 });
        assert_eq!(work.wide, Pixels { evaluations: 19.0 * 256.0, classified: 3.0 * 256.0, looked: 8.0 });
        assert_eq!((work.by(true), work.by(false)), (&work.wide, &work.narrow));
        work.add_alpha(&[[3.0, 2.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]);
        assert_eq!((work.fragments, work.blended), (4.0, 2.0));
    }
}
