//! Names as Vulkan takes them.

use std::ffi::CString;

/// Turns a name into a `CString`; a name with a NUL inside loses what follows it.
pub(super) fn c_name(name: &str) -> CString {
    CString::new(name.split('\0').next().unwrap_or_default()).unwrap_or_default()
}
