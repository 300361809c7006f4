//! The windows in which pictures are shown, as far as an instance must know them.

use std::ffi::c_char;

use raw_window_handle::HasDisplayHandle;

use base::error::{Error, Kind, Result};

/// The instance extensions that Vulkan needs to show pictures in the windows of a display.
#[derive(Clone, Debug)]
pub struct Windows(pub(super) &'static [*const c_char]);

// SAFETY: the pointers are to constant strings.
unsafe impl Send for Windows {}
// SAFETY: as above.
unsafe impl Sync for Windows {}

impl Windows {
    /// Returns the windows of this display. Fails if Vulkan cannot show pictures on it.
    pub fn of(display: &impl HasDisplayHandle) -> Result<Self> {
        let unavailable = |what: String| {
            Error::new(Kind::Unavailable, "VGS-GPU-007", what)
                .help("without a display, `vgs render` writes pictures to files")
        };
        let handle = display.display_handle().map_err(|e| unavailable(format!("no display: {e}")))?;
        ash_window::enumerate_required_extensions(handle.as_raw())
            .map(Windows)
            .map_err(|e| unavailable(format!("Vulkan has no windows on this display: {e}")))
    }
}
