//! Fits splats to the region of a volume beside the window, in a thread with a device of its own.
//!
//! The thread tells its progress, and hands out the splats as they are whenever the window asks for a picture
//! of them. Once its iterations have ended it waits for the word to write a file, or for its end.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use engine::fit::{
    self, Beginning, End, FitConfig, Fitted, Goal, Milestone, Order, Outcome, Plan, Problem, Progress, Watch,
};
use engine::gpu::{Gpu, GpuOptions};
use engine::splat::{self, Splat, SplatSet};
use engine::{Error, Kind, Result};

use crate::io::loader::{LoadedSplats, LoadedVolume};
use crate::model::fit_plan::{FitStatus, Stage};

/// Least time between two reports of the progress, so that the panels are not painted for each iteration.
const TELL_EVERY: Duration = Duration::from_millis(250);
/// What is fitted, and how.
pub struct FitOrder {
    /// Volume with its region.
    pub volume: Arc<LoadedVolume>,
    /// Hyper-parameters.
    pub config: FitConfig,
    /// Options of the device of the fit.
    pub gpu: GpuOptions,
}

/// News of a fit that the window has to act on.
pub enum News {
    /// The splats as they are.
    Splats(Arc<LoadedSplats>),
    /// The splats were written to this file, and the fit is over.
    Kept(PathBuf),
    /// Something went wrong. The splats so far can be kept, if there are any.
    Failed(Error),
    /// The fit has ended without splats.
    Nothing,
}

/// A fit beside the window. Dropping it stops the fit and waits for its thread.
pub struct Fitting {
    status: FitStatus,
    shared: Arc<Shared>,
    /// Word to write a file; dropped to end the thread.
    keep: Option<Sender<(PathBuf, bool)>>,
    reports: Receiver<Report>,
    thread: Option<JoinHandle<()>>,
}

/// State that both threads see.
#[derive(Default)]
struct Shared {
    /// True if the iterations are to stop.
    stop: AtomicBool,
    /// True if nobody wants the splats any more.
    gone: AtomicBool,
    /// Time from which on the window wants a picture of the splats; `None` until it has shown the last one.
    wanted: Mutex<Option<Instant>>,
}

impl Shared {
    fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.gone.load(Ordering::Relaxed)
    }
}

enum Report {
    Doing { what: &'static str, share: Option<f64> },
    Begun { splats: usize },
    Progress { iteration: u32, seconds: f64 },
    Figures { psnr_db: f64, rmse: f64 },
    Measured { p99: f64 },
    Ended { iteration: u32, seconds: f64 },
    NotWritten(Error),
    News(News),
}

impl Fitting {
    /// Begins a fit. `wake` is called from its thread whenever there is something to [take](Fitting::take).
    pub fn start(order: FitOrder, wake: Arc<dyn Fn() + Send + Sync>) -> Self {
        let status = FitStatus {
            iterations: order.config.iterations,
            doing: "preparing the fit",
            ..FitStatus::default()
        };
        let shared = Arc::new(Shared { wanted: Mutex::new(Some(Instant::now())), ..Shared::default() });
        let ((keep, kept), (sender, reports)) = (channel(), channel());
        let tell = Job { sender, wake, shared: Arc::clone(&shared) };
        let thread = std::thread::spawn(move || {
            if let Err(error) = run(&order, &tell, &kept) {
                tell.news(News::Failed(error));
                tell.news(News::Nothing);
            }
        });
        Fitting { status, shared, keep: Some(keep), reports, thread: Some(thread) }
    }

    /// Returns its progress as it was last taken.
    pub fn status(&self) -> &FitStatus {
        &self.status
    }

    /// Takes what the thread has told since the last call. Of several pictures the last one is news.
    pub fn take(&mut self) -> Vec<News> {
        let mut news = Vec::new();
        while let Ok(report) = self.reports.try_recv() {
            let status = &mut self.status;
            match report {
                Report::Doing { what, share } => (status.doing, status.done) = (what, share),
                Report::Begun { splats } => {
                    *status = FitStatus { stage: Stage::Running, splats: Some(splats), ..status.clone() };
                }
                Report::Progress { iteration, seconds } => {
                    (status.iteration, status.seconds) = (iteration, seconds);
                }
                Report::Figures { psnr_db, rmse } => {
                    (status.psnr_db, status.rmse) = (Some(psnr_db), Some(rmse));
                }
                Report::Measured { p99 } => status.p99 = Some(p99),
                Report::Ended { iteration, seconds } => {
                    (status.stage, status.iteration, status.seconds) = (Stage::Ended, iteration, seconds);
                }
                Report::NotWritten(error) => {
                    status.stage = Stage::Ended;
                    news.push(News::Failed(error));
                }
                Report::News(News::Splats(splats)) => {
                    news.retain(|n| !matches!(n, News::Splats(_)));
                    news.push(News::Splats(splats));
                }
                Report::News(other) => news.push(other),
            }
        }
        news
    }

