//! Names of elements and properties, and the first bytes of a PLY.

/// The properties that hold intensity and label, of the vertices or of [`INTENSITY_ELEMENT`].
pub(super) const INTENSITY_PROPERTY: &str = "intensity";
pub(super) const LABEL_PROPERTY: &str = "label";

/// The second element of some files, with one row per vertex.
pub(super) const INTENSITY_ELEMENT: &str = "splat_intensity";

/// The element of a region, and that of files from before there were regions; and its property, a byte of their code.
pub(super) const REGION_ELEMENT: &str = "region";
pub(super) const EXCEPTION_ELEMENT: &str = "exception";
pub(super) const CODE_PROPERTY: &str = "code";

/// The colour of degree 0; [`rest_property`] names the others.
pub(super) const COLOUR_PROPERTIES: [&str; 3] = ["f_dc_0", "f_dc_1", "f_dc_2"];

/// Returns the name of the vertex property of a harmonic beyond degree 0: all of red by rising degree, then
/// green, then blue.
pub(super) fn rest_property(index: usize) -> String {
    format!("f_rest_{index}")
}

pub(crate) fn sniff(start: &[u8]) -> bool {
    start.strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
}
