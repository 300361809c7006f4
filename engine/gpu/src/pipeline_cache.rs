//! The cache of compiled pipelines between two runs of a program: a file in the user's cache folder.

use std::path::PathBuf;

use ash::vk;

use super::{DeviceDescription, check};
use base::error::Result;

/// Creates the cache of a device, filled from the file that an earlier run left.
pub(super) fn load(device: &ash::Device, description: &DeviceDescription) -> Result<vk::PipelineCache> {
    let cached = path(description).and_then(|p| std::fs::read(p).ok()).unwrap_or_default();
    let info = vk::PipelineCacheCreateInfo::default().initial_data(&cached);
    // SAFETY: Vulkan checks the header of cached data and ignores what it does not know.
    check("creating the pipeline cache", unsafe { device.create_pipeline_cache(&info, None) })
}

/// Saves the cache if it can. A cache that cannot be written only costs compile time at the next start.
///
/// # Safety
/// `cache` must be a live pipeline cache of `device`, or null.
pub(super) unsafe fn save(device: &ash::Device, cache: vk::PipelineCache, description: &DeviceDescription) {
    if cache == vk::PipelineCache::null() {
        return;
    }
    // SAFETY: as the caller promises.
    let Ok(data) = (unsafe { device.get_pipeline_cache_data(cache) }) else { return };
    let Some(path) = path(description) else { return };
    let Some(folder) = path.parent() else { return };
    if std::fs::read(&path).is_ok_and(|old| old == data) || std::fs::create_dir_all(folder).is_err() {
        return;
    }
    // The data are written aside and renamed, so that a process that starts meanwhile never reads half a
    // file.
    if let Ok(mut file) = tempfile::NamedTempFile::new_in(folder)
        && std::io::Write::write_all(&mut file, &data).is_ok()
    {
        let _ = file.persist(path);
    }
}

/// Returns the file for a device and driver; `None` if the user has no cache folder.
fn path(description: &DeviceDescription) -> Option<PathBuf> {
    let folder = std::env::var_os("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::var_os("HOME").map(|h| PathBuf::from(h).join(".cache")))?;
    let key: String = format!("{}-{}", description.name, description.driver)
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    Some(folder.join("vgs").join("pipelines").join(key))
}
