//! What a frame consists of: stages, the passes of each, and the terms that its time goes by.
//!
//! A term has what one unit of it takes, for devices that are known by their data sheet alone: operations, bytes of
//! memory, and fragments. Operations are counted in the kernels' SPIR-V ([`Operations`]); bytes are those of the rows of
//! the kernels' buffers, each counted once where a tile's work shares it. Where a stage has a term and the same term
//! "lit" or "integrated", the second is what comes on top.

use std::sync::LazyLock;

use shaders_glsl::radix::RADIX_BLOCK;
use shaders_glsl::scan::SCAN_BLOCK;
use shaders_glsl::slab;
use shaders_glsl::tiles::{PLANES, TILE};
use shaders_glsl::{
    ALPHA_FRAG, ALPHA_VERT, BRICK_RANGES, EMIT_TILE_PAIRS, PROJECT_QUADS, PROJECT_SPLATS, RADIX_COUNT,
    RADIX_SCATTER, RAYMARCH, Resource, SCAN_APPLY, SCAN_SUMS, SLAB, Shader,
};

use super::operations::Operations;
use super::work::Work;

/// Pixels over which the loops of `slab` go in its source; a wide group leaves all but the first out.
const PIXELS: f64 = slab::MOST_PIXELS as f64;
/// Invocations of a wide group.
const LANES: f64 = 64.0;
/// Invocations of the wide groups of a tile.
const TILE_LANES: f64 = (TILE * TILE) as f64;
/// The area of a square around a circle over that of a triangle around it.
const SQUARE: f64 = 4.0 / 5.196_152_4;

/// Something that is done many times.
pub struct Term {
    /// What one is.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests find a term by it"))]
    pub name: &'static str,
    /// How many there are in a frame, on a device of wide groups or of narrow ones.
    pub of: fn(&Work, bool) -> f64,
    /// Operations of one.
    pub ops: f64,
    /// Bytes of memory of one.
    pub bytes: f64,
    /// Fragments that the rasterizer fills for one.
    pub fills: f64,
    /// Trilinear samples of an image for one.
    pub samples: f64,
}

/// Creates a term that fills no fragments.
fn term(name: &'static str, of: fn(&Work, bool) -> f64, ops: f64, bytes: f64) -> Term {
    Term { name, of, ops, bytes, fills: 0.0, samples: 0.0 }
}

/// Creates a term that samples an image.
fn sampled(name: &'static str, of: fn(&Work, bool) -> f64, ops: f64, samples: f64) -> Term {
    Term { samples, ..term(name, of, ops, 0.0) }
}

/// Returns the bytes of a row of each of these buffers of a shader together.
fn bytes(shader: &Shader, buffers: &[&str]) -> f64 {
    let stride = |name: &&str| {
        let binding = shader.bindings.iter().find(|binding| binding.name == *name);
        match binding.map(|binding| binding.resource) {
            Some(Resource::Buffer { stride }) => stride as f64,
            other => panic!("{}: {name} is {other:?}, not a buffer", shader.name),
        }
    };
    buffers.iter().map(stride).sum()
}

/// Passes whose time is told together.
pub struct Stage {
    /// What it does.
    pub name: &'static str,
    /// Modes that have it.
    pub modes: &'static [&'static str],
    /// Its passes, as the profile names them.
    #[cfg_attr(not(test), expect(dead_code, reason = "a test finds that none is forgotten"))]
    pub passes: &'static [&'static str],
    /// Dispatches and draws.
    pub dispatches: fn(&Work) -> f64,
    /// What its time goes by, besides the dispatches.
    pub terms: Vec<Term>,
}

impl Stage {
    /// Returns true if a frame has it.
    pub fn is_in(&self, work: &Work) -> bool {
        self.modes.contains(&work.mode.as_str())
    }
}

/// Returns the count where the condition holds, else 0.
fn only(condition: bool, count: f64) -> f64 {
    if condition { count } else { 0.0 }
}

/// The stages of modes slab, alpha and decoded, in their order.
pub static STAGES: LazyLock<[Stage; 9]> =
    LazyLock::new(|| [project(), emit(), scan(), sort(), ranges(), classify(), quads(), draw(), march()]);

