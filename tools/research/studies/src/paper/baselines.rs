//! Reproduces Table 3: the error of a volume that was downsampled and enlarged again.
//!
//! The README.md of the data folder states these figures, computed by another program; `check` compares ours
//! with them for all cases and masks. It also defines them: `minmax` normalises by the range of the whole
//! volume, `win` clips to ±1000 HU first; volumes are reduced by block mean or linear interpolation, and
//! enlarged by linear interpolation.

use std::path::{Path, PathBuf};

use engine::volume::resample::{AREA, Downsampling, LINEAR, downsampling_loss};
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use engine::{Error, Kind, Result};

use super::published::{CASES, TABLE_3};
use super::results::{db, mmse};
use bench::report::Table;
use bench::scene::help;

/// Greatest difference between our figures and the README's, dB.
const TOLERANCE_DB: f64 = 0.01;
/// Range of the norm `win`, HU.
const WINDOW: [f32; 2] = [-1000.0, 1000.0];

/// Column of the README, factor and filter of each downsampling.
const WAYS: [(&str, usize, Downsampling); 3] =
    [("x2", 2, AREA), ("x4 area", 4, AREA), ("x4 linear", 4, LINEAR)];

/// MMSE for each of [`WAYS`].
type Errors = [f64; 3];

fn psnr(mmse: f64) -> f64 {
    -10.0 * mmse.log10()
}

/// Returns the paper's Table 3 with our figures beside it, as Markdown.
pub fn table(data: &Path) -> Result<String> {
    let mut rows = Vec::new();
    for (i, case) in CASES.iter().enumerate() {
        eprintln!("downsampling {} for {}", case.folder, case.file);
        let volume = Case::read(data, case.folder)?;
        let [two, area, linear] = volume.errors(case.file, Norm::MinMax)?;
        for (factor, area, linear) in [(2, two, two), (4, area, linear)] {
            let paper = TABLE_3.iter().find(|row| (row.case, row.factor) == (i, factor));
            let figures = |error: f64| [mmse(error), db(psnr(error))];
            let [dash_mmse, dash_psnr] = ["—", "—"].map(str::to_owned);
            let [paper_mmse, paper_psnr] =
                paper.map_or([dash_mmse, dash_psnr], |row| [mmse(row.mmse), db(row.psnr)]);
            let ([area_mmse, area_psnr], [linear_mmse, linear_psnr]) = (figures(area), figures(linear));
            rows.push(vec![
                case.name.to_owned(),
                case.mask.to_owned(),
                format!("÷{factor}"),
                paper_mmse,
                paper_psnr,
                area_mmse,
                area_psnr,
                linear_mmse,
                linear_psnr,
            ]);
        }
    }
    let table = Table {
        title: "## Table 3: downsampled volumes\n\nDown by block mean or by linear interpolation (at ÷2 the same), up by linear \
                interpolation, against the volume itself in the region; over the range of the whole volume. The paper says neither \
                how it resampled nor over which range."
            .into(),
        columns: vec![
            "dataset",
            "mask",
            "factor",
            "paper: MMSE",
            "PSNR, dB",
            "block mean: MMSE",
            "PSNR, dB",
            "linear: MMSE",
            "PSNR, dB",
        ],
        rows,
    };
    Ok(table.markdown())
}

