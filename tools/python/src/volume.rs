//! Volumes and regions of interest, on their way between NumPy and the engine.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::Arc;

use engine::input::Input;
use engine::unit::Unit;
use engine::volume::compare::{Normalisation, compare};
use engine::volume::{self, Cleaning, LabelChoice, Labels, ReadOptions};
use engine::{Error, Kind};
use glam::{DAffine3, DMat3, DVec3};
use numpy::ndarray::{Array2, Array3, ShapeBuilder};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyDict;

use crate::device::unlocked;
use crate::errors::{internal, raised};

/// A volume of the engine.
#[pyclass(frozen, module = "vgs._vgs")]
pub struct Volume(pub Arc<volume::Volume>);

/// Returns an affine from the four by four numbers of a matrix, row by row.
pub fn affine_of(matrix: &PyReadonlyArray2<'_, f64>) -> PyResult<DAffine3> {
    let m = matrix.as_array();
    let wrong = |what: &str| {
        raised(Error::new(Kind::Usage, "VGS-PY-001", format!("the affine {what}")).help(
            "give the matrix of 4 by 4 numbers that takes [i, j, k, 1] to [x, y, z, 1] in mm RAS, as nibabel has it",
        ))
    };
    if m.shape() != [4, 4] || (0..4).any(|k| m[[3, k]] != f64::from(u8::from(k == 3))) {
        return Err(wrong("is no matrix of 4 by 4 numbers that ends in 0, 0, 0, 1"));
    }
    let column = |k: usize| DVec3::new(m[[0, k]], m[[1, k]], m[[2, k]]);
    let affine =
        DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3));
    if !affine.is_finite() || !affine.inverse().is_finite() {
        return Err(wrong("has numbers that are not finite, or axes that lie in one plane"));
    }
    Ok(affine)
}

/// Returns the matrix of 4 by 4 numbers of an affine.
pub fn matrix_of(affine: &DAffine3) -> Array2<f64> {
    let columns = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis, affine.translation];
    Array2::from_shape_fn((4, 4), |(row, column)| {
        if row < 3 { columns[column][row] } else { f64::from(u8::from(column == 3)) }
    })
}

/// Returns voxels, i fastest, as an array [i, j, k] that takes them over.
pub fn array_of<T>(size: [usize; 3], voxels: Vec<T>) -> PyResult<Array3<T>> {
    let [i, j, k] = size;
    let whole = Array3::from_shape_vec((i, j, k).f(), voxels);
    whole.map_err(internal)
}

#[pymethods]
impl Volume {
    /// Copies an array [i, j, k] of float32 that is contiguous in Fortran order.
    #[new]
    #[pyo3(signature = (array, affine, *, unit=None, oriented=true, labels=None, frame_of_reference=None))]
    fn new(
        array: PyReadonlyArray3<'_, f32>,
        affine: PyReadonlyArray2<'_, f64>,
        unit: Option<&str>,
        oriented: bool,
        labels: Option<BTreeMap<i32, String>>,
        frame_of_reference: Option<String>,
    ) -> PyResult<Self> {
        let view = array.as_array();
        // A transposed view of Fortran order is in C order, so its memory is that of the voxels, i fastest.
        let samples = match view.t().as_slice() {
            Some(samples) => samples.to_vec(),
            None => view.t().iter().copied().collect(),
        };
        let &[i, j, k] = view.shape() else {
            return Err(internal("an array without three axes"));
        };
        if samples.is_empty() {
            return Err(raised(
                Error::new(Kind::Usage, "VGS-PY-003", format!("a volume of {i} x {j} x {k} voxels"))
                    .help("give an array of at least one voxel"),
            ));
        }
        let volume = volume::Volume {
            oriented,
            labels: labels.unwrap_or_default(),
            frame_of_reference,
            stated_unit: unit.map(unit_of).transpose()?,
            ..volume::Volume::new([i, j, k], affine_of(&affine)?, samples)
        };
        Ok(Volume(Arc::new(volume)))
    }

    /// Writes a file of NIfTI or a folder of OME-Zarr.
    #[pyo3(signature = (path, force))]
    fn save(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        unlocked(py, || {
            volume::check_output(&path, force)?;
            volume::write(&path, &self.0, force)
        })
    }