fn project() -> Stage {
    let ops = Operations::of(&PROJECT_SPLATS, &[], &["tile_parts"]);
    // Active list, splat in three rows, and the projected one.
    let splat = bytes(&PROJECT_SPLATS, &["active_splats", "rows", "rows", "rows", "projected"]);
    Stage {
        name: "project",
        modes: &["slab"],
        passes: &["project_splats"],
        dispatches: |_| 1.0,
        terms: vec![
            // Of a splat that is not seen only the empty box and the count are written.
            term("row", |w, _| w.rows, 0.0, bytes(&PROJECT_SPLATS, &["boxes", "pair_counts"])),
            term("splat", |w, _| w.shown, ops.at("main"), splat),
            term("tile", |w, _| w.tiles, ops.at("main/ty/tx") + ops.at("tile_parts"), 0.0),
        ],
    }
}

fn emit() -> Stage {
    let ops = Operations::of(&EMIT_TILE_PAIRS, &[], &["tile_parts"]);
    let of = |buffers: &[&str]| bytes(&EMIT_TILE_PAIRS, buffers);
    Stage {
        name: "emit",
        modes: &["slab"],
        passes: &["emit_tile_pairs"],
        dispatches: |_| 1.0,
        terms: vec![
            term("row", |w, _| w.rows, 0.0, of(&["pair_offsets"])),
            term("splat", |w, _| w.shown, ops.at("main"), of(&["projected", "boxes"])),
            term("tile", |w, _| w.tiles, ops.at("main/ty/tx") + ops.at("tile_parts"), 0.0),
            term("pair", |w, _| w.sorted, ops.at("main/ty/tx/block"), of(&["keys", "values"])),
        ],
    }
}

fn scan() -> Stage {
    let [sums, apply] = [&SCAN_SUMS, &SCAN_APPLY].map(|shader| Operations::of(shader, &[], &[]));
    let run = f64::from(SCAN_BLOCK) / f64::from(SCAN_SUMS.width());
    // Halvings of the sums of a workgroup, and the mean number of runs of sixteen sums that an invocation joins.
    let halvings = f64::from(SCAN_SUMS.width().ilog2());
    let joined = (f64::from(SCAN_APPLY.width()) / 16.0 - 1.0) / 2.0;
    let invocation = sums.at("main")
        + halvings * sums.at("main/half_size")
        + apply.at("main")
        + joined * apply.at("main/r");
    // The run of an invocation, and in one of sixteen of the second kernel as many sums.
    let element = sums.at("main/i") + apply.at("main/i") + invocation / run;
    let moved = bytes(&SCAN_SUMS, &["values"]) + bytes(&SCAN_APPLY, &["values", "offsets"]);
    Stage {
        name: "scan",
        modes: &["slab", "alpha"],
        passes: &["scan_sums", "scan_offsets", "scan_apply"],
        dispatches: |w| 3.0 * (w.digits + only(w.mode == "slab", 1.0)),
        terms: vec![term(
            "element",
            |w, _| w.table * w.digits + only(w.mode == "slab", w.rows),
            element,
            moved,
        )],
    }
}

fn sort() -> Stage {
    let [count, scatter] = [&RADIX_COUNT, &RADIX_SCATTER].map(|shader| Operations::of(shader, &[], &[]));
    // A share of what an invocation does once for its keys.
    let keys = f64::from(RADIX_BLOCK) / f64::from(RADIX_SCATTER.width());
    let once = (count.at("main") + scatter.at("main")) / keys;
    let moved = bytes(&RADIX_COUNT, &["keys"])
        + bytes(&RADIX_SCATTER, &["keys", "values", "sorted_keys", "sorted_values"]);
    let table = bytes(&RADIX_COUNT, &["table"]) + bytes(&RADIX_SCATTER, &["offsets"]);
    Stage {
        name: "sort",
        modes: &["slab", "alpha"],
        passes: &["radix_count", "radix_scatter"],
        dispatches: |w| 2.0 * w.digits,
        terms: vec![
            term("key", |w, _| w.sorted * w.digits, count.at("main/i") + scatter.at("main/i") + once, moved),
            term("place of the table", |w, _| w.table * w.digits, 0.0, table),
            // What a block takes that is not full, and so no share of its keys.
            term("block", |w, _| (w.sorted / f64::from(RADIX_BLOCK)).ceil() * w.digits, 0.0, 0.0),
        ],
    }
}

fn ranges() -> Stage {
    let ops = Operations::of(&BRICK_RANGES, &[], &[]);
    Stage {
        name: "ranges",
        modes: &["slab"],
        passes: &["brick_ranges"],
        dispatches: |_| 1.0,
        terms: vec![
            // An invocation for every pair that there is room for; most of them end at once.
            term("room", |w, _| w.room, 0.0, 0.0),
            term("pair", |w, _| w.sorted, ops.at("main"), bytes(&BRICK_RANGES, &["keys"])),
            term("list", |w, _| w.lists, ops.at("main/s"), bytes(&BRICK_RANGES, &["starts"])),
        ],
    }
}

