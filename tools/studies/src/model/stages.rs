//! What a frame consists of: stages, the passes of each, and the terms that its time goes by.
//!
//! A term has what one unit of it takes, for devices that are known by their data sheet alone: operations, bytes of memory,
//! and fragments. **Operations** are counted by hand from the kernels' sources: an addition, multiplication, comparison or
//! conversion of floats or integers is 1, so that a fused multiply-add is 2, as in the makers' figures; a division, a
//! root, an exponential or a logarithm is 8, the time of four fused multiply-adds, at which GPUs' units for these run.
//! **Bytes** are those of the buffers' rows, each counted once where a tile's work shares it. Where a line names two
//! figures, the second is what comes on top.

use super::work::Work;

/// Sorted by one workgroup.
const SORT_BLOCK: f64 = 2048.0;
/// A square around a circle, of a triangle around it: their areas.
const SQUARE: f64 = 4.0 / 5.196_152_4;

/// Something that is done many times.
pub struct Term {
    /// What one is.
    pub name: &'static str,
    /// How many there are in a frame, on a device of wide groups or of narrow ones.
    pub of: fn(&Work, bool) -> f64,
    /// Operations of one.
    pub ops: f64,
    /// Bytes of memory of one.
    pub bytes: f64,
    /// Fragments that the rasterizer fills for one.
    pub fills: f64,
}

const fn term(name: &'static str, of: fn(&Work, bool) -> f64, ops: f64, bytes: f64) -> Term {
    Term { name, of, ops, bytes, fills: 0.0 }
}

/// Passes whose time is told together.
pub struct Stage {
    /// What it does.
    pub name: &'static str,
    /// Modes that have it.
    pub modes: &'static [&'static str],
    /// Its passes, as the profile names them.
    pub passes: &'static [&'static str],
    /// Dispatches and draws.
    pub dispatches: fn(&Work) -> f64,
    /// What its time goes by, besides the dispatches.
    pub terms: &'static [Term],
}

impl Stage {
    /// Whether a frame has it.
    pub fn is_in(&self, work: &Work) -> bool {
        self.modes.contains(&work.mode.as_str())
    }
}

fn only(condition: bool, count: f64) -> f64 {
    if condition { count } else { 0.0 }
}

/// The stages of modes slab and alpha, in their order.
pub static STAGES: [Stage; 8] = [
    Stage {
        name: "project",
        modes: &["slab"],
        passes: &["project_splats"],
        dispatches: |_| 1.0,
        terms: &[
            // Box and count of a row that nothing is seen of: 20 bytes.
            term("row", |w, _| w.rows, 10.0, 20.0),
            // Reads index and splat, 4 + 48 bytes, and writes the projected one, 48. Rotation 30, axes turned 60, scales and
            // their inverses 48, whitening and QR 130, bounds of the outline 110, tiles and blocks 80, amplitude 22.
            term("splat", |w, _| w.shown, 480.0, 100.0),
            // `tile_parts`: two rows of four parts, 125 each, and 20.
            term("tile", |w, _| w.tiles, 270.0, 0.0),
        ],
    },
    Stage {
        name: "emit",
        modes: &["slab"],
        passes: &["emit_tile_pairs"],
        dispatches: |_| 1.0,
        terms: &[
            term("row", |w, _| w.rows, 4.0, 8.0),
            // Projected splat and box.
            term("splat", |w, _| w.shown, 40.0, 64.0),
            term("tile", |w, _| w.tiles, 270.0, 0.0),
            // Key and value.
            term("pair", |w, _| w.sorted, 8.0, 8.0),
        ],
    },
    Stage {
        name: "scan",
        modes: &["slab", "alpha"],
        passes: &["scan_sums", "scan_offsets", "scan_apply"],
        dispatches: |w| 3.0 * (w.digits + only(w.mode == "slab", 1.0)),
        // Read twice and written once.
        terms: &[term("element", |w, _| w.table * w.digits + only(w.mode == "slab", w.rows), 6.0, 12.0)],
    },
    Stage {
        name: "sort",
        modes: &["slab", "alpha"],
        passes: &["radix_count", "radix_scatter"],
        dispatches: |w| 2.0 * w.digits,
        terms: &[
            // The key once to count, key and value read and written to move; of its block's places, 64 × 64 of three
            // operations and as many clears, a share.
            term("key", |w, _| w.sorted * w.digits, 26.0, 20.0),
            // Written by one kernel and read by the other.
            term("place of the table", |w, _| w.table * w.digits, 2.0, 8.0),
            // What a block takes that is not full, and so no share of its keys.
            term("block", |w, _| (w.sorted / SORT_BLOCK).ceil() * w.digits, 0.0, 0.0),
        ],
    },
    Stage {
        name: "ranges",
        modes: &["slab"],
        passes: &["brick_ranges"],
        dispatches: |_| 1.0,
        terms: &[
            term("room", |w, _| w.room, 3.0, 0.0),
            term("pair", |w, _| w.sorted, 4.0, 4.0),
            term("list", |w, _| w.lists, 2.0, 4.0),
        ],
    },
    Stage {
        name: "slab",
        modes: &["slab"],
        passes: &["slab"],
        dispatches: |_| 1.0,
        terms: &[
            // `add`: 13 for each plane and pixel; 14 for each plane, shared by four pixels; 12 for each pixel, shared by four planes.
            term("evaluation", |w, wide| w.by(wide).evaluations, 19.0, 0.0),
            // Gradients of Σw and Σwc.
            term("evaluation, lit", |w, wide| only(w.lit, w.by(wide).evaluations), 28.0, 0.0),
            // Value, and on a wide device the projected splat, which all parts share; tests and loads of 64 invocations, 15 each.
            term("pair", |w, wide| w.by(wide).looked, 960.0, 52.0),
            // Two divisions, a look-up, three exponentials or logarithms, and adding up.
            term("plane", |w, wide| w.by(wide).classified, 85.0, 0.0),
            // Four rows of the table of integrals, three weights and a division.
            term("plane, integrated", |w, wide| only(w.integrated, w.by(wide).classified), 110.0, 0.0),
            // Two normalisations, a power, and the gradient of O (V − v₀).
            term("plane, lit", |w, wide| only(w.lit, w.by(wide).classified), 110.0, 0.0),
            // Looked at for the end of each, by the parts of a tile.
            term("list", |w, _| w.lists, 640.0, 4.0),
            // The ray, and what is written.
            term("pixel", |w, _| w.pixels, 100.0, 0.0),
            term("byte of a pixel", |w, _| w.pixels * w.pixel_bytes, 0.0, 1.0),
        ],
    },
    Stage {
        name: "quads",
        modes: &["alpha"],
        passes: &["project_quads"],
        dispatches: |_| 1.0,
        terms: &[
            term("row", |w, _| w.rows, 4.0, 0.0),
            // Index, splat and centre, 4 + 48 + 36 bytes, key and value; the segment of the transfer function.
            term("splat", |w, _| w.shown, 190.0, 96.0),
            // Written. Rotation and axes 90, whitening and QR 130, scales 24, the ellipse on the picture 60.
            term("view of a splat", |w, _| w.shown * w.views, 304.0, 44.0),
            term("view of a splat, lit", |w, _| only(w.lit, w.shown * w.views), 130.0, 0.0),
        ],
    },
    Stage {
        name: "draw",
        modes: &["alpha"],
        passes: &["alpha"],
        dispatches: |_| 1.0,
        terms: &[
            // Six corners of 25, which a tiler does twice, once to see which tiles they are in; likewise the row and its index.
            term("quad", |w, _| w.quads * w.views, 300.0, 96.0),
            // A circle's equation, an exponential, a colour. A wide device draws squares.
            Term {
                name: "fragment",
                of: |w, wide| w.fragments * if wide { SQUARE } else { 1.0 },
                ops: 26.0,
                bytes: 0.0,
                fills: 1.0,
            },
            // On a tiler it happens beside the shaders, in memory of the chip.
            term("fragment, blended", |w, _| w.blended, 0.0, 0.0),
            // Cleared, fetched and stored.
            term("byte of a pixel", |w, _| w.pixels * w.pixel_bytes, 0.0, 3.0),
        ],
    },
];

