//! Golden texts: lines of a name and numbers, each name with its tolerance, kept in `tests/golden/`.
//!
//! `UPDATE_GOLDEN=1` rewrites them. Without it a missing or different text fails the test, and the text that
//! was found is left in `target/golden/`.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::close::{Bound, compare};

/// One named row of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct GoldenRow {
    /// Name, without spaces.
    pub name: String,
    /// Numbers.
    pub values: Vec<f64>,
    /// Bound within which the numbers may move.
    pub bound: Bound,
}

impl GoldenRow {
    /// Creates a row.
    pub fn new(name: &str, bound: Bound, values: impl IntoIterator<Item = f64>) -> Self {
        GoldenRow { name: name.to_owned(), values: values.into_iter().collect(), bound }
    }
}

/// Writes some rows as text: on each line a name and up to eight of its numbers.
pub fn text(rows: &[GoldenRow]) -> String {
    let mut out = String::new();
    for row in rows {
        for numbers in row.values.chunks(8) {
            let _ = write!(out, "{}", row.name);
            for v in numbers {
                let _ = write!(out, " {v:.7e}");
            }
            out.push('\n');
        }
    }
    out
}

/// Returns the differences between rows and a text, one sentence each.
pub fn differences(rows: &[GoldenRow], golden: &str) -> Vec<String> {
    let mut found = Vec::new();
    for row in rows {
        let wanted: Result<Vec<f64>, _> = golden
            .lines()
            .filter_map(|line| line.strip_prefix(&row.name)?.strip_prefix(' '))
            .flat_map(|numbers| numbers.split_whitespace().map(str::parse::<f64>))
            .collect();
        let Ok(wanted) = wanted else {
            found.push(format!("{}: not a number in the golden text", row.name));
            continue;
        };
        if wanted.len() != row.values.len() {
            found.push(format!(
                "{}: {} numbers, {} in the golden text",
                row.name,
                row.values.len(),
                wanted.len()
            ));
            continue;
        }
        let report = compare(row.bound, row.values.iter().copied().zip(wanted));
        println!("golden {}: worst {:.3} of the bound, {:?}", row.name, report.worst, report.worst_at);
        if !report.holds(row.bound) {
            found.push(format!("{}: beyond {:?}: {report:?}", row.name, row.bound));
        }
    }
    let known = |line: &&str| rows.iter().any(|row| line.split(' ').next() == Some(&row.name));
    found.extend(golden.lines().filter(|line| !known(line)).map(|line| format!("no longer made: {line}")));
    found
}

/// Compares rows with the golden text `name`, or rewrites it.
pub fn check(name: &str, rows: &[GoldenRow]) {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/golden"));
    let path = folder.join(format!("{name}.txt"));
    let found = text(rows);
    if std::env::var_os("UPDATE_GOLDEN").is_some_and(|v| v == "1") {
        std::fs::create_dir_all(&folder).expect("the folder of golden texts");
        std::fs::write(&path, found).expect("writing a golden text");
        println!("{name}: rewritten");
        return;
    }
    let golden = std::fs::read_to_string(&path).unwrap_or_else(|e| {
        panic!("the golden text {name}.txt cannot be read ({e}); UPDATE_GOLDEN=1 writes it")
    });
    let differences = differences(rows, &golden);
    if !differences.is_empty() {
        let left = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target/golden"));
        let actual = left.join(format!("{name}.txt"));
        let kept = std::fs::create_dir_all(&left).and_then(|()| std::fs::write(&actual, found));
        let place = if kept.is_ok() { "target/golden/ has what was found" } else { "what was found is lost" };
        panic!(
            "{name} differs from its golden text ({place}; UPDATE_GOLDEN=1 accepts it):\n{}",
            differences.join("\n")
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_agrees_with_its_rows_and_with_nothing_else() {
        let rows = |second: f64| {
            [
                GoldenRow::new("a", Bound::new(0.01, 0.0), (0..20).map(f64::from)),
                GoldenRow::new("ab", Bound::new(0.0, 1e-6), [second]),
            ]
        };
        let golden = text(&rows(5.0));
        assert_eq!(golden.lines().count(), 4);
        assert_eq!(differences(&rows(5.0), &golden), Vec::<String>::new());
        assert_eq!(differences(&rows(5.1), &golden).len(), 1);
        assert_eq!(
            differences(&rows(5.0), &golden.replace("ab ", "b ")).len(),
            2,
            "one missing, one too many"
        );
        assert_eq!(differences(&rows(5.0)[..1], &golden).len(), 1);
        assert_eq!(differences(&rows(5.0), &golden.replace("5.0000000e0", "x")).len(), 2);
        assert_eq!(differences(&rows(5.0), &golden[..golden.len() / 2]).len(), 2, "numbers are missing");
    }
}
