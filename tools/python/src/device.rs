//! The devices, each started once: pipelines that one call has compiled serve the next.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use engine::gpu::{self, DeviceDescription, Gpu, GpuOptions};
use engine::{Error, Kind};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{Raise, raised};

/// Devices by the name that was asked for.
type Started = HashMap<Option<String>, Gpu>;

/// Devices that run.
static STARTED: Mutex<Option<Started>> = Mutex::new(None);

/// The process that first did any work.
static FIRST: OnceLock<u32> = OnceLock::new();

/// Does `work` without the interpreter's lock, and raises its errors.
///
/// # Errors
/// Those of `work`, and an error in a process that was forked from one that did any: the threads that do the work stay
/// behind, and would be waited for in vain.
pub fn unlocked<T: Send>(py: Python<'_>, work: impl Send + FnOnce() -> engine::Result<T>) -> PyResult<T> {
    let here = std::process::id();
    if *FIRST.get_or_init(|| here) != here {
        let message = "vgs was used before this process was forked, and its threads stayed in the other one";
        return Err(raised(Error::new(Kind::Unavailable, "VGS-PY-019", message).help(
            "start processes anew: multiprocessing.get_context(\"spawn\"), or use vgs in the forked ones alone",
        )));
    }
    py.detach(work).or_raise()
}

/// Does `work` with the device of this name or index, or with the best one. Call it without the interpreter's lock.
///
/// # Errors
/// If there is no such device or none that can be used, and those of `work`.
pub fn with_device<T>(name: Option<&str>, work: impl FnOnce(&Gpu) -> engine::Result<T>) -> engine::Result<T> {
    let name = name.map(str::to_owned);
    let gpu = {
        let mut started = started();
        let started = started.get_or_insert_default();
        match started.get(&name) {
            Some(gpu) => gpu.clone(),
            None => {
                let gpu = Gpu::new(&GpuOptions { device: name.clone(), ..GpuOptions::default() })?;
                started.entry(name.clone()).or_insert(gpu).clone()
            }
        }
    };
    let done = work(&gpu);
    if done.as_ref().is_err_and(|error| error.kind == Kind::Temporary) {
        // A device that was lost stays lost: the next call starts it anew.
        started().get_or_insert_default().remove(&name);
    }
    done
}

fn started() -> MutexGuard<'static, Option<Started>> {
    STARTED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the Vulkan devices of this machine, a dictionary each.
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let found = unlocked(py, gpu::devices)?;
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
