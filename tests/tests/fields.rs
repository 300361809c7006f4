//! docs/design/fields.csv is what the readers' tables say: every field of a file's header, what it is used for, what its
//! absence means, and what is refused. `VGS_WRITE_FIELDS=1` writes the file anew.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use engine::volume::{FORMATS, dicom};

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/design/fields.csv")
}

/// Returns a line of cells in quotes (RFC 4180).
fn line<'a>(cells: impl IntoIterator<Item = &'a str>) -> String {
    let quoted = cells.into_iter().map(|cell| format!("\"{}\"", cell.replace('"', "\"\"")));
    quoted.collect::<Vec<_>>().join(",") + "\n"
}

fn written() -> String {
    let mut out = line(["format", "field", "used for", "absent", "refused, such as"]);
    for format in FORMATS {
        for row in format.fields {
            let absent = if row.absent.is_empty() { "refused" } else { row.absent };
            let refused: Vec<_> =
                row.refused.iter().map(|v| if v.is_empty() { "nothing" } else { v }).collect();
            out += &line([format.name, row.name, row.used, absent, &refused.join(" ")]);
        }
    }
    for row in dicom::element_rows() {
        let refused = match row.unreadable {
            "refused" => "all that cannot be read".to_owned(),
            other => format!("nothing: what cannot be read is {other}"),
        };
        out += &line(["DICOM", &row.element, "", &row.absent, &refused]);
    }
    out
}

#[test]
fn the_file_is_what_the_readers_say() {
    let new = written();
    if std::env::var_os("VGS_WRITE_FIELDS").is_some_and(|v| v == "1") {
        std::fs::write(file(), &new).expect("writing docs/design/fields.csv");
    }
    let old = std::fs::read_to_string(file()).unwrap_or_default();
    assert!(new == old, "docs/design/fields.csv is out of date; VGS_WRITE_FIELDS=1 writes it anew");
}

#[test]
fn a_field_has_one_row() {
    for format in FORMATS {
        let names: BTreeSet<_> = format.fields.iter().map(|row| row.name).collect();
        assert_eq!(names.len(), format.fields.len(), "{}", format.name);
        assert!(format.fields.iter().all(|row| !row.used.is_empty()), "{}", format.name);
    }
}