/// Computes every row of the README's table, prints them and returns an error if one differs.
pub fn check(data: &Path) -> Result<()> {
    let path = data.join("README.md");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io(&path, "reading", &e))?;
    let stated = parse(&text).map_err(|e| e.file(&path))?;
    let mut rows = Vec::new();
    let mut wrong = Vec::new();
    // Rows of one case stand together, so that its volume is read once.
    for group in stated.chunk_by(|a, b| a.case == b.case) {
        eprintln!("downsampling {}, {} rows", group[0].case, group.len());
        let case = Case::read(data, &group[0].case)?;
        for row in group {
            let (cells, worst) = compare(row, &case.errors(&row.mask, row.norm)?);
            if worst > TOLERANCE_DB {
                wrong.push(format!("{} {} {}", row.case, row.mask, row.norm.name()));
            }
            rows.push(cells);
        }
    }
    let table = Table {
        title: format!("Downsampled volumes, ours and those of {}", path.display()),
        columns: vec![
            "case",
            "mask",
            "norm",
            "x2: ours, dB",
            "README",
            "difference",
            "x4 area: ours, dB",
            "README",
            "difference",
            "x4 linear: ours, dB",
            "README",
            "difference",
        ],
        rows,
    };
    println!("{}", table.markdown());
    if wrong.is_empty() {
        println!("all {} rows agree to {TOLERANCE_DB} dB", stated.len());
        return Ok(());
    }
    let message = format!(
        "{} of {} rows differ from the README by more than {TOLERANCE_DB} dB: {}",
        wrong.len(),
        stated.len(),
        wrong.join(", ")
    );
    Err(Error::new(Kind::BadData, "VGS-BEN-004", message).file(&path).help(
        "compare the checksums of the data with those in the README; if they agree, the resampling is wrong",
    ))
}

/// Returns the cells of a row, and its greatest difference in dB. It compares the errors with their stated
/// digits, since dB are rounded.
fn compare(stated: &Stated, errors: &Errors) -> (Vec<String>, f64) {
    let mut cells = vec![stated.case.clone(), stated.mask.clone(), stated.norm.name().to_owned()];
    let mut worst = 0.0f64;
    for (error, stated) in errors.iter().zip(stated.errors) {
        let difference = psnr(*error) - psnr(stated);
        cells.extend([
            format!("{:.3}", psnr(*error)),
            format!("{:.3}", psnr(stated)),
            format!("{difference:+.4}"),
        ]);
        // A difference that is not a number must not pass.
        worst = if difference.is_nan() { f64::INFINITY } else { worst.max(difference.abs()) };
    }
    (cells, worst)
}

/// Normalisation of errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Norm {
    MinMax,
    Window,
}

impl Norm {
    fn name(self) -> &'static str {
        match self {
            Norm::MinMax => "minmax",
            Norm::Window => "win",
        }
    }
}

/// Row of the README.
#[derive(Debug, PartialEq)]
struct Stated {
    case: String,
    mask: String,
    norm: Norm,
    errors: Errors,
}

/// Reads the table of baselines in a README: the first one with the columns case, mask and norm.
fn parse(text: &str) -> Result<Vec<Stated>> {
    let bad = |message: String| Error::new(Kind::BadData, "VGS-BEN-005", message);
    let cells = |line: &str| -> Vec<String> {
        line.trim().trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
    };
    let mut lines = text.lines();
    let columns = lines.by_ref().filter(|line| line.starts_with('|')).map(cells).find(|columns| {
        ["case", "mask", "norm"].iter().all(|name| columns.iter().any(|column| column == name))
    });
    let Some(columns) = columns else {
        return Err(bad("there is no table with the columns case, mask and norm".into()));
    };
    let column = |name: &str| {
        let found = columns.iter().position(|column| column == name);
        found.ok_or_else(|| bad(format!("the table of baselines has no column {name:?}")))
    };
    let [case, mask, norm] = [column("case")?, column("mask")?, column("norm")?];
    let mut errors = [0; 3];
    for (at, (name, ..)) in errors.iter_mut().zip(WAYS) {
        *at = column(&format!("{name} MMSE"))?;
    }
    let mut rows = Vec::new();
    for line in lines.take_while(|line| line.starts_with('|')).filter(|line| !line.starts_with("|--")) {
        let row = cells(line);
        if row.len() != columns.len() {
            return Err(bad(format!("{} cells, {} are needed: {line}", row.len(), columns.len())));
        }
        let norm = match row[norm].as_str() {
            "minmax" => Norm::MinMax,
            "win" => Norm::Window,
            other => return Err(bad(format!("the normalisation {other:?} is neither minmax nor win"))),
        };
        let mut figures = [0.0; 3];
        for (figure, &at) in figures.iter_mut().zip(&errors) {
            *figure = row[at].parse().map_err(|_| bad(format!("{:?} is no number: {line}", row[at])))?;
        }
        rows.push(Stated { case: row[case].clone(), mask: row[mask].clone(), norm, errors: figures });
    }
    if rows.is_empty() {
        return Err(bad("the table of baselines has no rows".into()));
    }
    Ok(rows)
}

