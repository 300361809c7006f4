//! Writes Tables 2, 4 and 6 of the paper with ours beside them.

use super::plan::{Effort, LossRow, TableRow};
use super::published::{self, CASES, Span, TABLE_4_ROW};
use super::results::{Results, core_minutes, count, db, mmse, worst_best};
use super::runs::Record;
use bench::report::Table;

/// Returns the text before all tables of runs.
pub fn preamble(effort: &Effort, device: &str) -> String {
    let mut text = format!(
        "# The paper's tables, and ours\n\n\
         Device: {device}. PSNR and MMSE are equation (4) on the native grid with all splats. `--profile paper` is the paper's \
         method to the letter; *default* is the default profile. A dash is a figure that is not there (yet).\n\n"
    );
    if effort.quick {
        text += &format!(
            "**Short run** (`--quick`): {} iterations of `--profile paper` instead of 1000 and {} of the default profile \
             instead of 300, one row of each case, fewer densities and findings of {} iterations. The fidelity rows are run in \
             full. Figures of a short run say whether the method works, not how good it is.\n\n",
            effort.paper_iterations, effort.default_iterations, effort.finding_iterations
        );
    }
    text
}

fn name(case: usize) -> [String; 2] {
    [CASES[case].name.to_owned(), CASES[case].mask.to_owned()]
}

fn pair(span: Span, digits: usize) -> String {
    format!("{:.digits$} / {:.digits$}", span.worst, span.best)
}

/// Returns a table of how the cases differ and how the numbers were scaled; for Tables 2, 3, 4 and 6.
pub fn cases(rows: &[TableRow]) -> Table {
    Table {
        title: "## Cases\n\nThe paper's data are not public with its masks, so each case stands for the nearest one at hand. The paper does not \
         state the size of its regions of interest; it is estimated from the volume of the anatomy and the size of a voxel. \
         Where ours is smaller, the number of splats and of the subset are the paper's times our voxels over that \
         estimate, so that the splats per voxel are the same. PSNR is over the range of the whole volume (minimum to \
         maximum as stored), which the paper does not state either: compare with the downsampled volumes of Table 3."
            .into(),
        columns: vec![
            "paper's case",
            "mask",
            "here",
            "paper's ROI voxels, estimated",
            "ROI voxels here",
            "counts times",
            "remark",
        ],
        rows: CASES
            .iter()
            .enumerate()
            .filter_map(|(i, case)| {
                let voxels = rows.iter().find(|row| row.case == i)?.voxels;
                let [name, mask] = name(i);
                Some(vec![
                    name,
                    mask,
                    format!("{} {}", case.folder, case.file),
                    format!("{:.0}", case.estimated_voxels),
                    format!("{voxels:.0}"),
                    format!("{:.3}", (voxels / case.estimated_voxels).min(1.0)),
                    case.remark.to_owned(),
                ])
            })
            .collect(),
    }
}

