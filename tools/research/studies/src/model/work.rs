//! The work of a frame, counted: what is on the device anyway, and what shaders count in a run of their own.

use engine::Result;
use engine::render::{self, Renderer};
use serde::{Deserialize, Serialize};

/// Pixels of a part of a tile.
const PART: [usize; 2] = [4, 8];
const PART_PIXELS: f64 = (PART[0] * PART[1]) as f64;
/// Pixels of a group of rays of eight invocations.
const BLOCK: [usize; 2] = [4, 2];
/// Pixels along the edge of the square of 64 invocations: two parts of a tile, or eight groups of rays.
const SQUARE: usize = 8;
const BLOCK_PIXELS: f64 = (BLOCK[0] * BLOCK[1]) as f64;
const SQUARE_PIXELS: f64 = (SQUARE * SQUARE) as f64;

/// Counts of a frame of all its views.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// Name of the mode.
    pub mode: String,
    /// Number of pictures.
    pub views: f64,
    /// Pixels of all pictures.
    pub pixels: f64,
    /// Bytes of a pixel that are written.
    pub pixel_bytes: f64,
    /// True if surfaces are lit.
    pub lit: bool,
    /// True if the transfer function is integrated from sample to sample.
    pub integrated: bool,
    /// Invocations that own a splat.
    pub rows: f64,
    /// Those of them whose splat the look can show.
    pub shown: f64,
    /// Tiles in the boxes around outlines, each of which is tested.
    pub tiles: f64,
    /// What is sorted: pairs in mode slab, splats in mode alpha.
    pub sorted: f64,
    /// The greatest number that could be sorted.
    pub room: f64,
    /// Passes of the sort.
    pub digits: f64,
    /// Entries of the sort's table in each pass.
    pub table: f64,
    /// Lists, one for each (view, tile, block).
    pub lists: f64,
    /// Splats that are drawn in every view.
    pub quads: f64,
    /// Bytes of the image that rays sample.
    pub image_bytes: f64,
    /// Work on pixels, done by narrow groups: as wide as a part of a tile, or of eight rays.
    pub narrow: Pixels,
    /// The same, done by wide groups: of two parts of a tile, or of 64 rays.
    pub wide: Pixels,
    /// Fragments that were rasterized, of triangles around the splats' ellipses or of squares.
    pub fragments: f64,
    /// Those of them that were blended.
    pub blended: f64,
}

/// Work on pixels. A group in lockstep does for all of its pixels what any of them needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Pixels {
    /// Evaluations of mode slab: splat × plane × pixel.
    pub evaluations: f64,
    /// Classifications of mode slab: plane × pixel.
    pub classified: f64,
    /// Pairs of a splat and a list that groups visited in mode slab.
    pub looked: f64,
    /// Rounds of rays, leaps included: round × pixel.
    pub rounds: f64,
    /// Samples of rays: cell × pixel.
    pub samples: f64,
    /// Gradients that rays sampled, of six places each: cell × pixel.
    pub gradients: f64,
}

impl Work {
    /// Returns the work on pixels, done by wide groups or by narrow ones.
    pub fn by(&self, wide: bool) -> &Pixels {
        if wide { &self.wide } else { &self.narrow }
    }

    /// Adds the counts of mode slab of a picture of `width` pixels, in each pixel those of its part
    /// ([`render::Settings::counting`]). A wide group goes on as long as any of its parts, so that for pairs and
    /// planes it has the most of its two parts; planes that only the other part has are not counted, which makes
    /// that a little too few.
    pub fn add_slab(&mut self, counts: &[[f32; 4]], width: usize) {
        for_groups(counts, width, [SQUARE; 2], PART, |parts| {
            for part in parts {
                self.narrow.evaluations += PART_PIXELS * part[0];
                self.narrow.classified += PART_PIXELS * part[2];
                self.narrow.looked += part[3];
            }
            let most = most(parts);
            self.wide.evaluations += SQUARE_PIXELS * most[1];
            self.wide.classified += SQUARE_PIXELS * most[2];
            self.wide.looked += most[3];
        });
    }

    /// Adds the counts of rays of a picture of `width` pixels, in each pixel those of its group of eight. A wide
    /// group goes on as long as any of its eight groups; rounds that only others of them have are not counted,
    /// which makes that a little too few.
    pub fn add_rays(&mut self, counts: &[[f32; 4]], width: usize) {
        let add = |to: &mut Pixels, pixels: f64, of: &[f64; 4]| {
            to.rounds += pixels * of[0];
            to.samples += pixels * of[1];
            to.gradients += pixels * of[2];
        };
        for_groups(counts, width, [SQUARE; 2], BLOCK, |blocks| {
            blocks.iter().for_each(|block| add(&mut self.narrow, BLOCK_PIXELS, block));
            add(&mut self.wide, SQUARE_PIXELS, &most(blocks));
        });
    }

    /// Adds the counts of mode alpha of a picture: in each pixel its fragments, and those that were blended.
    pub fn add_alpha(&mut self, counts: &[[f32; 4]]) {
        self.fragments += counts.iter().map(|c| f64::from(c[0])).sum::<f64>();
        self.blended += counts.iter().map(|c| f64::from(c[1])).sum::<f64>();
    }

