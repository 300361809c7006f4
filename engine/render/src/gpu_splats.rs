//! The splats of a scene on the device, and the list of those that a transfer function can show.
//!
//! A splat whose own intensity is transparent still changes the field beside it, so it may only be left out
//! if nothing that it reaches is visible. Within its support the field is a weighted mean of the intensities
//! of the splats that reach there, too; [`intervals`] bounds these, once for a scene. A transfer function
//! then drops exactly the splats of whose interval it shows nothing.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::{DAffine3, DVec3};
use shaders_glsl::types::Centre;

use super::decoded::{self, DecodeOptions, Decoded};
use super::extents::{box_around, cores, intervals, middle_sigma, of_region, reaches};
use super::gpu_volume::GpuVolume;
use super::look::LookBuffers;
use super::splat_points::splat_points;
use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Recorder};
use passes::activity::ActivitySources;
use passes::deconvolution::DevicePoints;
use passes::{Activity, Ranking, SplatRows};
use splat::harmonics::basis_count;
use splat::{
    Field, Form, Grid, Harmonics, Object, Packed, Region, SplatSet, Voxels, by_importance, far_splats,
};

/// Precision of the splats on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Splats as they were fitted, 48 bytes each.
    #[default]
    Full,
    /// Splats of 16 bytes each; see [`Packed`].
    Packed,
}

/// Properties of standard splats, those of ordinary 3D Gaussian splatting: they have colours instead of an
/// intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Standard {
    /// Number of spherical harmonics of each colour.
    pub(super) coefficients: u32,
}

/// What mode alpha draws splats by, besides their shapes.
pub(super) struct Faces {
    /// Gradients of the field at the centres.
    pub(super) centres: Buffer<Centre>,
    /// Points at which the splats are compared with the medium; `None` for standard splats.
    pub(super) points: Option<DevicePoints>,
}

/// A function that decodes a field, and tells its argument the part that is done, 0 to 1.
pub type Decoding = Box<dyn FnOnce(&mut dyn FnMut(f32)) -> Result<()> + Send>;

/// How a field was decoded, and the field: on the device, and on the host where the device has not all of it.
struct Shown {
    options: DecodeOptions,
    volume: Arc<GpuVolume>,
    whole: Option<Arc<Decoded>>,
}

/// The splats of a scene.
pub struct GpuSplats {
    rows: SplatRows,
    /// Field that the splats add up to.
    pub field: Field,
    /// Number of splats.
    pub count: usize,
    /// Standard deviation of the middle splat along its shortest axis, mm: the unit of steps along a ray.
    pub sigma_mm: f64,
    /// Least and greatest intensity.
    pub range: [f64; 2],
    /// Corners of the box around all supports, mm in the space of the scene.
    pub bounds: [DVec3; 2],
    /// Corners of the box around the region; without one, around the cores, half a standard deviation from the means on, of all splats but those that
    /// lie far from all others, mm in the space of the scene: where the mask is that they were fitted to.
    pub(super) cores: [DVec3; 2],
    /// Number of splats that lie far from all others.
    pub far: usize,
    /// Objects of the splats, by ascending number.
    pub objects: Vec<Object>,
    intervals: Buffer<[f32; 2]>,
    /// Number of each splat's object.
    object_numbers: Buffer<u32>,
    activity: Activity,
    /// Greatest number of splats that a look lists.
    budget: Option<usize>,
    ranking: Option<Ranking>,
    /// What only mode alpha needs.
    faces: Arc<OnceLock<Faces>>,
    /// The grid that the splats were fitted on, in the space of the scene.
    grid: Option<Grid>,
    form: Form,
    region: Option<Region>,
    voxels: Vec<Voxels>,
    /// Field that mode decoded shows, with how it was decoded.
    decoded: Arc<Mutex<Option<Shown>>>,
    /// Origin of the space of the scene in the world, mm RAS.
    origin: DVec3,
    /// Coefficients of spherical harmonics, two halves a word; for standard splats only.
    harmonics: Buffer<u32>,
    standard: Option<Standard>,
}