fn classify() -> Stage {
    let [plain, lit, integrated] =
        [&[][..], &[("SHADED", 1)], &[("SEGMENTS", 1)]].map(|c| Operations::of(&SLAB, c, &["add"]));
    // Of the planes of a round and the pixels of an invocation.
    let planes = f64::from(PLANES) * PIXELS;
    let of_plane = |ops: &Operations| ops.at("main/block/round") / planes;
    // One call has half of the planes.
    let of_call = |ops: &Operations| ops.at("add") / (planes / 2.0);
    Stage {
        name: "slab",
        modes: &["slab"],
        passes: &["slab"],
        dispatches: |_| 1.0,
        terms: vec![
            term("evaluation", |w, wide| w.by(wide).evaluations, of_call(&plain), 0.0),
            // Gradients of Σw and Σwc.
            term(
                "evaluation, lit",
                |w, wide| only(w.lit, w.by(wide).evaluations),
                of_call(&lit) - of_call(&plain),
                0.0,
            ),
            term(
                "pair",
                |w, wide| w.by(wide).looked,
                LANES * plain.at("main/block/round/i"),
                bytes(&SLAB, &["pairs", "projected"]),
            ),
            term("plane", |w, wide| w.by(wide).classified, of_plane(&plain), 0.0),
            term(
                "plane, integrated",
                |w, wide| only(w.integrated, w.by(wide).classified),
                of_plane(&integrated) - of_plane(&plain),
                0.0,
            ),
            term(
                "plane, lit",
                |w, wide| only(w.lit, w.by(wide).classified),
                of_plane(&lit) - of_plane(&plain),
                0.0,
            ),
            term("list", |w, _| w.lists, TILE_LANES * plain.at("main/block"), bytes(&SLAB, &["starts"])),
            term("pixel", |w, _| w.pixels, plain.at("main") / PIXELS, 0.0),
            term("byte of a pixel", |w, _| w.pixels * w.pixel_bytes, 0.0, 1.0),
        ],
    }
}

fn quads() -> Stage {
    let [plain, lit] = [&[][..], &[("SHADED", 1)]].map(|c| Operations::of(&PROJECT_QUADS, c, &["quad_of"]));
    // Active list, splat in three rows, what it draws; key and value.
    let splat = ["active_splats", "rows", "rows", "rows", "media", "keys", "values"];
    Stage {
        name: "quads",
        modes: &["alpha"],
        passes: &["project_quads"],
        dispatches: |_| 1.0,
        terms: vec![
            term("row", |w, _| w.rows, 0.0, 0.0),
            term("splat", |w, _| w.shown, plain.at("main"), bytes(&PROJECT_QUADS, &splat)),
            term(
                "view of a splat",
                |w, _| w.shown * w.views,
                plain.at("main/view") + plain.at("quad_of"),
                bytes(&PROJECT_QUADS, &["quads"]),
            ),
            term(
                "view of a splat, lit",
                |w, _| only(w.lit, w.shown * w.views),
                lit.at("quad_of") - plain.at("quad_of"),
                bytes(&PROJECT_QUADS, &["centres"]),
            ),
        ],
    }
}

fn draw() -> Stage {
    let [corner, fragment] =
        [&ALPHA_VERT, &ALPHA_FRAG].map(|shader| Operations::of(shader, &[], &[]).at("main"));
    // A tiler works on all corners twice, once to see which tiles they are in.
    let quad = 2.0 * bytes(&ALPHA_VERT, &["quads", "order"]);
    Stage {
        name: "draw",
        modes: &["alpha"],
        passes: &["alpha"],
        dispatches: |_| 1.0,
        terms: vec![
            term("quad", |w, _| w.quads * w.views, 2.0 * 6.0 * corner, quad),
            // A wide device draws squares.
            Term {
                name: "fragment",
                of: |w, wide| w.fragments * if wide { SQUARE } else { 1.0 },
                ops: fragment,
                bytes: 0.0,
                fills: 1.0,
                samples: 0.0,
            },
            // On a tiler it happens beside the shaders, in memory of the chip.
            term("fragment, blended", |w, _| w.blended, 0.0, 0.0),
            // Cleared, fetched and stored.
            term("byte of a pixel", |w, _| w.pixels * w.pixel_bytes, 0.0, 3.0),
        ],
    }
}

