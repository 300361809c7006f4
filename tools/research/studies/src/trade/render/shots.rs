//! Renders one case through one transfer function, and measures each picture's error and cost.

use engine::Result;
use engine::fit::FitConfig;
use engine::gpu::Gpu;
use engine::image::Image;
use engine::render::{Camera, Frames, Look, Precision, QualityLevel, Scene, Settings, VolumeSource, mode};
use engine::splat::SplatSet;
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices};
use serde::{Deserialize, Serialize};

use super::plan::Choice;
use bench::cost::{self, Cost};
use bench::render::accuracy::{checked, sight};
use bench::render::config::{Case, Classify, Orbit, Rendering, Transfer};
use bench::render::record::Sight;
use bench::render::scenes::{Place, TimedRenderer, check_validation, shows_something};
use bench::store::{Keep, hash};

/// Returns the rendering of the CT itself, in steps of a twentieth of a voxel: the reference of all others.
fn reference() -> Rendering {
    Rendering {
        name: "reference".into(),
        mode: "volume".into(),
        step: 0.05,
        classification: Some(Classify::Point),
        computed: false,
    }
}

/// Case through a transfer function, with all that its figures depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Volume and region.
    pub case: Case,
    /// Fit of its splats.
    pub fit: FitConfig,
    /// Fit for the grid with as many splats.
    pub grid_fit: FitConfig,
    /// Transfer function.
    pub transfer: Transfer,
    /// Choices to render.
    pub choices: Vec<Choice>,
    /// Edge of the full pictures, pixels.
    pub size: u32,
    /// All views.
    pub orbit: Orbit,
    /// Indices of the views that are rendered.
    pub views: Vec<usize>,
    /// Device and driver.
    pub device: String,
}

impl Unit {
    /// Returns the name of its file without the extension.
    pub fn key(&self) -> String {
        let plain = |text: &str| text.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        format!("{}-{}-{}", plain(&self.case.name), plain(&self.transfer.name), hash(self))
    }

    /// Returns a title for people.
    pub fn title(&self) -> String {
        format!("{}, {}", self.case.name, self.transfer.name)
    }
}

/// Pictures of one choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChoiceRow {
    /// Choice that was rendered.
    pub choice: Choice,
    /// Comparisons with the reference, one for each view.
    pub sights: Vec<Sight>,
}

/// Result of a unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Unit that was measured.
    pub unit: Unit,
    /// Number of splats of the scene, and of those that the transfer function can show: the others are never
    /// touched.
    pub splats: [usize; 2],
    /// Cost of the reference itself, one for each view.
    pub reference: Vec<Cost>,
    /// Pictures by choice; empty if the transfer function shows nothing of the case.
    pub rows: Vec<ChoiceRow>,
}

impl Keep for Record {
    fn key(&self) -> String {
        self.unit.key()
    }
}

/// Renders all pictures of a unit, of splats of both of its fits, and compares them with the reference.
pub fn measure(unit: &Unit, place: &Place, set: &SplatSet, grid_set: &SplatSet, gpu: &Gpu) -> Result<Record> {
    let look = Look::new(place.transfer(&unit.transfer)?);
    let (volume, roi) =
        volume::shown(&place.volume, Some(&place.roi), BetweenSlices::default(), Edges::default());
    let ct = VolumeSource { volume: &volume, roi: roi.as_deref() };
    let mut full = Scene::new(gpu, Some(set), Some(&ct), &look)?;
    let packed = Scene::with_precision(gpu, Some(set), None, &look, Precision::Packed)?;
    let of_grid = Scene::new(gpu, Some(grid_set), None, &look)?;
    let cameras = place.cameras(&unit.orbit, &unit.views)?;
    let active = full.splats.as_ref().map_or(Ok(0), |splats| splats.active_count())?;
    let mut record = Record {
        unit: unit.clone(),
        splats: [set.splats.len(), active],
        reference: Vec::new(),
        rows: Vec::new(),
    };
    let wanted = references(unit, gpu, &full, &cameras)?;
    record.reference = wanted.iter().map(|(_, cost)| *cost).collect();
    if !wanted.iter().any(|(picture, _)| shows_something(picture)) {
        return Ok(record);
    }
    for choice in &unit.choices {
        let count = (set.splats.len() as f64 * choice.splats).ceil() as usize;
        full.set_splat_budget((choice.splats < 1.0).then_some(count))?;
        let scene = match choice {
            Choice { packed: true, .. } => &packed,
            Choice { of_grid: true, .. } => &of_grid,
            _ => &full,
        };
        let shots = shoot(unit, gpu, scene, choice, &cameras)?;
        let sights =
            unit.views.iter().zip(&wanted).zip(shots).map(|((&view, (wanted, _)), (found, cost))| {
                sight(view, &wanted.over([0.0; 3]), &found, cost)
            });
        record.rows.push(ChoiceRow { choice: choice.clone(), sights: sights.collect::<Result<_>>()? });
    }
    check_validation(gpu)?;
    Ok(record)
}

