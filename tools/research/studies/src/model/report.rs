//! Reports of what work costs and how far predictions are off: tables, CSV, JSON and a plot.

use std::fmt::Write;

use engine::Result;
use serde::Serialize;

use super::plot::{self, Panel, Series};
use super::rates::{Errors, Rates, Sample, held_out};
use super::shots::{Frame, Record};
use super::stages::STAGES;
use bench::report::Table;
use bench::store::Store;

/// Report of all that was measured.
pub struct ModelReport {
    device: String,
    wide: bool,
    /// Results of each unit.
    pub records: Vec<Record>,
}

/// Frame with its measured and its predicted times, ms.
struct FrameRow<'a> {
    case: &'a str,
    record: &'a Record,
    frame: &'a Frame,
    ms: f64,
    /// Time by the rates of all frames.
    fitted: f64,
    /// Time by the rates of other cases.
    other_cases: f64,
    /// Time by the rates of other sizes.
    other_sizes: f64,
}

/// Errors of frames that have something in common.
#[derive(Serialize)]
struct Group {
    what: String,
    errors: Errors,
}

/// Contents of `model.json`.
#[derive(Serialize)]
struct All<'a> {
    device: &'a str,
    rates: &'a Rates,
    /// Errors of the frames that rates were found from.
    fitted: Vec<Group>,
    /// Errors of cases that were held out.
    cases_held_out: Vec<Group>,
    /// Errors of sizes that were held out.
    sizes_held_out: Vec<Group>,
}

impl ModelReport {
    /// Creates a report without results.
    pub fn new(device: String, wide: bool) -> Self {
        ModelReport { device, wide, records: Vec::new() }
    }

    /// Returns all frames that took any time, each with its record.
    fn frames(&self) -> Vec<(&Record, &Frame)> {
        let all = self.records.iter().flat_map(|r| r.frames.iter().map(move |f| (r, f)));
        all.filter(|(_, f)| f.passes.values().sum::<f64>() > 0.0).collect()
    }

    fn fit(&self) -> (Rates, Vec<FrameRow<'_>>) {
        let frames = self.frames();
        let samples: Vec<Sample<'_>> =
            frames.iter().map(|(_, f)| Sample { work: &f.work, passes: &f.passes }).collect();
        let cases: Vec<&str> = frames.iter().map(|(r, _)| r.unit.case()).collect();
        let sizes: Vec<[u32; 2]> = frames.iter().map(|(_, f)| f.shot.size).collect();
        let rates = Rates::fit(&samples, self.wide);
        let (by_case, by_size) =
            (held_out(&samples, &cases, self.wide), held_out(&samples, &sizes, self.wide));
        let rows = frames.iter().enumerate().map(|(i, &(record, frame))| FrameRow {
            case: cases[i],
            record,
            frame,
            ms: samples[i].ms(),
            fitted: rates.predict(&frame.work),
            other_cases: by_case[i],
            other_sizes: by_size[i],
        });
        let rows = rows.collect();
        (rates, rows)
    }

    /// Returns the tables of errors and of rates as Markdown.
    pub fn markdown(&self) -> String {
        let (rates, rows) = self.fit();
        let tables = [self.errors_table(&rows), self.rates_table(&rates, &rows)];
        tables.iter().map(Table::markdown).collect::<Vec<_>>().join("\n")
    }

