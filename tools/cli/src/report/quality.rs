//! Quality of a set of splats: the figures that `fit` and `eval` print and record.

use engine::fit::evaluate::{Evaluation, Metrics};
use serde::Serialize;

use crate::shared::figures::{psnr, table};

/// Quality of a set of splats. The names are part of the interface; all stay at the top level of their JSON
/// object.
#[derive(Clone, Debug, Serialize)]
pub struct Quality {
    /// PSNR on the grid, dB.
    pub psnr_db: f64,
    /// Worst PSNR between voxels, dB.
    pub psnr_min_offset_db: f64,
    /// Mean PSNR between voxels, dB.
    pub psnr_mean_offset_db: f64,
    /// Mean squared error on the grid, relative to the square of the range.
    pub mmse: f64,
    /// Root mean square error on the grid, HU.
    pub rmse_hu: f64,
    /// 99th percentile of the absolute error on the grid, HU.
    pub p99_hu: f64,
    /// Range of the PSNR, HU.
    pub range: [f32; 2],
    /// Root mean square of occupancy minus mask over ROI and shell, at the offsets between voxels.
    pub occupancy_rmse: f64,
    /// The same error on the grid, where the trilinear mask has its kinks.
    pub occupancy_rmse_on_grid: f64,
    /// Overlap of occupancy and mask on the grid.
    pub soft_dice: f64,
    /// Number of offset grids.
    pub offsets: usize,
}

impl Quality {
    /// Returns the figures of an evaluation.
    pub fn of(evaluation: &Evaluation) -> Self {
        let grid = &evaluation.on_grid;
        Quality {
            psnr_db: grid.psnr_db,
            psnr_min_offset_db: evaluation.worst_psnr_db(),
            psnr_mean_offset_db: evaluation.mean_psnr_db(),
            mmse: grid.mmse,
            rmse_hu: grid.rmse_hu,
            p99_hu: grid.p99_hu,
            range: evaluation.range,
            occupancy_rmse: evaluation.occupancy_rmse(),
            occupancy_rmse_on_grid: grid.occupancy_rmse,
            soft_dice: grid.soft_dice,
            offsets: evaluation.between.len(),
        }
    }
}

/// Formats the figures of an evaluation as a table; `of` is the origin of their range.
pub fn quality_table(evaluation: &Evaluation, of: &str) -> String {
    let row = |name: String, m: &Metrics| {
        vec![
            name,
            psnr(m.psnr_db, evaluation.range),
            format!("{:.2}", m.rmse_hu),
            format!("{:.2}", m.p99_hu),
            format!("{:.4}", m.occupancy_rmse),
            format!("{:.4}", m.soft_dice),
        ]
    };
    let mut rows = vec![row("at the voxels".into(), &evaluation.on_grid)];
    for m in &evaluation.between {
        let [x, y, z] = m.offset;
        rows.push(row(format!("offset {x:+.2} {y:+.2} {z:+.2}"), m));
    }
    if !evaluation.between.is_empty() {
        let worst = psnr(evaluation.worst_psnr_db(), evaluation.range);
        let mean = psnr(evaluation.mean_psnr_db(), evaluation.range);
        let occupancy = format!("{:.4}", evaluation.occupancy_rmse());
        rows.push(["worst between", &worst, "", "", "", ""].map(str::to_owned).to_vec());
        rows.push(["mean between", &mean, "", "", &occupancy, ""].map(str::to_owned).to_vec());
    }
    let [low, high] = evaluation.range;
    let unit = evaluation.unit;
    let rmse = if unit.is_empty() { "RMSE" } else { "RMSE, HU" };
    let heads = ["", "PSNR", rmse, "99 % within", "occupancy RMSE", "soft Dice"];
    format!("PSNR over {low} to {high}{unit} ({of}):\n{}", table(&heads, &rows))
}