/// Volume of the data folder.
struct Case {
    folder: PathBuf,
    volume: Volume,
}

impl Case {
    fn read(data: &Path, case: &str) -> Result<Self> {
        let folder = data.join(case);
        let file = ["ct.nii.gz", "mr.nii.gz"].map(|name| folder.join(name));
        let file = file.iter().find(|path| path.exists()).unwrap_or(&file[0]);
        let volume = Volume::read(file, &ReadOptions::default()).map_err(help)?;
        Ok(Case { folder, volume })
    }

    /// Returns the errors of all [`WAYS`] within a mask.
    fn errors(&self, mask: &str, norm: Norm) -> Result<Errors> {
        let range = match norm {
            Norm::MinMax => self.volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default(),
            Norm::Window => WINDOW,
        };
        let path = self.folder.join(format!("{mask}.nii.gz"));
        let mask = Volume::read(&path, &ReadOptions::default()).map_err(help)?;
        let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &self.volume)?;
        Ok(WAYS.map(|(_, factor, how)| downsampling_loss(&self.volume, &roi, factor, &how, range).mmse))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const README: &str = "\
# Data
| case | what |
|---|---|
| ct-a | a CT |

## Baseline
text
| case | mask | norm | x2 MMSE | x2 PSNR dB | x4 area MMSE | x4 area PSNR | x4 linear MMSE | x4 linear PSNR |
|---|---|---|---|---|---|---|---|---|
| ct-a | mask_b | minmax | 0.001 | 30.00 | 0.01 | 20.00 | 2e-05 | 46.99 |
| ct-a | mask_b | win | 0.1 | 10.00 | 0.2 | 6.99 | 0.3 | 5.23 |

| other | table |
";

    #[test]
    fn the_table_of_a_readme_is_read_by_its_column_names() {
        let rows = parse(README).expect("a table");
        assert_eq!(rows.len(), 2);
        let first = Stated {
            case: "ct-a".into(),
            mask: "mask_b".into(),
            norm: Norm::MinMax,
            errors: [1e-3, 1e-2, 2e-5],
        };
        assert_eq!(rows[0], first);
        assert_eq!((rows[1].norm, rows[1].errors), (Norm::Window, [0.1, 0.2, 0.3]));
    }

    #[test]
    fn what_is_no_such_table_is_refused() {
        let rows = [
            (README.replace("| norm |", "| range |"), "no table"),
            (README.replace("x4 linear MMSE", "x8 MMSE"), "x4 linear MMSE"),
            (README.replace("2e-05", "two"), "no number"),
            (README.replace("| win |", "| full |"), "neither"),
            (README.replace(" | 46.99 |", " |"), "8 cells"),
            (README[..README.find("| ct-a | mask_b").unwrap_or_default()].to_owned(), "no rows"),
        ];
        for (text, says) in rows {
            let error = parse(&text).expect_err(says);
            assert!(error.message.contains(says), "{} instead of {says}", error.message);
        }
    }

    #[test]
    fn a_difference_counts_in_every_way() {
        let stated = &parse(README).expect("a table")[0];
        assert!(compare(stated, &stated.errors).1 < 1e-12);
        for way in 0..3 {
            let mut errors = stated.errors;
            errors[way] *= 1.005;
            let (cells, worst) = compare(stated, &errors);
            assert!((worst - 0.0217).abs() < 1e-3, "{worst}");
            assert_eq!(cells[3 * way + 5], "-0.0217");
            errors[way] = f64::NAN;
            assert_eq!(compare(stated, &errors).1, f64::INFINITY);
        }
    }
}
