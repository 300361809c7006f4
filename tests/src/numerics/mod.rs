//! The table of docs/results/numerics.md: scenarios at the extremes, with the bound of each error and the
//! worst one seen.
//!
//! A test hands its measured value to [`keep`], which holds it to the bound of its [`ExtremeRow`] and to the
//! words of the docs. `VGS_WRITE_NUMERICS=1` writes the table anew, with the measured values; they differ
//! from device to device, so without it only the bound counts.

use std::fmt::Write as _;
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

const BEGIN: &str = "| # | scenario | measured | at most | worst seen | test |\n|---|---|---|---|---|---|\n";

/// Returns the path of docs/results/numerics.md.
pub fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results/numerics.md")
}

/// Returns true if the table is to be written anew.
pub fn writing() -> bool {
    std::env::var_os("VGS_WRITE_NUMERICS").is_some_and(|v| v == "1")
}

/// Holds a measured value to the row `id`; writes it to the docs if [`writing`].
///
/// # Panics
/// If the value is beyond the bound or not a number, or if the docs have other words for the row.
pub fn keep(id: &str, worst: f64) {
    let row = ROWS.iter().find(|row| row.id == id).unwrap_or_else(|| panic!("no row is called {id}"));
    println!("{id}: {}: {worst:.3e}, at most {}", row.measured, number(row.bound));
    assert!(worst <= row.bound, "{id}: {}: {worst} is beyond {}", row.measured, row.bound);
    let page = page();
    if writing() {
        // Tests are processes that run at the same time, so they take a lock.
        let lock = File::create(std::env::temp_dir().join("vgs-numerics.lock")).expect("a lock");
        lock.lock().expect("the lock");
        let text = std::fs::read_to_string(&page).expect("docs/results/numerics.md");
        std::fs::write(&page, with(&text, id, &number(worst))).expect("writing docs/results/numerics.md");
        return;
    }
    let text = std::fs::read_to_string(&page).expect("docs/results/numerics.md");
    let found = text.lines().find(|line| line.starts_with(&format!("| {id} |")));
    let kept = seen(&text, id).unwrap_or_default();
    assert_eq!(
        found,
        Some(line(row, &kept).as_str()),
        "docs/results/numerics.md; VGS_WRITE_NUMERICS=1 writes it anew"
    );
}

/// Returns the worst value of a row in the text.
pub fn seen(text: &str, id: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with(&format!("| {id} |")))?;
    Some(line.split(" | ").nth(4)?.trim().to_owned())
}

/// Writes the table with the worst values that `seen` returns.
pub fn table(seen: impl Fn(&str) -> Option<String>) -> String {
    let mut out = BEGIN.to_owned();
    for row in ROWS {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{}", line(row, &seen(row.id).unwrap_or_default()));
    }
    out
}

/// Returns the text with its table written anew, and a new worst value for a row.
fn with(text: &str, id: &str, worst: &str) -> String {
    let start = text.find(BEGIN).expect("docs/results/numerics.md has a table");
    let length: usize =
        text[start..].split_inclusive('\n').take_while(|l| l.starts_with('|')).map(str::len).sum();
    let new = table(|row| if row == id { Some(worst.to_owned()) } else { seen(text, row) });
    format!("{}{new}{}", &text[..start], &text[start + length..])
}

fn line(row: &ExtremeRow, worst: &str) -> String {
    let ExtremeRow { id, scenario, measured, test, .. } = row;
    format!("| {id} | {scenario} | {measured} | {} | {worst} | `{test}` |", number(row.bound))
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
        let id = ROWS[1].id;
        let text = format!("before\n\n{}\nafter\n", table(|_| Some("1".into())));
        let new = with(&text, id, "2.5e-3");
        assert_eq!(seen(&new, id).as_deref(), Some("2.5e-3"));
        assert_eq!(seen(&new, ROWS[0].id).as_deref(), Some("1"));
        assert!(new.starts_with("before\n\n|") && new.ends_with("|\n\nafter\n"));
        assert_eq!(new.lines().count(), text.lines().count());
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