    /// Returns how far `other` is from this volume, by the names of the JSON of `vgs compare`.
    #[pyo3(signature = (other, roi, range))]
    fn compare<'py>(
        &self,
        py: Python<'py>,
        other: &Volume,
        roi: Option<&Roi>,
        range: Option<[f32; 2]>,
    ) -> PyResult<Bound<'py, PyDict>> {
        roi.map_or(Ok(()), |roi| roi.check_on(&self.0))?;
        range.map_or(Ok(()), check_range)?;
        let own = || self.0.min_max().map(|(low, high)| [low, high]).unwrap_or_default();
        let range = range.unwrap_or_else(own);
        let compared = || {
            let whole;
            let region = match roi {
                Some(roi) => &*roi.roi,
                None => {
                    whole = volume::Roi::new(vec![1.0; self.0.len()], &self.0)?;
                    &whole
                }
            };
            compare(&self.0, &other.0, region, Normalisation::Range(range))
        };
        let found = unlocked(py, compared)?;
        let dictionary = PyDict::new(py);
        dictionary.set_item("voxels", found.voxels)?;
        dictionary.set_item("psnr_db", found.psnr_db())?;
        dictionary.set_item("mean_hu", found.mean_hu)?;
        dictionary.set_item("rmse_hu", found.rmse_hu)?;
        dictionary.set_item("p99_hu", found.p99_hu)?;
        dictionary.set_item("largest_hu", found.largest_hu)?;
        dictionary.set_item("largest_voxel", found.largest_voxel)?;
        Ok(dictionary)
    }

    #[getter]
    fn unit(&self) -> &'static str {
        self.0.unit().name()
    }

    #[getter]
    fn axis_codes(&self) -> String {
        self.0.axis_codes()
    }
}

/// Returns a volume as the keywords of `vgs.Volume`; the array takes the samples over.
pub fn keywords(py: Python<'_>, volume: volume::Volume) -> PyResult<Bound<'_, PyDict>> {
    let dictionary = PyDict::new(py);
    dictionary.set_item("unit", volume.unit().name())?;
    dictionary.set_item("affine", matrix_of(&volume.world_from_voxel).into_pyarray(py))?;
    dictionary.set_item("oriented", volume.oriented)?;
    dictionary.set_item("labels", volume.labels)?;
    dictionary.set_item("frame_of_reference", volume.frame_of_reference)?;
    dictionary.set_item("array", array_of(volume.size, volume.samples)?.into_pyarray(py))?;
    Ok(dictionary)
}

/// Fails if a matrix of 4 by 4 numbers is no affine of a volume.
#[pyfunction]
pub fn check_affine(affine: PyReadonlyArray2<'_, f64>) -> PyResult<()> {
    affine_of(&affine).map(|_| ())
}

/// A file as Python gives it: a path, or its bytes with a name for messages.
#[derive(FromPyObject)]
pub enum File {
    Path(PathBuf),
    Bytes(String, PyBackedBytes),
}

impl From<File> for Input {
    fn from(file: File) -> Self {
        match file {
            File::Path(path) => path.into(),
            File::Bytes(name, bytes) => Input::of(Cursor::new(bytes), name),
        }
    }
}

/// Reads a volume from a file or a folder, as the keywords of `vgs.Volume`.
#[pyfunction]
#[pyo3(signature = (file, *, volume_index, level, voxels, series, voxel_mm, unit, lenient, max_bytes))]
#[expect(clippy::too_many_arguments, reason = "they are the flags of the command line")]
pub fn read_volume<'py>(
    py: Python<'py>,
    file: File,
    volume_index: Option<usize>,
    level: Option<usize>,
    voxels: Option<[[usize; 2]; 3]>,
    series: Option<String>,
    voxel_mm: Option<[f64; 3]>,
    unit: Option<&str>,
    lenient: bool,
    max_bytes: Option<u64>,
) -> PyResult<Bound<'py, PyDict>> {
    let default = ReadOptions::default();
    let options = ReadOptions {
        volume_index,
        level,
        voxels,
        series,
        spacing_mm: voxel_mm.map(DVec3::from_array),
        unit: unit.map(unit_of).transpose()?,
        lenient,
        max_bytes: max_bytes.unwrap_or(default.max_bytes),
        ..default
    };
    keywords(py, unlocked(py, || volume::Volume::read(file, &options))?)
}

/// Reads a mask of a volume, likewise; the labels that will be chosen decide which structures of DICOM are read.
#[pyfunction]
#[pyo3(signature = (file, volume, labels))]
pub fn read_mask<'py>(
    py: Python<'py>,
    file: File,
    volume: &Volume,
    labels: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let choice = choice_of(labels)?;
    let read = || volume::Volume::read_mask(file, &ReadOptions::default(), &choice, &volume.0);
    keywords(py, unlocked(py, read)?)
}

/// A region of interest, and the labels of its structures if some were chosen.
#[pyclass(frozen, module = "vgs._vgs")]
pub struct Roi {
    pub roi: Arc<volume::Roi>,
    pub labels: Option<Arc<Labels>>,
    ml: f64,
    /// The grid of its volume, if that has a place in the world.
    world_from_voxel: Option<DAffine3>,
}

/// Greatest distance of corners, in voxels, of grids that count as the same.
const SAME_GRID_VOXELS: f64 = 1e-3;

