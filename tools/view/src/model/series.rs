//! Series of a DICOM folder, of which the user chooses one.

use engine::volume::dicom;

use crate::model::state::Files;

/// Series of a folder or a zip, of which one is to be chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Files that are opened together with the series.
    pub files: Files,
    /// The series, in the order of their numbers.
    pub rows: Vec<dicom::Series>,
}
