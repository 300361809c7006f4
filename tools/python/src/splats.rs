//! Splat sets as arrays, their files, their field, and how far it is from a volume.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;

use engine::fidelity::{evaluate_decoded, in_volume};
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::fit::place::place;
use engine::rasterize::{Quantity, grid_around, rasterize};
use engine::render::Probe;
use engine::splat::{self, Activations, Form, Grid, Kernel, SplatSet, WriteOptions, activation};
use engine::unit::Unit;
use engine::volume;
use engine::{Error, Kind};
use glam::{DMat3, DVec3};
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::device::{unlocked, with_device};
use crate::errors::{internal, raised};
use crate::volume::{File, Roi, Volume, affine_of, check_range, keywords, matrix_of};

/// A splat set of the engine.
#[pyclass(frozen, module = "vgs._vgs")]
pub struct Splats(pub Arc<SplatSet>);

impl Splats {
    pub fn new(set: SplatSet) -> Self {
        Splats(Arc::new(set))
    }

    fn rows<T, const N: usize>(&self, of: impl Fn(&splat::Splat) -> [T; N]) -> PyResult<Array2<T>> {
        let flat: Vec<T> = self.0.splats.iter().flat_map(of).collect();
        Array2::from_shape_vec((self.0.splats.len(), N), flat).map_err(internal)
    }
}

/// ln σ of splats.
const LOG_SCALES: RangeInclusive<f32> = -activation::LOG_SCALE_LIMIT..=activation::LOG_SCALE_LIMIT;

/// Most grids of offsets that are measured.
const MOST_OFFSETS: usize = 64;

/// Arrays of a new set, [splat, ...].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Arrays<'py> {
    means: PyReadonlyArray2<'py, f64>,
    scales: PyReadonlyArray2<'py, f32>,
    rotations: PyReadonlyArray2<'py, f32>,
    opacities: PyReadonlyArray1<'py, f32>,
    intensities: PyReadonlyArray1<'py, f32>,
    labels: Option<PyReadonlyArray1<'py, u8>>,
}

impl Arrays<'_> {
    /// Fails if the arrays are not of one number of splats.
    fn check(&self) -> PyResult<()> {
        let count = self.means.as_array().shape()[0];
        let shapes = [
            ("means", self.means.as_array().shape() == [count, 3]),
            ("scales", self.scales.as_array().shape() == [count, 3]),
            ("rotations", self.rotations.as_array().shape() == [count, 4]),
            ("opacities", self.opacities.as_array().len() == count),
            ("intensities", self.intensities.as_array().len() == count),
            ("labels", self.labels.as_ref().is_none_or(|labels| labels.as_array().len() == count)),
        ];
        if let Some((name, _)) = shapes.iter().find(|(_, right)| !right) {
            let help = format!(
                "means decide on {count} splats: N x 3 means and scales, N x 4 rotations, N of the others"
            );
            return Err(raised(
                Error::new(Kind::Usage, "VGS-PY-007", format!("{name} have another shape than the means"))
                    .help(help),
            ));
        }
        Ok(())
    }

    /// Returns these splats, whose shapes are checked, with the statements of `like`.
    fn set(&self, like: &SplatSet) -> PyResult<SplatSet> {
        let count = self.means.as_array().shape()[0];
        let (means, scales, rotations) =
            (self.means.as_array(), self.scales.as_array(), self.rotations.as_array());
        let (opacities, intensities) = (self.opacities.as_array(), self.intensities.as_array());
        let mut splats = Vec::with_capacity(count);
        for i in 0..count {
            let mean = DVec3::from_array([0, 1, 2].map(|k| means[[i, k]])) - like.origin_mm;
            let mut splat = splat::Splat {
                mean: mean.as_vec3().to_array(),
                rotation: activation::normalised([0, 1, 2, 3].map(|k| rotations[[i, k]])),
                intensity: intensities[i],
                ..splat::Splat::default()
            };
            let scale = [0, 1, 2].map(|k| scales[[i, k]]);
            let bad = if scale.iter().any(|s| !LOG_SCALES.contains(&s.ln())) {
                Some(format!("scales of {scale:?} mm"))
            } else if (0..4).any(|k| !rotations[[i, k]].is_finite())
                || (0..4).all(|k| rotations[[i, k]] == 0.0)
            {
                Some("its quaternion is zero or not finite".to_owned())
            } else if !(0.0..=1.0).contains(&opacities[i]) {
                Some(format!("an opacity of {}", opacities[i]))
            } else {
                None
            };
            splat.set_scale(scale);
            splat.set_opacity(opacities[i]);
            if let Some(why) = bad.or_else(|| splat::defect(&splat).map(str::to_owned)) {
                return Err(raised(Error::new(Kind::Usage, "VGS-PY-008", format!("splat {i}: {why}")).help(
                    "means, scales above 0 and intensities are finite numbers, opacities from 0 to 1",
                )));
            }
            splats.push(splat);
        }
        let labels = self.labels.as_ref().map(|labels| labels.as_array().to_vec());
        let mut set = SplatSet { splats, labels, colours: None, rounding: None, ..like.clone() };
        if set.labels != like.labels {
            set.label_region();
        }
        Ok(set)
    }
}

