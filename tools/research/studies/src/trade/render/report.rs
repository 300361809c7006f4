//! Writes tables, CSV, JSON and plots of pictures.

use std::collections::BTreeMap;
use std::fmt::Write;

use engine::Result;
use engine::render::SplatKind;
use serde::Serialize;

use super::averages::Averages;
use super::plan::Choice;
use super::quality_levels;
use super::shots::{self, Record, Unit};
use crate::trade::front::{Point, front};
use crate::trade::plot::{self, Panel, Series};
use bench::cost::{Cost, mean, median};
use bench::render::record::Sight;
use bench::report::Table;
use bench::store::Store;

/// All measurements.
pub struct PictureTradeReport {
    /// Device and driver.
    pub device: String,
    /// True if the device is the processor itself: CPU time is then that of the device.
    pub is_cpu: bool,
    /// Records by case and transfer function.
    pub records: Vec<Record>,
}

fn of(row: &shots::ChoiceRow, figure: impl Fn(&Cost) -> f64) -> f64 {
    median(&row.sights.iter().map(|s| figure(&s.cost)).collect::<Vec<_>>()).unwrap_or(f64::NAN)
}

impl PictureTradeReport {
    /// Returns the records in which something is seen.
    fn seen(&self) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(|record| !record.rows.is_empty())
    }

    /// Returns the averages of all choices that were measured everywhere.
    pub fn rows(&self) -> Vec<Averages> {
        self.rows_of(&self.seen().collect::<Vec<_>>())
    }

    fn rows_of(&self, records: &[&Record]) -> Vec<Averages> {
        let Some(first) = records.first() else { return Vec::new() };
        let usual = Choice::usual("slab");
        let find = |record: &'_ Record, choice: &Choice| {
            record.rows.iter().find(|row| row.choice == *choice).cloned()
        };
        first
            .rows
            .iter()
            .filter_map(|row| {
                let choice = &row.choice;
                let pairs: Option<Vec<(shots::ChoiceRow, shots::ChoiceRow)>> =
                    records.iter().map(|r| Some((find(r, choice)?, find(r, &usual)?))).collect();
                let pairs = pairs?;
                let ms = |row: &shots::ChoiceRow| of(row, |cost| cost.of_device(self.is_cpu));
                let sights: Vec<&Sight> = pairs.iter().flat_map(|(row, _)| &row.sights).collect();
                let mean_of = |figure: &dyn Fn(&Sight) -> f64| {
                    mean(&sights.iter().map(|s| figure(s)).collect::<Vec<_>>()).unwrap_or(f64::NAN)
                };
                let over = |figure: &dyn Fn(&(shots::ChoiceRow, shots::ChoiceRow)) -> f64| {
                    mean(&pairs.iter().map(figure).collect::<Vec<_>>()).unwrap_or(f64::NAN)
                };
                Some(Averages {
                    choice: choice.clone(),
                    cost: over(&|(row, usual)| (ms(row) / ms(usual)).ln()).exp(),
                    ms: over(&|(row, _)| ms(row)),
                    device_ms: over(&|(row, _)| of(row, |cost| cost.device_ms)),
                    psnr: mean_of(&Sight::psnr),
                    worst_psnr: sights.iter().map(|s| s.psnr()).fold(f64::INFINITY, f64::min),
                    ssim: mean_of(&|s| s.ssim),
                    flip: mean_of(&|s| s.flip),
                })
            })
            .collect()
    }

    fn unit(&self) -> &'static str {
        if self.is_cpu { "core-ms" } else { "device-ms" }
    }

    /// Returns tables of the front, of the splats that a transfer function shows, of each case, and of the
    /// quality levels.
    pub fn markdown(&self) -> String {
        let rows = self.rows();
        let size = self.records.first().map_or(0, |r| r.unit.size);
        let mut cases: Vec<&str> = self.records.iter().map(|r| r.unit.case.name.as_str()).collect();
        cases.dedup();
        let title = format!(
            "Pictures of {size} × {size} of {} against the CT, in {} cases and functions of {} views; {}",
            cases.join(", "),
            self.seen().count(),
            self.records.first().map_or(0, |r| r.unit.views.len()),
            self.device
        );
        let mut text = self.table(title, rows.clone()).markdown();
        text += &format!("\n{}", self.active().markdown());
        text += &format!("\n{}", self.by_case().markdown());
        for kind in SplatKind::ALL {
            let levels = quality_levels::levels_of(kind, &rows);
            text += &format!("\n{}", self.levels(kind, &levels).markdown());
        }
        text
    }

    fn table(&self, title: String, mut rows: Vec<Averages>) -> Table {
        rows.sort_by(|a, b| b.cost.total_cmp(&a.cost));
        let points: Vec<Point> = rows.iter().map(|r| Point { cost: r.cost, gain: r.psnr }).collect();
        let on = front(&points);
        let cells = rows.iter().zip(on).map(|(r, on)| {
            vec![
                r.choice.name(),
                format!("{:.2}", r.psnr),
                format!("{:.2}", r.worst_psnr),
                format!("{:.4}", r.ssim),
                format!("{:.4}", r.flip),
                format!("{:.1}", r.ms),
                format!("{:.1}", r.device_ms),
                format!("{:.2}", r.cost),
                if on { "yes".into() } else { String::new() },
            ]
        });
        let columns = vec![
            "rendering",
            "PSNR, dB",
            "worst view, dB",
            "SSIM",
            "FLIP",
            if self.is_cpu { "core-ms a frame" } else { "device-ms a frame (compared)" },
            "device-ms a frame",
            "cost",
            "on the front",
        ];
        Table { title, columns, rows: cells.collect() }
    }

    /// Returns a table of the modes at full quality, end to end: from the CT to the picture.
    fn by_case(&self) -> Table {
        let modes = ["exact", "slab", "decoded", "alpha"].map(Choice::usual);
        let choices: Vec<Choice> = modes.into_iter().chain([Choice::of_grid()]).collect();
        let rows = self.seen().map(|record| {
            let rows = self.rows_of(&[record]);
            let figures = choices.iter().map(|choice| {
                let row = rows.iter().find(|row| row.choice == *choice);
                row.map_or("–".into(), |row| format!("{:.2} ({:.1})", row.psnr, row.ms))
            });
            let Unit { case, transfer, .. } = &record.unit;
            [case.name.clone(), transfer.name.clone()].into_iter().chain(figures).collect()
        });
        Table {
            title: format!("PSNR against the CT by case and function, dB ({} a frame)", self.unit()),
            columns: vec![
                "case",
                "transfer function",
                "exact",
                "slab",
                "decoded",
                "alpha",
                "decoded, fitted for the grid",
            ],
            rows: rows.collect(),
        }
    }

    /// Returns a table of the splats that are left out because a transfer function cannot show them. This is
    /// always done: nothing visible is lost by it.
    fn active(&self) -> Table {
        let rows = self.records.iter().map(|record| {
            let [all, active] = record.splats;
            let reference: Vec<f64> = record.reference.iter().map(|c| c.of_device(self.is_cpu)).collect();
            vec![
                record.unit.case.name.clone(),
                record.unit.transfer.name.clone(),
                all.to_string(),
                active.to_string(),
                format!("{:.1}", 100.0 * active as f64 / all.max(1) as f64),
                format!("{:.1}", median(&reference).unwrap_or(f64::NAN)),
            ]
        });
        let unit = if self.is_cpu { "core-ms of the reference" } else { "device-ms of the reference" };
        Table {
            title: "Splats that a transfer function can show, and what the CT itself costs".into(),
            columns: vec!["case", "transfer function", "splats", "active", "%", unit],
            rows: rows.collect(),
        }
    }

    /// Returns a table of the quality levels, with what each step down saves and gives up.
    fn levels(&self, kind: SplatKind, levels: &[Averages]) -> Table {
        // Times are those of the first level times the relative cost: a mean of ms is dominated by the
        // dearest cases, the cost is not.
        let first = levels.first().map_or(f64::NAN, |row| row.ms);
        let rows = levels.iter().enumerate().map(|(n, row)| {
            let above = n.checked_sub(1).map(|n| &levels[n]);
            let step = above.map_or_else(
                || ["–".to_owned(), "–".to_owned()],
                |above| {
                    let (db, ms) = (above.psnr - row.psnr, first * (above.cost - row.cost));
                    [format!("{db:.2}"), format!("{:.3}", db / ms)]
                },
            );
            let [lost, rate] = step;
            vec![
                n.to_string(),
                row.choice.name(),
                format!("{:.2}", row.psnr),
                format!("{:.1}", first * row.cost),
                format!("{:.2}", row.cost),
                lost,
                rate,
            ]
        });
        let columns = vec![
            "level",
            "rendering",
            "PSNR, dB",
            if self.is_cpu {
                "core-ms of the first, times the cost"
            } else {
                "device-ms of the first, times the cost"
            },
            "cost",
            "given up, dB",
            "dB per ms saved",
        ];
        Table {
            title: format!("Quality levels of the frame budget: {}", kind.name()),
            columns,
            rows: rows.collect(),
        }
    }

    fn csv(&self) -> String {
        let mut out = String::from(
            "case,transfer,rendering,mode,of_grid,step,resolution,splats,packed,view,psnr_db,ssim,flip,core_ms,wall_ms,device_ms\n",
        );
        for record in &self.records {
            for row in &record.rows {
                let c = &row.choice;
                for s in &row.sights {
                    let core = s.cost.core_ms.map(|ms| format!("{ms:.3}")).unwrap_or_default();
                    // Writing to a string cannot fail.
                    let _ = writeln!(
                        out,
                        "{},{},\"{}\",{},{},{},{},{},{},{},{:.4},{:.5},{:.5},{core},{:.3},{:.3}",
                        record.unit.case.name,
                        record.unit.transfer.name,
                        c.name(),
                        c.mode,
                        c.of_grid,
                        c.step,
                        c.resolution,
                        c.splats,
                        c.packed,
                        s.view,
                        s.psnr(),
                        s.ssim,
                        s.flip,
                        s.cost.wall_ms,
                        s.cost.device_ms
                    );
                }
            }
        }
        out
    }

    fn json(&self) -> Result<String> {
        #[derive(Serialize)]
        struct All<'a> {
            device: &'a str,
            is_cpu: bool,
            rows: Vec<Averages>,
            quality_levels: BTreeMap<&'static str, Vec<Averages>>,
        }
        let rows = self.rows();
        let levels = SplatKind::ALL.map(|kind| (kind.name(), quality_levels::levels_of(kind, &rows)));
        let all = All { device: &self.device, is_cpu: self.is_cpu, quality_levels: levels.into(), rows };
        bench::report::json(&all)
    }

    /// Plots a panel for each case, with all its transfer functions, as SVG.
    fn svg(&self) -> Result<String> {
        let mut cases: Vec<&str> = self.seen().map(|r| r.unit.case.name.as_str()).collect();
        cases.sort_unstable();
        cases.dedup();
        let panels = cases.iter().map(|case| {
            let records: Vec<&Record> = self.seen().filter(|r| r.unit.case.name == *case).collect();
            let rows = self.rows_of(&records);
            let point = |row: &Averages| Point { cost: row.ms, gain: row.psnr };
            let labels = [
                ("exact", false, "exact"),
                ("slab", false, "slab"),
                ("decoded", false, "decoded"),
                ("alpha", false, "alpha"),
                ("decoded", true, "decoded, fitted for the grid"),
            ];
            let series = labels.map(|(mode, of_grid, label)| Series {
                label: label.to_owned(),
                points: rows
                    .iter()
                    .filter(|r| r.choice.mode == mode && r.choice.of_grid == of_grid)
                    .map(point)
                    .collect(),
            });
            Panel {
                title: format!("{case}, {} transfer functions", records.len()),
                cost: format!("{} a frame", self.unit()),
                gain: "PSNR against the CT / dB".into(),
                series: series.into(),
                named: Vec::new(),
            }
        });
        plot::svg("Pictures: what accuracy costs", &panels.collect::<Vec<_>>(), 3)
    }

    /// Writes all reports.
    pub fn write(&self, store: &Store) -> Result<()> {
        store.report("render.md", &self.markdown())?;
        store.report("render.csv", &self.csv())?;
        store.report("render.json", &self.json()?)?;
        store.report("render.svg", &self.svg()?)
    }
}
