//! One forward and backward pass on the device through the pass types, with all its results. This is the only
//! place, besides the fit itself, that knows the order of the passes.

use engine::gpu::{Buffer, Gpu, Recorder};
use engine::passes::loss::{ChunkSamples, DICE, INTENSITIES, LEAK, MSE, OCCUPANCY, Sum, TERMS, Weighted};
use engine::passes::{Gradient, Losses, Rasterizer, Storage};
use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use reference;
use reference::loss::{Numbers, Quantity};
use shaders_glsl::types::{Adjoint, Footprint, Reconstruction, SplatGrad, Target};

use crate::Scene;
use crate::scene::EPSILON;

/// Results of a pass over all chunks.
pub struct Pass {
    /// Footprint of each splat.
    pub footprints: Vec<Footprint>,
    /// W and V̂ of all samples.
    pub reconstructions: Vec<Reconstruction>,
    /// Folded adjoints of all samples.
    pub adjoints: Vec<Adjoint>,
    /// Moments that the backward pass sums for each splat, in the order of
    /// `reference::splat_to_volume_grad::Moments`.
    pub moments: Vec<[f32; 11]>,
    /// dL/d(parameters).
    pub gradients: Vec<SplatGrad>,
    /// Sums of the terms, in the order given.
    pub sums: Vec<Sum>,
    /// Number of chunks into which the grid was cut.
    pub chunks: usize,
}

/// Lower end of the range relative to the background in the tests: the least value of targets and
/// intensities.
pub const LOW: f32 = -0.5;

/// Returns the terms of the paper and of the default fit with weights that make each matter: the Dice loss is
/// one number for all samples, the others are sums.
pub fn terms(soft: bool) -> Vec<Weighted> {
    all_terms(soft).into_iter().filter(|term| [MSE, OCCUPANCY, DICE, LEAK].contains(&term.term)).collect()
}

/// Returns all terms. The slope of a divergence has no bound, so that together they are no measure of
/// rounding.
pub fn all_terms(soft: bool) -> Vec<Weighted> {
    let region = if soft { -1.0 } else { 0.5 };
    let of = |term| {
        let trial = &reference_of(term).trial;
        let end = |all: &[f32], last: bool| *if last { all.last() } else { all.first() }.expect("a number");
        Weighted {
            term,
            weight: trial.weight,
            parameter: end(trial.parameters, soft),
            region,
            low: LOW,
            tolerance: end(trial.tolerances, !soft),
        }
    };
    (0..TERMS.len()).map(of).collect()
}

/// Returns the reference implementation of a row of [`TERMS`].
pub fn reference_of(term: usize) -> &'static reference::loss::Loss {
    terms64(&[Weighted { term, ..Weighted::default() }])[0].loss
}

/// Returns the reference implementations of [`Weighted`] terms.
pub fn terms64(terms: &[Weighted]) -> Vec<reference::Term> {
    let implementation = |t: &Weighted| {
        let quantity = match TERMS[t.term].quantity {
            Some(INTENSITIES) => Quantity::Intensity { low: f64::from(t.low) },
            _ => Quantity::Mask,
        };
        let [weight, parameter, region, tolerance] =
            [t.weight, t.parameter, t.region, t.tolerance].map(f64::from);
        let name = TERMS[t.term].shader.name.trim_start_matches("loss_");
        reference::Term::new(name, Numbers { weight, parameter, region, tolerance, quantity })
    };
    terms.iter().map(implementation).collect()
}

/// Runs a scene in full storage.
pub fn run(gpu: &Gpu, scene: &Scene, terms: &[Weighted]) -> Pass {
    run_stored(gpu, scene, terms, Storage::Full)
}

/// Runs a scene with samples in `storage`.
pub fn run_stored(gpu: &Gpu, scene: &Scene, terms: &[Weighted], storage: Storage) -> Pass {
    run_inputs(gpu, &Inputs::of(scene, false), terms, storage)
}

/// Runs a scene with the losses of only those bricks that a splat reaches.
pub fn run_touched(gpu: &Gpu, scene: &Scene, terms: &[Weighted], storage: Storage) -> Pass {
    run_inputs(gpu, &Inputs::of(scene, true), terms, storage)
}

/// Runs splats against targets in full storage.
pub fn run_with(
    gpu: &Gpu,
    bricks: &Bricks,
    splats: &[Splat],
    targets: &[Target],
    kernel: Kernel,
    offset: [f32; 3],
    terms: &[Weighted],
) -> Pass {
    let inputs = Inputs { bricks, splats, targets, kernel, offset, touched_only: false };
    run_inputs(gpu, &inputs, terms, Storage::Full)
}

/// A scene of borrowed parts.
struct Inputs<'a> {
    bricks: &'a Bricks,
    splats: &'a [Splat],
    targets: &'a [Target],
    kernel: Kernel,
    offset: [f32; 3],
    touched_only: bool,
}

