//! The splats of a scene on the device, and which of them a transfer function can show.
//!
//! A splat whose own intensity is transparent still holds down the field beside it, so it may only be left out where
//! nothing that it reaches is visible. Within its support the field is a weighted mean of the intensities of the splats
//! that reach there, too; [`intervals`] bounds these, once for a scene. A transfer function then drops exactly the splats
//! whose interval it shows nothing of.

use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use shaders_glsl::types::Centre;

use super::centres::centres;
use super::look::LookBuffers;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::passes::Activity;
use crate::splat::harmonics::basis_count;
use crate::splat::{Activations, Field, Harmonics, Splat, SplatSet};

/// Most cells of the grid that intervals are found with.
const MOST_CELLS: f64 = 4e6;

/// What is particular to standard splats, those of ordinary 3D Gaussian splatting: they have colours instead of an
/// intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Standard {
    /// Spherical harmonics of each colour.
    pub(super) coefficients: u32,
}

/// The splats of a scene.
pub struct Cloud {
    rows: Buffer<Splat>,
    /// How they add up.
    pub field: Field,
    /// Number of splats.
    pub count: usize,
    /// Standard deviation of the middle splat along its shortest axis, mm: what steps along a ray are measured in.
    pub sigma_mm: f64,
    /// Least and greatest intensity.
    pub range: [f64; 2],
    /// Corners of the box around all supports, mm in the space of the scene.
    pub bounds: [DVec3; 2],
    intervals: Buffer<[f32; 2]>,
    labels: Buffer<u32>,
    activity: Activity,
    /// Only mode alpha needs them.
    centres: OnceLock<Buffer<Centre>>,
    /// Coefficients of spherical harmonics, two halves a word; of standard splats only.
    harmonics: Buffer<u32>,
    standard: Option<Standard>,
}

impl Cloud {
    pub(super) fn new(gpu: &Gpu, set: &SplatSet) -> Result<Self> {
        let splats = &set.splats;
        let count = splats.len();
        let reach = reaches(splats, set.field.kernel.support_q());
        let mut shortest: Vec<f32> =
            splats.iter().map(|s| s.scale().into_iter().fold(f32::INFINITY, f32::min)).collect();
        let middle = count / 2;
        let sigma_mm = match shortest.is_empty() {
            true => 1.0,
            false => f64::from(*shortest.select_nth_unstable_by(middle, f32::total_cmp).1),
        };
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for (splat, reach) in splats.iter().zip(&reach) {
            let c = f64::from(splat.intensity);
            range = [range[0].min(c), range[1].max(c)];
            let mean = Vec3::from_array(splat.mean);
            bounds = [bounds[0].min((mean - reach).as_dvec3()), bounds[1].max((mean + reach).as_dvec3())];
        }
        if count == 0 {
            (range, bounds) = ([0.0, 1.0], [DVec3::splat(-1.0), DVec3::ONE]);
        }
        let labels: Vec<u32> = match &set.labels {
            Some(labels) => labels.iter().map(|&l| u32::from(l)).collect(),
            None => vec![0; count],
        };
        // No transfer function acts on colours: `mark_active` takes an interval that ends before it begins for that.
        let intervals = match set.colours {
            Some(_) => vec![[1.0, 0.0]; count],
            None => intervals(splats, &reach),
        };
        Ok(Cloud {
            rows: gpu.upload("splats", "splats", splats)?,
            field: set.field,
            count,
            sigma_mm,
            range,
            bounds,
            intervals: gpu.upload("intervals of intensity", "splats", &intervals)?,
            labels: gpu.upload("labels", "splats", &labels)?,
            activity: Activity::new(gpu, count)?,
            centres: OnceLock::new(),
            harmonics: gpu.upload(
                "spherical harmonics",
                "splats",
                &set.colours.as_ref().map_or(vec![0], halves),
            )?,
            standard: set.colours.as_ref().map(|c| Standard { coefficients: basis_count(c.degree) as u32 }),
        })
    }

    /// Lists what a look can show. To be recorded when the look has changed.
    pub(super) fn record_activity(&mut self, recorder: &mut Recorder, look: &LookBuffers) {
        self.activity.record(recorder, &look.rows, &look.visible, &self.intervals, &self.labels);
    }

