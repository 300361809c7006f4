//! The rows that say what a reader does with each field of a file's header. Each reader has such a table beside it, its
//! tests put every refused value into a file, and `docs/design/fields.csv` is written from all of them.
//!
//! A reader has three answers: the value, that there is none, or an error that names the field. A default stands for a
//! field that is absent, never for one that cannot be read.

/// A field of a file's header.
#[derive(Clone, Copy, Debug)]
pub struct FieldRow {
    /// The name, as the format spells it. Errors have it.
    pub name: &'static str,
    /// What is read from it; or that it is not used, and why.
    pub used: &'static str,
    /// What a file without it means; empty if a file must have it.
    pub absent: &'static str,
    /// Some of the values that are refused. Empty if nothing is: the field is not used, or says anything.
    pub refused: &'static [&'static str],
}

impl FieldRow {
    /// Creates the row of a field that a file must have.
    pub(super) const fn needed(
        name: &'static str,
        used: &'static str,
        refused: &'static [&'static str],
    ) -> Self {
        FieldRow { name, used, absent: "", refused }
    }

    /// Creates the row of a field that a file may have.
    pub(super) const fn with_default(
        name: &'static str,
        used: &'static str,
        absent: &'static str,
        refused: &'static [&'static str],
    ) -> Self {
        FieldRow { name, used, absent, refused }
    }

    /// Creates the row of a field that is not used; `why` says what stands for it.
    pub(super) const fn unused(name: &'static str, why: &'static str) -> Self {
        FieldRow { name, used: why, absent: "the same", refused: &[] }
    }
}
