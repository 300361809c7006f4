//! Quality of a set of splats: the figures that `fit` and `eval` print and record.

use engine::fit::evaluate::{Evaluation, Metrics};
use serde::Serialize;

use crate::shared::figures::{psnr, table, with_unit};

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
    /// Mean distance of the splats' outline from the mask's, voxels and mm; null without offsets.
    pub outline_voxels: Option<f64>,
    pub outline_mm: Option<f64>,
    /// Number of offset grids.
    pub offsets: usize,
}

impl Quality {
    /// Returns the figures of an evaluation.
    pub fn of(evaluation: &Evaluation) -> Self {
        let grid = &evaluation.on_grid;
        let outline = evaluation.outline_apart();
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
            outline_voxels: outline.map(|[voxels, _]| voxels),
            outline_mm: outline.map(|[_, mm]| mm),
            offsets: evaluation.between.len(),
        }
    }
}

/// Describes in plain words how near what is shown is to the scan.
pub fn quality_text(evaluation: &Evaluation) -> String {
    let Evaluation { on_grid, range, unit, .. } = evaluation;
    let mut out = format!(
        "99 % of the voxels are within {:.1}{unit} of the scan; the error is {:.1}{unit} (root mean square)\n",
        on_grid.p99_hu, on_grid.rmse_hu
    );
    match evaluation.outline_apart() {
        Some([0.0, _]) => out.push_str("outline: exactly the mask's\n"),
        Some([voxels, mm]) => {
            out.push_str(&format!("outline: {voxels:.2} voxels ({mm:.2} mm) from the mask's on average\n"));
        }
        None => {}
    }
    let [low, high] = range;
    out.push_str(&format!(
        "PSNR over {low} to {high}{unit}: {} at the voxels",
        psnr(on_grid.psnr_db, *range)
    ));
    if !evaluation.between.is_empty() {
        out.push_str(&format!(
            "; between them {} in the mean and {} at the worst of {} offsets",
            psnr(evaluation.mean_psnr_db(), *range),
            psnr(evaluation.worst_psnr_db(), *range),
            evaluation.between.len()
        ));
    }
    out.push('\n');
    out
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
        rows.push(row(format!("{x:+.2} {y:+.2} {z:+.2} voxels off"), m));
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
    let [rmse, within] = ["RMSE", "99 % within"].map(|name| with_unit(name, unit));
    let heads = ["", "PSNR", &rmse, &within, "mask RMSE, 0 to 1", "soft Dice, 0 to 1"];
    format!("PSNR over {low} to {high}{unit} ({of}):\n{}", table(&heads, &rows))
}
