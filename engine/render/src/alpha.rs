//! Mode alpha: every splat is a quad of one colour, blended back to front.
//!
//! It is the cheapest mode, and any rasterizer can do it. Mode slab sums first and classifies the sum; this
//! mode gives each splat an extinction and a colour, so that their sum is near the medium that the transfer
//! function makes of the field: see [`Deconvolution`]. They are found once for a look. One order serves all
//! views: back to front along the mean of the viewing directions. Clip planes remove whole splats, by their
//! centres.
//!
//! Standard splats, which have colours of their own instead of an intensity, are drawn as in Kerbl et al.
//! 2023: opacity α exp(−γ/2) in the plane of the picture, widened by 0.3 pixels², at most 0.99, ended at
//! 1/255; colour from spherical harmonics. No transfer function and no light acts on them.

use glam::DVec3;
use shaders_glsl as glsl;
use shaders_glsl::types::{AlphaParams, QuadParams};

use super::mode::Mode;
use super::part::Part;
use super::quality::Quality;
use super::scene::Scene;
use super::settings::Settings;
use super::target::Target;
use super::variants::Variants;
use base::error::Result;
use gpu::{Buffer, Drawing, Format, Gpu, Recorder};
use passes::quads::{QuadSources, QuadVariant, corners};
use passes::{Deconvolution, Quads, Views, Work};

/// The mode `alpha`.
pub struct Alpha {
    gpu: Gpu,
    /// Kernels for what the look requires, each created when it is first needed.
    kernels: Variants<QuadVariant>,
    quads: Quads,
    /// Extinction and colour of each splat; `None` before the first frame.
    deconvolution: Option<Deconvolution>,
    /// Stands for the media of standard splats, which have none.
    no_media: Buffer<[f32; 4]>,
    /// True if frames of less than full quality have one round of the deconvolution each.
    gradual: bool,
    /// Number of splats that the look can show in the frame.
    count: Buffer<u32>,
    drawing: Drawing,
    params: QuadParams,
    depth: bool,
    masked: bool,
}

impl Alpha {
    /// Creates the mode for a scene with splats.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        let splats = scene.expect_splats();
        let [low, high] = splats.bounds;
        let centre: DVec3 = (low + high) * 0.5;
        let colour = if settings.precise { Format::Rgba32f } else { Format::Rgba16f };
        let (fragment, formats) = match settings.depth {
            false => (&glsl::ALPHA_FRAG, vec![colour]),
            true => (&glsl::ALPHA_DEPTH_FRAG, vec![colour, Format::R32f]),
        };
        let constants = [corners(gpu), u32::from(splats.standard().is_some()), u32::from(settings.counting)];
        Ok(Alpha {
            gpu: gpu.clone(),
            kernels: Variants::new(),
            quads: Quads::new(gpu, settings.views, splats.count)?,
            deconvolution: None,
            no_media: gpu.buffer("no media", "splats", 1)?,
            gradual: settings.gradual,
            count: gpu.buffer("splats of the frame", "views", 1)?,
            drawing: Drawing::new(gpu, &glsl::ALPHA_VERT, fragment, &constants, &formats, settings.views)?,
            params: QuadParams {
                size: settings.size,
                centre: centre.as_vec3().to_array(),
                radius: ((high - low).length() * 0.5) as f32,
                view_count: settings.views,
                splat_count: splats.count as u32,
                range: splats.rows().range,
                coefficients: splats.standard().map_or(0, |s| s.coefficients),
            },
            depth: settings.depth,
            masked: settings.masked,
        })
    }

    /// Returns the index of the kernel for the look; creates the kernel if necessary.
    fn kernel(&mut self, scene: &Scene) -> Result<usize> {
        let (splats, look, gpu) = (scene.expect_splats(), scene.look_buffers(), &self.gpu);
        let standard = splats.standard().is_some();
        let variant = QuadVariant {
            corners: corners(gpu),
            standard,
            shaded: look.facts.shaded && !standard,
            packed: splats.rows().packed,
            objects: look.facts.objects_differ,
            hidden: self.masked,
        };
        self.kernels.find(variant, |&variant| Quads::kernel(gpu, variant))
    }

    /// Records what the drawing of a picture reads: the quads of the splats, in their order.
    fn prepare(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        quality: &Quality,
    ) -> Result<()> {
        let size = quality.size(self.params.size);
        let rounds = if self.gradual && *quality != Quality::FULL { 1 } else { u32::MAX };
        let kernel = self.kernel(scene)?;
        let (splats, look) = (scene.expect_splats(), scene.look_buffers());
        let (faces, harmonics) = splats.faces(&self.gpu)?;
        splats.count_active(recorder, &mut self.count);
        let tables = (&look.rows, &look.points, &look.integrals);
        if let Some(points) = &faces.points {
            let deconvolution = match &mut self.deconvolution {
                Some(made) => made,
                none => none.insert(Deconvolution::new(&self.gpu, points)?),
            };
            deconvolution.record(recorder, points, (look.number, tables), rounds);
        }
        let sources = QuadSources {
            look: tables,
            splats: splats.rows(),
            media: self.deconvolution.as_ref().map_or(&self.no_media, |made| &made.media),
            centres: &faces.centres,
            harmonics,
            active: (splats.active(), &self.count),
            objects: (splats.active_objects(), &look.appearances),
        };
        let params = QuadParams { size, splat_count: splats.count as u32, ..self.params };
        self.quads.record(recorder, &self.kernels[kernel], views, &sources, &params);
        Ok(())
    }
}

impl Mode for Alpha {
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
        part: Part,
    ) -> Result<()> {
        let size = quality.size(self.params.size);
        if part.is_first() {
            self.prepare(recorder, scene, views, quality)?;
            recorder.clear_image(&target.colour, [0.0; 4]);
            if self.depth {
                recorder.clear_image(&target.depth, [0.0; 4]);
            }
        }
        let mut pictures = vec![&mut target.colour];
        if self.depth {
            pictures.push(&mut target.depth);
        }
        recorder
            .draw(&self.drawing)
            .read("quads", &self.quads.rows)
            .read("order", self.quads.order())
            .push(&AlphaParams { splat_count: scene.expect_splats().count as u32 })
            .within(size)
            .in_rows(part.rows(size[1]))
            .over(&mut pictures, &self.quads.arguments, 0);
        Ok(())
    }

    fn work(&self) -> Result<Work> {
        let shown = u64::from(self.count.read()?[0]);
        let quads = u64::from(self.quads.arguments.read()?[0][0] / corners(&self.gpu));
        Ok(Work { shown, quads, ..self.quads.work(shown) })
    }
}
