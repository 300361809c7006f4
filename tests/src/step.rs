//! One forward and backward pass on the device through the pass types, with everything it leaves behind. The one place
//! that knows how the passes hang together, besides the fit itself.

use engine::gpu::Gpu;
use engine::passes::loss::{Sum, Weighted};
use engine::passes::{Gradient, Losses, Rasteriser, Storage};
use engine::reference;
use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use shaders_glsl::types::{Adjoint, Footprint, Reconstruction, SplatGrad, Target};

use crate::Scene;
use crate::scene::EPSILON;

/// What a pass over all chunks left behind.
pub struct Pass {
    /// Footprint of each splat.
    pub footprints: Vec<Footprint>,
    /// W and V̂ of all samples.
    pub reconstructions: Vec<Reconstruction>,
    /// Folded adjoints of all samples.
    pub adjoints: Vec<Adjoint>,
    /// What the backward pass sums for each splat; `reference::splat_to_volume_grad::Moments` has the order.
    pub moments: Vec<[f32; 11]>,
    /// dL/d(parameters).
    pub gradients: Vec<SplatGrad>,
    /// Sums of the terms, in the order given.
    pub sums: Vec<Sum>,
    /// How many chunks the grid was cut into.
    pub chunks: usize,
}

/// MSE and occupancy with weights that make both matter.
pub fn terms(soft: bool) -> [Weighted; 2] {
    [
        Weighted { term: 0, weight: 1.0, parameter: f32::from(u8::from(soft)) },
        Weighted { term: 1, weight: 0.3, parameter: 0.05 },
    ]
}

/// The twins of [`Weighted`] terms.
pub fn terms64(terms: &[Weighted]) -> Vec<reference::Term> {
    let twin = |t: &Weighted| {
        let weight = f64::from(t.weight);
        match engine::passes::loss::TERMS[t.term].name {
            "mse" => reference::Term::Mse { weight, soft: t.parameter != 0.0 },
            "occupancy" => reference::Term::Occupancy { weight, w0: f64::from(t.parameter) },
            name => panic!("the loss term {name} has no twin in reference::loss"),
        }
    };
    terms.iter().map(twin).collect()
}

/// Runs a scene in full storage.
pub fn run(gpu: &Gpu, scene: &Scene, terms: &[Weighted]) -> Pass {
    run_stored(gpu, scene, terms, Storage::Full)
}

/// Runs a scene.
pub fn run_stored(gpu: &Gpu, scene: &Scene, terms: &[Weighted], storage: Storage) -> Pass {
    let Scene { bricks, splats, targets, kernel, offset } = scene;
    run_inputs(gpu, &Inputs { bricks, splats, targets, kernel: *kernel, offset: *offset }, terms, storage)
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
    run_inputs(gpu, &Inputs { bricks, splats, targets, kernel, offset }, terms, Storage::Full)
}

/// A scene of borrowed parts.
struct Inputs<'a> {
    bricks: &'a Bricks,
    splats: &'a [Splat],
    targets: &'a [Target],
    kernel: Kernel,
    offset: [f32; 3],
}

/// Over all chunks, binning again where the bins were too small.
fn run_inputs(gpu: &Gpu, inputs: &Inputs, terms: &[Weighted], storage: Storage) -> Pass {
    let &Inputs { bricks, splats, targets, kernel, offset } = inputs;
    let mut raster =
        Rasteriser::with_storage(gpu, kernel, EPSILON, bricks, splats.len(), storage).expect("a rasteriser");
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
    for chunk in 0..chunks {
        let slots = raster.grid.chunk(chunk);
        let samples = slots.start * SAMPLES..slots.end * SAMPLES;
        let wanted = gpu.upload("targets", "targets", &targets[samples]).expect("targets");
        // Once to learn how large the bins must be, once with bins that large.
        let settled = (0..2).any(|_| {
            let mut recorder = gpu.record().expect("a recorder");
            raster.record(&mut recorder, &buffer, chunk, offset).expect("the forward pass");
            let ticket = recorder.submit().expect("submitting");
            gpu.wait(ticket).expect("waiting");
            let needed = raster.pair_totals.read_range(chunk, 1).expect("pair totals")[0] as usize;
            let enough = needed <= raster.bins.capacity();
            if !enough {
                raster.bins.grow(needed).expect("larger bins");
            }
            enough
        });
        assert!(settled, "the same splats need another number of pairs the second time");
        let mut recorder = gpu.record().expect("a recorder");
        losses.record(&mut recorder, &wanted, &raster.reconstructions, chunk, slots.len());
        gradient
            .gather(&mut recorder, &raster.grid, &raster.bins.footprints, &losses.adjoints, chunk, offset)
            .expect("the backward pass");
        if chunk + 1 == chunks {
            gradient.record(&mut recorder, &buffer);
        }
        let ticket = recorder.submit().expect("submitting");
        gpu.wait(ticket).expect("waiting");
        let words = slots.len() * SAMPLES * storage.words();
        let (samples, adjoints) = (&raster.reconstructions, &losses.adjoints);
        let samples = samples.read_range(0, words).expect("samples");
        pass.reconstructions.extend(storage.unpack::<Reconstruction>(&samples));
        let adjoints = adjoints.read_range(0, words).expect("adjoints");
        pass.adjoints.extend(storage.unpack::<Adjoint>(&adjoints));
    }
    pass.footprints = raster.bins.footprints.read().expect("footprints");
    pass.moments = gradient.moments.read().expect("moments").as_chunks::<11>().0.to_vec();
    pass.gradients = gradient.rows.read().expect("gradients");
    pass.sums = losses.sums().expect("sums");
    pass
}
