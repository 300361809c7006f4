//! Where the error is: V̂ − V voxel by voxel, and its figures by label, by tissue and by distance to edges.
//!
//! On the voxel grid, not clipped to any range. Figures weight a voxel with its mask, as the evaluation does, so those of the
//! whole region are the evaluation's own.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::evaluate::Sampler;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::splat::{Field, Splat};
use crate::volume::bricks::SAMPLES;
use crate::volume::distance::distances_mm;
use crate::volume::{Bricks, Labels, Roi, Volume};

/// The error of a field in a region.
pub struct ErrorMap<'a> {
    volume: &'a Volume,
    roi: &'a Roi,
    /// V̂ − V, HU, for each voxel of the volume; 0 outside the region.
    pub hu: Vec<f32>,
    /// Voxels of the region that no splat reaches.
    pub uncovered: usize,
    /// Indices of the region's voxels, ascending.
    region: Vec<usize>,
}

/// Figures of a part of the region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// What part.
    pub name: String,
    /// How many voxels it has.
    pub voxels: usize,
    /// Mean of V̂ − V, HU: what is lost to one side.
    pub mean_hu: f64,
    /// Root mean square of V̂ − V, HU.
    pub rmse_hu: f64,
    /// |V̂ − V| that 99 of 100 voxels do not exceed, HU.
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

/// Upper ends of the bins of distances, mm; the last bin has none.
pub const DISTANCES_MM: [f32; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

/// A gradient is strong from that of this share of the region's voxels on.
const STRONG: f64 = 0.9;

impl<'a> ErrorMap<'a> {
    /// Of splats in voxel coordinates and HU.
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

    /// The whole region.
    pub fn whole(&self) -> Group {
        self.group("region".to_owned(), &self.region)
    }

    /// The voxel with the largest |V̂ − V|; the first of several.
    pub fn worst_voxel(&self) -> usize {
        let larger = |best: usize, &i: &usize| if self.hu[i].abs() > self.hu[best].abs() { i } else { best };
        self.region.iter().fold(self.region[0], larger)
    }

    /// The map as a volume on the grid of the other.
    pub fn volume(&self) -> Volume {
        Volume { samples: self.hu.clone(), labels: BTreeMap::new(), ..self.volume.clone() }
    }

    /// By the label of the voxel, ascending; `label_name` gives each a name.
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

    /// By the HU of the volume, as [`TISSUES`] has them.
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

    /// By the distance to the nearest voxel outside the region (what lies beyond the volume is outside), centre to centre.
    pub fn by_distance_to_boundary(&self) -> Vec<Group> {
        self.by_distance(|i| self.roi.weight[i] <= 0.0, true)
    }

    /// By the distance to the nearest voxel of the region where the volume changes strongly, and the gradient, HU per mm, from
    /// which a change is strong: that of the steepest tenth. No groups where the region is flat.
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

    /// |∇V| at a voxel, HU per mm: central differences, one-sided at the faces of the volume.
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
        // Beside a voxel without a value.
        if steep.is_finite() { steep } else { 0.0 }
    }

    /// Bins of the distance to sites, which lie within a voxel of the region's box; `beyond`: so does all beyond the volume.
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

    /// The group of those that `of` takes, by their place among the region's voxels and by their index; nothing for none.
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