impl GpuSplats {
    pub(super) fn new(gpu: &Gpu, set: &SplatSet, precision: Precision) -> Result<Self> {
        // Packed splats lie in an order of their own, and everything here is computed from what is shown.
        // Colours would have to follow that order: standard splats are not packed.
        let packed = (precision == Precision::Packed && set.colours.is_none())
            .then(|| Packed::new(&set.splats, set.labels.as_deref()));
        let unpacked = packed.as_ref().map(Packed::unpack_all);
        let splats = unpacked.as_ref().unwrap_or(&set.splats);
        let count = splats.len();
        let reach = reaches(splats, set.field.kernel.support_q());
        let far = far_splats(splats);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for splat in splats {
            let c = f64::from(splat.intensity);
            range = [range[0].min(c), range[1].max(c)];
        }
        // Interpolation reaches into the rim.
        for [low, high] in set.voxels.iter().filter_map(Voxels::range) {
            range = [range[0].min(low), range[1].max(high)];
        }
        if set.is_empty() {
            range = [0.0, 1.0];
        }
        let object_numbers: Vec<u32> = match (&packed, &set.labels) {
            (Some(packed), _) => (0..count).map(|row| u32::from(packed.label(row))).collect(),
            (None, Some(labels)) => labels.iter().map(|&l| u32::from(l)).collect(),
            (None, None) => vec![0; count],
        };
        let rows = match &packed {
            Some(packed) => SplatRows::packed(gpu, packed)?,
            None => SplatRows::full(gpu, splats)?,
        };
        // No transfer function acts on colours: `mark_active` recognises them by an interval that ends before
        // it begins.
        let intervals = match set.colours {
            Some(_) => vec![[1.0, 0.0]; count],
            None => intervals(splats, &reach),
        };
        Ok(GpuSplats {
            rows,
            field: set.field,
            count,
            sigma_mm: middle_sigma(splats),
            range,
            bounds: match of_region(set).filter(|_| set.splats.is_empty()) {
                Some(corners) => corners,
                None => box_around(splats, &reach),
            },
            cores: of_region(set).unwrap_or_else(|| cores(splats, &far)),
            far: far.len(),
            intervals: gpu.upload("intervals of intensity", "splats", &intervals)?,
            objects: set.objects(),
            object_numbers: gpu.upload("objects of splats", "splats", &object_numbers)?,
            activity: Activity::new(gpu, count)?,
            budget: None,
            ranking: None,
            faces: Arc::default(),
            grid: set.grid.map(|grid| Grid {
                world_from_voxel: DAffine3::from_translation(-set.origin_mm) * grid.world_from_voxel,
                ..grid
            }),
            form: set.form,
            region: set.region.clone(),
            voxels: set.voxels.clone(),
            decoded: Arc::default(),
            origin: set.origin_mm,
            harmonics: gpu.upload(
                "spherical harmonics",
                "splats",
                &set.colours.as_ref().map_or(vec![0], halves),
            )?,
            standard: set.colours.as_ref().map(|c| Standard { coefficients: basis_count(c.degree) as u32 }),
        })
    }

    /// Records the pass that lists the splats a look can show. It must be recorded when the look has changed.
    pub(super) fn record_activity(&mut self, recorder: &mut Recorder, look: &LookBuffers) {
        let sources = ActivitySources {
            look: &look.rows,
            visible: &look.visible,
            appearances: &look.appearances,
            intervals: &self.intervals,
            objects: &self.object_numbers,
        };
        self.activity.record(recorder, &sources, self.ranking.as_mut().zip(self.budget));
    }

    /// Sets the greatest number of splats that are listed from now on: the most important of those that a
    /// look can show. The first budget computes the order of importance, and waits for the device.
    pub(super) fn set_budget(&mut self, gpu: &Gpu, budget: Option<usize>) -> Result<()> {
        self.budget = budget.filter(|&most| most < self.count);
        if self.budget.is_some() && self.ranking.is_none() {
            let order = by_importance(&self.rows.read()?, &self.field);
            self.ranking = Some(Ranking::new(gpu, &order)?);
        }
        Ok(())
    }

