//! The devices, each started once: pipelines that one call has compiled serve the next.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use engine::Kind;
use engine::gpu::{self, DeviceDescription, Gpu, GpuOptions};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::Raise;

/// Devices by process and name.
type Started = HashMap<(u32, Option<String>), Gpu>;

/// Devices that run, by the process that has started them and the name that was asked for. A process that was forked
/// cannot use those of its parent.
static STARTED: Mutex<Option<Started>> = Mutex::new(None);

/// Does `work` with the device of this name or index, or with the best one. Call it without the interpreter's lock.
///
/// # Errors
/// If there is no such device or none that can be used, and those of `work`.
pub fn with_device<T>(
    name: Option<&str>,
    work: impl FnOnce(&Gpu) -> engine::Result<T>,
) -> engine::Result<T> {
    let key = (std::process::id(), name.map(str::to_owned));
    let gpu = {
        let mut started = started();
        let started = started.get_or_insert_default();
        match started.get(&key) {
            Some(gpu) => gpu.clone(),
            None => {
                let gpu = Gpu::new(&GpuOptions { device: key.1.clone(), ..GpuOptions::default() })?;
                started.entry(key.clone()).or_insert(gpu).clone()
            }
        }
    };
    let done = work(&gpu);
    if done.as_ref().is_err_and(|error| error.kind == Kind::Temporary) {
        // A device that was lost stays lost: the next call starts it anew.
        started().get_or_insert_default().remove(&key);
    }
    done
}

fn started() -> MutexGuard<'static, Option<Started>> {
    STARTED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the Vulkan devices of this machine, a dictionary each.
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let found = py.detach(gpu::devices).or_raise()?;
    found.iter().map(|device| description(py, device)).collect()
}

fn description<'py>(py: Python<'py>, device: &DeviceDescription) -> PyResult<Bound<'py, PyDict>> {
    let dictionary = PyDict::new(py);
    dictionary.set_item("index", device.index)?;
    dictionary.set_item("name", &device.name)?;
    dictionary.set_item("kind", device.kind)?;
    dictionary.set_item("driver", &device.driver)?;
    dictionary.set_item("vulkan", &device.api)?;
    dictionary.set_item("memory_bytes", device.memory_bytes)?;
    dictionary.set_item("missing", &device.missing)?;
    Ok(dictionary)
}
