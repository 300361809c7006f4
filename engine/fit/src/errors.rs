//! Error maps: V̂ − V at every voxel of a region, and its statistics by label, by tissue and by distance to
//! edges.
//!
//! Errors are taken on the voxel grid and are not clipped to any range. Means weight a voxel by its mask, as
//! the evaluation does, so the RMSE of the whole region is that of the evaluation as long as the evaluation's
//! range clips nothing. Percentiles and maxima count every voxel alike.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::evaluate::Sampler;
use base::error::Result;
use gpu::Gpu;
use splat::{Field, Splat};
use volume::bricks::SAMPLES;
use volume::distance::distances_mm;
use volume::{Bricks, Labels, Roi, Volume};

/// The error of a field in a region.
pub struct ErrorMap<'a> {
    volume: &'a Volume,
    roi: &'a Roi,
    /// V̂ − V, HU, for each voxel of the volume; 0 outside the region.
    pub hu: Vec<f32>,
    /// Number of voxels of the region that no splat reaches.
    pub uncovered: usize,
    /// Indices of the region's voxels, ascending.
    region: Vec<usize>,
}

/// Error statistics of a part of the region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Name of the part.
    pub name: String,
    /// Number of voxels.
    pub voxels: usize,
    /// Mean of V̂ − V, HU: the bias.
    pub mean_hu: f64,
    /// Root mean square of V̂ − V, HU.
    pub rmse_hu: f64,
    /// 99th percentile of |V̂ − V| over the voxels, HU.
    pub p99_hu: f64,
    /// Largest |V̂ − V|, HU.
    pub worst_hu: f64,
}

/// Tissues of a CT by their HU, each from its lower bound up to the next.
pub const TISSUES: [(&str, f32); 6] = [
    ("air", f32::NEG_INFINITY),
    ("lung", -900.0),
    ("fat", -200.0),
    ("soft tissue", -30.0),
    ("bone", 200.0),
    ("metal", 3000.0),
];