    fn errors_table(&self, rows: &[FrameRow<'_>]) -> Table {
        let groups = [
            ("", groups(rows, |r| r.fitted, &|r| [String::new(), mode(r)])),
            (", cases held out", groups(rows, |r| r.other_cases, &|r| [r.case.to_owned(), mode(r)])),
            (
                ", sizes held out",
                groups(rows, |r| r.other_sizes, &|r| [format!("edge {}", r.frame.shot.size[0]), mode(r)]),
            ),
        ];
        let percent = |x: f64| format!("{:.1}", 100.0 * x);
        let cells = groups.iter().flat_map(|(how, groups)| {
            groups.iter().map(move |Group { what, errors: e }| {
                vec![
                    format!("{what}{how}"),
                    e.frames.to_string(),
                    percent(e.median),
                    percent(e.p90),
                    percent(e.worst),
                    percent(e.within),
                    format!("{:.3}", e.bias),
                ]
            })
        });
        let splats: Vec<String> = self.records.iter().map(|r| r.unit.title()).collect();
        Table {
            title: format!(
                "Predicted against measured device time of a frame: {} frames of {}; {}",
                rows.len(),
                splats.join("; "),
                self.device
            ),
            columns: vec![
                "frames of",
                "number",
                "median error / %",
                "90 % within / %",
                "worst / %",
                "within 30 % / %",
                "geometric mean of predicted over measured",
            ],
            rows: cells.collect(),
        }
    }

    fn rates_table(&self, rates: &Rates, rows: &[FrameRow<'_>]) -> Table {
        let mut cells = Vec::new();
        for (at, (stage, found)) in STAGES.iter().zip(&rates.stages).enumerate() {
            let frames: Vec<&FrameRow<'_>> = rows.iter().filter(|r| stage.is_in(&r.frame.work)).collect();
            let whole: f64 = frames.iter().map(|r| rates.stages(&r.frame.work)[at]).sum();
            let mut line = |name: &str, ms: f64, count: &dyn Fn(&FrameRow<'_>) -> f64| {
                let share = ms * frames.iter().map(|r| count(r)).sum::<f64>() / whole.max(f64::MIN_POSITIVE);
                let rate = if ms > 0.0 { per_second(1e3 / ms) } else { "–".into() };
                cells.push(vec![
                    stage.name.to_owned(),
                    name.to_owned(),
                    if ms > 0.0 { format!("{:.4}", ms * 1e6) } else { "0".into() },
                    rate,
                    format!("{:.1}", 100.0 * share),
                ]);
            };
            line("dispatch", found.dispatch_ms, &|r| (stage.dispatches)(&r.frame.work));
            for (term, &ms) in stage.terms.iter().zip(&found.unit_ms) {
                line(term.name, ms, &|r| (term.of)(&r.frame.work, rates.wide));
            }
        }
        let columns = vec!["stage", "unit", "ns a unit", "units a second", "% of the stage's time"];
        Table { title: format!("What work costs; {}", self.device), columns, rows: cells }
    }

    fn csv(&self, rows: &[FrameRow<'_>]) -> String {
        let mut out = String::from(
            "file,splats,transfer,lit,integrated,place,mode,size,views,coarseness,rows,shown,tiles,sorted,room,digits,table,lists,quads,\
             image_bytes,evaluations,classified,looked,rounds,samples,gradients,wide_evaluations,wide_classified,wide_looked,\
             wide_rounds,wide_samples,wide_gradients,fragments,blended,ms,fitted_ms,case_held_out_ms,size_held_out_ms\n",
        );
        for row in rows {
            let (w, f) = (&row.frame.work, row.frame);
            let lists = [w.rows, w.shown, w.tiles, w.sorted, w.room, w.digits, w.table, w.lists, w.quads];
            let counts = [&lists[..], &[w.image_bytes]].concat();
            let pixels = [w.narrow, w.wide]
                .map(|p| [p.evaluations, p.classified, p.looked, p.rounds, p.samples, p.gradients])
                .concat();
            let numbers: Vec<String> =
                counts.iter().chain(&pixels).chain(&[w.fragments, w.blended]).map(f64::to_string).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(
                out,
                "{},{},{},{},{},{},{},{},{},{},{},{:.4},{:.4},{:.4},{:.4}",
                row.record.unit.file,
                row.record.splats,
                f.sight.transfer,
                w.lit,
                w.integrated,
                f.place.name(),
                w.mode,
                f.shot.size[0],
                f.shot.views,
                f.shot.coarseness,
                numbers.join(","),
                row.ms,
                row.fitted,
                row.other_cases,
                row.other_sizes
            );
        }
        out
    }

    /// Plots predicted against measured times as SVG, each case by the rates of the others.
    fn svg(&self, rows: &[FrameRow<'_>]) -> Result<String> {
        let mut cases: Vec<&str> = rows.iter().map(|r| r.case).collect();
        cases.sort_unstable();
        cases.dedup();
        let panels = ["slab", "alpha", "decoded"].map(|wanted| {
            let series = cases.iter().map(|&case| Series {
                label: case.to_owned(),
                points: rows
                    .iter()
                    .filter(|r| r.case == case && r.frame.work.mode == wanted && r.other_cases.is_finite())
                    .map(|r| (r.ms, r.other_cases))
                    .collect(),
            });
            Panel {
                title: format!("mode {wanted}, each case by the rates of the others"),
                series: series.collect(),
            }
        });
        plot::against("Device time of a frame, predicted against measured", &panels)
    }

    /// Writes all reports to `store`.
    pub fn write(&self, store: &Store) -> Result<()> {
        let (rates, rows) = self.fit();
        let all = All {
            device: &self.device,
            rates: &rates,
            fitted: groups(&rows, |r| r.fitted, &|r| [String::new(), mode(r)]),
            cases_held_out: groups(&rows, |r| r.other_cases, &|r| [r.case.to_owned(), mode(r)]),
            sizes_held_out: groups(&rows, |r| r.other_sizes, &|r| {
                [r.frame.shot.size[0].to_string(), mode(r)]
            }),
        };
        let json = bench::report::json(&all)?;
        store.report("model.md", &self.markdown())?;
        store.report("model.csv", &self.csv(&rows))?;
        store.report("model.json", &json)?;
        store.report("model.svg", &self.svg(&rows)?)
    }
}

fn mode(row: &FrameRow<'_>) -> String {
    format!("mode {}", row.frame.work.mode)
}

/// Returns the errors of all frames, of those that share the second of their `names`, and of those that share
/// both (unless the first is empty). Frames whose predicted time is not finite are left out.
fn groups(
    rows: &[FrameRow<'_>],
    predicted: fn(&FrameRow<'_>) -> f64,
    names: &dyn Fn(&FrameRow<'_>) -> [String; 2],
) -> Vec<Group> {
    let mut all: Vec<(String, Vec<(f64, f64)>)> = vec![("all".into(), Vec::new())];
    for row in rows.iter().filter(|r| predicted(r).is_finite()) {
        let [first, second] = names(row);
        let both = format!("{first}, {second}");
        let named = [second.as_str(), if first.is_empty() { "" } else { both.as_str() }];
        for name in ["all"].into_iter().chain(named).filter(|name| !name.is_empty()) {
            let at = all.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
                all.push((name.to_owned(), Vec::new()));
                all.len() - 1
            });
            all[at].1.push((predicted(row), row.ms));
        }
    }
    all[1..].sort_by(|a, b| (a.0.contains(','), &a.0).cmp(&(b.0.contains(','), &b.0)));
    let group = |(what, pairs): (String, Vec<(f64, f64)>)| Some(Group { what, errors: Errors::of(&pairs)? });
    all.into_iter().filter_map(group).collect()
}

/// Formats a rate with an SI prefix: 1.230 G.
fn per_second(rate: f64) -> String {
    let (scale, prefix) = match rate {
        r if r >= 1e9 => (1e9, " G"),
        r if r >= 1e6 => (1e6, " M"),
        r if r >= 1e3 => (1e3, " k"),
        _ => (1.0, ""),
    };
    format!("{:.3}{prefix}", rate / scale)
}
