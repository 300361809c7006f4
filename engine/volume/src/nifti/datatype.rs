//! NIfTI datatypes: which exist, which are scalar, and their conversion to f64.

use crate::elements::{self, Element};

/// A datatype of the standard.
#[derive(Debug)]
pub(super) struct Datatype {
    pub code: i16,
    pub name: &'static str,
    /// Bytes of one voxel; 0 if the standard gives none.
    pub bytes: usize,
    /// Type of a voxel, if it is one number that this program can use.
    pub element: Option<&'static Element>,
}

const fn row(code: i16, name: &'static str, bytes: usize) -> Datatype {
    Datatype { code, name, bytes, element: None }
}

const fn scalar(code: i16, of: &'static Element) -> Datatype {
    Datatype { code, name: of.name, bytes: of.bytes, element: Some(of) }
}

/// Every datatype of the standard.
pub(super) const DATATYPES: &[Datatype] = &[
    row(0, "unknown", 0),
    row(1, "binary", 0),
    scalar(2, &elements::UINT8),
    scalar(4, &elements::INT16),
    scalar(8, &elements::INT32),
    scalar(16, &elements::FLOAT32),
    row(32, "complex64", 8),
    scalar(64, &elements::FLOAT64),
    row(128, "RGB", 3),
    scalar(256, &elements::INT8),
    scalar(512, &elements::UINT16),
    scalar(768, &elements::UINT32),
    scalar(1024, &elements::INT64),
    scalar(1280, &elements::UINT64),
    row(1536, "float128", 16),
    row(1792, "complex128", 16),
    row(2048, "complex256", 32),
    row(2304, "RGBA", 4),
];