/// What a frame's work takes of a device, stage by stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Operations.
    pub ops: f64,
    /// Bytes of memory.
    pub bytes: f64,
    /// Fragments that are filled.
    pub fills: f64,
    /// Dispatches and draws.
    pub dispatches: f64,
}

impl Demand {
    /// Of a stage; nothing where the frame does not have it.
    pub fn of(stage: &Stage, work: &Work, wide: bool) -> Self {
        if !stage.is_in(work) {
            return Demand::default();
        }
        let begin = Demand { dispatches: (stage.dispatches)(work), ..Demand::default() };
        stage.terms.iter().fold(begin, |sum, term| {
            let count = (term.of)(work, wide);
            Demand {
                ops: sum.ops + count * term.ops,
                bytes: sum.bytes + count * term.bytes,
                fills: sum.fills + count * term.fills,
                ..sum
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::work::Pixels;

    #[test]
    fn what_a_frame_takes_is_the_sum_of_its_terms() {
        let narrow = Pixels { evaluations: 100.0, classified: 10.0, looked: 5.0 };
        let wide = Pixels { evaluations: 400.0, classified: 20.0, looked: 3.0 };
        let work =
            Work { mode: "slab".into(), pixels: 50.0, pixel_bytes: 8.0, narrow, wide, ..Work::default() };
        let slab = STAGES.iter().find(|s| s.name == "slab").expect("a stage");
        let plain = Demand::of(slab, &work, false);
        assert_eq!(plain.ops, 100.0 * 19.0 + 10.0 * 85.0 + 5.0 * 960.0 + 50.0 * 100.0);
        assert_eq!((plain.bytes, plain.dispatches), (5.0 * 52.0 + 50.0 * 8.0, 1.0));
        let lit = Demand::of(slab, &Work { lit: true, ..work.clone() }, true);
        assert_eq!(lit.ops, 400.0 * 47.0 + 20.0 * 195.0 + 3.0 * 960.0 + 50.0 * 100.0);
        let alpha = Work { mode: "alpha".into(), digits: 3.0, fragments: 60.0, views: 2.0, ..work };
        assert_eq!(Demand::of(slab, &alpha, true), Demand::default());
        let of = |name: &str, wide: bool| {
            Demand::of(STAGES.iter().find(|s| s.name == name).expect("a stage"), &alpha, wide)
        };
        assert_eq!((of("scan", true).dispatches, of("sort", true).dispatches), (9.0, 6.0));
        assert_eq!(of("draw", false).fills, 60.0);
        // Squares around circles are smaller than triangles around them.
        assert!((of("draw", true).fills / 60.0 - 4.0 / 27f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn no_pass_belongs_to_two_stages() {
        let mut passes: Vec<&str> = STAGES.iter().flat_map(|s| s.passes).copied().collect();
        let count = passes.len();
        passes.sort_unstable();
        passes.dedup();
        assert_eq!(passes.len(), count);
    }
}
