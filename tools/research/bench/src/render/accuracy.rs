//! Measures how far pictures are from their references.

use engine::gpu::Gpu;
use engine::image::{Image, flip, psnr, ssim};
use engine::render::{Camera, Look, Scene, VolumeSource};
use engine::splat::{Packed, SplatSet};
use engine::transfer::TransferFunction;
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices};
use engine::{Error, Kind, Result};

use super::config::{Classify, Rendering, Section};
use super::plan::{Unit, mode_row};
use super::record::{Comparison, Record, Role, Sight};
use super::scenes::{Place, TimedRenderer, check_validation, is_finite, shows_something, volume_bytes};
use crate::cost::Cost;

/// Distance between the eyes, mm.
const EYES_MM: f64 = 64.0;

/// Makes all comparisons of a unit of `end-to-end`, `renderer-error` or `storage`. `saw` is called after each
/// rendering.
pub fn measure(
    unit: &Unit,
    place: &Place,
    set: &SplatSet,
    gpu: &Gpu,
    saw: &mut dyn FnMut(&Comparison),
) -> Result<Record> {
    let mut record = Record {
        key: unit.key(),
        splats: set.splats.len(),
        roi_voxels: place.roi.weight_sum(),
        ..Record::default()
    };
    let studio = Studio {
        gpu,
        size: unit.part.size,
        views: unit.views(),
        cameras: place.cameras(&unit.orbit, &unit.views())?,
    };
    let first = Look::new(place.transfer(&unit.transfers[0])?);
    let (volume, roi) =
        volume::shown(&place.volume, Some(&place.roi), BetweenSlices::default(), Edges::default());
    let ct = VolumeSource { volume: &volume, roi: roi.as_deref() };
    let mut stage = Stage {
        full: Scene::new(gpu, Some(set), needs_volume(unit).then_some(&ct), &first)?,
        packed: packed(unit, set, gpu, &first)?,
        downsampled: Vec::new(),
    };
    for &factor in &unit.part.downsampled {
        let (volume, roi) = (place.volume.coarsened(factor), place.roi.coarsened(factor));
        let scene = Scene::new(gpu, None, Some(&VolumeSource { volume: &volume, roi: Some(&roi) }), &first)?;
        stage.downsampled.push((factor, volume_bytes(&roi), scene));
    }
    for transfer in &unit.transfers {
        stage.set_look(&place.transfer(transfer)?)?;
        let mut rows = Rows { transfer: &transfer.name, record: &mut record, saw: &mut *saw };
        match unit.section {
            Section::Storage => storage(unit, &studio, &stage, &mut rows)?,
            _ => against_reference(unit, place, &studio, &stage, &mut rows)?,
        }
        for rendering in &unit.stereo {
            two_eyes(&studio, &stage.full, rendering, &mut rows)?;
        }
    }
    check_validation(gpu)?;
    Ok(record)
}

/// Returns true if a unit renders the volume itself.
fn needs_volume(unit: &Unit) -> bool {
    let of_volume = |rendering: &Rendering| mode_row(rendering).is_some_and(|row| !row.of_splats);
    unit.renderings.iter().chain(&unit.reference).any(of_volume)
}

/// Scenes of a unit.
struct Stage {
    full: Scene,
    /// Scene of the splats after packing, and the bytes of the packed splats.
    packed: Option<(Scene, u64)>,
    /// Factor, bytes and scene of each downsampled volume.
    downsampled: Vec<(usize, u64, Scene)>,
}

impl Stage {
    fn set_look(&mut self, transfer: &TransferFunction) -> Result<()> {
        let look = Look::new(transfer.clone());
        let packed = self.packed.iter_mut().map(|(scene, _)| scene);
        let downsampled = self.downsampled.iter_mut().map(|(_, _, scene)| scene);
        packed.chain(downsampled).chain([&mut self.full]).try_for_each(|scene| scene.set_look(&look))
    }
}

/// Adds the rows of one transfer function to a record.
struct Rows<'a> {
    transfer: &'a str,
    record: &'a mut Record,
    saw: &'a mut dyn FnMut(&Comparison),
}

impl Rows<'_> {
    fn leave_out(&mut self, what: &str) {
        self.record.left_out.push(format!("{}: {what}", self.transfer));
    }

    fn add(
        &mut self,
        role: Role,
        name: String,
        rendering: &Rendering,
        sights: Vec<Sight>,
    ) -> &mut Comparison {
        let comparison = Comparison {
            transfer: self.transfer.to_owned(),
            rendering: name,
            role,
            mode: rendering.mode.clone(),
            step: rendering.step,
            integrated: rendering.classification.map(|c| c == Classify::Integrated),
            volume_bytes: None,
            packed_bytes: None,
            sights,
        };
        (self.saw)(&comparison);
        self.record.comparisons.push(comparison);
        self.record.comparisons.last_mut().expect("it was just added")
    }
}

/// Pictures from all views with their costs.
type Shots = Vec<(Image, Cost)>;

/// Cameras and size of the pictures.
struct Studio<'a> {
    gpu: &'a Gpu,
    size: u32,
    views: Vec<usize>,
    cameras: Vec<Camera>,
}

