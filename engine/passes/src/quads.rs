//! Quads of splats: one for each view, in one order for all views, and the number of quads to draw.

use shaders_glsl as glsl;
pub use shaders_glsl::project_quads::ORDER_BITS;
use shaders_glsl::types::{Appearance, Centre, Quad, QuadParams};

use super::deconvolution::LookTables;
use super::{RadixSort, SplatRows, Views, Work, WorkgroupShape};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// Returns the number of vertices of a quad on a device; `include/alpha.glsl` says why. The picture is the
/// same.
pub fn corners(gpu: &Gpu) -> u32 {
    match WorkgroupShape::of(gpu) {
        WorkgroupShape::OneByOne => 3,
        WorkgroupShape::SideBySide => 6,
    }
}

/// Buffers that quads are made from, besides views and constants.
pub struct QuadSources<'a> {
    /// The look: its row, points and integrals.
    pub look: LookTables<'a>,
    /// All splats.
    pub splats: &'a SplatRows,
    /// Extinction times colour, and extinction, of each splat; not read for standard splats.
    pub media: &'a Buffer<[f32; 4]>,
    /// The gradients of the field at their centres; read only for light.
    pub centres: &'a Buffer<Centre>,
    /// Spherical harmonics of standard splats, two halves a word; not read for others.
    pub harmonics: &'a Buffer<u32>,
    /// Indices of the splats that the look can show, and their number in one element.
    pub active: (&'a Buffer<u32>, &'a Buffer<u32>),
    /// Objects that these splats belong to, and the appearance of each object.
    pub objects: (&'a Buffer<u32>, &'a Buffer<Appearance>),
}

/// Variant of `project_quads` that a kernel is created for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuadVariant {
    /// Vertices of a quad; see [`corners`].
    pub corners: u32,
    /// True if colour and opacity are the splats' own.
    pub standard: bool,
    /// True if surfaces are lit.
    pub shaded: bool,
    /// True if rows are packed.
    pub packed: bool,
    /// True if objects have tints and opacities.
    pub objects: bool,
    /// True if views come with visibility masks, and splats in patches hidden by the lens are left out.
    pub hidden: bool,
}

/// Projects splats to quads and sorts them back to front.
pub struct Quads {
    sort: RadixSort,
    /// Quads, [view][index among the active splats].
    pub rows: Buffer<Quad>,
    /// Arguments of the draw: vertices, one instance, and the first of each.
    pub arguments: Buffer<[u32; 4]>,
    /// Number of splats that the kernel was started for last.
    splats: usize,
}

impl Quads {
    /// Creates buffers for `splat_count` splats in `views` views.
    pub fn new(gpu: &Gpu, views: u32, splat_count: usize) -> Result<Self> {
        Ok(Quads {
            sort: RadixSort::new(gpu, splat_count)?,
            rows: gpu.buffer("quads", "views", splat_count * views as usize)?,
            arguments: gpu.buffer("quads to draw", "views", 1)?,
            splats: 0,
        })
    }

    /// Creates a `project_quads` kernel.
    pub fn kernel(gpu: &Gpu, variant: QuadVariant) -> Result<Kernel> {
        let QuadVariant { corners, standard, shaded, packed, objects, hidden } = variant;
        let flags = [standard, shaded, packed, objects, hidden].map(u32::from);
        Kernel::new(gpu, &glsl::PROJECT_QUADS, &[&[corners][..], &flags].concat())
    }

    /// Records the projection, by a [`Quads::kernel`], and the sorting of the active splats, of which there
    /// are at most `params.splat_count`.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        kernel: &Kernel,
        views: &Views,
        sources: &QuadSources<'_>,
        params: &QuadParams,
    ) {
        self.splats = params.splat_count as usize;
        recorder.clear(&self.arguments);
        let (keys, values) = self.sort.input();
        recorder
            .pass(kernel)
            .read("views", &views.rows)
            .read("look_rows", sources.look.0)
            .read("look_points", sources.look.1)
            .read("look_integrals", sources.look.2)
            .read("rows", &sources.splats.rows)
            .read("chunks", &sources.splats.chunks)
            .read("centres", sources.centres)
            .read("harmonic_halves", sources.harmonics)
            .read("active_splats", sources.active.0)
            .read("active_count", sources.active.1)
            .write("quads", &mut self.rows)
            .write("keys", keys)
            .write("values", values)
            .write_words("arguments", &mut self.arguments)
            .read("active_objects", sources.objects.0)
            .read("appearances", sources.objects.1)
            .read("patches", &views.patches)
            .read("media", sources.media)
            .push(&QuadParams { range: sources.splats.range, ..*params })
            .dispatch_over(params.splat_count);
        self.sort.record(recorder, sources.active.1, 0, ORDER_BITS);
    }

    /// Returns the work of the last frame, for which `shown` splats were listed.
    pub fn work(&self, shown: u64) -> Work {
        Work { rows: self.splats as u64, sorted: shown, ..self.sort.work(ORDER_BITS) }
    }

    /// Returns the sort keys from back to front.
    pub fn sorted_keys(&self) -> &Buffer<u32> {
        self.sort.sorted_keys(ORDER_BITS)
    }

    /// Returns the rows of the quads from back to front; those that no view shows come last.
    pub fn order(&self) -> &Buffer<u32> {
        self.sort.sorted_values(ORDER_BITS)
    }
}