    /// Adds the lists of a renderer's last frame.
    pub fn add_lists(&mut self, of: render::Work) {
        let render::Work { rows, shown, tiles, sorted, room, digits, table, lists, quads, image_bytes } = of;
        let counts = [rows, shown, tiles, sorted, room, digits, table, lists, quads, image_bytes];
        let [rows, shown, tiles, sorted, room, digits, table, lists, quads, image_bytes] =
            counts.map(|n| n as f64);
        self.rows += rows;
        self.shown += shown;
        self.tiles += tiles;
        self.sorted += sorted;
        (self.room, self.digits, self.table) = (room, digits, table);
        self.lists += lists;
        self.quads += quads;
        self.image_bytes = image_bytes;
    }

    /// Adds the counts in the pictures of a counting renderer, whose last frame lies in their upper left
    /// `size`.
    pub fn add_pixels(&mut self, counting: &Renderer, size: [u32; 2]) -> Result<()> {
        let [width, height] = size.map(|n| n as usize);
        let stride = counting.target.size()[0] as usize;
        for view in 0..counting.target.views() {
            let whole = counting.target.read_colour(view)?;
            let rows = whole.chunks(stride).take(height);
            let part: Vec<[f32; 4]> = rows.flat_map(|row| &row[..width]).copied().collect();
            match self.mode.as_str() {
                "alpha" => self.add_alpha(&part),
                "slab" => self.add_slab(&part, width),
                _ => self.add_rays(&part, width),
            }
        }
        Ok(())
    }

    /// Returns true if the frame shows something.
    pub fn shows_something(&self) -> bool {
        self.sorted > 0.0 || self.narrow.samples > 0.0
    }
}

/// Visits the wide groups of a picture of `width` pixels: each with the counts of its narrow groups, all pixels of which
/// have the same.
fn for_groups(
    counts: &[[f32; 4]],
    width: usize,
    wide: [usize; 2],
    narrow: [usize; 2],
    mut visit: impl FnMut(&[[f64; 4]]),
) {
    let height = counts.len() / width.max(1);
    let mut parts = Vec::new();
    for top in (0..height).step_by(wide[1]) {
        for left in (0..width).step_by(wide[0]) {
            parts.clear();
            for y in (top..height.min(top + wide[1])).step_by(narrow[1]) {
                for x in (left..width.min(left + wide[0])).step_by(narrow[0]) {
                    parts.push(counts[y * width + x].map(f64::from));
                }
            }
            visit(&parts);
        }
    }
}

/// Returns the greatest of each count.
fn most(parts: &[[f64; 4]]) -> [f64; 4] {
    parts.iter().fold([0.0; 4], |most, part| std::array::from_fn(|k| f64::max(most[k], part[k])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_group_does_what_its_most_needy_part_needs() {
        // 20 × 17 pixels: nine squares, of which five are cut by the edges.
        let [width, height] = [20, 17];
        let mut counts = vec![[0f32; 4]; width * height];
        // Two parts side by side, and one whose neighbour is not in the picture.
        let mut fill = |left: usize, top: usize, value: [f32; 4]| {
            for y in top..height.min(top + PART[1]) {
                for x in left..width.min(left + PART[0]) {
                    counts[y * width + x] = value;
                }
            }
        };
        fill(0, 0, [3.0, 10.0, 2.0, 5.0]);
        fill(4, 0, [4.0, 12.0, 1.0, 6.0]);
        fill(16, 0, [1.0, 7.0, 1.0, 2.0]);
        let mut work = Work::default();
        work.add_slab(&counts, width);
        let of = |evaluations: f64, classified: f64, looked: f64| Pixels {
            evaluations,
            classified,
            looked,
            ..Pixels::default()
        };
        assert_eq!(work.narrow, of(8.0 * 32.0, 4.0 * 32.0, 13.0));
        assert_eq!(work.wide, of(19.0 * 64.0, 3.0 * 64.0, 8.0));
        assert_eq!((work.by(true), work.by(false)), (&work.wide, &work.narrow));
        work.add_alpha(&[[3.0, 2.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]);
        assert_eq!((work.fragments, work.blended), (4.0, 2.0));
    }

    #[test]
    fn rays_of_a_wide_group_wait_for_its_slowest() {
        // 12 × 8 pixels: a square of eight groups, and half of one.
        let [width, height] = [12, 8];
        let mut counts = vec![[0f32; 4]; width * height];
        for (left, top, value) in
            [(0, 0, [3.0, 2.0, 1.0, 0.0]), (4, 6, [2.0, 2.0, 2.0, 0.0]), (8, 2, [5.0; 4])]
        {
            for y in top..top + BLOCK[1] {
                for x in left..left + BLOCK[0] {
                    counts[y * width + x] = value;
                }
            }
        }
        let mut work = Work { mode: "decoded".into(), ..Work::default() };
        assert!(!work.shows_something());
        work.add_rays(&counts, width);
        let of = |rounds: f64, samples: f64, gradients: f64| Pixels {
            rounds,
            samples,
            gradients,
            ..Pixels::default()
        };
        assert_eq!(work.narrow, of(10.0 * 8.0, 9.0 * 8.0, 8.0 * 8.0));
        assert_eq!(work.wide, of(8.0 * 64.0, 7.0 * 64.0, 7.0 * 64.0));
        assert!(work.shows_something());
    }
}