    /// Stops the iterations; the splats so far stay.
    pub fn stop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.status.stopping = true;
    }

    /// Writes the splats to a file, once the iterations have ended; an existing one is replaced only if `force`
    /// is set. The fit ends with [`News::Kept`], or goes on waiting after [`News::Failed`].
    pub fn keep(&mut self, path: PathBuf, force: bool) {
        if let (Stage::Ended, Some(keep)) = (self.status.stage, &self.keep)
            && keep.send((path, force)).is_ok()
        {
            (self.status.stage, self.status.doing, self.status.done) =
                (Stage::Writing, "writing the splats", None);
        }
    }

    /// Asks for a picture of the splats as they will be after some time.
    pub fn want_splats(&self, after: Duration) {
        let mut wanted = self.shared.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.get_or_insert_with(|| Instant::now() + after);
    }
}

impl Drop for Fitting {
    /// Waits for the thread: a driver crashes if the program ends while its device is used.
    fn drop(&mut self) {
        self.shared.gone.store(true, Ordering::Relaxed);
        self.keep = None;
        if let Some(thread) = self.thread.take() {
            // A panic of the thread was told when it happened.
            let _ = thread.join();
        }
    }
}

/// The thread's end of the channel. If nobody listens any more, its reports are lost.
struct Job {
    sender: Sender<Report>,
    wake: Arc<dyn Fn() + Send + Sync>,
    shared: Arc<Shared>,
}

impl Job {
    fn say(&self, report: Report) {
        let _ = self.sender.send(report);
        (self.wake)();
    }

    /// Tells what is done next, of which it is not known how far it is.
    fn doing(&self, what: &'static str) {
        self.say(Report::Doing { what, share: None });
    }

    /// Returns what hears how far work called `what` is, and stops it once `stopped` returns true.
    fn going<'a>(
        &'a self,
        what: &'static str,
        stopped: impl Fn() -> bool + 'a,
    ) -> impl FnMut(f64) -> ControlFlow<()> + 'a {
        let mut told: Option<Instant> = None;
        move |share| {
            if told.is_none_or(|at| at.elapsed() >= TELL_EVERY) {
                told = Some(Instant::now());
                self.say(Report::Doing { what, share: Some(share) });
            }
            if stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }

    fn news(&self, news: News) {
        self.say(Report::News(news));
    }

    /// Hands out a set, with the labels of the volume's region.
    fn show(&self, set: SplatSet) -> Result<()> {
        let splats = LoadedSplats::join(vec![("fit".into(), set)])?;
        self.news(News::Splats(Arc::new(splats)));
        Ok(())
    }
}

