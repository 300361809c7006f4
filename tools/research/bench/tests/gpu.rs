//! `bench gpu` runs its steps once, goes on where it ended, and says what is missing.

use std::path::Path;
use std::process::{Command, Output};

fn bench(out: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_bench");
    let mut command = match std::env::var_os("VGS_RUNNER") {
        Some(runner) => {
            let mut command = Command::new(runner);
            command.arg(program);
            command
        }
        None => Command::new(program),
    };
    command.args(["gpu", "--quick", "--only", "passes", "--out"]).arg(out).args(arguments);
    command.output().expect("bench starts")
}

#[test]
fn steps_are_run_once_and_what_is_missing_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("results");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();

    let late = bench(&out, &["--minutes", "0"]);
    let said = text(&late.stderr);
    assert_eq!(late.status.code(), Some(75), "{said}");
    assert!(said.contains("VGS-BEN-051") && said.contains("passes") && said.contains("goes on"), "{said}");
    assert!(std::fs::read_to_string(out.join("gpu.md")).expect("a report").contains("not yet run"));

    let first = bench(&out, &[]);
    assert!(first.status.success(), "{}", text(&first.stderr));
    let report = std::fs::read_to_string(out.join("gpu.md")).expect("a report");
    assert!(report.contains("Growth with splats") && !report.contains("not yet run"), "{report}");

    let again = bench(&out, &[]);
    assert!(again.status.success() && text(&again.stderr).contains("there already"));
    assert_eq!(std::fs::read_to_string(out.join("gpu.md")).expect("a report"), report);
}
