//! The table docs/results/data/numerics.csv: scenarios at the extremes, with the bound of each error and the
//! worst one seen.
//!
//! A test hands its measured value to [`keep`], which holds it to the bound of its [`ExtremeRow`] and to the
//! words of the table. `VGS_WRITE_NUMERICS=1` writes the table anew, with the measured values; they differ
//! from device to device, so without it only the bound counts.

use std::fs::File;
use std::path::{Path, PathBuf};

mod rows;

pub use rows::ROWS;

/// One scenario of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtremeRow {
    /// Identifier: N and the number of the scenario, with a letter if it has several figures; R for real
    /// data.
    pub id: &'static str,
    /// Scenario that is tried.
    pub scenario: &'static str,
    /// Measured quantity, with its unit.
    pub measured: &'static str,
    /// The greatest value that is accepted.
    pub bound: f64,
    /// The test, as `file::function` below `tests/tests/extremes/`.
    pub test: &'static str,
}

const HEAD: &str = "number,worst_seen,at_most,measured,scenario,test\n";

/// Returns the path of docs/results/data/numerics.csv.
pub fn table() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results/data/numerics.csv")
}

/// Returns true if the table is to be written anew.
pub fn writing() -> bool {
    std::env::var_os("VGS_WRITE_NUMERICS").is_some_and(|v| v == "1")
}

/// Holds a measured value to the row `id`; writes it to the table if [`writing`].
///
/// # Panics
/// If the value is beyond the bound or not a number, or if the table has other words for the row.
pub fn keep(id: &str, worst: f64) {
    let row = ROWS.iter().find(|row| row.id == id).unwrap_or_else(|| panic!("no row is called {id}"));
    println!("{id}: {}: {worst:.3e}, at most {}", row.measured, number(row.bound));
    assert!(worst <= row.bound, "{id}: {}: {worst} is beyond {}", row.measured, row.bound);
    let table = table();
    if writing() {
        // Tests are processes that run at the same time, so they take a lock.
        let lock = File::create(std::env::temp_dir().join("vgs-numerics.lock")).expect("a lock");
        lock.lock().expect("the lock");
        let text = std::fs::read_to_string(&table).unwrap_or_default();
        let new = written(|other| if other == id { Some(number(worst)) } else { seen(&text, other) });
        std::fs::write(&table, new).expect("writing the table");
        return;
    }
    let text = std::fs::read_to_string(&table).expect("docs/results/data/numerics.csv");
    let kept = seen(&text, id).unwrap_or_default();
    assert!(
        text.lines().any(|found| found == line(row, &kept)),
        "docs/results/data/numerics.csv has other words for {id}; VGS_WRITE_NUMERICS=1 writes it anew"
    );
}

/// Returns the worst value of a row in the text of the table.
pub fn seen(text: &str, id: &str) -> Option<String> {
    let (_, rest) = text.lines().filter_map(|line| line.split_once(',')).find(|(number, _)| *number == id)?;
    Some(rest.split(',').next()?.to_owned())
}

/// Returns the table with the worst values that `seen` returns.
pub fn written(seen: impl Fn(&str) -> Option<String>) -> String {
    let lines = ROWS.iter().map(|row| line(row, &seen(row.id).unwrap_or_default()) + "\n");
    HEAD.to_owned() + &lines.collect::<String>()
}

fn line(row: &ExtremeRow, worst: &str) -> String {
    let ExtremeRow { id, scenario, measured, test, .. } = row;
    format!("{id},{worst},{},{},{},{test}", number(row.bound), quoted(measured), quoted(scenario))
}

/// Returns a text as a cell, in quotes where it has a comma.
fn quoted(text: &str) -> String {
    if text.contains(',') { format!("\"{text}\"") } else { text.to_owned() }
}

/// Formats a number as in the table: whole numbers plainly, others with two digits.
fn number(v: f64) -> String {
    if v.fract() == 0.0 && v.abs() < 1e4 { format!("{v}") } else { format!("{v:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_written_and_read() {
        let text = written(|id| (id == ROWS[1].id).then(|| "2.5e-3".to_owned()));
        assert_eq!(seen(&text, ROWS[1].id).as_deref(), Some("2.5e-3"));
        assert_eq!(seen(&text, ROWS[0].id).as_deref(), Some(""));
        assert_eq!(seen(&text, "N"), None);
        assert_eq!(text.lines().count(), 1 + ROWS.len());
    }

    #[test]
    #[should_panic(expected = "is beyond")]
    fn what_is_beyond_its_bound_fails() {
        keep(ROWS[0].id, ROWS[0].bound + 1.0);
    }

    #[test]
    #[should_panic(expected = "is beyond")]
    fn what_is_no_number_fails() {
        keep(ROWS[0].id, f64::NAN);
    }
}
