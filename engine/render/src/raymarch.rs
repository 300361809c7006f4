//! The modes `volume` and `decoded`: rays marched through the voxels of the CT itself, against which the
//! splats' modes are measured, or through those that the splats were decoded to. Both have the same
//! shaders; only the image differs. Rays are started by a kernel or, of the same shader code, by fragments
//! ([`Rays`]).

use std::sync::Arc;

use shaders_glsl as glsl;
use shaders_glsl::types::RaymarchParams;

use super::gpu_volume::GpuVolume;
use super::look::Classification;
use super::mode::Mode;
use super::part::Part;
use super::quality::Quality;
use super::scene::Scene;
use super::settings::{Rays, Settings};
use super::target::Target;
use super::variants::Variants;
use base::error::{Error, Kind, Result};
use gpu::{Drawing, Format, Gpu, Image, Kernel, Overlap, Recorder};
use passes::{Faces, Views, Work, WorkgroupShape};

/// Least distance of samples, in voxels. Nearer ones would change nothing but the time.
const LEAST_STEP: f64 = 0.01;
/// Greatest length of a cell that is cut, in voxels: an interval of a brick covers what is up to a voxel away.
const LONGEST_CELL: f64 = 2.0;
/// Lengths of a cell, in voxels, where none is asked for. In a shorter one there is little to be found; in a longer one
/// single voxels are lost, which are two wide as they are interpolated.
const USUAL_CELLS: [f64; 2] = [1.0, 1.5];
/// Steps of a cell where no length is asked for.
const USUAL_PARTS: f64 = 4.0;
/// How far V is taken to go beyond its values at the ends of a cell, as a part of the range of the volume. Of a CT it is
/// about 100 HU: with it, pictures are those of even steps.
const SLACK: f64 = 1.0 / 32.0;

/// What kernels and drawings are created for: the constants of the shaders' march.glsl and medium.glsl.
type Variant = Vec<u32>;

/// What starts the rays.
enum Start {
    Computed(Variants<Variant>),
    Rasterized(Box<Rasterized>),
}

/// Rays that fragments start. First the pixels that faces around visible bricks cover are marked, then one
/// triangle over the picture starts the rays of those. Rays that the faces' own fragments start would have less
/// company: a subgroup holds pixels of one triangle.
struct Rasterized {
    drawings: Variants<Variant, Drawing>,
    marking: Drawing,
    marks: Image,
}

/// The mode `volume` or `decoded`.
pub struct Raymarch {
    gpu: Gpu,
    start: Start,
    settings: Settings,
    /// Bytes of the images that the last frame sampled.
    image_bytes: u64,
    /// The decoded field; `None` if the scene's volume is rendered.
    decoded: Option<Arc<GpuVolume>>,
}