impl<'a> Inputs<'a> {
    fn of(scene: &'a Scene, touched_only: bool) -> Self {
        let Scene { bricks, splats, targets, kernel, offset } = scene;
        Inputs { bricks, splats, targets, kernel: *kernel, offset: *offset, touched_only }
    }
}

/// Runs all chunks; bins again if the bins were too small.
fn run_inputs(gpu: &Gpu, inputs: &Inputs, terms: &[Weighted], storage: Storage) -> Pass {
    let &Inputs { bricks, splats, targets, kernel, offset, touched_only } = inputs;
    let mut raster =
        Rasterizer::with_storage(gpu, kernel, EPSILON, bricks, splats.len(), storage).expect("a rasterizer");
    let chunks = raster.grid.chunks();
    let mut losses =
        Losses::new(gpu, terms, EPSILON, storage, raster.grid.chunk_slots(), chunks).expect("losses");
    let mut gradient = Gradient::new(gpu, kernel, splats.len(), storage).expect("a gradient pass");
    let buffer = gpu.upload("splats", "splats", splats).expect("splats");
    let mut pass = Pass {
        footprints: Vec::new(),
        moments: Vec::new(),
        reconstructions: Vec::new(),
        adjoints: Vec::new(),
        gradients: Vec::new(),
        sums: Vec::new(),
        chunks,
    };
    let targets: Vec<_> = (0..chunks)
        .map(|chunk| {
            let slots = raster.grid.chunk(chunk);
            gpu.upload("targets", "targets", &targets[slots.start * SAMPLES..slots.end * SAMPLES])
                .expect("targets")
        })
        .collect();
    let untouched: Vec<_> = (0..if touched_only { chunks } else { 0 })
        .map(|c| {
            let (slots, nothing) = (raster.grid.chunk(c), &raster.reconstructions);
            losses.untouched_sums(gpu, terms, &targets[c], nothing, c, slots).expect("sums of nothing")
        })
        .collect();
    let sweeps = if losses.need_overlap() { [0, 1].as_slice() } else { &[1] };
    for (&sweep, (chunk, wanted)) in
        sweeps.iter().flat_map(|s| targets.iter().enumerate().map(move |t| (s, t)))
    {
        rasterize(gpu, &mut raster, &buffer, chunk, offset);
        let samples = ChunkSamples {
            chunk,
            slots: raster.grid.chunk(chunk),
            targets: wanted,
            reconstructions: &raster.reconstructions,
            touched: untouched.get(chunk).map(|sums| (raster.bins.starts(), sums)),
        };
        if sweep == 0 {
            submit(gpu, |r| losses.record_overlap(r, &samples));
            continue;
        }
        submit(gpu, |r| {
            losses.record(r, terms, &samples);
            gradient
                .gather(r, &raster.grid, &raster.bins.footprints, &losses.adjoints, chunk, offset)
                .expect("the backward pass");
            if chunk + 1 == chunks {
                gradient.record(r, &buffer, raster.grid.stretch);
            }
        });
        let words = samples.slots.len() * SAMPLES * storage.words();
        let samples = raster.reconstructions.read_range(0, words).expect("samples");
        pass.reconstructions.extend(storage.unpack::<Reconstruction>(&samples));
        let adjoints = losses.adjoints.read_range(0, words).expect("adjoints");
        pass.adjoints.extend(storage.unpack::<Adjoint>(&adjoints));
    }
    pass.footprints = raster.bins.footprints.read().expect("footprints");
    pass.moments = gradient.moments.read().expect("moments").as_chunks::<11>().0.to_vec();
    pass.gradients = gradient.rows.read().expect("gradients");
    pass.sums = losses.sums().expect("sums");
    pass
}

fn submit(gpu: &Gpu, record: impl FnOnce(&mut Recorder)) {
    let mut recorder = gpu.record().expect("a recorder");
    record(&mut recorder);
    let ticket = recorder.submit().expect("submitting");
    gpu.wait(ticket).expect("waiting");
}

/// Rasterizes a chunk: once to learn how large the bins must be, if need be once more with bins that large.
fn rasterize(gpu: &Gpu, raster: &mut Rasterizer, splats: &Buffer<Splat>, chunk: usize, offset: [f32; 3]) {
    let settled = (0..2).any(|_| {
        submit(gpu, |r| raster.record(r, splats, chunk, offset).expect("the forward pass"));
        let needed = raster.pair_totals.read_range(chunk, 1).expect("pair totals")[0] as usize;
        let enough = needed <= raster.bins.capacity();
        if !enough {
            raster.bins.grow(needed).expect("larger bins");
        }
        enough
    });
    assert!(settled, "the same splats need another number of pairs the second time");
}