    /// Rows in mm in the space of the scene.
    pub(super) fn rows(&self) -> &Buffer<Splat> {
        &self.rows
    }

    /// What the splats show: the field at their centres, or their spherical harmonics where they are standard splats; the
    /// other of the two is of no use. The first call makes it, and waits for the device.
    pub(super) fn faces(&self, gpu: &Gpu) -> Result<(&Buffer<Centre>, &Buffer<u32>)> {
        if let Some(made) = self.centres.get() {
            return Ok((made, &self.harmonics));
        }
        let rows = match self.standard {
            Some(_) => vec![Centre::default()],
            None => centres(&self.rows.read()?, &self.field),
        };
        let made = gpu.upload("field at the centres", "splats", &rows)?;
        Ok((self.centres.get_or_init(|| made), &self.harmonics))
    }

    /// Whether these are standard splats, and of which kind.
    pub(super) fn standard(&self) -> Option<Standard> {
        self.standard
    }

    /// Indices of the splats that the look can show, and in one element how many they are.
    pub(super) fn active(&self) -> (&Buffer<u32>, &Buffer<u32>) {
        (&self.activity.active, &self.activity.count)
    }

    /// How many splats the look can show. Waits for the device.
    pub fn active_count(&self) -> Result<usize> {
        Ok(self.activity.count.read()?[0] as usize)
    }
}

/// Coefficients as halves, two in a word.
fn halves(colours: &Harmonics) -> Vec<u32> {
    let half = |v: &f32| u32::from(half::f16::from_f32(*v).to_bits());
    colours.coefficients.chunks(2).map(|pair| half(&pair[0]) | pair.get(1).map_or(0, half) << 16).collect()
}

/// Half sizes of the boxes around the supports, mm.
fn reaches(splats: &[Splat], support_q: f64) -> Vec<Vec3> {
    splats
        .par_iter()
        .map(|splat| {
            let axes = splat.axes();
            let scale = DVec3::from_array(splat.scale().map(f64::from));
            let squares = (0..3).map(|k| (axes.col(k) * scale[k]).powf(2.0)).sum::<DVec3>();
            (squares * support_q).powf(0.5).as_vec3()
        })
        .collect()
}

/// Bounds of the field within the support of each splat: least and greatest intensity of all splats whose boxes share a
/// cell of a regular grid with its own.
fn intervals(splats: &[Splat], reach: &[Vec3]) -> Vec<[f32; 2]> {
    let mut sizes: Vec<f32> = reach.iter().map(|r| r.max_element()).collect();
    if sizes.is_empty() {
        return Vec::new();
    }
    let middle = sizes.len() / 2;
    let typical = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for splat in splats {
        let mean = Vec3::from_array(splat.mean);
        (low, high) = (low.min(mean), high.max(mean));
    }
    // What reaches beyond the box of the centres falls into its outermost cells.
    let extent = high - low;
    let volume =
        f64::from(extent.x + typical) * f64::from(extent.y + typical) * f64::from(extent.z + typical);
    let edge = typical.max((volume / MOST_CELLS).cbrt() as f32).max(f32::MIN_POSITIVE);
    let cells = (extent / edge).floor().as_uvec3() + 1;
    let span = |i: usize| {
        let mean = Vec3::from_array(splats[i].mean);
        let at = |x: Vec3| ((x - low) / edge).floor().max(Vec3::ZERO).as_uvec3().min(cells - 1);
        (at(mean - reach[i]), at(mean + reach[i]))
    };
    let each = |i: usize, visit: &mut dyn FnMut(usize)| {
        let (from, to) = span(i);
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    visit(((z * cells.y + y) * cells.x + x) as usize);
                }
            }
        }
    };
    let join = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let mut bounds = vec![[f32::INFINITY, f32::NEG_INFINITY]; (cells.x * cells.y * cells.z) as usize];
    for (i, splat) in splats.iter().enumerate() {
        each(i, &mut |cell| bounds[cell] = join(bounds[cell], [splat.intensity; 2]));
    }
    (0..splats.len())
        .into_par_iter()
        .map(|i| {
            let mut own = [splats[i].intensity; 2];
            each(i, &mut |cell| own = join(own, bounds[cell]));
            own
        })
        .collect()
}
