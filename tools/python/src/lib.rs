//! The native half of the Python package `vgs`: NumPy arrays in, NumPy arrays out. What users call, with its
//! documentation, is Python, in `vgs/`.
//!
//! | file | what is there |
//! |---|---|
//! | `volume` | volumes and regions of interest |
//! | `fit` | fits |
//! | `bake` | splats with colours for other viewers |
//! | `watching` | what takes long, watched by a callable |
//! | `splats` | splat sets as arrays, their files, their field and how far it is from a volume |
//! | `look` | how splats or a volume are to be shown |
//! | `render` | pictures, and how much two of them differ |
//! | `device` | the devices, each started once |
//! | `errors`, `log` | errors as exceptions; warnings as records of `logging` |
//!
//! Arrays of voxels are indexed [i, j, k] as in nibabel, i fastest in memory (Fortran order); that is the engine's own
//! order. Whatever takes long runs without the lock of the interpreter.
#![forbid(unsafe_code)]

mod bake;
mod device;
mod errors;
mod fit;
mod log;
mod look;
mod render;
mod splats;
mod volume;
mod watching;

use pyo3::prelude::*;

/// The module `vgs._vgs`.
#[pymodule]
mod _vgs {
    use super::*;

    #[pymodule_export]
    use super::bake::bake;
    #[pymodule_export]
    use super::device::devices;
    #[pymodule_export]
    use super::errors::usage_error;
    #[pymodule_export]
    use super::fit::{code, fit, fit_settings};
    #[pymodule_export]
    use super::render::{compare_pictures, render, transfer_functions};
    #[pymodule_export]
    use super::splats::Splats;
    #[pymodule_export]
    use super::volume::{Roi, Volume, check_affine, read_mask, read_volume};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        log::start();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
