//! Splats with colours for other viewers.

use engine::bake::{Options, Progress, check};
use engine::fit::Watch;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;

use crate::device::{unlocked, with_device};
use crate::fit::seconds;
use crate::look::{AskedLook, parsed};
use crate::splats::Splats;
use crate::watching::Watching;

/// How splats are to be baked; JSON of `vgs/_bake.py`. What is left out is as usual.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    look: AskedLook,
    iterations: Option<u32>,
    time_budget: Option<f64>,
    max_splats: Option<usize>,
    views: Option<usize>,
    size: Option<u32>,
    degree: Option<u8>,
    seed: u64,
}

impl Asked {
    fn options(&self) -> PyResult<Options> {
        let usual = Options::default();
        Ok(Options {
            iterations: self.iterations.unwrap_or(usual.iterations),
            time_budget: self.time_budget.map(seconds).transpose()?,
            max_splats: self.max_splats,
            views: self.views.unwrap_or(usual.views),
            size: self.size.unwrap_or(usual.size),
            degree: self.degree,
            seed: self.seed,
            ..usual
        })
    }
}

/// Bakes what a look shows of splats into colours. `watch`, a callable or None, is called with a dictionary of news and may
/// return False to stop. The result is the splats, and how near they come.
#[pyfunction]
#[pyo3(signature = (splats, asked, *, device, watch))]
pub fn bake<'py>(
    py: Python<'py>,
    splats: &Splats,
    asked: &str,
    device: Option<&str>,
    watch: Option<Py<PyAny>>,
) -> PyResult<(Splats, Bound<'py, PyDict>)> {
    let asked: Asked = parsed(asked, "bake")?;
    let options = asked.options()?;
    let mut watching = Watching::new(watch);
    let done = unlocked(py, || {
        let set = &*splats.0;
        check(set)?;
        options.check()?;
        let look = asked.look.look(Some(set), set.unit, set.intensity_range())?;
        let mut stage = "";
        let mut going = |progress: &Progress| {
            let (now, share) = match *progress {
                Progress::Rendering(done, all) => ("rendering the pictures", done as f64 / all.max(1) as f64),
                Progress::Training(_, share) => ("fitting the splats to them", share),
            };
            if now != stage {
                stage = now;
                watching.tell(|news| news.set_item("stage", now));
            }
            watching.going(share)
        };
        with_device(device, |gpu| engine::bake::bake(gpu, set, &look, &options, None, &mut going))
    });
    if let Some(error) = watching.error {
        return Err(error);
    }
    let baked = done?;
    let report = &baked.report;
    if watching.interrupted && report.steps == 0 {
        return Err(PyKeyboardInterrupt::new_err("stopped before there were splats"));
    }
    let told = PyDict::new(py);
    told.set_item("iterations", report.steps)?;
    told.set_item("seconds", report.rendering_s + report.training_s)?;
    told.set_item("stopped", baked.unfinished.is_some() || watching.stop)?;
    told.set_item("psnr_db", report.curve.last().map(|point| point.psnr_db))?;
    Ok((Splats::new(baked.set), told))
}