fn march() -> Stage {
    // The field comes from an atlas; places and light are counted apart, since not every round has them.
    let of = |constants: &[(&str, u32)]| {
        let constants = [&[("ATLAS", 1), ("MASKED", 1), ("KEPT", 1)], constants].concat();
        Operations::of(&RAYMARCH, &constants, &["field_at", "slopes_at", "look_lit"])
    };
    let [plain, lit, integrated] = [&[][..], &[("SHADED", 1)], &[("SEGMENTS", 1)]].map(of);
    let round = plain.at("main/k");
    Stage {
        name: "march",
        modes: &["decoded"],
        passes: &["raymarch"],
        dispatches: |_| 1.0,
        terms: vec![
            term("pixel", |w, _| w.pixels, plain.at("main"), 0.0),
            // A leap counts as much as a cell, which is a little too much.
            term("round", |w, wide| w.by(wide).rounds, round, 0.0),
            term(
                "round, integrated",
                |w, wide| only(w.integrated, w.by(wide).rounds),
                integrated.at("main/k") - round,
                0.0,
            ),
            sampled("sample", |w, wide| w.by(wide).samples, plain.at("field_at"), 1.0),
            term(
                "sample, lit",
                |w, wide| only(w.lit, w.by(wide).samples),
                lit.at("main/k") - round + lit.at("look_lit"),
                0.0,
            ),
            sampled("gradient", |w, wide| w.by(wide).gradients, lit.at("slopes_at"), 1.0),
            // Rays of one picture share what they read; two eyes may not.
            term("byte of the atlas", |w, _| w.image_bytes * w.views, 0.0, 1.0),
            term("byte of a pixel", |w, _| w.pixels * w.pixel_bytes, 0.0, 1.0),
        ],
    }
}

/// What a frame's work takes of a device, stage by stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Operations.
    pub ops: f64,
    /// Bytes of memory.
    pub bytes: f64,
    /// Fragments that are filled.
    pub fills: f64,
    /// Trilinear samples of images.
    pub samples: f64,
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
                samples: sum.samples + count * term.samples,
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
        let narrow = Pixels { evaluations: 100.0, classified: 10.0, looked: 5.0, ..Pixels::default() };
        let wide = Pixels { evaluations: 400.0, classified: 20.0, looked: 3.0, ..Pixels::default() };
        let work =
            Work { mode: "slab".into(), pixels: 50.0, pixel_bytes: 8.0, narrow, wide, ..Work::default() };
        let slab = STAGES.iter().find(|s| s.name == "slab").expect("a stage");
        let ops = |name: &str| slab.terms.iter().find(|t| t.name == name).expect("a term").ops;
        let [evaluation, plane, pair, pixel] = ["evaluation", "plane", "pair", "pixel"].map(ops);
        let plain = Demand::of(slab, &work, false);
        assert_eq!(plain.ops, 100.0 * evaluation + 10.0 * plane + 5.0 * pair + 50.0 * pixel);
        assert_eq!((plain.bytes, plain.dispatches), (5.0 * 52.0 + 50.0 * 8.0, 1.0));
        let lit = Demand::of(slab, &Work { lit: true, ..work.clone() }, true);
        let [more, more_of_plane] = ["evaluation, lit", "plane, lit"].map(ops);
        let expected =
            400.0 * (evaluation + more) + 20.0 * (plane + more_of_plane) + 3.0 * pair + 50.0 * pixel;
        assert_eq!(lit.ops, expected);
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
    fn terms_take_what_the_kernels_have() {
        let term = |stage: &str, name: &str| {
            let stage = STAGES.iter().find(|s| s.name == stage).expect("a stage");
            let term = stage.terms.iter().find(|t| t.name == name).expect("a term");
            (term.ops, term.bytes)
        };
        for (stage, name, ops, bytes) in [
            // By hand 19.5: see the test of `operations`; rows of 48 bytes for a splat before and after.
            ("slab", "evaluation", 15.0..27.0, 0.0),
            ("slab", "pair", 500.0..1500.0, 52.0),
            ("project", "splat", 400.0..900.0, 100.0),
            ("emit", "pair", 4.0..12.0, 8.0),
            ("scan", "element", 6.0..30.0, 12.0),
            ("sort", "key", 20.0..60.0, 20.0),
            ("quads", "view of a splat", 250.0..500.0, 44.0),
            ("draw", "quad", 150.0..400.0, 96.0),
            ("draw", "fragment", 15.0..30.0, 0.0),
            ("march", "sample", 40.0..120.0, 0.0),
            ("march", "gradient", 20.0..120.0, 0.0),
        ] {
            let found = term(stage, name);
            assert!(ops.contains(&found.0) && found.1 == bytes, "{stage}, {name}: {found:?}");
        }
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
