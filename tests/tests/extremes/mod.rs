//! The scenarios N1 to N28 of docs/results/data/numerics.csv, one module a subject, and the extremes of real data. Each test measures
//! how far off the worst value is and hands that to `numerics::keep`, which holds it to its bound.

mod devices;
mod field;
mod fuzz;
mod gradient;
mod measures;
mod order;
mod pictures;
mod places;
mod real;
mod shape;
mod storage;

use vgs_tests::numerics::{self, ROWS, seen, table, written};

#[test]
fn the_table_is_whole() {
    if numerics::writing() {
        println!("the table is being written by the tests beside this one");
        return;
    }
    let text = std::fs::read_to_string(table()).expect("docs/results/data/numerics.csv");
    assert_eq!(text, written(|id| seen(&text, id)), "the table has other words");
    for scenario in 1..=28 {
        let of_this = |id: &str| {
            id.strip_prefix('N')
                .is_some_and(|n| n.trim_end_matches(char::is_alphabetic) == scenario.to_string())
        };
        assert!(ROWS.iter().any(|row| of_this(row.id)), "no row for N{scenario}");
    }
    for (i, row) in ROWS.iter().enumerate() {
        assert!(ROWS[..i].iter().all(|other| other.id != row.id), "{} twice", row.id);
        let worst: f64 = seen(&text, row.id).and_then(|v| v.parse().ok()).unwrap_or(f64::NAN);
        assert!(worst <= row.bound, "{}: {worst} in the table", row.id);
        let (file, function) = row.test.split_once("::").expect("file::function");
        let path = format!("{}/tests/extremes/{file}.rs", env!("CARGO_MANIFEST_DIR"));
        let code = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {path}: {e}", row.id));
        assert!(code.contains(&format!("fn {function}()")), "{}: no test {}", row.id, row.test);
        assert!(code.contains(&format!("\"{}\"", row.id)), "{}: {path} keeps no such row", row.id);
    }
}
