//! A fit, watched by a callable of Python.

use std::time::{Duration, Instant};

use engine::coded::{coded, usual_bound};
use engine::fidelity;
use engine::fit::evaluate::Protocol;
use engine::fit::{Clock, End, FitConfig, Fitted, Goal, IntensityRange, Order, Plan, Settings, SizeLimit};
use engine::splat::{self, WriteOptions};
use engine::volume;
use engine::{Error, Kind};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value};

use crate::device::{unlocked, with_device};
use crate::errors::{Raise, raised};
use crate::splats::Splats;
use crate::volume::{Roi, Volume};
use crate::watching::Watching;

/// Returns the hyper-parameters: for each its key, what it is, and its default as JSON.
#[pyfunction]
pub fn fit_settings() -> Vec<(&'static str, &'static str, String)> {
    let defaults = Settings::values(&FitConfig::default());
    FitConfig::FIELDS
        .iter()
        .map(|field| (field.key, field.doc.trim(), defaults[field.key].to_string()))
        .collect()
}

/// Codes the region of a volume in place of splats, none of its voxels off by more than `bound`.
#[pyfunction]
#[pyo3(signature = (volume, roi, bound=None))]
pub fn code(py: Python<'_>, volume: &Volume, roi: &Roi, bound: Option<f64>) -> PyResult<Splats> {
    roi.check_on(&volume.0)?;
    unlocked(py, || {
        let (volume, region) = (&*volume.0, &*roi.roi);
        let bound = bound.unwrap_or_else(|| usual_bound(volume, region));
        coded(volume, region, roi.labels.as_deref(), bound)
    })
    .map(Splats::new)
}

/// Fits splats to the region of a volume. `values` is a JSON object of hyper-parameters by key; `watch`, a callable or
/// None, is called with a dictionary of news and may return False to stop. The result is the splats, and how the fit ended.
#[pyfunction]
#[pyo3(signature = (volume, roi, *, profile, quality, values, rounded, max_size, time_budget, device, watch))]
#[expect(clippy::too_many_arguments, reason = "they are the flags of the command line")]
pub fn fit<'py>(
    py: Python<'py>,
    volume: &Volume,
    roi: &Roi,
    profile: &str,
    quality: Option<&str>,
    values: &str,
    rounded: bool,
    max_size: Option<u64>,
    time_budget: Option<f64>,
    device: Option<&str>,
    watch: Option<Py<PyAny>>,
) -> PyResult<(Splats, Bound<'py, PyDict>)> {
    roi.check_on(&volume.0)?;
    let values: Map<String, Value> = serde_json::from_str(values)
        .map_err(|e| raised(Settings::wrong_value("the hyper-parameters", &e.to_string())))?;
    let values: Vec<_> = values.into_iter().collect();
    let time = time_budget.map(seconds).transpose()?;
    let limited = max_size.is_some() || time.is_some();
    let settings = Settings::new(profile, quality, &values, limited).or_raise()?.for_volume(volume.0.is_ct());
    let mut watching = Watching::new(watch);
    let done = unlocked(py, || {
        with_device(device, |gpu| {
            let (volume, region) = (&*volume.0, &*roi.roi);
            let config = &settings.config;
            let protocol = protocol(volume, region, config);
            let name = if rounded { "splats.vgs" } else { "splats.ply" };
            let write = WriteOptions::default();
            let begun = Instant::now();
            let order = Order {
                labels: roi.labels.as_deref(),
                goal: Goal::of(config, protocol.range, protocol.threshold),
                measure: Some(fidelity::measured_as_shown(gpu, (volume, region), &protocol)),
                rounded,
                size: max_size.map(|bytes| SizeLimit {
                    bytes,
                    fill: !settings.says_how_many(),
                    bytes_of: Box::new(move |set| splat::file_bytes(name.as_ref(), set, &write)),
                }),
                clock: time.map(|time| Clock {
                    begun,
                    time,
                    // The default number of iterations is meant for fits without a clock.
                    iterations: if settings.is_explicit("iterations") { config.iterations } else { u32::MAX },
                }),
                ..Order::new(volume, region, config)
            };
            let (plan, start) = Plan::new(gpu, order, &mut watching)?;
            if watching.interrupted && watching.iteration == 0 {
                return Ok(None);
            }
            let Fitted { set, outcome, lacking } = plan.run(start, &mut watching)?;
            if let (Some(goal), End::Finished, None) = (plan.goal(), &outcome.end, &lacking) {
                let measure = fidelity::measured_as_shown(gpu, (volume, region), &protocol);
                let found = measure(plan.problem(), &set, &outcome.splats)?;
                if let Some(db) = settings.missed_db(goal.surplus_of(&found)) {
                    let reach = match settings.is_aim() {
                        true => "a target_hu of your own reaches it",
                        false => "the limits of the fit leave no more splats",
                    };
                    let unit = volume.unit().text();
                    tracing::warn!(
                        "{} is missed by {db:.1} dB ({:.1}{unit}, {:.1} dB): {reach}",
                        goal.text(unit),
                        found.p99_hu,
                        found.psnr_db
                    );
                }
            }
            match (outcome.end, lacking) {
                (End::Failed(error), _) | (_, Some(error)) => Err(error),
                (End::Finished, None) => Ok(Some((set, outcome.iterations, outcome.seconds, false))),
                (End::Stopped, None) => Ok(Some((set, outcome.iterations, outcome.seconds, true))),
            }
        })
    });
    if let Some(error) = watching.error {
        return Err(error);
    }
    let Some((set, iterations, seconds, stopped)) = done? else {
        return Err(PyKeyboardInterrupt::new_err("stopped before there were splats"));
    };
    let told = PyDict::new(py);
    told.set_item("iterations", iterations)?;
    told.set_item("seconds", seconds)?;
    told.set_item("stopped", stopped)?;
    Ok((Splats::new(set), told))
}

/// Returns the protocol by which `vgs fit` measures its goal.
fn protocol(volume: &volume::Volume, roi: &volume::Roi, config: &FitConfig) -> Protocol {
    let whole = volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default();
    // A fit over the region's range is measured over it, too, and every voxel counts alike.
    let (range, unweighted) = match config.region.range {
        IntensityRange::Roi => (roi.range(volume).unwrap_or(whole), 0.01),
        IntensityRange::Auto => (whole, 0.0),
    };
    let threshold = f32::max(unweighted, config.region.threshold);
    Protocol { offsets: Vec::new(), range, shell: config.loss.shell, threshold }
}

/// Returns a time budget of so many seconds.
pub fn seconds(time: f64) -> PyResult<Duration> {
    Some(time).filter(|s| (0.1..1e7).contains(s)).map(Duration::from_secs_f64).ok_or_else(|| {
        raised(
            Error::new(Kind::Usage, "VGS-PY-006", format!("a time budget of {time} s"))
                .help("give seconds, from 0.1 on"),
        )
    })
}