/// Returns Table 2: quality.
pub fn table_2(rows: &[TableRow], results: &Results) -> Table {
    let between = |record: Option<&Record>| match record.and_then(|r| r.last).and_then(|l| l.held_out) {
        Some(h) => format!("{:.2} / {:.2}", h.worst, h.mean),
        None => "—".to_owned(),
    };
    Table {
        title: "## Table 2: worst and best within the iterations\n\nIteration 0 (the initialisation) counts in *worst* and \
                *best*: the paper's best hardly depends on its loss (Table 4), as that of a start would. In brackets the worst \
                after iteration 0, where that is another. The last column has the default profile at 8 sub-voxel offsets \
                that it has not seen. (The paper's first row contradicts itself: an MMSE of 0.00336 is 24.74 dB.)"
            .into(),
        columns: vec![
            "dataset",
            "mask",
            "splats: paper → here",
            "PSNR worst / best, dB: paper",
            "--profile reference, region's range",
            "--profile paper",
            "default",
            "MMSE worst / best: paper",
            "--profile reference, region's range",
            "--profile paper",
            "default",
            "default between the voxels: worst / mean, dB",
        ],
        rows: rows
            .iter()
            .filter_map(|row| {
                let published = published::quality_of(row.case, row.splats.paper)?;
                let [paper, ours] = [results.of(&row.paper), results.of(&row.ours)];
                let reference = results.of(&row.reference);
                let [case, mask] = name(row.case);
                Some(vec![
                    case,
                    mask,
                    count(row.splats),
                    pair(published.psnr, 2),
                    worst_best(reference, |p| db(p.psnr())),
                    worst_best(paper, |p| db(p.psnr())),
                    worst_best(ours, |p| db(p.psnr())),
                    format!("{} / {}", mmse(published.mmse.worst), mmse(published.mmse.best)),
                    worst_best(reference, |p| mmse(p.mmse)),
                    worst_best(paper, |p| mmse(p.mmse)),
                    worst_best(ours, |p| mmse(p.mmse)),
                    between(ours),
                ])
            })
            .collect(),
    }
}

/// Returns Table 4: what the terms of the loss are worth.
pub fn table_4(rows: &[LossRow], results: &Results) -> Table {
    let psnr = |record| worst_best(record, |p| db(p.psnr()));
    Table {
        title: format!(
            "## Table 4: terms of the loss, {} {}k\n\nPSNR worst / best, dB, as in Table 2; λ_leak = 0.1 throughout. The default \
             profile has no Dice and no leak term: its occupancy stands in their place.",
            CASES[TABLE_4_ROW.0].name,
            TABLE_4_ROW.1 / 1000
        ),
        columns: vec![
            "λ_mask",
            "λ_ct",
            "paper",
            "--profile reference, region's range",
            "--profile paper",
            "default",
            "loss of the default profile",
        ],
        rows: rows
            .iter()
            .map(|row| {
                vec![
                    row.loss.mask.to_string(),
                    row.loss.ct.to_string(),
                    pair(row.loss.psnr, 2),
                    psnr(results.of(&row.reference)),
                    psnr(results.of(&row.paper)),
                    psnr(results.of(&row.ours)),
                    row.what.to_owned(),
                ]
            })
            .collect(),
    }
}