impl Raymarch {
    /// Creates mode volume.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        Self::of(gpu, scene, settings, None)
    }

    /// Creates mode decoded. Decodes the splats as `settings.decoding` says if necessary; samples are
    /// spaced as in mode volume.
    pub fn decoded(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Self> {
        let decoded = scene.expect_splats().decoded(gpu, settings.decoding)?;
        Self::of(gpu, scene, settings, Some(decoded))
    }

    fn of(gpu: &Gpu, scene: &Scene, settings: &Settings, decoded: Option<Arc<GpuVolume>>) -> Result<Self> {
        if !(settings.step >= LEAST_STEP && settings.step.is_finite()) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-RENDER-023",
                format!("samples {} voxels apart; the least is {LEAST_STEP}", settings.step),
            )
            .help("choose another --step; 0.2 is fine for pictures"));
        }
        if let Some(cell) = settings.cell.filter(|cell| !(LEAST_STEP..=LONGEST_CELL).contains(cell)) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-RENDER-030",
                format!("cells of {cell} voxels; {LEAST_STEP} to {LONGEST_CELL} can be"),
            )
            .help("choose another --cell; 1 is fast, and hardly anything is lost"));
        }
        let start = match settings.rays.where_subgroups_are(gpu.limits().fragment_subgroups) {
            Rays::Computed => Start::Computed(Variants::new()),
            Rays::Rasterized => {
                let Settings { size, views, .. } = *settings;
                let marks = gpu.picture("marks of faces", "pictures", Format::D32f, size, views)?;
                let marking = Faces::marking(gpu, &marks)?;
                Start::Rasterized(Box::new(Rasterized { drawings: Variants::new(), marking, marks }))
            }
        };
        let settings = settings.clone();
        let mut mode = Raymarch { gpu: gpu.clone(), start, settings, image_bytes: 0, decoded };
        let (_, needs) = mode.needs(scene);
        let (classification, _) = mode.settings.variant(scene);
        mode.pipeline(scene, classification, &Quality::FULL, needs)?;
        Ok(mode)
    }

    /// Returns how objects count in the look of the scene (`OBJECTS` of the shaders), and true if its picture needs gradients.
    fn needs(&self, scene: &Scene) -> (u32, bool) {
        let (volume, look) =
            (self.decoded.as_deref().unwrap_or_else(|| scene.expect_volume()), scene.look_buffers());
        // Splats of a hidden object are still in the decoded field.
        let objects = match volume.atlas() > 0 {
            true if look.facts.own_functions => glsl::medium::OWN_FUNCTIONS,
            true if look.facts.objects_differ || look.facts.hides => glsl::medium::TINTS,
            _ => 0,
        };
        (objects, look.facts.shaded || look.facts.graded)
    }

    /// Returns the index of the kernel or drawing for the look of the scene, classified in this way, at a quality; creates it if
    /// necessary. `kept` says that gradients are kept.
    fn pipeline(
        &mut self,
        scene: &Scene,
        classification: Classification,
        quality: &Quality,
        kept: bool,
    ) -> Result<usize> {
        let (objects, _) = self.needs(scene);
        let (gpu, settings) = (&self.gpu, &self.settings);
        let (volume, look) =
            (self.decoded.as_deref().unwrap_or_else(|| scene.expect_volume()), scene.look_buffers());
        let (_, shaded) = settings.variant(scene);
        let constants = vec![
            u32::from(volume.image().format() == Format::Rg16),
            volume.atlas(),
            objects,
            u32::from(settings.counting),
            u32::from(classification == Classification::PreIntegrated),
            u32::from(shaded),
            u32::from(settings.masked),
            u32::from(settings.jitter),
            u32::from(look.facts.occluded && quality.occlusion),
            u32::from(look.facts.graded),
            u32::from(kept),
        ];
        match &mut self.start {
            Start::Computed(kernels) => kernels.find(constants, |constants| {
                let own = [u32::from(settings.depth), WorkgroupShape::of(gpu) as u32];
                Kernel::new(gpu, &glsl::RAYMARCH, &[&constants[..], &own].concat())
            }),
            Start::Rasterized(rasterized) => rasterized.drawings.find(constants, |constants| {
                let colour = if settings.precise { Format::Rgba32f } else { Format::Rgba16f };
                let (fragment, formats) = match settings.depth {
                    false => (&glsl::RAYMARCH_FRAG, &[colour, Format::D32f][..]),
                    true => (&glsl::RAYMARCH_DEPTH_FRAG, &[colour, Format::R32f, Format::D32f][..]),
                };
                let shaders = [&glsl::RAYMARCH_VERT, fragment];
                Drawing::overlapping(gpu, shaders, constants, formats, settings.views, Overlap::Nearest)
            }),
        }
    }
}

/// Binds what a march reads, in the order of the shaders.
macro_rules! marched {
    ($pass:expr, $views:ident, $look:ident, $volume:ident, $marked:ident) => {
        $pass
            .read("views", &$views.rows)
            .read("look_rows", &$look.rows)
            .read("look_points", &$look.points)
            .read("look_integrals", &$look.integrals)
            .sample("medium", $volume.image())
            .read("places", $volume.places())
            .sample("labels", $volume.labels())
            .read("appearances", &$look.appearances)
            .read("distances", $marked.distances())
            .read("patches", &$views.patches)
            .read("gradient_factors", &$look.gradient_factors)
            .read("visible_before", &$look.visible)
            .sample("gradients", $volume.gradients(&$marked))
    };
}

/// Returns the bytes of an image's texels.
fn bytes_of(image: &Image) -> u64 {
    let texels: u64 = image.size().iter().map(|&n| u64::from(n)).product();
    texels * image.format().bytes() as u64
}

