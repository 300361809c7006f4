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