    /// Treats every splat from now on as if it could show every intensity.
    pub(super) fn list_all(&mut self, gpu: &Gpu) -> Result<()> {
        // Standard splats are listed whatever the look.
        if self.standard.is_none() {
            let all = vec![self.range.map(|c| c as f32); self.count];
            self.intervals = gpu.upload("intervals of intensity", "splats", &all)?;
        }
        Ok(())
    }

    /// Returns the splats on the device, mm in the space of the scene.
    pub(super) fn rows(&self) -> &SplatRows {
        &self.rows
    }

    /// Returns what mode alpha draws by, and the spherical harmonics, a placeholder but for standard splats.
    /// The first call evaluates the field, and waits for the device.
    pub(super) fn faces(&self, gpu: &Gpu) -> Result<(&Faces, &Buffer<u32>)> {
        let made = match self.faces.get() {
            Some(made) => made,
            None => {
                let made = self.faces_maker(gpu)?()?;
                self.faces.get_or_init(|| made)
            }
        };
        Ok((made, &self.harmonics))
    }

    /// Returns true if mode alpha can begin at once.
    pub fn has_faces(&self) -> bool {
        self.faces.get().is_some()
    }

    /// Returns a function that prepares mode alpha, so that it can begin at once; it may be called on any
    /// thread. For 100,000 splats it takes one to two seconds of the host. Waits for the device.
    pub fn preparation(&self, gpu: &Gpu) -> Result<impl FnOnce() -> Result<()> + Send + use<>> {
        let (place, make) = (Arc::clone(&self.faces), self.faces_maker(gpu)?);
        Ok(move || {
            if place.get().is_none() {
                let made = make()?;
                place.get_or_init(|| made);
            }
            Ok(())
        })
    }

    fn faces_maker(&self, gpu: &Gpu) -> Result<impl FnOnce() -> Result<Faces> + Send + use<>> {
        let gpu = gpu.clone();
        let source = match self.standard {
            Some(_) => None,
            None => Some(self.source()?),
        };
        Ok(move || {
            let upload = |rows: &[Centre]| gpu.upload("field at the centres", "splats", rows);
            let Some(source) = source else {
                return Ok(Faces { centres: upload(&[Centre::default()])?, points: None });
            };
            // Between the voxels of its grid such a fit means nothing, only its decoded field does.
            let decoded = match source.form {
                Form::Grid => source.decode(&gpu, &DecodeOptions::default(), &mut |_| true)?,
                Form::Field => None,
            };
            let made = splat_points(&source.splats, &source.field, decoded.as_ref())?;
            Ok(Faces {
                centres: upload(&made.centres)?,
                points: Some(DevicePoints::new(&gpu, &made.points)?),
            })
        })
    }

    /// Returns the field decoded as `options` say; decodes it now if necessary. Only the last field is kept.
    pub(super) fn decoded(&self, gpu: &Gpu, options: DecodeOptions) -> Result<Arc<GpuVolume>> {
        if !self.has_decoded(options) {
            self.decoding(gpu, options)?(&mut |_| ())?;
        }
        self.decoded_last()
            .ok_or_else(|| Error::new(Kind::Internal, "VGS-RENDER-026", "a decoded field is lost"))
    }

    /// Returns the field that was decoded last; `None` if none was.
    pub(super) fn decoded_last(&self) -> Option<Arc<GpuVolume>> {
        let place = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        place.as_ref().map(|shown| Arc::clone(&shown.volume))
    }

    /// Returns true if mode decoded can begin at once, perhaps with bricks that are whole elsewhere.
    pub fn has_decoded(&self, options: DecodeOptions) -> bool {
        self.decoded_as().is_some_and(|there| there.is_like(&options))
    }

    /// Returns how the field is decoded that there is; `None` if there is none.
    pub fn decoded_as(&self) -> Option<DecodeOptions> {
        let place = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        place.as_ref().map(|shown| shown.options)
    }

    /// Returns a function that prepares mode decoded as `options` say, so that it can begin at once; it may
    /// be called on any thread. It tells its argument the part that is done, 0 to 1, and ends without a result
    /// once the splats are gone. Waits for the device.
    ///
    /// # Errors
    /// If the pitch is out of range.
    pub fn decoding(&self, gpu: &Gpu, options: DecodeOptions) -> Result<Decoding> {
        self.decoding_as(gpu, options, None)
    }

