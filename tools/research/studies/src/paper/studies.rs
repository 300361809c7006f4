//! Writes tables that go beyond the paper's: the ablation of the default loss, the sweep of densities,
//! `--profile paper` against the prototype, and what the paper's choices are worth.

use super::job::Job;
use super::plan::{LossRow, SweepRow};
use super::prototype::{Fidelity, Finding, Variant};
use super::published;
use super::results::{Results, core_minutes, db, diverged};
use super::runs::Record;
use bench::report::Table;

const DASH: &str = "—";

fn dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| DASH.to_owned())
}

fn best(record: Option<&Record>) -> Option<f64> {
    record.and_then(Record::best).map(|p| p.psnr())
}

fn last(record: Option<&Record>) -> Option<f64> {
    record.and_then(Record::end).map(|p| p.psnr())
}

fn difference(ours: Option<f64>, theirs: Option<f64>) -> String {
    dash(ours.zip(theirs).map(|(a, b)| format!("{:+.2}", a - b)))
}

/// Returns the table of the terms of the default loss, with what each is for.
pub fn ablation(rows: &[LossRow], results: &Results) -> Table {
    let (case, splats) = published::TABLE_4_ROW;
    Table {
        title: format!(
            "## The loss of the default profile, {} {}k\n\nOn the grid and, in front of it, at 8 held-out offsets (worst / mean). \
             Soft Dice and the error of the occupancy are over the region and its shell.",
            published::CASES[case].name,
            splats / 1000
        ),
        columns: vec![
            "loss",
            "between: worst / mean, dB",
            "on the grid, dB",
            "soft Dice",
            "occupancy RMSE between (on the grid)",
            "CPU time, core-min",
        ],
        rows: rows
            .iter()
            .map(|row| {
                let record = results.of(&row.ours);
                let end = record.and_then(|r| r.last);
                let held_out = end.and_then(|e| e.held_out);
                vec![
                    row.what.to_owned(),
                    dash(held_out.map(|h| format!("{:.2} / {:.2}", h.worst, h.mean))),
                    dash(last(record).map(db)),
                    dash(end.map(|e| format!("{:.4}", e.soft_dice))),
                    dash(
                        end.zip(held_out)
                            .map(|(e, h)| format!("{:.4} ({:.4})", h.occupancy_rmse, e.occupancy_rmse)),
                    ),
                    core_minutes(record),
                ]
            })
            .collect(),
    }
}

/// Returns the table of PSNR over splats per voxel.
pub fn density(rows: &[SweepRow], results: &Results) -> Table {
    Table {
        title: "## Splats per voxel of the region\n\n`--profile paper` with every splat in every step and no change of topology; \
                PSNR over -1024..3071 HU. The prototype of our method was fitted and measured on the grid alone, which is \
                easier than right between the voxels: see the default profile's own two columns."
            .into(),
        columns: vec![
            "case",
            "splats per voxel",
            "splats",
            "--profile paper: iterations",
            "start / best / last, dB",
            "prototype of it: best, dB",
            "default on the grid, dB",
            "between: worst / mean, dB",
            "prototype, on the grid alone, dB",
            "CPU time, core-min: --profile paper",
            "default",
        ],
        rows: rows
            .iter()
            .map(|row| {
                let [paper, ours] = [results.of(&row.paper), results.of(&row.ours)];
                let held_out = ours.and_then(|r| r.last).and_then(|e| e.held_out);
                vec![
                    format!("{} {}", row.paper.folder, row.paper.mask),
                    row.known.density.to_string(),
                    row.paper.config.count.splats.to_string(),
                    row.paper.config.iterations.to_string(),
                    way(paper),
                    dash(row.known.paper.map(db)),
                    dash(last(ours).map(db)),
                    dash(held_out.map(|h| format!("{:.2} / {:.2}", h.worst, h.mean))),
                    dash(row.known.ours.map(|x| format!("{x:.1}"))),
                    core_minutes(paper),
                    core_minutes(ours),
                ]
            })
            .collect(),
    }
}

/// Formats PSNRs as "start / best / last".
fn way(record: Option<&Record>) -> String {
    dash(record.and_then(|r| {
        let [start, best, end] = [r.start()?, r.best()?, r.end()?].map(|p| db(p.psnr()));
        Some(format!("{start} / {best} / {end}{}", diverged(r)))
    }))
}