/// Returns Table 6: what a fit costs.
pub fn table_6(rows: &[TableRow], results: &Results) -> Table {
    let counts = |record: Option<&Record>| match record.map(|r| (r.start(), r.end())) {
        Some((Some(start), Some(end))) => format!("{} → {}", start.splats, end.splats),
        _ => "—".to_owned(),
    };
    let at_end = |record: Option<&Record>| {
        record.and_then(Record::end).map_or_else(|| "—".to_owned(), |p| db(p.psnr()))
    };
    let memory = |record: Option<&Record>| {
        record.map_or_else(|| "—".to_owned(), |r| format!("{:.3}", r.device_peak_bytes as f64 * 1e-9))
    };
    Table {
        title: "## Table 6: cost\n\nTime is that of the iterations, without measurements: the paper's in minutes on its GPU, ours in core-minutes, \
                the CPU time of all threads, which other programs on the machine change little (two idle cores take about half as many \
                minutes); memory is the most that the fit held on \
                the device at once. PSNR is that of the last iteration here; the paper does not say of which. Each row \
                of `--profile paper` may densify up to the paper's number at the end over that at the start; `--profile reference` keeps \
                its number, as the documented command of the authors' code does, and its PSNR is over the range of the region."
            .into(),
        columns: vec![
            "dataset",
            "mask",
            "subset: paper → here",
            "splats start → end: paper",
            "--profile reference",
            "--profile paper",
            "default",
            "time: paper, min",
            "--profile reference, core-min",
            "--profile paper, core-min",
            "default, core-min",
            "PSNR, dB: paper",
            "--profile reference",
            "--profile paper",
            "default",
            "memory, GB: paper",
            "--profile reference",
            "--profile paper",
            "default",
        ],
        rows: rows
            .iter()
            .filter(|row| row.training.start == row.splats.paper)
            .map(|row| {
                let [paper, ours] = [results.of(&row.paper), results.of(&row.ours)];
                let reference = results.of(&row.reference);
                let published = row.training;
                let [case, mask] = name(row.case);
                vec![
                    case,
                    mask,
                    count(row.subset),
                    format!("{} → {}", published.start, published.end),
                    counts(reference),
                    counts(paper),
                    counts(ours),
                    format!("{:.0}", published.minutes),
                    core_minutes(reference),
                    core_minutes(paper),
                    core_minutes(ours),
                    format!("{:.2}", published.psnr),
                    at_end(reference),
                    at_end(paper),
                    at_end(ours),
                    format!("{:.2}", published.gigabytes),
                    memory(reference),
                    memory(paper),
                    memory(ours),
                ]
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::count::Count;
    use crate::paper::job::tests::job;
    use crate::paper::runs::tests::record;

    fn rows() -> Vec<TableRow> {
        // Case 4 with 100k splats, which Table 6 lacks, and with 250k.
        [100_000, 250_000]
            .into_iter()
            .map(|splats| TableRow {
                case: 2,
                voxels: 322_824.0,
                splats: Count::scaled(splats, 0.322_824),
                subset: Count::scaled(4000, 0.322_824),
                training: published::training_of(2, splats),
                paper: job(splats),
                reference: job(splats + 2),
                ours: job(splats + 1),
            })
            .collect()
    }

    fn line(table: &Table, row: usize) -> String {
        table.rows[row].join(" | ")
    }

    #[test]
    fn tables_put_the_paper_and_both_profiles_side_by_side() {
        let rows = rows();
        let mut results = Results::default();
        results.add(record(rows[1].paper.clone(), &[0.004, 0.005, 0.01]));
        let table = table_2(&rows, &results);
        assert_eq!(
            line(&table, 0),
            "Case 4 | TS-Bones (binary) | 100000 → 32282 | 20.75 / 23.36 | — | — | — | 0.00841 / 0.00462 | — | — | — | —"
        );
        assert_eq!(
            line(&table, 1),
            "Case 4 | TS-Bones (binary) | 250000 → 80706 | 21.00 / 23.80 | — | 20.00 / 23.98 | — | 0.00795 / 0.00417 | \
             — | 0.0100 / 0.00400 | — | —"
        );
        // The default profile starts at its worst.
        results.add(record(rows[1].ours.clone(), &[0.001, 0.0001, 0.00001]));
        assert_eq!(table_2(&rows, &results).rows[1][6], "30.00 (40.00) / 50.00");
        assert_eq!(table_2(&rows, &results).rows[1][11], "40.00 / 41.00");
        let table = table_6(&rows, &results);
        assert_eq!(table.rows.len(), 1, "Table 6 has no 100k");
        assert_eq!(
            line(&table, 0),
            "Case 4 | TS-Bones (binary) | 4000 → 1291 | 250000 → 250000 | — | 250000 → 250020 | 250001 → 250021 | 54 | — | 1.9 | 1.9 | \
             21.00 | — | 20.00 | 50.00 | 5.02 | — | 0.005 | 0.005"
        );
        assert_eq!(cases(&rows).rows[0][3..6], ["1000000", "322824", "0.323"]);
        for table in [table_2(&rows, &results), table_6(&rows, &results)] {
            assert!(table.rows.iter().all(|row| row.len() == table.columns.len()), "{}", table.title);
        }
    }

    #[test]
    fn the_short_run_says_so() {
        assert!(preamble(&Effort::QUICK, "d").contains("Short run"));
        assert!(!preamble(&Effort::FULL, "d").contains("Short run"));
    }
}