#[pymethods]
impl Splats {
    /// Makes a set of arrays; of `like` it has all that is not in them: kernel, grid, unit, names of labels.
    #[staticmethod]
    #[pyo3(signature = (arrays, *, like=None, kernel=None, unit=None, background=None, label_names=None))]
    fn of_arrays(
        arrays: Arrays<'_>,
        like: Option<&Splats>,
        kernel: Option<&str>,
        unit: Option<&str>,
        background: Option<f32>,
        label_names: Option<BTreeMap<u8, String>>,
    ) -> PyResult<Self> {
        let mut base =
            like.map_or_else(SplatSet::default, |like| SplatSet { splats: Vec::new(), ..(*like.0).clone() });
        arrays.check()?;
        if arrays.means.as_array().nrows() > 0 {
            base.voxels.clear();
        }
        if like.is_none()
            && let Some(first) = arrays.means.as_array().outer_iter().next()
        {
            base.origin_mm = DVec3::from_array([0, 1, 2].map(|k| first[k].round()));
        }
        if let Some(name) = kernel {
            base.field.kernel = Kernel::from_name(name).ok_or_else(|| {
                raised(
                    Error::new(Kind::Usage, "VGS-PY-009", format!("no kernel is called {name:?}"))
                        .help("compact, gaussian or density"),
                )
            })?;
        }
        if let Some(name) = unit {
            base.unit = Unit::from_name(name).filter(|unit| unit.is_physical()).ok_or_else(|| {
                raised(
                    Error::new(Kind::Usage, "VGS-PY-005", format!("no unit is called {name:?}"))
                        .help("\"hu\" for a CT, \"arbitrary\" for any other scan"),
                )
            })?;
        }
        base.field.background = background.unwrap_or(base.field.background);
        if !base.field.background.is_finite() {
            let message = format!("a background of {}", base.field.background);
            return Err(raised(
                Error::new(Kind::Usage, "VGS-PY-022", message).help("give a finite intensity"),
            ));
        }
        if let Some(names) = label_names {
            base.label_names = names.into_iter().collect();
        }
        Ok(Splats::new(arrays.set(&base)?))
    }

    /// Reads one or several files as one set, whose objects are named after the files.
    #[staticmethod]
    #[pyo3(signature = (files, volume, roi))]
    fn read(py: Python<'_>, files: Vec<File>, volume: Option<&Volume>, roi: Option<&Roi>) -> PyResult<Self> {
        let read =
            || splat::read_all(files, || Ok(volume.map(|volume| place(&volume.0, roi.map(|roi| &*roi.roi)))));
        Ok(Splats::new(unlocked(py, read)?))
    }

    /// Writes a file, in the format that its extension names, with the splats `live` and their HU in it as well.
    #[pyo3(signature = (path, force, live))]
    fn save(&self, py: Python<'_>, path: PathBuf, force: bool, live: Option<&Splats>) -> PyResult<()> {
        let live = live.map(|live| &*live.0);
        let options = WriteOptions { force, live, ..WriteOptions::default() };
        unlocked(py, || {
            live.map_or(Ok(()), |_| splat::check_live(&path))?;
            splat::write_as(&path, &self.0, &options)
        })
    }

    /// Returns true if the splats were rounded, as those of a small file are.
    #[getter]
    fn rounded(&self) -> bool {
        self.0.rounding.is_some()
    }

    fn __len__(&self) -> usize {
        self.0.splats.len()
    }