/// Returns the table that compares `--profile paper` with the prototype's measurements of the same method.
pub fn fidelity(rows: &[(&'static Fidelity, Job)], results: &Results) -> Table {
    Table {
        title: "## `--profile paper` against the prototype\n\nThe prototype is another program (CPU, f32) after the same text. \
                Every splat in every step, no change of topology, PSNR over -1024..3071 HU."
            .into(),
        columns: vec![
            "case",
            "splats per voxel",
            "splats",
            "iterations",
            "start / best / last, dB",
            "prototype best / last, dB",
            "difference of the best, dB",
            "of the last, dB",
            "CPU time, core-min",
        ],
        rows: rows
            .iter()
            .map(|(known, job)| {
                let record = results.of(job);
                vec![
                    format!("{} {}", job.folder, job.mask),
                    known.density.to_string(),
                    job.config.count.splats.to_string(),
                    job.config.iterations.to_string(),
                    way(record),
                    format!("{} / {}", db(known.best), dash(known.last.map(db))),
                    difference(best(record), Some(known.best)),
                    difference(last(record), known.last),
                    core_minutes(record),
                ]
            })
            .collect(),
    }
}

/// Returns the table of what the paper's choices are worth, one at a time.
pub fn findings(rows: &[(&'static Finding, Job)], results: &Results) -> Table {
    let title = rows.first().map_or_else(String::new, |(_, job)| format!(", {} {}", job.folder, job.mask));
    Table {
        title: format!(
            "## What the paper's choices do{title}\n\nEach row departs in one thing from `--profile paper` with every splat in \
             every step and no change of topology. PSNR over -1024..3071 HU. The figure to look at is *last - start*: whether the \
             optimisation improves on its own initialisation."
        ),
        columns: vec![
            "what",
            "splats per voxel",
            "splats start → end",
            "subset",
            "iterations",
            "start / best / last, dB",
            "last - start, dB",
            "prototype best / last, dB",
            "CPU time, core-min",
        ],
        rows: rows
            .iter()
            .map(|(known, job)| {
                let record = results.of(job);
                let counts =
                    record.and_then(|r| Some(format!("{} → {}", r.start()?.splats, r.end()?.splats)));
                vec![
                    what(known.variant).to_owned(),
                    known.density.to_string(),
                    counts.unwrap_or_else(|| job.config.count.splats.to_string()),
                    if job.config.subset.size > 0 {
                        job.config.subset.size.to_string()
                    } else {
                        "all".to_owned()
                    },
                    job.config.iterations.to_string(),
                    way(record),
                    difference(last(record), record.and_then(Record::start).map(|p| p.psnr())),
                    known.prototype.to_owned(),
                    core_minutes(record),
                ]
            })
            .collect(),
    }
}

fn what(variant: Variant) -> &'static str {
    match variant {
        Variant::FullBatch => "every splat in every step",
        Variant::SubsetAlone => "a subset a step, rasterized alone",
        Variant::SubsetOfAll => "a subset a step, all splats rasterized",
        Variant::Sampled => "intensities sampled at the means, not learned",
        Variant::DensityKernel => "kernel of unit integral instead of peak 1",
        Variant::NoMask => "no Dice (λ_mask = 0)",
        Variant::Densify => "half of the splats at first, then densification",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::job::tests::job;
    use crate::paper::prototype::{FIDELITY, FINDINGS, SWEEPS};
    use crate::paper::runs::tests::record;

    #[test]
    fn differences_are_ours_less_theirs_and_dashes_where_one_is_missing() {
        let rows: Vec<_> = FIDELITY.iter().enumerate().map(|(i, known)| (known, job(i + 1))).collect();
        let mut results = Results::default();
        results.add(record(job(1), &[0.001, 0.0005, 0.0008]));
        results.add(record(job(3), &[0.001]));
        let table = fidelity(&rows, &results);
        assert_eq!(table.rows[0][4..8], ["30.00 / 33.01 / 30.97", "31.21 / 31.21", "+1.80", "-0.24"]);
        assert_eq!(table.rows[1][4..8], ["—", "32.94 / 32.94", "—", "—"]);
        assert_eq!(table.rows[2][4..8], ["30.00 / 30.00 / 30.00", "27.85 / —", "+2.15", "—"]);
    }

    #[test]
    fn findings_tell_loss_against_the_start() {
        let mut subset = job(176);
        subset.config.subset.size = 3;
        let rows = [(&FINDINGS[8], subset.clone())];
        let mut results = Results::default();
        results.add(record(subset, &[0.001, 0.002]));
        let row = &findings(&rows, &results).rows[0];
        assert_eq!(row[2..7], ["176 → 186", "3", "7", "30.00 / 30.00 / 26.99", "-3.01"]);
        assert_eq!(row[7], "29.62 (the start) / 27.77");
    }

    #[test]
    fn every_row_has_a_cell_for_every_column() {
        let sweep = SweepRow { known: &SWEEPS[0].densities[2], paper: job(1), ours: job(2) };
        let loss = LossRow {
            loss: &published::TABLE_4[0],
            what: "w",
            paper: job(1),
            reference: job(3),
            ours: job(2),
        };
        let mut results = Results::default();
        for done in [false, true] {
            if done {
                results.add(record(job(1), &[0.01]));
                results.add(record(job(2), &[0.01]));
            }
            let tables = [
                density(std::slice::from_ref(&sweep), &results),
                ablation(std::slice::from_ref(&loss), &results),
                findings(&[(&FINDINGS[0], job(1))], &results),
                fidelity(&[(&FIDELITY[0], job(1))], &results),
            ];
            for table in tables {
                assert_eq!(table.rows[0].len(), table.columns.len(), "{}", table.title);
            }
        }
    }
}