    /// Returns a function like that of [`Self::decoding`], whose field has other objects than the splats: `number`
    /// gives that of each voxel by its place in the space of the scene, mm. Only mode decoded shows them.
    ///
    /// # Errors
    /// If the pitch is out of range.
    pub fn decoding_objects(
        &self,
        gpu: &Gpu,
        options: DecodeOptions,
        number: impl Fn(DVec3) -> u8 + Send + Sync + 'static,
    ) -> Result<Decoding> {
        self.decoding_as(gpu, options, Some(Box::new(number)))
    }

    fn decoding_as(
        &self,
        gpu: &Gpu,
        options: DecodeOptions,
        number: Option<Box<dyn Fn(DVec3) -> u8 + Send + Sync>>,
    ) -> Result<Decoding> {
        decoded::check(options.pitch)?;
        let mut source = self.source()?;
        if number.is_some() {
            // Those of the splats need not be found.
            source.objects.fill(0);
        }
        let (gpu, place, origin) = (gpu.clone(), Arc::downgrade(&self.decoded), self.origin);
        Ok(Box::new(move |progress: &mut dyn FnMut(f32)| {
            let start = std::time::Instant::now();
            let mut going = |part: f64| {
                progress(part as f32);
                place.strong_count() > 0
            };
            let held = place.upgrade().and_then(|place| {
                let place = place.lock().unwrap_or_else(PoisonError::into_inner);
                place
                    .as_ref()
                    .filter(|shown| shown.options.is_of_field(&options) && number.is_none())?
                    .whole
                    .clone()
            });
            let done = if held.is_some() { "placed anew" } else { "decoded" };
            let field = match (held, number) {
                (Some(held), _) => held,
                (None, number) => {
                    let Some(field) = source.decode(&gpu, &options, &mut going)? else { return Ok(()) };
                    Arc::new(match number {
                        Some(number) => field.with_objects(&number),
                        None => field,
                    })
                }
            };
            let Some(place) = place.upgrade() else { return Ok(()) };
            let volume = Arc::new(GpuVolume::of_field(&gpu, &field, origin, options.budget.as_ref())?);
            tracing::info!("{} bricks {done} in {:.2} s", field.brick_count(), start.elapsed().as_secs_f64());
            let whole = options.budget.map(|_| field);
            *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(Shown { options, volume, whole });
            Ok(())
        }))
    }

    /// Returns the splats with what decoding needs. Waits for the device.
    fn source(&self) -> Result<decoded::Source> {
        Ok(decoded::Source {
            splats: self.rows.read()?,
            objects: self.object_numbers.read()?.iter().map(|&number| number as u8).collect(),
            field: self.field,
            grid: self.grid,
            form: self.form,
            region: self.region.clone(),
            voxels: self.voxels.clone(),
            sigma_mm: self.sigma_mm,
        })
    }

    /// Returns the properties of standard splats; `None` for other splats.
    pub(super) fn standard(&self) -> Option<Standard> {
        self.standard
    }

    /// Returns the indices of the splats that the look can show, in ascending order.
    pub(super) fn active(&self) -> &Buffer<u32> {
        &self.activity.active
    }

    /// Records a copy of the number of splats that the look can show into `count`.
    pub(super) fn count_active(&self, recorder: &mut Recorder, count: &mut Buffer<u32>) {
        recorder.copy(&self.activity.places, self.count, count, 0, 1);
    }

    /// Returns the objects that the splats of [`Self::active`] belong to.
    pub(super) fn active_objects(&self) -> &Buffer<u32> {
        &self.activity.active_objects
    }

    /// Returns the number of splats that are rendered: those that the look can show, as far as the budget
    /// goes. Waits for the device.
    pub fn active_count(&self) -> Result<usize> {
        Ok(self.activity.count.read()?[0] as usize)
    }
}

/// Returns coefficients as halves, two in a word.
fn halves(colours: &Harmonics) -> Vec<u32> {
    let half = |v: &f32| u32::from(half::f16::from_f32(*v).to_bits());
    colours.coefficients.chunks(2).map(|pair| half(&pair[0]) | pair.get(1).map_or(0, half) << 16).collect()
}
