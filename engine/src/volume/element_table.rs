//! The elements of headers that the readers use, as a table: what each of them means where it is absent, and where it
//! cannot be read. docs/design/elements.md is made of it.

use super::dicom;

/// An element of a header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ElementRow {
    /// Name of the format.
    pub reader: &'static str,
    /// Name of the element, and where it stands.
    pub element: String,
    /// What its absence means: the default, or what is done.
    pub absent: String,
    /// What is done if its value cannot be read.
    pub unreadable: String,
}

/// Returns the elements of all readers that have such a table, one reader after the other.
pub fn element_table() -> Vec<ElementRow> {
    [dicom::element_rows()].concat()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const HEAD: &str = "\
# Elements of headers

What each element that a reader of vgs uses means where it is absent, or has no value, and what is done where a value is
there and cannot be read: it never counts as absent. A default stands only where the standard has one. A test writes this
page from the tables of the readers: `VGS_WRITE_ELEMENTS=1 cargo test -p vgs-engine --lib element_table`.
";

    fn written() -> String {
        let mut out = HEAD.to_owned();
        let mut reader = "";
        for row in element_table() {
            if row.reader != reader {
                reader = row.reader;
                out += &format!("\n## {reader}\n\n| element | absent | cannot be read |\n|---|---|---|\n");
            }
            out += &format!("| {} | {} | {} |\n", row.element, row.absent, row.unreadable);
        }
        out
    }

    #[test]
    fn the_page_is_what_the_tables_say() {
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/design/elements.md");
        if std::env::var_os("VGS_WRITE_ELEMENTS").is_some_and(|v| v == "1") {
            std::fs::write(&page, written()).expect("docs/design/elements.md");
        }
        let found = std::fs::read_to_string(&page).unwrap_or_default();
        assert!(
            found == written(),
            "docs/design/elements.md is out of date; VGS_WRITE_ELEMENTS=1 writes it anew"
        );
    }
}
