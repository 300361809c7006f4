//! docs/results/data/reliability.csv has the rows of `inputs`, and docs/results/reliability.md those that do not hold. Each row
//! there and in `found`, the faults of files that readers once took, names the tests that show it, and they are there.
//! `VGS_WRITE_RELIABILITY=1` writes both anew.

mod found;
mod inputs;
mod named;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use found::FOUND;
use inputs::INPUTS;
use named::ALL_READERS;

/// A test that shows what a row claims.
#[derive(Clone, Copy)]
pub struct Test {
    /// Source file from the root of the repository.
    file: &'static str,
    /// Name of the function.
    function: &'static str,
    /// Texts in the file that are the cases of a table.
    cases: &'static [&'static str],
}

/// Returns a test of a file, or cases of one.
pub const fn t(file: &'static str, function: &'static str, cases: &'static [&'static str]) -> Test {
    Test { file, function, cases }
}

/// Whether the tests show it.
#[derive(Clone, Copy)]
pub enum Verdict {
    /// All of it.
    Holds,
    /// What is said here.
    Partly(&'static str),
    /// Nothing shows it, for the reason that is said here.
    Untested(&'static str),
}

/// What is done to the program, and what it must do then.
pub struct Row {
    number: u8,
    input: &'static str,
    must: &'static str,
    tests: &'static [Test],
    verdict: Verdict,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_owned()
}

fn page() -> PathBuf {
    root().join("docs/results/reliability.md")
}

fn data() -> PathBuf {
    root().join("docs/results/data/reliability.csv")
}

impl Row {
    fn verdict(&self) -> String {
        match self.verdict {
            Verdict::Holds => "holds".to_owned(),
            Verdict::Partly(what) => format!("partly: {what}"),
            Verdict::Untested(why) => format!("not tested: {why}"),
        }
    }
}

/// Returns all rows as a table of comma-separated values.
fn csv(rows: &[Row]) -> String {
    let cell = |text: &str| if text.contains([',', '"']) { format!("\"{text}\"") } else { text.to_owned() };
    let lines = rows.iter().map(|row| {
        format!("{},{},{},{}\n", row.number, cell(row.input), cell(row.must), cell(&row.verdict()))
    });
    "number,what,must_be,verdict\n".to_owned() + &lines.collect::<String>()
}

/// Returns a table of the rows that do not hold, or not all of them.
fn table(rows: &[Row]) -> String {
    let mut out = "| | what | must be | verdict |\n|---|---|---|---|\n".to_owned();
    for row in rows.iter().filter(|row| !matches!(row.verdict, Verdict::Holds)) {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "| {} | {} | {} | {} |", row.number, row.input, row.must, row.verdict());
    }
    out
}

/// Returns the parts of the page that are made here, with the marks that stand before and after each.
fn parts() -> [(&'static str, String); 2] {
    let count = |of: fn(&Verdict) -> bool| INPUTS.iter().filter(|row| of(&row.verdict)).count();
    let sum = format!(
        "Of {} rows {} hold, {} hold in part, {} are not tested.\n",
        INPUTS.len(),
        count(|v| matches!(v, Verdict::Holds)),
        count(|v| matches!(v, Verdict::Partly(_))),
        count(|v| matches!(v, Verdict::Untested(_))),
    );
    [("sum", sum), ("inputs", table(INPUTS))]
}

/// Returns the page with its parts made anew.
fn written(old: &str) -> String {
    let mut new = old.to_owned();
    for (name, text) in parts() {
        let [begin, end] = [format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->")];
        let Some((before, rest)) = new.split_once(&begin) else { panic!("the page has no {begin}") };
        let Some((_, after)) = rest.split_once(&end) else { panic!("the page has no {end}") };
        new = format!("{before}{begin}{text}{end}{after}");
    }
    new
}

#[test]
fn the_page_is_what_the_rows_say() {
    let old = std::fs::read_to_string(page()).expect("docs/results/reliability.md");
    let new = written(&old);
    if std::env::var_os("VGS_WRITE_RELIABILITY").is_some_and(|v| v == "1") {
        std::fs::write(page(), new).expect("writing docs/results/reliability.md");
        std::fs::write(data(), csv(INPUTS)).expect("writing the rows");
        return;
    }
    let rows = std::fs::read_to_string(data()).expect("docs/results/data/reliability.csv");
    assert_eq!(rows, csv(INPUTS), "VGS_WRITE_RELIABILITY=1 writes it anew");
    let first = new.lines().zip(old.lines()).find(|(new, old)| new != old);
    assert!(
        new == old,
        "docs/results/reliability.md is out of date; VGS_WRITE_RELIABILITY=1 writes it anew. The first line that \
         differs, as it should be and as it is: {first:?}"
    );
}

/// Returns what is wrong with a test that a row names.
fn fault(test: &Test) -> Option<String> {
    let Test { file, function, cases } = test;
    let Ok(code) = std::fs::read_to_string(root().join(file)) else {
        return Some(format!("there is no {file}"));
    };
    let name = format!("fn {function}(");
    let Some(at) = code.find(&name) else { return Some(format!("{file} has no {function}")) };
    // The attribute stands above, before any other function.
    let above = &code[..at];
    let is_test = above.rfind("#[test]").is_some_and(|test| !above[test..].contains("fn "));
    if !is_test {
        return Some(format!("{file}: {function} is no test"));
    }
    let missing = cases.iter().find(|case| !code.contains(&format!("\"{case}\"")))?;
    Some(format!("{file} has no case {missing:?} for {function}"))
}

#[test]
fn every_test_that_is_named_is_there() {
    let rows = INPUTS.iter().chain(FOUND);
    let faults: Vec<String> = rows.flat_map(|row| row.tests).chain(ALL_READERS).filter_map(fault).collect();
    assert!(faults.is_empty(), "{faults:#?}");
    for (what, of) in [
        ("there is no", t("nowhere.rs", "a", &[])),
        ("has no a_test_of_nothing", t("tests/tests/reliability/mod.rs", "a_test_of_nothing", &[])),
        ("is no test", t("tests/tests/reliability/mod.rs", "written", &[])),
        (
            "has no case",
            t("tests/tests/reliability/mod.rs", "the_page_is_what_the_rows_say", &["case\u{21}"]),
        ),
    ] {
        assert!(fault(&of).is_some_and(|fault| fault.contains(what)), "{what}");
    }
}

#[test]
fn rows_are_counted_and_a_verdict_has_its_tests() {
    for (rows, first, last) in [(INPUTS, 1, 70), (FOUND, 0, 32)] {
        let numbers: Vec<u8> = rows.iter().map(|row| row.number).collect();
        assert_eq!(numbers, (first..=last).collect::<Vec<u8>>());
        for row in rows {
            let is_shown = !matches!(row.verdict, Verdict::Untested(_));
            assert_eq!(is_shown, !row.tests.is_empty(), "row {}", row.number);
        }
    }
}
