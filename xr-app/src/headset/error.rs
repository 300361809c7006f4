//! Errors of the OpenXR runtime.

use engine::{Error, Kind};
use openxr as xr;

/// Returns the error for a runtime that has answered `e`; `doing` says what was being done.
pub(super) fn runtime_error(doing: &str, e: xr::sys::Result) -> Error {
    use xr::sys::Result as R;
    match e {
        R::ERROR_INSTANCE_LOST | R::ERROR_SESSION_LOST | R::ERROR_RUNTIME_FAILURE => {
            Error::new(Kind::Temporary, "VGS-XR-010", format!("{doing}: the OpenXR runtime was lost ({e})"))
                .help("start the runtime and this program again")
        }
        e => Error::new(Kind::Internal, "VGS-XR-011", format!("{doing}: the OpenXR runtime said {e}")),
    }
}