impl Studio<'_> {
    fn shoot(&self, scene: &Scene, rendering: &Rendering) -> Result<Shots> {
        let mut renderer = TimedRenderer::new(self.gpu, scene, rendering, self.size, 1, true)?;
        // The first frame creates kernels and sizes buffers; its cost must not count for any other.
        renderer.frame(scene, &self.cameras[..1])?;
        self.cameras
            .iter()
            .map(|&camera| {
                let (cost, _) = renderer.frame(scene, &[camera])?;
                Ok((checked(renderer.picture(0)?, rendering)?, cost))
            })
            .collect()
    }

    fn compare(&self, reference: &Shots, test: &Shots) -> Result<Vec<Sight>> {
        let pairs = self.views.iter().zip(reference).zip(test);
        pairs.map(|((&view, (reference, _)), (test, cost))| sight(view, reference, test, *cost)).collect()
    }
}

/// Returns the picture, or an error if a pixel is not a finite number: no figure of it would mean anything.
pub fn checked(picture: Image, rendering: &Rendering) -> Result<Image> {
    if is_finite(&picture) {
        return Ok(picture);
    }
    let message = format!("a picture of {} has pixels that are no numbers", rendering.name);
    Err(Error::new(Kind::Internal, "VGS-BEN-024", message))
}

/// Compares a picture with its reference.
pub fn sight(view: usize, reference: &Image, test: &Image, cost: Cost) -> Result<Sight> {
    Ok(Sight {
        view,
        mse: mse(reference, test)?,
        ssim: ssim(reference, test)?,
        flip: flip(reference, test)?.mean,
        cost,
    })
}

/// Returns the row of the reference itself, which has no error.
fn equal(studio: &Studio<'_>, shots: &Shots) -> Vec<Sight> {
    let sight = |(&view, (_, cost)): (&usize, &(Image, Cost))| Sight {
        view,
        mse: 0.0,
        ssim: 1.0,
        flip: 0.0,
        cost: *cost,
    };
    studio.views.iter().zip(shots).map(sight).collect()
}

/// Returns the mean squared difference of two pictures.
pub fn mse(reference: &Image, test: &Image) -> Result<f64> {
    Ok(10f64.powf(-0.1 * psnr(reference, test)?))
}

fn against_reference(
    unit: &Unit,
    place: &Place,
    studio: &Studio<'_>,
    stage: &Stage,
    rows: &mut Rows<'_>,
) -> Result<()> {
    let Some(reference) = &unit.reference else { return Ok(()) };
    let wanted = studio.shoot(&stage.full, reference)?;
    if !wanted.iter().any(|(picture, _)| shows_something(picture)) {
        rows.leave_out(&format!("nothing is seen of this case in {}", reference.name));
        return Ok(());
    }
    let row = rows.add(Role::Reference, reference.name.clone(), reference, equal(studio, &wanted));
    row.volume_bytes = mode_row(reference).is_some_and(|row| !row.of_splats).then(|| place.bytes());
    for rendering in &unit.renderings {
        let shots = studio.shoot(&stage.full, rendering)?;
        rows.add(Role::Mode, rendering.name.clone(), rendering, studio.compare(&wanted, &shots)?);
    }
    for (factor, bytes, scene) in &stage.downsampled {
        let shots = studio.shoot(scene, reference)?;
        let name = format!("{} ÷{factor}", reference.mode);
        let row = rows.add(Role::Downsampled, name, reference, studio.compare(&wanted, &shots)?);
        row.volume_bytes = Some(*bytes);
    }
    Ok(())
}

/// Packs and unpacks the splats of a unit of `storage`. Returns the scene of the result and the bytes of the
/// packed splats; `None` for other sections.
fn packed(unit: &Unit, set: &SplatSet, gpu: &Gpu, look: &Look) -> Result<Option<(Scene, u64)>> {
    if unit.section != Section::Storage {
        return Ok(None);
    }
    let packed = Packed::new(&set.splats, None);
    let unpacked = SplatSet { splats: packed.unpack_all(), labels: None, ..set.clone() };
    Ok(Some((Scene::new(gpu, Some(&unpacked), None, look)?, packed.bytes() as u64)))
}

fn storage(unit: &Unit, studio: &Studio<'_>, stage: &Stage, rows: &mut Rows<'_>) -> Result<()> {
    let Some((scene, bytes)) = &stage.packed else { return Ok(()) };
    for rendering in &unit.renderings {
        let full = studio.shoot(&stage.full, rendering)?;
        if !full.iter().any(|(picture, _)| shows_something(picture)) {
            rows.leave_out(&format!("nothing is seen of this case in {}", rendering.name));
            continue;
        }
        let shots = studio.shoot(scene, rendering)?;
        let row = rows.add(Role::Packed, rendering.name.clone(), rendering, studio.compare(&full, &shots)?);
        row.packed_bytes = Some(*bytes);
    }
    Ok(())
}

/// Compares both eyes of a head, rendered by one renderer, with a picture of each eye alone.
fn two_eyes(studio: &Studio<'_>, scene: &Scene, rendering: &Rendering, rows: &mut Rows<'_>) -> Result<()> {
    let mut both = TimedRenderer::new(studio.gpu, scene, rendering, studio.size, 2, true)?;
    let mut one = TimedRenderer::new(studio.gpu, scene, rendering, studio.size, 1, true)?;
    let mut sights = Vec::new();
    for (&view, head) in studio.views.iter().zip(&studio.cameras) {
        let eyes = head.eyes(EYES_MM);
        let (cost, _) = both.frame(scene, &eyes)?;
        for (layer, eye) in (0..).zip(eyes) {
            one.frame(scene, &[eye])?;
            let alone = checked(one.picture(0)?, rendering)?;
            sights.push(sight(view, &alone, &checked(both.picture(layer)?, rendering)?, cost)?);
        }
    }
    rows.add(Role::TwoEyes, format!("{}, one order for two eyes", rendering.name), rendering, sights);
    Ok(())
}