/// Fits, and then waits for the word to write a file or for the end.
fn run(order: &FitOrder, tell: &Job, kept: &Receiver<(PathBuf, bool)>) -> Result<()> {
    let LoadedVolume { volume, roi, labels, .. } = &*order.volume;
    let roi = roi.as_ref().ok_or_else(|| {
        Error::new(Kind::NothingToDo, "VGS-VIEW-040", "the volume has no region to fit")
            .help("open a mask, or find the voxels of a threshold")
    })?;
    tell.doing("starting the device");
    let gpu = Gpu::new(&order.gpu)?;
    let mut watch = Watching { tell, plan: None, begun: Instant::now(), told: None, span: 1.0, stage: None };
    let request = Order { labels: labels.as_ref(), ..Order::new(volume, roi, &order.config) };
    let (plan, start) = Plan::new(&gpu, request, &mut watch)?;
    if tell.shared.stops() {
        tell.news(News::Nothing);
        return Ok(());
    }
    tell.doing("preparing the device");
    watch.plan = Some(&plan);
    let Fitted { set, outcome, lacking: _ } = plan.run(start, &mut watch)?;
    let Outcome { splats, iterations, seconds, end, .. } = outcome;
    tell.say(Report::Ended { iteration: iterations, seconds });
    let finished = matches!(end, End::Finished);
    if let End::Failed(error) = end {
        tell.news(News::Failed(error));
    }
    if tell.shared.gone.load(Ordering::Relaxed) {
        return Ok(());
    }
    if finished && let Err(error) = measure(order, plan.problem(), &gpu, &splats, tell) {
        tracing::warn!("the splats could not be measured: {error}");
    }
    tell.show(set.clone())?;
    while let Ok((path, force)) = kept.recv() {
        let gone = || tell.shared.gone.load(Ordering::Relaxed);
        let mut going = tell.going("rounding the splats for the file", gone);
        let rounded = match finished && plan.problem().is_rounded_in(&path) {
            true => plan.rounded_set(&splats, iterations, &mut going).map(Some),
            false => Ok(None),
        };
        let rounded = rounded.unwrap_or_else(|error| {
            tracing::warn!("the rounded splats could not be fitted again: {error}");
            None
        });
        if tell.shared.gone.load(Ordering::Relaxed) {
            break;
        }
        tell.doing("writing the splats");
        match splat::write(&path, rounded.as_ref().unwrap_or(&set), force) {
            Ok(()) => {
                tell.news(News::Kept(path));
                break;
            }
            Err(error) => tell.say(Report::NotWritten(error)),
        }
    }
    Ok(())
}

/// Measures the splats of a fit at the voxels of the region, and tells it.
fn measure(order: &FitOrder, problem: &Problem<'_>, gpu: &Gpu, splats: &[Splat], tell: &Job) -> Result<()> {
    let volume = &order.volume.volume;
    let range = volume.min_max().map_or([0.0; 2], |(low, high)| [low, high]);
    let threshold = order.config.region.threshold;
    let found = problem.at_voxels(gpu, &Goal { psnr_db: None, p99_hu: None, range, threshold }, splats)?;
    tell.say(Report::Figures { psnr_db: found.psnr_db, rmse: found.rmse_hu });
    tell.say(Report::Measured { p99: found.p99_hu });
    Ok(())
}

/// Observer of the fit.
struct Watching<'a> {
    tell: &'a Job,
    /// The fit, once it runs.
    plan: Option<&'a Plan<'a>>,
    begun: Instant,
    /// Time of the last report.
    told: Option<Instant>,
    /// Width of the range that errors are told in, HU for CT.
    span: f64,
    stage: Option<fit::Stage>,
}

impl Watching<'_> {
    /// Returns true if it is time for a report.
    fn is_due(&mut self) -> bool {
        let due = self.told.is_none_or(|at| at.elapsed() >= TELL_EVERY);
        if due {
            self.told = Some(Instant::now());
        }
        due
    }
}

impl Watch for Watching<'_> {
    fn begin(&mut self, beginning: &Beginning) {
        let [low, high] = beginning.range.map(f64::from);
        (self.begun, self.span) = (Instant::now(), high - low);
        self.tell.say(Report::Begun { splats: beginning.splats });
    }

    fn step(&mut self, iteration: u32, _share: f64) {
        if self.is_due() {
            self.tell.say(Report::Progress { iteration, seconds: self.begun.elapsed().as_secs_f64() });
        }
    }

    fn begin_stage(&mut self, stage: fit::Stage) {
        self.stage = Some(stage);
        self.tell.doing(stage.text());
    }

    fn going(&mut self, done: f64) -> ControlFlow<()> {
        if let Some(stage) = self.stage.filter(|_| self.is_due()) {
            self.tell.say(Report::Doing { what: stage.text(), share: Some(done) });
        }
        if self.stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn figures(&mut self, progress: &Progress) {
        let rmse = progress.mse.sqrt() * self.span;
        self.tell.say(Report::Figures { psnr_db: progress.psnr_db, rmse });
    }

    fn stops(&mut self) -> bool {
        self.tell.shared.stops()
    }

    fn keeps(&self, _iteration: u32) -> bool {
        let wanted = self.tell.shared.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.is_some_and(|at| Instant::now() >= at)
    }

    fn keep(&mut self, milestone: &mut Milestone<'_, '_>) -> Result<bool> {
        if !milestone.stopped {
            *self.tell.shared.wanted.lock().unwrap_or_else(PoisonError::into_inner) = None;
            if let Some(plan) = self.plan {
                self.tell.show(plan.set(milestone.splats, milestone.iteration))?;
            }
        }
        Ok(true)
    }
}