    /// Returns the splats of these rows, in this order.
    fn of_rows(&self, rows: Vec<usize>) -> PyResult<Self> {
        if rows.iter().any(|&i| i >= self.0.splats.len()) {
            return Err(pyo3::exceptions::PyIndexError::new_err("a splat that is not there"));
        }
        Ok(Splats::new(self.0.of_rows(&rows)))
    }

    /// Means [splat, x y z], mm RAS.
    #[getter]
    fn means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let origin = self.0.origin_mm;
        Ok(self.rows(|s| (DVec3::from_array(s.mean.map(f64::from)) + origin).to_array())?.into_pyarray(py))
    }

    /// Standard deviations [splat, axis], mm.
    #[getter]
    fn scales<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        Ok(self.rows(Activations::scale)?.into_pyarray(py))
    }

    /// Unit quaternions [splat, w x y z].
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        Ok(self.rows(|s| activation::normalised(s.rotation))?.into_pyarray(py))
    }

    /// Covariances [splat, 3, 3], mm².
    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let covariance = |s: &splat::Splat| {
            let (axes, scale) = (s.axes(), DVec3::from_array(s.scale().map(f64::from)));
            (axes * DMat3::from_diagonal(scale * scale) * axes.transpose()).transpose().to_cols_array()
        };
        let flat: Vec<f64> = self.0.splats.iter().flat_map(covariance).collect();
        let whole = Array3::from_shape_vec((self.0.splats.len(), 3, 3), flat).map_err(internal)?;
        Ok(whole.into_pyarray(py))
    }

    /// Opacities [splat], 0 to 1.
    #[getter]
    fn opacities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.0.splats.iter().map(Activations::opacity).collect::<Array1<_>>().into_pyarray(py)
    }

    /// Intensities [splat].
    #[getter]
    fn intensities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.0.splats.iter().map(|s| s.intensity).collect::<Array1<_>>().into_pyarray(py)
    }

    /// Labels [splat], or None.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<u8>>> {
        self.0.labels.as_ref().map(|labels| Array1::from_vec(labels.clone()).into_pyarray(py))
    }

    #[getter]
    fn label_names(&self) -> BTreeMap<u8, String> {
        self.0.label_names.iter().cloned().collect()
    }

    /// Name of the kernel.
    #[getter]
    fn kernel(&self) -> &'static str {
        self.0.field.kernel.name()
    }

    /// Number of voxels that are coded in place of splats.
    #[getter]
    fn coded_count(&self) -> usize {
        self.0.coded_count()
    }

    /// Greatest error of coded voxels; None if there are none.
    #[getter]
    fn bound(&self) -> Option<f64> {
        self.0.voxels.iter().map(|voxels| voxels.precision.bound()).reduce(f64::max)
    }

    #[getter]
    fn unit(&self) -> &'static str {
        self.0.unit.name()
    }

    #[getter]
    fn background(&self) -> f32 {
        self.0.field.background
    }

    /// Name of what the splats are meant for: voxels, a field, or colours.
    #[getter]
    fn form(&self) -> &'static str {
        self.0.form_name()
    }

    #[getter]
    fn iterations(&self) -> Option<u32> {
        self.0.iterations
    }

    /// Size and affine of the grid that the splats were fitted on, or None.
    #[getter]
    fn grid<'py>(&self, py: Python<'py>) -> Option<([u32; 3], Bound<'py, PyArray2<f64>>)> {
        self.0
            .grid
            .map(|Grid { size, world_from_voxel }| (size, matrix_of(&world_from_voxel).into_pyarray(py)))
    }

    /// Returns intensity and occupancy at points [point, x y z], mm RAS; NaN and 0 where no splat reaches.
    fn field<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<[Bound<'py, PyArray1<f32>>; 2]> {
        let points: Vec<DVec3> =
            points.as_array().outer_iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect();
        let (intensity, occupancy): (Vec<f32>, Vec<f32>) = unlocked(py, || {
            let probe = Probe::new(&self.0);
            let at = |&x: &DVec3| {
                probe.at(x).map_or((f32::NAN, 0.0), |r| (r.intensity as f32, r.occupancy as f32))
            };
            Ok(points.par_iter().map(at).unzip())
        })?;
        Ok([intensity, occupancy].map(|values| Array1::from_vec(values).into_pyarray(py)))
    }

    /// Returns size and affine of a grid of this spacing, mm, around the splats.
    fn grid_around<'py>(&self, py: Python<'py>, spacing: [f64; 3]) -> ([u32; 3], Bound<'py, PyArray2<f64>>) {
        let grid = grid_around(&self.0, DVec3::from_array(spacing));
        (grid.size, matrix_of(&grid.world_from_voxel).into_pyarray(py))
    }

    /// Returns a quantity at the voxels of a grid, as the keywords of `vgs.Volume`.
    #[pyo3(signature = (size, affine, *, quantity, outside, device))]
    fn rasterize<'py>(
        &self,
        py: Python<'py>,
        size: [usize; 3],
        affine: PyReadonlyArray2<'_, f64>,
        quantity: &str,
        outside: f32,
        device: Option<&str>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let quantity = match quantity {
            "intensity" => Quantity::Intensity { outside },
            "field" => Quantity::Field,
            "occupancy" => Quantity::Occupancy,
            "weight" => Quantity::Weight,
            other => {
                return Err(raised(
                    Error::new(Kind::Usage, "VGS-PY-010", format!("no quantity is called {other:?}"))
                        .help("intensity, field, occupancy or weight"),
                ));
            }
        };
        let affine = affine_of(&affine)?;
        let bytes = size.iter().fold(4u64, |bytes, &n| bytes.saturating_mul(n as u64));
        let made = || {
            engine::memory::require(bytes, "the volume")?;
            let mut grid = volume::Volume::new(size, affine, vec![0.0; size.iter().product()]);
            with_device(device, |gpu| rasterize(gpu, &self.0, quantity, &mut grid))?;
            grid.stated_unit = Some(match quantity {
                Quantity::Intensity { .. } | Quantity::Field => self.0.unit,
                Quantity::Occupancy | Quantity::Weight => Unit::Arbitrary,
            });
            Ok(grid)
        };
        keywords(py, unlocked(py, made)?)
    }

    /// Measures the splats against a volume in a region, as what is shown of them.
    #[pyo3(signature = (volume, roi, *, range, offsets, seed, device))]
    #[expect(clippy::too_many_arguments, reason = "they are the flags of the command line")]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        volume: &Volume,
        roi: &Roi,
        range: Option<[f32; 2]>,
        offsets: usize,
        seed: u64,
        device: Option<&str>,
    ) -> PyResult<Bound<'py, PyDict>> {
        roi.check_on(&volume.0)?;
        range.map_or(Ok(()), check_range)?;
        if offsets > MOST_OFFSETS {
            let message = format!("{offsets} grids of offsets");
            let help = format!("up to {MOST_OFFSETS} are measured");
            return Err(raised(Error::new(Kind::Usage, "VGS-PY-021", message).help(help)));
        }
        let (set, of, region) = (&*self.0, &*volume.0, &*roi.roi);
        let whole = || of.min_max().map(|(low, high)| [low, high]).unwrap_or_default();
        let protocol = Protocol {
            offsets: evaluate::random_offsets(offsets, seed),
            range: range.unwrap_or_else(whole),
            shell: 4,
            threshold: 0.0,
        };
        let evaluated = || {
            in_volume(set, of)?;
            let between = evaluate::between_slices_of(set, of);
            with_device(device, |gpu| {
                evaluate::with_slices(of, region, between, &protocol, |of, region, protocol| match set.form {
                    Form::Field => {
                        let splats = set.to_voxel(&of.world_from_voxel);
                        evaluate::evaluate(gpu, &splats, &set.field, of, region, protocol)
                    }
                    Form::Grid => evaluate_decoded(gpu, set, of, region, protocol),
                })
            })
        };
        figures(py, &unlocked(py, evaluated)?)
    }
}

/// Returns the figures by the names that they have in the JSON of `vgs eval`.
fn figures<'py>(py: Python<'py>, evaluation: &Evaluation) -> PyResult<Bound<'py, PyDict>> {
    let at = &evaluation.on_grid;
    let dictionary = PyDict::new(py);
    dictionary.set_item("psnr_db", at.psnr_db)?;
    dictionary.set_item("psnr_mean_offset_db", evaluation.mean_psnr_db())?;
    dictionary.set_item("psnr_min_offset_db", evaluation.worst_psnr_db())?;
    dictionary.set_item("rmse_hu", at.rmse_hu)?;
    dictionary.set_item("p99_hu", at.p99_hu)?;
    dictionary.set_item("occupancy_rmse_on_grid", at.occupancy_rmse)?;
    dictionary.set_item("soft_dice", at.soft_dice)?;
    dictionary.set_item("range", evaluation.range)?;
    Ok(dictionary)
}