fn references(unit: &Unit, gpu: &Gpu, scene: &Scene, cameras: &[Camera]) -> Result<Vec<(Image, Cost)>> {
    let rendering = reference();
    let mut renderer = TimedRenderer::new(gpu, scene, &rendering, unit.size, 1, true)?;
    renderer.frame(scene, &cameras[..1])?;
    let shot = |&camera: &Camera| {
        let (cost, _) = renderer.frame(scene, &[camera])?;
        Ok((checked(renderer.picture(0)?, &rendering)?, cost))
    };
    cameras.iter().map(shot).collect()
}

/// Renders pictures in full size over black, and returns them with their costs.
fn shoot(
    unit: &Unit,
    gpu: &Gpu,
    scene: &Scene,
    choice: &Choice,
    cameras: &[Camera],
) -> Result<Vec<(Image, Cost)>> {
    let levels = [QualityLevel { mode: mode(&choice.mode)?.name, quality: choice.quality(), cost: 1.0 }];
    let settings = Settings { step: choice.settings_step(), precise: true, ..Settings::new([unit.size; 2]) };
    let mut frames = Frames::new(gpu, scene, &settings, &levels)?;
    // A frame that needs more room than those before it lacks splats.
    for camera in cameras {
        frames.warm_up(scene, &[*camera])?;
    }
    let shot = |&camera: &Camera| {
        let mut size = [0; 2];
        let (cost, _) = cost::measure(gpu, || {
            let frame = frames.begin(scene, 0)?;
            size = frame.size.map(|n| n as usize);
            let ticket = frames.submit(frame, scene, &[camera])?;
            gpu.wait(ticket)
        })?;
        frames.finished()?;
        let all = frames.target.size().map(|n| n as usize);
        let picture = Image { size: all, pixels: frames.target.read_colour(0)? };
        let named = Rendering { name: choice.name(), ..reference() };
        Ok((checked(enlarged(&picture, size), &named)?.over([0.0; 3]), cost))
    };
    cameras.iter().map(shot).collect()
}

/// Enlarges the upper left corner of a picture, of size `part`, to the size of the whole with bilinear
/// interpolation.
fn enlarged(picture: &Image, part: [usize; 2]) -> Image {
    let [width, height] = picture.size;
    let at = |x: usize, y: usize| picture.pixels[y * width + x];
    let place = |i: usize, all: usize, part: usize| {
        let x = ((i as f64 + 0.5) * part as f64 / all as f64 - 0.5).clamp(0.0, part as f64 - 1.0);
        let low = x.floor() as usize;
        (low, (low + 1).min(part - 1), (x - x.floor()) as f32)
    };
    let pixels = (0..width * height)
        .map(|i| {
            let (x0, x1, u) = place(i % width, width, part[0]);
            let (y0, y1, v) = place(i / width, height, part[1]);
            std::array::from_fn(|c| {
                let upper = at(x0, y0)[c] * (1.0 - u) + at(x1, y0)[c] * u;
                let lower = at(x0, y1)[c] * (1.0 - u) + at(x1, y1)[c] * u;
                upper * (1.0 - v) + lower * v
            })
        })
        .collect();
    Image { size: picture.size, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_is_enlarged_as_a_sampler_does() {
        let row = [[0.0; 4], [1.0; 4], [9.0; 4], [9.0; 4]];
        let picture = Image { size: [4, 2], pixels: [row, row].concat() };
        let wide = enlarged(&picture, [2, 1]);
        let first: Vec<f32> = wide.pixels[..4].iter().map(|p| p[0]).collect();
        assert_eq!(first, [0.0, 0.25, 0.75, 1.0], "what lies beyond the corner does not bleed in");
        assert_eq!(enlarged(&picture, [4, 2]).pixels, picture.pixels);
    }
}
