//! The paper's Table 5 with our own frames beside it.

use super::config::Section;
use super::figures::{dash, ms, thousands};
use super::plan::{Source, Unit};
use super::record::{Record, Timing};
use super::results::Results;
use crate::cost::median;
use crate::report::Table;

/// Rendering method of a row of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    Volume,
    /// Standard 3D Gaussian splatting with this number of splats, in thousands.
    Standard(usize),
    /// The paper's splats, in thousands.
    Ours(usize),
}

/// Row of the paper: data set and mask there, folder and mask of the nearest case here, method, and frames
/// per second on an RTX 4060 Mobile.
struct Table5Row {
    dataset: &'static str,
    folder: &'static str,
    mask: &'static str,
    method: Method,
    fps: u32,
}

const fn row(case: (&'static str, &'static str, &'static str), method: Method, fps: u32) -> Table5Row {
    Table5Row { dataset: case.0, folder: case.1, mask: case.2, method, fps }
}

const CASE_1: (&str, &str, &str) = ("Case 1, TS", "ct-thorax-1p5mm", "mask_ts");
const CASE_4: (&str, &str, &str) = ("Case 4, TS-bones", "ct-abdomen-full", "mask_bones");
const CASE_6: (&str, &str, &str) = ("Case 6, TS", "ct-chest-full", "mask_vessels");

/// Table 5, copied digit by digit.
const PAPER: [Table5Row; 15] = [
    row(CASE_1, Method::Volume, 107),
    row(CASE_1, Method::Standard(250), 272),
    row(CASE_1, Method::Ours(250), 337),
    row(CASE_1, Method::Ours(500), 236),
    row(CASE_1, Method::Ours(1000), 147),
    row(CASE_4, Method::Volume, 125),
    row(CASE_4, Method::Standard(250), 281),
    row(CASE_4, Method::Ours(250), 341),
    row(CASE_4, Method::Ours(500), 238),
    row(CASE_4, Method::Ours(1000), 152),
    row(CASE_6, Method::Volume, 104),
    row(CASE_6, Method::Standard(250), 265),
    row(CASE_6, Method::Ours(250), 342),
    row(CASE_6, Method::Ours(500), 239),
    row(CASE_6, Method::Ours(1000), 143),
];

/// Our measurement for a row of the paper.
enum Here<'a> {
    Record(&'a Unit, &'a Record),
    Missing(String),
}