impl Roi {
    fn of(roi: volume::Roi, labels: Option<Labels>, volume: &volume::Volume) -> Self {
        let ml = roi.ml(volume);
        let world_from_voxel = volume.oriented.then_some(volume.world_from_voxel);
        Roi { roi: Arc::new(roi), labels: labels.map(Arc::new), ml, world_from_voxel }
    }

    /// Fails if the region is not on the grid of a volume.
    pub fn check_on(&self, volume: &volume::Volume) -> PyResult<()> {
        let (a, b) = (self.roi.size, volume.size);
        let apart = self.world_from_voxel.filter(|_| volume.oriented).is_some_and(|grid| {
            let there = volume.world_from_voxel.inverse() * grid;
            (0..8).any(|corner| {
                let at = DVec3::from_array(
                    [0, 1, 2].map(|k| if corner >> k & 1 == 1 { a[k] as f64 } else { 0.0 }),
                );
                (there.transform_point3(at) - at).abs().max_element() > SAME_GRID_VOXELS
            })
        });
        if a == b && !apart {
            return Ok(());
        }
        let where_it_is = if a == b { ", which lies elsewhere" } else { "" };
        let message = format!(
            "a region of {} x {} x {} voxels in a volume of {} x {} x {}{where_it_is}",
            a[0], a[1], a[2], b[0], b[1], b[2]
        );
        Err(raised(
            Error::new(Kind::Usage, "VGS-PY-004", message)
                .help("make the region of this volume: vgs.Roi.from_mask(mask, volume)"),
        ))
    }
}

#[pymethods]
impl Roi {
    /// Returns the region that a mask marks.
    #[staticmethod]
    #[pyo3(signature = (mask, volume, labels=None))]
    fn from_mask(py: Python<'_>, mask: &Volume, volume: &Volume, labels: Option<&str>) -> PyResult<Self> {
        let choice = choice_of(labels)?;
        let made = || {
            let roi = volume::Roi::from_mask(&mask.0, &choice, &volume.0)?;
            Ok(Roi::of(roi, Labels::chosen(&mask.0, &choice, &volume.0)?, &volume.0))
        };
        unlocked(py, made)
    }

    /// Returns the voxels from `low` to `high`, cleaned.
    #[staticmethod]
    #[pyo3(signature = (volume, low, high, *, min_ml, largest, close_mm, fill_holes))]
    #[expect(clippy::too_many_arguments, reason = "they are the flags of the command line")]
    fn from_threshold(
        py: Python<'_>,
        volume: &Volume,
        low: f32,
        high: f32,
        min_ml: Option<f64>,
        largest: Option<usize>,
        close_mm: Option<f64>,
        fill_holes: bool,
    ) -> PyResult<Self> {
        let cleaning = Cleaning { min_ml, largest, close_mm, fill_holes };
        let made = || {
            cleaning.check()?;
            Ok(Roi::of(cleaning.region(&volume.0, low, high)?, None, &volume.0))
        };
        unlocked(py, made)
    }

    /// Returns the weights, 0 to 1, as an array [i, j, k].
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        Ok(array_of(self.roi.size, self.roi.weight.clone())?.into_pyarray(py))
    }

    #[getter]
    fn voxels(&self) -> usize {
        self.roi.voxel_count()
    }

    #[getter]
    fn ml(&self) -> f64 {
        self.ml
    }

    #[getter]
    fn shape(&self) -> [usize; 3] {
        self.roi.size
    }

    /// Names of the chosen labels by number.
    #[getter]
    fn label_names(&self) -> BTreeMap<u8, String> {
        self.labels.as_ref().map(|labels| labels.names.clone()).unwrap_or_default()
    }
}

/// Fails if two intensities are no range.
pub fn check_range([low, high]: [f32; 2]) -> PyResult<()> {
    if low < high && low.is_finite() && high.is_finite() {
        return Ok(());
    }
    let message = format!("a range from {low} to {high}");
    Err(raised(
        Error::new(Kind::Usage, "VGS-PY-020", message).help("give two finite numbers, the lower one first"),
    ))
}

/// Parses the unit of a volume.
fn unit_of(name: &str) -> PyResult<Unit> {
    [Unit::Hu, Unit::Arbitrary].into_iter().find(|unit| unit.name() == name).ok_or_else(|| {
        raised(
            Error::new(Kind::Usage, "VGS-PY-005", format!("no unit is called {name:?}"))
                .help("\"hu\" for a CT, \"arbitrary\" for any other scan"),
        )
    })
}

/// Parses a choice of labels.
fn choice_of(labels: Option<&str>) -> PyResult<LabelChoice> {
    labels.map_or(Ok(LabelChoice::Whole), |text| text.parse::<LabelChoice>().map_err(raised))
}
