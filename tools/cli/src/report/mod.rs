//! What a command tells at its end: figures as text and as JSON, and how numbers are written.

pub mod curve;
pub mod errors;
pub mod record;

use engine::fit::evaluate::{Evaluation, Metrics};
use serde::{Serialize, Serializer};

/// How good a set of splats is. The names are part of the interface; all stay at the top level of their object.
#[derive(Clone, Debug, Serialize)]
pub struct Quality {
    /// On the grid.
    #[serde(serialize_with = "decibel")]
    pub psnr_db: f64,
    /// The worst between voxels.
    #[serde(serialize_with = "decibel")]
    pub psnr_min_offset_db: f64,
    /// The mean between voxels.
    #[serde(serialize_with = "decibel")]
    pub psnr_mean_offset_db: f64,
    /// Mean squared error on the grid, squared spans of the range.
    pub mmse: f64,
    /// Root mean square error on the grid, HU.
    pub rmse_hu: f64,
    /// 99th percentile of the absolute error on the grid, HU.
    pub p99_hu: f64,
    /// What the PSNR is over, HU.
    pub range: [f32; 2],
    /// Root mean square of occupancy less mask over ROI and shell, at the offsets between voxels.
    pub occupancy_rmse: f64,
    /// The same on the grid, where the trilinear mask has its kinks.
    pub occupancy_rmse_on_grid: f64,
    /// Overlap of occupancy and mask, on the grid.
    pub soft_dice: f64,
    /// Number of offset grids.
    pub offsets: usize,
}

impl Quality {
    /// Of an evaluation.
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

/// Serialises infinity, which JSON lacks, as "inf".
pub fn decibel<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if *value == f64::INFINITY { serializer.serialize_str("inf") } else { serializer.serialize_f64(*value) }
}

/// A PSNR with its range, as it must always be told.
pub fn psnr(value: f64, [low, high]: [f32; 2]) -> String {
    match (value == f64::INFINITY, high > low) {
        (true, false) => "∞ (range 0)".to_owned(),
        (true, true) => "∞ (exact)".to_owned(),
        (false, _) => format!("{value:.2} dB"),
    }
}

/// The figures of an evaluation as a table; `of` says what their range was taken from.
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

/// Rows under headings, in columns; empty columns of the right are trimmed.
pub fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count());
        cells.chain([heads[column].chars().count()]).max().unwrap_or_default()
    };
    let widths: Vec<usize> = (0..heads.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let padded: Vec<String> = cells
            .zip(&widths)
            .map(|(cell, &w)| format!("{cell}{}", " ".repeat(w.saturating_sub(cell.chars().count()))))
            .collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    let mut out = line(&mut heads.iter().copied());
    for row in rows {
        out.push_str(&line(&mut row.iter().map(String::as_str)));
    }
    out
}

/// Bytes in a unit that people read.
pub fn bytes(n: u64) -> String {
    let n = n as f64;
    let row = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")].into_iter().find(|(unit, _)| n >= *unit);
    match row {
        Some((unit, name)) => format!("{:.1} {name}", n / unit),
        None => format!("{n:.0} bytes"),
    }
}

/// Seconds in units that people read.
pub fn seconds(s: f64) -> String {
    match s {
        s if !s.is_finite() => "?".to_owned(),
        s if s < 0.1 => format!("{:.0} ms", 1e3 * s),
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min {:02.0} s", (s / 60.0).floor(), (s % 60.0).floor()),
        s => format!("{:.0} h {:02.0} min", (s / 3600.0).floor(), (s % 3600.0 / 60.0).floor()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people() {
        for (n, text) in [(12, "12 bytes"), (2_500_000, "2.5 MB"), (7_000_000_000, "7.0 GB")] {
            assert_eq!(bytes(n), text);
        }
        for (s, text) in
            [(0.02, "20 ms"), (1.26, "1.3 s"), (61.2, "61 s"), (150.0, "2 min 30 s"), (1e4, "2 h 46 min")]
        {
            assert_eq!(seconds(s), text);
        }
        assert_eq!(psnr(f64::INFINITY, [5.0, 5.0]), "∞ (range 0)");
        assert_eq!(psnr(31.416, [0.0, 1.0]), "31.42 dB");
    }

    #[test]
    fn tables_align() {
        let text = table(&["", "b"], &[vec!["long".into(), "1".into()], vec!["ü".into(), String::new()]]);
        assert_eq!(text, "      b\nlong  1\nü\n");
    }
}
