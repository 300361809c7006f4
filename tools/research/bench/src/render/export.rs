//! Exports all measurements for other programs, as JSON and CSV.

use std::fmt::Write;

use engine::{Error, Kind, Result};
use serde::Serialize;

use super::config::Config;
use super::plan::Unit;
use super::record::Record;
use super::results::Results;
use crate::cost::Cost;

/// Contents of `render.json`.
#[derive(Serialize)]
struct All<'a> {
    device: &'a str,
    is_cpu: bool,
    quick: bool,
    command: &'a str,
    config: &'a Config,
    units: Vec<Measured<'a>>,
    left_out: &'a [String],
}

#[derive(Serialize)]
struct Measured<'a> {
    unit: &'a Unit,
    record: Option<&'a Record>,
    /// Reason why there is no record.
    skipped: Option<&'a String>,
}

/// Returns configuration, units and records as JSON.
pub fn json(report: &Results<'_>) -> Result<String> {
    let units = report.plan.units.iter().map(|unit| {
        let key = unit.key();
        Measured { unit, record: report.records.get(&key), skipped: report.skipped.get(&key) }
    });
    let all = All {
        device: &report.device.text,
        is_cpu: report.device.is_cpu,
        quick: report.quick,
        command: report.command,
        config: report.config,
        units: units.collect(),
        left_out: &report.plan.left_out,
    };
    serde_json::to_string_pretty(&all)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-026", format!("writing JSON failed: {e}")))
}

const COLUMNS: &str = "section,case,source,splats,size,transfer,rendering,view,\
                       psnr_db,ssim,flip,core_ms,wall_ms,device_ms";

/// Returns CSV with a line for each compared picture and each timed frame. The PSNR of equal pictures is
/// `inf`.
pub fn csv(report: &Results<'_>) -> String {
    let mut out = format!("{COLUMNS}\n");
    for section in report.sections {
        for (unit, record) in report.units(*section) {
            let mut line =
                |transfer: &str, rendering: &str, view: usize, figures: [Option<f64>; 3], cost: &Cost| {
                    let text = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
                    let names = [section.name(), &unit.case.name, &unit.case.source()].map(quoted).join(",");
                    let shown = [transfer, rendering].map(quoted).join(",");
                    let figures = figures.map(text).join(",");
                    let core = text(cost.core_ms);
                    // Writing to a string cannot fail.
                    let _ = writeln!(
                        out,
                        "{names},{},{},{shown},{view},{figures},{core},{},{}",
                        record.splats, unit.part.size, cost.wall_ms, cost.device_ms
                    );
                };
            for row in &record.comparisons {
                for sight in &row.sights {
                    let figures = [Some(sight.psnr()), Some(sight.ssim), Some(sight.flip)];
                    line(&row.transfer, &row.rendering, sight.view, figures, &sight.cost);
                }
            }
            for row in &record.timings {
                for (view, cost) in &row.frames {
                    line(&row.transfer, &row.rendering, *view, [None; 3], cost);
                }
            }
        }
    }
    out
}

/// Quotes a field if it holds a comma, a quote or a line break.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}