/// Returns the table in Markdown. Subjects that are not in the paper stand below it.
pub fn markdown(report: &Results<'_>) -> String {
    let units: Vec<&Unit> = report.plan.units.iter().filter(|unit| unit.section == Section::Table5).collect();
    let mut rows: Vec<Vec<String>> = PAPER.iter().map(|row| row.cells(report, &units)).collect();
    for unit in units.iter().filter(|unit| !PAPER.iter().any(|row| row.is_case(unit))) {
        let Some(record) = report.records.get(&unit.key()) else { continue };
        let of_splats = |timing: &Timing| timing.mode != "volume";
        for (method, of) in [("volume rendering", false), ("splats", true)] {
            let splats = if of { thousands(record.splats as u64) } else { dash() };
            let start = [method.to_owned(), dash(), unit.case.source(), splats, dash()];
            rows.push([start.to_vec(), figures(record, |timing| of_splats(timing) == of)].concat());
        }
    }
    let (size, is_cpu) =
        (report.config.parts.get(&Section::Table5).map_or(0, |part| part.size), report.device.is_cpu);
    let here = if is_cpu { "a software driver, here" } else { "this device" };
    let title = format!(
        "## The paper's Table 5\n\nFrames a second at {size}×{size}: the paper's on an RTX 4060 Mobile with the SIBR viewer and \
         MeVisLab's GigaVoxelRenderer, ours on {here}: {}. The cases are the nearest at hand; the transfer function is {}. Ours \
         is 1000 over the median wall time in ms, of the modes `slab` and `alpha`.",
        report.device.text,
        units.first().map_or_else(dash, |unit| unit
            .transfers
            .iter()
            .map(|t| t.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")),
    );
    let columns = vec![
        "method",
        "paper's data set",
        "here",
        "splats",
        "paper, fps",
        "here, fps",
        "here, core-ms a frame",
        "here, device ms a frame",
    ];
    Table { title, columns, rows }.markdown()
}

impl Table5Row {
    fn is_case(&self, unit: &Unit) -> bool {
        unit.case.folder == self.folder
            && unit.case.mask.trim_end_matches(".gz").trim_end_matches(".nii") == self.mask
    }

    fn cells(&self, report: &Results<'_>, units: &[&Unit]) -> Vec<String> {
        let (method, splats) = match self.method {
            Method::Volume => ("volume rendering", dash()),
            Method::Standard(n) => ("3DGS", format!("{n}k")),
            Method::Ours(n) => ("ours", format!("{n}k")),
        };
        let start = [
            method.to_owned(),
            self.dataset.to_owned(),
            format!("{} {}", self.folder, self.mask),
            splats,
            self.fps.to_string(),
        ];
        let wanted = |timing: &Timing| (timing.mode == "volume") == (self.method == Method::Volume);
        let rest = match self.here(report, units) {
            Here::Record(_, record) if record.timings.iter().any(wanted) => figures(record, wanted),
            Here::Record(unit, _) => missing(&format!("left out of {}", unit.title())),
            Here::Missing(why) => missing(&why),
        };
        [start.to_vec(), rest].concat()
    }

    /// Finds the measurement that belongs beside this row; of several, the first one that was measured.
    fn here<'a>(&self, report: &Results<'a>, units: &[&'a Unit]) -> Here<'a> {
        let fits = |unit: &&&Unit| {
            // Whose splats a file holds is known only once it was read; until then it may match any row.
            let read = report.records.get(&unit.key());
            self.is_case(unit)
                && match (self.method, &unit.source) {
                    (Method::Volume, _) => true,
                    // A file matches here, whatever it holds, unless it is to be coloured.
                    (Method::Standard(_), Source::File(..)) if !unit.coloured => {
                        read.is_none_or(|record| record.of_colours)
                    }
                    (Method::Standard(n), Source::File(..)) => {
                        read.is_none_or(|record| record.splats == n * 1000)
                    }
                    (Method::Standard(n), Source::Fit(config)) => {
                        unit.coloured && config.count.splats == n * 1000
                    }
                    (Method::Ours(n), Source::Fit(config)) => {
                        !unit.coloured && config.count.splats == n * 1000
                    }
                    (Method::Ours(n), Source::File(..)) => {
                        read.is_some_and(|record| !record.of_colours && record.splats == n * 1000)
                    }
                }
        };
        let candidates: Vec<&&Unit> = units.iter().filter(fits).collect();
        let measured = candidates.iter().find_map(|unit| Some((unit, report.records.get(&unit.key())?)));
        match (measured, candidates.first()) {
            (Some((unit, record)), _) => Here::Record(unit, record),
            (None, Some(unit)) => {
                let why = report.skipped.get(&unit.key());
                Here::Missing(why.cloned().unwrap_or_else(|| "not measured yet".into()))
            }
            (None, None) if matches!(self.method, Method::Standard(_)) => {
                Here::Missing("no PLY of 3DGS in the configuration".into())
            }
            (None, None) => Here::Missing("not in the configuration".into()),
        }
    }
}

fn missing(why: &str) -> Vec<String> {
    vec![format!("— ({why})"), dash(), dash()]
}

/// Returns three cells for the timings that are `wanted`: frames per second, CPU time and device time.
fn figures(record: &Record, wanted: impl Fn(&Timing) -> bool) -> Vec<String> {
    let rows: Vec<&Timing> = record.timings.iter().filter(|timing| wanted(timing)).collect();
    let cell = |figure: &dyn Fn(&Timing) -> Option<String>| {
        let parts = rows.iter().map(|row| format!("{} {}", row.rendering, figure(row).unwrap_or_else(dash)));
        let text = parts.collect::<Vec<_>>().join(", ");
        if text.is_empty() { dash() } else { text }
    };
    let fps = |row: &Timing| {
        median(&row.each(|c| c.wall_ms))
            .map(|ms| if ms > 100.0 { format!("{:.2}", 1e3 / ms) } else { format!("{:.0}", 1e3 / ms) })
    };
    let core = |row: &Timing| {
        let all: Option<Vec<f64>> = row.frames.iter().map(|(_, cost)| cost.core_ms).collect();
        all.as_deref().and_then(median).map(|v| ms(Some(v)))
    };
    let device = |row: &Timing| median(&row.each(|c| c.device_ms)).map(|v| ms(Some(v)));
    vec![cell(&fps), cell(&core), cell(&device)]
}