/// Upper ends of the distance bins, mm; one more bin takes all that lies beyond.
pub const DISTANCES_MM: [f32; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

/// Quantile of the region's gradients from which a gradient counts as strong.
const STRONG: f64 = 0.9;

impl<'a> ErrorMap<'a> {
    /// Computes the error map of `splats`, given in voxel coordinates and HU.
    pub fn new(gpu: &Gpu, splats: &[Splat], field: &Field, volume: &'a Volume, roi: &'a Roi) -> Result<Self> {
        let bricks = Bricks::around(roi, 0);
        let got = Sampler::new(gpu, splats, field, &bricks)?.sample([0.0; 3])?;
        let mut hu = vec![0.0; volume.len()];
        let mut uncovered = 0;
        for (i, sample) in got.iter().enumerate() {
            let (slot, morton) = (i / SAMPLES, i % SAMPLES);
            if !bricks.is_active(slot, morton) {
                continue;
            }
            let [x, y, z] = bricks.voxel(slot, morton).to_array().map(|v| v as usize);
            let voxel = volume.index(x, y, z);
            hu[voxel] = sample.hu - volume.samples[voxel];
            uncovered += usize::from(sample.weight == 0.0);
        }
        let region = (0..roi.weight.len()).filter(|&i| roi.weight[i] > 0.0).collect();
        Ok(ErrorMap { volume, roi, hu, uncovered, region })
    }

    /// Computes the error map of a field that returns V and O at a place in voxel coordinates.
    pub fn of_field(field: impl Fn(DVec3) -> (f64, f64) + Sync, volume: &'a Volume, roi: &'a Roi) -> Self {
        let [nx, ny, _] = volume.size;
        let region: Vec<usize> = (0..roi.weight.len()).filter(|&i| roi.weight[i] > 0.0).collect();
        let at =
            |&i: &usize| field(DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64));
        let found: Vec<(f64, f64)> = region.par_iter().map(at).collect();
        let mut hu = vec![0.0; volume.len()];
        for (&voxel, (value, _)) in region.iter().zip(&found) {
            hu[voxel] = *value as f32 - volume.samples[voxel];
        }
        let uncovered = found.iter().filter(|(_, occupancy)| *occupancy == 0.0).count();
        ErrorMap { volume, roi, hu, uncovered, region }
    }

    /// Returns the statistics of the whole region.
    pub fn whole(&self) -> Group {
        self.group("region".to_owned(), &self.region)
    }

    /// Returns the index of the voxel with the largest |V̂ − V|, the first of several.
    pub fn worst_voxel(&self) -> usize {
        let larger = |best: usize, &i: &usize| if self.hu[i].abs() > self.hu[best].abs() { i } else { best };
        self.region.iter().fold(self.region[0], larger)
    }

    /// Returns the error map as a volume on the grid of the fitted one.
    pub fn volume(&self) -> Volume {
        Volume { samples: self.hu.clone(), labels: BTreeMap::new(), ..self.volume.clone() }
    }

    /// Returns the statistics by label, in ascending order. Each voxel has the label nearest to it in the
    /// world; a group is named by the number of its label and, where there is one, the label's name.
    pub fn by_label(&self, labels: &Labels) -> Vec<Group> {
        let [nx, ny, _] = self.volume.size;
        let world = |i: &usize| {
            let voxel = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
            self.volume.world_from_voxel.transform_point3(voxel)
        };
        let of: Vec<u8> = self.region.par_iter().map(|i| labels.nearest(world(i))).collect();
        (1..=u8::MAX)
            .map(|label| {
                let name =
                    labels.names.get(&label).map_or(label.to_string(), |name| format!("{label} {name}"));
                (name, label)
            })
            .filter_map(|(name, label)| self.part(name, |at, _| of[at] == label))
            .collect()
    }

    /// Returns the statistics by tissue: the HU of the volume in the classes of [`TISSUES`].
    pub fn by_tissue(&self) -> Vec<Group> {
        let class = |v: f32| TISSUES.iter().rposition(|(_, low)| v >= *low).unwrap_or_default();
        let text = |k: usize| match (TISSUES[k], TISSUES.get(k + 1)) {
            ((name, low), Some((_, high))) if low.is_infinite() => format!("{name}, below {high} HU"),
            ((name, low), Some((_, high))) => format!("{name}, {low} to {high} HU"),
            ((name, low), None) => format!("{name}, from {low} HU"),
        };
        (0..TISSUES.len())
            .filter_map(|k| self.part(text(k), |_, i| class(self.volume.samples[i]) == k))
            .collect()
    }

    /// Returns the statistics by the distance to the nearest voxel outside the region, centre to centre. What
    /// lies beyond the volume is outside.
    pub fn by_distance_to_boundary(&self) -> Vec<Group> {
        self.by_distance(|i| self.roi.weight[i] <= 0.0, true)
    }

    /// Returns the statistics by the distance to the nearest voxel of the region with a strong gradient, and
    /// the least gradient that counts as strong, HU per mm: that of the steepest tenth. Returns no groups if
    /// the region is flat.
    pub fn by_distance_to_edges(&self) -> (Vec<Group>, f64) {
        let steepness: Vec<f32> = self.region.par_iter().map(|&i| self.steepness(i)).collect();
        let mut sorted = steepness.clone();
        let at = ((sorted.len() - 1) as f64 * STRONG).round() as usize;
        let strong = *sorted.select_nth_unstable_by(at, f32::total_cmp).1;
        // Where most of the region is flat, what is not flat is an edge.
        let strong = if strong > 0.0 { strong } else { f32::MIN_POSITIVE };
        let mut edge = vec![false; self.hu.len()];
        self.region.iter().zip(&steepness).for_each(|(&i, &steep)| edge[i] = steep >= strong);
        if !edge.contains(&true) {
            return (Vec::new(), 0.0);
        }
        (self.by_distance(|i| edge[i], false), f64::from(strong))
    }

    /// Returns |∇V| at voxel `i`, HU per mm, by central differences, one-sided at the faces of the volume; 0
    /// where a neighbour is not finite.
    fn steepness(&self, i: usize) -> f32 {
        let [nx, ny, nz] = self.volume.size;
        let place = [i % nx, i / nx % ny, i / (nx * ny)];
        let slope = |axis: usize, count: usize, stride: usize| {
            let (low, high) = (place[axis].min(1), (count - 1 - place[axis]).min(1));
            if low + high == 0 {
                return 0.0;
            }
            let value = |i: usize| f64::from(self.volume.samples[i]);
            (value(i + high * stride) - value(i - low * stride)) / (low + high) as f64
        };
        let by_voxel = DVec3::new(slope(0, nx, 1), slope(1, ny, nx), slope(2, nz, nx * ny));
        let to_mm: DMat3 = self.volume.world_from_voxel.matrix3.inverse().transpose();
        let steep = (to_mm * by_voxel).length() as f32;
        // A neighbour is not finite.
        if steep.is_finite() { steep } else { 0.0 }
    }

    /// Returns the statistics by the distance to the nearest voxel for which `site` (given the voxel's index)
    /// is true, in the bins of [`DISTANCES_MM`]. Sites are searched in the region's bounding box and one
    /// voxel around it; if `beyond` is true, everything beyond the volume is a site.
    fn by_distance(&self, site: impl Fn(usize) -> bool + Sync, beyond: bool) -> Vec<Group> {
        let size = self.volume.size;
        let place = |i: usize| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
        let around = |at: usize| at as i64 - 1..at as i64 + 2;
        let mut axes: [Range<i64>; 3] = place(self.region[0]).map(around);
        for &i in &self.region {
            for (axis, at) in axes.iter_mut().zip(place(i)) {
                let near = around(at);
                *axis = axis.start.min(near.start)..axis.end.max(near.end);
            }
        }
        let extent: [usize; 3] = std::array::from_fn(|k| (axes[k].end - axes[k].start) as usize);
        let distances = distances_mm(extent, self.volume.spacing_mm(), |j| {
            let at = [j % extent[0], j / extent[0] % extent[1], j / (extent[0] * extent[1])];
            let voxel: [i64; 3] = std::array::from_fn(|k| axes[k].start + at[k] as i64);
            let inside = (0..3).all(|k| (0..size[k] as i64).contains(&voxel[k]));
            if inside {
                let [x, y, z] = voxel.map(|v| v as usize);
                site(self.volume.index(x, y, z))
            } else {
                beyond
            }
        });
        let distance = |i: usize| {
            let at: [usize; 3] = std::array::from_fn(|k| (place(i)[k] as i64 - axes[k].start) as usize);
            distances[(at[2] * extent[1] + at[1]) * extent[0] + at[0]]
        };
        let bin = |mm: f32| DISTANCES_MM.iter().position(|end| mm <= *end).unwrap_or(DISTANCES_MM.len());
        let bins: Vec<usize> = self.region.par_iter().map(|&i| bin(distance(i))).collect();
        let text = |k: usize| match (k.checked_sub(1).map(|k| DISTANCES_MM[k]), DISTANCES_MM.get(k)) {
            (None, Some(end)) => format!("up to {end} mm"),
            (Some(from), Some(end)) => format!("{from} to {end} mm"),
            (from, None) => format!("beyond {} mm", from.unwrap_or_default()),
        };
        (0..=DISTANCES_MM.len()).filter_map(|k| self.part(text(k), |at, _| bins[at] == k)).collect()
    }

    /// Returns the statistics of the voxels that `of` accepts, given their place among the region's voxels
    /// and their index; nothing if it accepts none.
    fn part(&self, name: String, of: impl Fn(usize, usize) -> bool) -> Option<Group> {
        let voxels: Vec<usize> =
            self.region.iter().enumerate().filter(|&(at, &i)| of(at, i)).map(|(_, &i)| i).collect();
        (!voxels.is_empty()).then(|| self.group(name, &voxels))
    }

    fn group(&self, name: String, voxels: &[usize]) -> Group {
        let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for &i in voxels {
            let (m, error) = (f64::from(self.roi.weight[i]), f64::from(self.hu[i]));
            weight += m;
            sum += m * error;
            squares += m * error * error;
        }
        let mut sizes: Vec<f32> = voxels.iter().map(|&i| self.hu[i].abs()).collect();
        let at = ((sizes.len() - 1) as f64 * 0.99).ceil() as usize;
        let p99 = *sizes.select_nth_unstable_by(at, f32::total_cmp).1;
        let worst = sizes.iter().copied().fold(0.0, f32::max);
        Group {
            name,
            voxels: voxels.len(),
            mean_hu: sum / weight,
            rmse_hu: (squares / weight).sqrt(),
            p99_hu: f64::from(p99),
            worst_hu: f64::from(worst),
        }
    }
}