impl Mode for Raymarch {
    fn record(
        &mut self,
        recorder: &mut Recorder,
        scene: &Scene,
        views: &Views,
        target: &mut Target,
        quality: &Quality,
        part: Part,
    ) -> Result<()> {
        let decoded = self.decoded.clone();
        let volume = decoded.as_deref().unwrap_or_else(|| scene.expect_volume());
        let look = scene.look_buffers();
        let mut marked = volume.marked(recorder, look);
        let (objects, needs) = self.needs(scene);
        // A draft of something that is being dragged is not worth the pass: it is lit as the look before was.
        let rests = part.is_first() && marked.rests(look);
        let rests = rests || !self.settings.gradual || *quality == Quality::FULL;
        let kept =
            needs && volume.keep_gradients(&self.gpu, recorder, &mut marked, look, objects != 0, !rests)?;
        let (classification, _) = self.settings.variant(scene);
        let pipeline = self.pipeline(scene, classification, quality, kept)?;
        let gradients = if kept { bytes_of(volume.gradients(&marked)) } else { 0 };
        self.image_bytes = bytes_of(volume.image()) + gradients;
        let size @ [width, height] = quality.size(self.settings.size);
        let step = self.settings.step * quality.coarseness;
        let usual = (USUAL_PARTS * step).clamp(USUAL_CELLS[0], USUAL_CELLS[1]);
        let cell = self.settings.cell.unwrap_or(usual).max(step);
        let params = RaymarchParams {
            grid: volume.grid(),
            voxel_from_scene: volume.voxel_from_scene(),
            first: volume.scale().first as f32,
            span: volume.scale().span as f32,
            size,
            cell: (cell * volume.spacing_mm) as f32,
            parts: (cell / step).round() as u32,
            slack: ((volume.range[1] - volume.range[0]) * SLACK) as f32,
            dark: self.settings.dark,
            edge: (volume.mean_edge_mm * if kept { volume.gradient_unit(&marked) } else { 1.0 }) as f32,
        };
        match &mut self.start {
            // All at once: the kernel knows no parts.
            Start::Computed(_) if !part.is_first() => {}
            Start::Computed(kernels) => {
                // Width and height of a workgroup, pixels; see the kernel.
                let group = match WorkgroupShape::of(&self.gpu) {
                    WorkgroupShape::OneByOne => [4, 2],
                    WorkgroupShape::SideBySide => [8, 8],
                };
                marched!(recorder.pass(&kernels[pipeline]), views, look, volume, marked)
                    .write_image("colour_image", &mut target.colour)
                    .write_image("depth_image", &mut target.depth)
                    .push(&params)
                    .dispatch_3d([width.div_ceil(group[0]), height.div_ceil(group[1]), self.settings.views]);
            }
            Start::Rasterized(rasterized) => {
                let Rasterized { drawings, marking, marks } = &mut **rasterized;
                if part.is_first() {
                    let faces = marked.faces(&self.gpu, recorder)?;
                    faces.mark(recorder, marking, views, volume.voxel_from_scene(), size, marks);
                    recorder.clear_image(&target.colour, [0.0; 4]);
                    if self.settings.depth {
                        recorder.clear_image(&target.depth, [0.0; 4]);
                    }
                }
                let mut pictures = vec![&mut target.colour];
                if self.settings.depth {
                    pictures.push(&mut target.depth);
                }
                pictures.push(marks);
                marched!(recorder.draw(&drawings[pipeline]), views, look, volume, marked)
                    .push(&params)
                    .within(size)
                    .in_rows(part.rows(height))
                    .vertices_over(&mut pictures, 0..3);
            }
        }
        Ok(())
    }

    fn warm_up(&mut self, scene: &Scene) -> Result<()> {
        let (_, kept) = self.needs(scene);
        let occluded = scene.look_buffers().facts.occluded;
        for classification in self.settings.classifications() {
            for occlusion in [true, false].into_iter().take(1 + usize::from(occluded)) {
                let quality = Quality { occlusion, ..Quality::FULL };
                self.pipeline(scene, classification, &quality, kept)?;
            }
        }
        Ok(())
    }

    fn renew(&mut self, scene: &Scene) {
        if self.decoded.is_some() {
            self.decoded = scene.expect_splats().decoded_last().or(self.decoded.take());
        }
    }

    fn work(&self) -> Result<Work> {
        Ok(Work { image_bytes: self.image_bytes, ..Work::default() })
    }
}
