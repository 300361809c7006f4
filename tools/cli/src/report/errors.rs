//! Errors of an evaluation by place: by label, by tissue and by distance to edges.

use engine::fit::errors::{ErrorMap, Group};
use engine::volume::{Labels, Volume};
use serde::Serialize;

use crate::shared::figures::{table, with_unit};

/// Errors of the region and of its parts, on the voxel grid and not clipped to any range. The names are part
/// of the interface.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorsByPlace {
    /// The whole region.
    pub region: Group,
    /// Voxels of the region that no splat reaches.
    pub uncovered_voxels: usize,
    /// Voxel index along x, y, z of the largest |V̂ − V|.
    pub worst_voxel: [usize; 3],
    /// Place of that voxel, mm RAS.
    pub worst_mm: [f64; 3],
    /// Errors by the chosen labels of the mask; empty if none were chosen.
    pub by_label: Vec<Group>,
    /// Errors by the HU of the volume; empty if it is no CT.
    pub by_tissue: Vec<Group>,
    /// Errors by the distance to the nearest voxel outside the region, mm.
    pub by_distance_to_boundary: Vec<Group>,
    /// Errors by the distance to the nearest voxel with a strong gradient, mm.
    pub by_distance_to_edges: Vec<Group>,
    /// Least gradient that counts as strong, HU per mm: that of the steepest tenth of the region.
    pub strong_gradient: f64,
}

impl ErrorsByPlace {
    /// Collects the figures of an error map.
    pub fn of(map: &ErrorMap, volume: &Volume, labels: Option<&Labels>) -> Self {
        let worst = map.worst_voxel();
        let [nx, ny, _] = volume.size;
        let worst_voxel = [worst % nx, worst / nx % ny, worst / (nx * ny)];
        let place = glam::DVec3::from_array(worst_voxel.map(|v| v as f64));
        let (by_distance_to_edges, strong_gradient) = map.by_distance_to_edges();
        ErrorsByPlace {
            region: map.whole(),
            uncovered_voxels: map.uncovered,
            worst_voxel,
            worst_mm: volume.world_from_voxel.transform_point3(place).to_array(),
            by_label: labels.map(|labels| map.by_label(labels)).unwrap_or_default(),
            by_tissue: if volume.is_ct() { map.by_tissue() } else { Vec::new() },
            by_distance_to_boundary: map.by_distance_to_boundary(),
            by_distance_to_edges,
            strong_gradient,
        }
    }

    /// Returns the figures as a table for people.
    pub fn table(&self, volume: &Volume) -> String {
        let unit = volume.unit().text();
        let [x, y, z] = self.worst_voxel;
        let [wx, wy, wz] = self.worst_mm;
        let mut out = format!(
            "where the error is: {}, splats less scan, at the voxels; worst at voxel {x} {y} {z} \
             (R {wx:.1}, A {wy:.1}, S {wz:.1} mm); {} voxels have no splat:\n",
            if unit.is_empty() { "intensities" } else { unit.trim() },
            self.uncovered_voxels,
        );
        let row = |g: &Group| {
            let figures = [g.mean_hu, g.rmse_hu, g.p99_hu, g.worst_hu].map(|v| format!("{v:.2}"));
            [vec![g.name.clone(), g.voxels.to_string()], figures.to_vec()].concat()
        };
        let head = |text: String| vec![text];
        let mut rows = vec![row(&self.region)];
        let edges = format!("by distance to gradients from {:.1}{unit}/mm", self.strong_gradient);
        for (name, groups) in [
            ("by label".to_owned(), &self.by_label),
            ("by tissue".to_owned(), &self.by_tissue),
            ("by distance to the region's outside".to_owned(), &self.by_distance_to_boundary),
            (edges, &self.by_distance_to_edges),
        ] {
            if !groups.is_empty() {
                rows.push(head(name));
                rows.extend(groups.iter().map(|group| {
                    let mut cells = row(group);
                    cells[0].insert_str(0, "  ");
                    cells
                }));
            }
        }
        let [mean, rmse, within, worst] =
            ["mean", "RMSE", "99 % within", "worst"].map(|name| with_unit(name, unit));
        out += &table(&["", "voxels", &mean, &rmse, &within, &worst], &rows);
        out
    }
}
