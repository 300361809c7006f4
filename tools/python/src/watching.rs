//! What takes long, watched by a callable of Python.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use engine::fit::{Beginning, Count, Progress, Stage, Watch};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Least time between two calls of the watching callable.
const TELL_EVERY: Duration = Duration::from_millis(100);

/// Tells a callable how the work goes, and asks the interpreter for signals.
pub struct Watching {
    watch: Option<Py<PyAny>>,
    told: Instant,
    asked: Instant,
    pub iteration: u32,
    /// True if the callable or Ctrl-C wants the work to stop.
    pub stop: bool,
    pub interrupted: bool,
    /// What the callable has raised.
    pub error: Option<PyErr>,
}

impl Watching {
    pub fn new(watch: Option<Py<PyAny>>) -> Self {
        let long_ago = Instant::now() - TELL_EVERY;
        let (told, asked) = (long_ago, long_ago);
        Watching { watch, told, asked, iteration: 0, stop: false, interrupted: false, error: None }
    }

    /// Calls the callable with a dictionary that `fill` makes.
    pub fn tell(&mut self, fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>) {
        let Some(watch) = &self.watch else { return };
        if self.stop {
            return;
        }
        self.told = Instant::now();
        let answer = Python::attach(|py| {
            let news = PyDict::new(py);
            fill(&news)?;
            let answer = watch.bind(py).call1((news,))?;
            Ok(!answer.is_none() && !answer.is_truthy()?)
        });
        match answer {
            Ok(stop) => self.stop |= stop,
            Err(error) => self.fail(error),
        }
    }

    fn fail(&mut self, error: PyErr) {
        self.stop = true;
        let interrupt = Python::attach(|py| error.is_instance_of::<PyKeyboardInterrupt>(py));
        if interrupt {
            self.interrupted = true;
        } else {
            self.error.get_or_insert(error);
        }
    }
}

impl Watch for Watching {
    fn begin(&mut self, beginning: &Beginning) {
        let splats = beginning.splats;
        self.tell(|news| {
            news.set_item("stage", "fitting the splats")?;
            news.set_item("splats", splats)
        });
    }

    fn step(&mut self, iteration: u32, share: f64) {
        self.iteration = iteration;
        if self.told.elapsed() >= TELL_EVERY {
            self.tell(|news| {
                news.set_item("iteration", iteration)?;
                news.set_item("share", share)
            });
        }
    }

    fn wants_figures(&self) -> bool {
        self.watch.is_some()
    }

    fn figures(&mut self, progress: &Progress) {
        let (iteration, psnr_db) = (progress.iteration, progress.psnr_db);
        self.tell(|news| {
            news.set_item("iteration", iteration)?;
            news.set_item("psnr_db", psnr_db)
        });
    }

    fn stops(&mut self) -> bool {
        if !self.stop && self.asked.elapsed() >= TELL_EVERY {
            self.asked = Instant::now();
            if let Err(error) = Python::attach(|py| py.check_signals()) {
                self.fail(error);
            }
        }
        self.stop
    }

    fn begin_stage(&mut self, stage: Stage) {
        self.tell(|news| news.set_item("stage", stage.text()));
    }

    fn going(&mut self, done: f64) -> ControlFlow<()> {
        if self.told.elapsed() >= TELL_EVERY {
            self.tell(|news| news.set_item("share", done));
        }
        if self.stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn counted(&mut self, count: &Count) {
        if let &Count::Found { splats, .. } = count {
            self.tell(|news| news.set_item("splats", splats));
        }
    }
}
