//! docs/design/fields.md is what the readers' tables say: every field of a file's header, what it is used for, what its
//! absence means, and what is refused. `VGS_WRITE_FIELDS=1` writes the page anew.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use engine::volume::{FORMATS, FieldRow, dicom};

const HEAD: &str = "\
# Fields of headers

What the readers of volumes take from the header of a file. A reader has three answers: the value, that there is none, or an
error that names the field. A default stands for a field that is absent, never for one that cannot be read; the tests of each
reader put every value that is listed as refused into a file. A test writes this page from the tables beside the readers:
`VGS_WRITE_FIELDS=1 cargo test -p vgs-tests --test house fields`.
";

fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/design/fields.md")
}

fn cell(row: &FieldRow) -> String {
    let absent = if row.absent.is_empty() { "refused" } else { row.absent };
    let refused: Vec<_> =
        row.refused.iter().map(|value| format!("`{value}`").replace("``", "nothing")).collect();
    format!("| {} | {} | {absent} | {} |", row.name, row.used, refused.join(" "))
}

fn written() -> String {
    let mut out = HEAD.to_owned();
    for format in FORMATS.iter().filter(|format| !format.fields.is_empty()) {
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "\n## {}\n\n| field | used for | absent | refused, such as |\n|---|---|---|---|",
            format.name
        );
        for row in format.fields {
            let _ = writeln!(out, "{}", cell(row));
        }
    }
    out += "\n## DICOM\n\n| element | absent, or without a value | cannot be read |\n|---|---|---|\n";
    for row in dicom::element_rows() {
        let _ = writeln!(out, "| {} | {} | {} |", row.element, row.absent, row.unreadable);
    }
    out
}

#[test]
fn the_page_is_what_the_readers_say() {
    let new = written();
    if std::env::var_os("VGS_WRITE_FIELDS").is_some_and(|v| v == "1") {
        std::fs::write(page(), &new).expect("writing docs/design/fields.md");
    }
    let old = std::fs::read_to_string(page()).unwrap_or_default();
    assert!(new == old, "docs/design/fields.md is out of date; VGS_WRITE_FIELDS=1 writes it anew");
}

#[test]
fn a_field_has_one_row() {
    for format in FORMATS {
        let names: BTreeSet<_> = format.fields.iter().map(|row| row.name).collect();
        assert_eq!(names.len(), format.fields.len(), "{}", format.name);
        assert!(format.fields.iter().all(|row| !row.used.is_empty()), "{}", format.name);
    }
}
