//! Reads files beside the window: splats, the volume and its region, and what is computed from them.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use engine::fidelity::ShownError;
use engine::fit::place::place;
use engine::gpu::Gpu;
use engine::render::{Probe, VolumeSource};
use engine::splat::{self, SplatSet};
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices, LabelChoice, Labels, ReadOptions, Roi, Volume, dicom};
use engine::{Error, Result};

pub use crate::io::loaded_splats::LoadedSplats;
use crate::io::sorting::{Sorted, sort_looking};
use crate::model::deletions::Deletion;
use crate::model::histogram::Histogram;
use crate::model::region::{Region, RegionSize};
use crate::model::series::Series;
use crate::model::state::{Files, Subject, is_session};

/// Volume and the part of it that is shown.
pub struct LoadedVolume {
    /// Volume.
    pub volume: Arc<Volume>,
    /// Region that is shown; `None` for all of it.
    pub roi: Option<Roi>,
    /// Size of the region.
    pub size: Option<RegionSize>,
    /// Labels of the region, if it was made of those of a label map.
    pub labels: Option<Labels>,
    /// The DICOM series that it is, as a session names it: by its UID, if one was asked for.
    pub series: Option<String>,
    /// What was made last to be shown, with these edges.
    shown: Mutex<Option<(Edges, Arc<ShownVolume>)>>,
}

/// What is shown of a volume and its region, where that is something else than they are.
pub struct ShownVolume(Option<(Volume, Option<Roi>)>);

impl LoadedVolume {
    /// Creates what is shown of a volume: a region of it with its labels, and the key of its series.
    pub fn new(
        volume: Arc<Volume>,
        roi: Option<Roi>,
        labels: Option<Labels>,
        series: Option<String>,
    ) -> Self {
        let size = roi.as_ref().map(|roi| RegionSize::of(roi, &volume));
        LoadedVolume { volume, roi, size, labels, series, shown: Mutex::default() }
    }

    /// Returns what is shown of the volume: with what lies between its slices if they are thick, and these edges of a
    /// binary region. That takes seconds, so a thread of the loader asks first.
    pub fn shown(&self, edges: Edges) -> Arc<ShownVolume> {
        if let Some(shown) = self.latest().filter(|_| !self.lacks(edges)) {
            return shown;
        }
        let between = BetweenSlices::default();
        let made = match volume::shown(&self.volume, self.roi.as_ref(), between, edges) {
            (Cow::Owned(volume), roi) => Some((volume, roi.map(Cow::into_owned))),
            (Cow::Borrowed(_), _) => None,
        };
        let shown = Arc::new(ShownVolume(made));
        *self.shown.lock().unwrap_or_else(PoisonError::into_inner) = Some((edges, Arc::clone(&shown)));
        shown
    }

    /// Returns what was made last to be shown; `None` if nothing was.
    pub fn latest(&self) -> Option<Arc<ShownVolume>> {
        let shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        shown.as_ref().map(|(_, shown)| Arc::clone(shown))
    }

    /// Returns true if what was made last to be shown has other edges.
    pub fn lacks(&self, edges: Edges) -> bool {
        let shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        let has_edges = self.roi.as_ref().is_some_and(|roi| !roi.soft);
        shown.as_ref().is_none_or(|(made_for, _)| has_edges && *made_for != edges)
    }

    /// Returns what is shown of the volume as a scene takes it.
    pub fn source<'a>(&'a self, shown: &'a ShownVolume) -> VolumeSource<'a> {
        match &shown.0 {
            Some((volume, roi)) => VolumeSource { volume, roi: roi.as_ref() },
            None => VolumeSource { volume: &self.volume, roi: self.roi.as_ref() },
        }
    }
}

/// Result of a thread of the loader.
pub enum Loaded {
    /// Splats of all files.
    Splats(Arc<LoadedSplats>),
    /// Splats beside them.
    Beside(Arc<LoadedSplats>),
    /// Splats that deletions have left.
    Remaining(Remaining),
    /// Histogram of the intensities of these splats, and the probe that evaluates their field at points.
    Counted(Arc<LoadedSplats>, Option<Histogram>, Box<Probe>),
    /// Volume.
    Volume(Arc<LoadedVolume>),
    /// This volume can be shown with other edges.
    Edges(Arc<LoadedVolume>),
    /// Series of a folder, of which one is to be chosen before there is a volume.
    Several(Series),
    /// Histogram of the intensities of this volume within its region.
    VolumeHistogram(Arc<LoadedVolume>, Option<Histogram>),
    /// Files that had to be looked into to be sorted, and those that were asked for.
    Sorted(Box<Sorted>, Vec<PathBuf>),
    /// Error of these splats against this volume; `None` if they lie nowhere in it.
    Error(Arc<LoadedSplats>, Arc<LoadedVolume>, Result<Option<Arc<ShownError>>>),
    /// File that was written, and what else there is to tell of it.
    Written(PathBuf, String),
    /// Error of something that could not be done; the rest goes on. The subject is given if its files could
    /// not be read.
    Failed(Option<Subject>, Error),
}

/// Splats that deletions have left.
pub struct Remaining {
    /// All splats.
    pub whole: Arc<LoadedSplats>,
    /// Deletions.
    pub deleted: Vec<Deletion>,
    /// Splats that are left.
    pub splats: Arc<LoadedSplats>,
}

/// Reads and writes files in threads of its own, and wakes the window for each result.
pub struct Loader {
    wake: Arc<dyn Fn() + Send + Sync>,
    sender: Sender<(u64, Message)>,
    receiver: Receiver<(u64, Message)>,
    /// Number of the latest call of [`Loader::open`]; results of earlier ones are dropped.
    turn: u64,
    /// Work in progress, and the part of it that is done, if known.
    doing: Vec<(String, Option<f32>)>,
    /// Threads that use the device.
    preparing: Vec<JoinHandle<()>>,
}

/// The work of [`Loader::edge`].
pub const EDGING: &str = "smoothing the edges of the volume";
/// Error code of a folder of several series, of which none was chosen.
const SEVERAL_SERIES: &str = "VGS-DCM-006";
/// Turn of work whose result is wanted whatever is opened meanwhile.
const ALWAYS: u64 = 0;

#[expect(clippy::large_enum_variant, reason = "few are on the way at a time")]
enum Message {
    /// Work has begun, or a part of it is done, 0 to 1.
    Doing(String, Option<f32>),
    Ended(String),
    Loaded(Loaded),
}

impl Loader {
    /// Creates a loader. `wake` is called from other threads.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (sender, receiver) = channel();
        Loader { wake: Arc::new(wake), sender, receiver, turn: 0, doing: Vec::new(), preparing: Vec::new() }
    }

    /// Begins to read files; results of what was being read before are dropped. Files that are also in `had`
    /// are not read again; neither is `volume`, that of `had`, where only its region is another one. A volume is shown with
    /// `edges` at first.
    pub fn open(&mut self, files: &Files, before: &Files, volume: Option<&Arc<Volume>>, edges: Edges) {
        self.turn += 1;
        self.doing.clear();
        let turn = self.turn;
        if files.splats != before.splats && !files.splats.is_empty() {
            let files = files.clone();
            self.spawn(turn, move |job| job.splats(&files));
        }
        if let Some(path) = files.beside.clone()
            && files.beside != before.beside
        {
            let files = files.clone();
            self.spawn(turn, move |job| job.beside(path, &files));
        }
        if let Some(path) = files.volume.clone()
            && !(files.has_volume_of(before) && files.region() == before.region())
        {
            let files = files.clone();
            let there = volume.filter(|_| files.has_volume_of(before)).map(Arc::clone);
            self.spawn(turn, move |job| job.volume(&path, there, &files, edges));
        }
    }

    /// Begins to sort files that have to be looked into.
    pub fn sort(&self, open: &Files, added: Vec<PathBuf>, volume: Option<&Arc<Volume>>) {
        let (open, volume) = (open.clone(), volume.map(Arc::clone));
        self.spawn(ALWAYS, move |job| {
            let session = added.iter().find(|path| is_session(path)).map(|path| name_of(path));
            let what = session.map_or("checking whether it is a volume or a mask".to_owned(), |name| {
                format!("opening {name}")
            });
            let sort = || {
                let sorted = sort_looking(&open, &added, volume.as_deref())?;
                Ok(Sorted { read: sorted.state().transpose()?, ..sorted })
            };
            if let Some(sorted) = job.run(what, sort) {
                job.say(Message::Loaded(Loaded::Sorted(Box::new(sorted), added)));
            }
        });
    }

    /// Begins to list the series of the volume's folder.
    pub fn list_series(&self, files: &Files) {
        // The region is that of the series that is open.
        let mut files = files.clone();
        files.set_region(None);
        let Some(path) = files.volume.clone() else { return };
        self.spawn(ALWAYS, move |job| {
            let list = || dicom::series(&path, &ReadOptions::default()).map_err(|e| e.or_file(&path));
            if let Some(rows) = job.run("listing the series".to_owned(), list) {
                job.say(Message::Loaded(Loaded::Several(Series { files, rows })));
            }
        });
    }

    /// Returns a function that wakes the window, from any thread.
    pub fn waker(&self) -> Arc<dyn Fn() + Send + Sync> {
        Arc::clone(&self.wake)
    }

    fn spawn(&self, turn: u64, work: impl FnOnce(&Job) + Send + 'static) -> JoinHandle<()> {
        let job = Job { wake: Arc::clone(&self.wake), sender: self.sender.clone(), turn };
        std::thread::spawn(move || work(&job))
    }

    /// Returns what has been loaded since the last call.
    pub fn take(&mut self) -> Vec<Loaded> {
        let mut loaded = Vec::new();
        while let Ok((turn, message)) = self.receiver.try_recv() {
            if turn != self.turn && turn != ALWAYS {
                continue;
            }
            match message {
                Message::Doing(what, part) => match self.doing.iter_mut().find(|d| d.0 == what) {
                    Some(row) => row.1 = part,
                    None => self.doing.push((what, part)),
                },
                Message::Ended(what) => self.doing.retain(|d| d.0 != what),
                Message::Loaded(what) => loaded.push(what),
            }
        }
        loaded
    }

    /// Returns the work in progress, and the part of it that is done, if known.
    pub fn doing(&self) -> Option<(&str, Option<f32>)> {
        self.doing.first().map(|(what, part)| (what.as_str(), *part))
    }

    /// Returns true if this work is in progress.
    pub fn is_doing(&self, what: &str) -> bool {
        self.doing.iter().any(|(doing, _)| doing == what)
    }

    /// Runs a job beside the window that makes later work faster. It is given a function that takes its
    /// progress, from 0 to 1.
    pub fn prepare(
        &mut self,
        what: &'static str,
        work: impl FnOnce(&mut dyn FnMut(f32)) -> Result<()> + Send + 'static,
    ) {
        self.doing.push((what.to_owned(), None));
        let thread = self.spawn(self.turn, move |job| {
            let mut progress = |part| job.say(Message::Doing(what.to_owned(), Some(part)));
            job.run(what.to_owned(), || work(&mut progress));
        });
        self.wait_at_end_for(thread);
    }

    /// Begins to make what is shown of a volume with these edges.
    pub fn edge(&mut self, volume: Arc<LoadedVolume>, edges: Edges) {
        self.doing.push((EDGING.to_owned(), None));
        let thread = self.spawn(ALWAYS, move |job| {
            job.run(EDGING.to_owned(), || Ok(volume.shown(edges)));
            job.say(Message::Loaded(Loaded::Edges(volume)));
        });
        self.wait_at_end_for(thread);
    }

    /// Begins to find the splats that deletions leave, and what is counted of them.
    pub fn delete(&mut self, whole: Arc<LoadedSplats>, deleted: Vec<Deletion>) {
        let what = if deleted.is_empty() { "restoring splats" } else { "deleting splats" };
        self.doing.push((what.to_owned(), None));
        let thread = self.spawn(ALWAYS, move |job| job.delete(what, whole, deleted));
        self.wait_at_end_for(thread);
    }

    /// Begins to measure the error of splats against a volume.
    pub fn measure(&mut self, splats: Arc<LoadedSplats>, volume: Arc<LoadedVolume>, gpu: &Gpu) {
        let gpu = gpu.clone();
        let what = "measuring the error";
        self.doing.push((what.to_owned(), None));
        let thread = self.spawn(ALWAYS, move |job| {
            let mut progress = |part| job.say(Message::Doing(what.to_owned(), Some(part)));
            let measured =
                ShownError::new(&gpu, &splats.set, &volume.volume, volume.roi.as_ref(), &mut progress)
                    .map(|found| found.map(Arc::new));
            job.say(Message::Ended(what.to_owned()));
            // Whoever takes the result has to know of a failure, so that it is not tried again.
            job.say(Message::Loaded(Loaded::Error(splats, volume, measured)));
        });
        self.wait_at_end_for(thread);
    }

    fn wait_at_end_for(&mut self, thread: JoinHandle<()>) {
        self.preparing.retain(|thread| !thread.is_finished());
        self.preparing.push(thread);
    }

    /// Writes a file as [`Loader::write`] does. The program does not end before the file is written.
    pub fn write_to_the_end(
        &mut self,
        path: PathBuf,
        write: impl FnOnce(&mut dyn FnMut(f32)) -> Result<String> + Send + 'static,
    ) {
        let thread = self.write(path, write);
        self.wait_at_end_for(thread);
    }

    /// Writes a file beside the window. `write` is given a function that takes its progress, from 0 to 1, and returns
    /// what else there is to tell of the file.
    pub fn write(
        &self,
        path: PathBuf,
        write: impl FnOnce(&mut dyn FnMut(f32)) -> Result<String> + Send + 'static,
    ) -> JoinHandle<()> {
        self.spawn(ALWAYS, move |job| {
            let what = format!("writing {}", name_of(&path));
            let mut progress = |part| job.say(Message::Doing(what.clone(), Some(part)));
            if let Some(note) = job.run(what.clone(), || write(&mut progress)) {
                job.say(Message::Loaded(Loaded::Written(path, note)));
            }
        })
    }
}

impl Drop for Loader {
    /// Waits for the threads that use the device: a driver crashes if the program ends meanwhile. They end soon once
    /// their scene is gone.
    fn drop(&mut self) {
        for thread in self.preparing.drain(..) {
            // A panic of the thread was told when it happened.
            let _ = thread.join();
        }
    }
}

/// The thread's end of the channel. If nobody listens any more, its messages are lost.
struct Job {
    wake: Arc<dyn Fn() + Send + Sync>,
    sender: Sender<(u64, Message)>,
    turn: u64,
}

impl Job {
    /// Returns a job whose results are wanted whatever is opened meanwhile: they name what they belong to.
    fn always(&self) -> Self {
        Job { wake: Arc::clone(&self.wake), sender: self.sender.clone(), turn: ALWAYS }
    }

    fn say(&self, message: Message) {
        let _ = self.sender.send((self.turn, message));
        (self.wake)();
    }

    fn run<T>(&self, what: String, job: impl FnOnce() -> Result<T>) -> Option<T> {
        self.doing(what, None, job)
    }

    /// Runs a job that reads the files of a subject, and reports its progress.
    fn reading<T>(&self, what: String, subject: Subject, job: impl FnOnce() -> Result<T>) -> Option<T> {
        self.doing(what, Some(subject), job)
    }

    fn doing<T>(&self, what: String, subject: Option<Subject>, job: impl FnOnce() -> Result<T>) -> Option<T> {
        self.say(Message::Doing(what.clone(), None));
        let start = Instant::now();
        let result = job();
        tracing::debug!("{what}: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
        let value = match result {
            Ok(value) => Some(value),
            Err(error) => {
                self.say(Message::Loaded(Loaded::Failed(subject, error)));
                None
            }
        };
        self.say(Message::Ended(what));
        value
    }

    fn splats(&self, files: &Files) {
        let sets = self.reading("reading splats".to_owned(), Subject::Splats, || {
            let sets = files.splats.iter().map(|path| Ok((path.clone(), read_splats(path, files)?)));
            LoadedSplats::join(sets.collect::<Result<_>>()?).map(Arc::new)
        });
        let Some(splats) = sets else { return };
        self.say(Message::Loaded(Loaded::Splats(Arc::clone(&splats))));
        self.count(splats);
    }

    fn beside(&self, path: PathBuf, files: &Files) {
        let splats = self.reading("reading the splats to compare with".to_owned(), Subject::Beside, || {
            let set = read_splats(&path, files)?;
            LoadedSplats::join(vec![(path, set)]).map(Arc::new)
        });
        let Some(splats) = splats else { return };
        self.say(Message::Loaded(Loaded::Beside(Arc::clone(&splats))));
        self.count(splats);
    }

    fn count(&self, splats: Arc<LoadedSplats>) {
        let always = self.always();
        let counted = always.run("computing the histogram of the splats".to_owned(), || {
            Ok((Histogram::of_splats(&splats.set), Box::new(Probe::new(&splats.set))))
        });
        let Some((histogram, probe)) = counted else { return };
        always.say(Message::Loaded(Loaded::Counted(splats, histogram, probe)));
    }

    fn delete(&self, what: &str, whole: Arc<LoadedSplats>, deleted: Vec<Deletion>) {
        let splats = self.run(what.to_owned(), || {
            Ok(match deleted.is_empty() {
                true => Arc::clone(&whole),
                false => Arc::new(whole.without(&deleted)),
            })
        });
        let Some(splats) = splats else { return };
        self.say(Message::Loaded(Loaded::Remaining(Remaining {
            whole,
            deleted,
            splats: Arc::clone(&splats),
        })));
        self.count(splats);
    }

    fn volume(&self, path: &Path, there: Option<Arc<Volume>>, files: &Files, edges: Edges) {
        let name = name_of(path);
        let what = match &there {
            Some(_) => format!("finding the region of {name}"),
            None => format!("reading {name}"),
        };
        let read = || match read_volume(path, there, files) {
            Err(error) if error.code == SEVERAL_SERIES => {
                Ok(Err(dicom::series(path, &ReadOptions::default())?))
            }
            read => {
                let shown = Arc::new(read?);
                shown.shown(edges);
                Ok(Ok(shown))
            }
        };
        let shown = match self.reading(what, Subject::Volume, read) {
            None => return,
            Some(Err(rows)) => {
                return self.say(Message::Loaded(Loaded::Several(Series { files: files.clone(), rows })));
            }
            Some(Ok(shown)) => shown,
        };
        self.say(Message::Loaded(Loaded::Volume(Arc::clone(&shown))));
        let always = self.always();
        let histogram = always.run(format!("computing the histogram of {name}"), || {
            Ok(Histogram::of_volume(&shown.volume, shown.roi.as_ref()))
        });
        always.say(Message::Loaded(Loaded::VolumeHistogram(shown, histogram.flatten())));
    }
}

/// Reads the splat set of a file; volume and region of `files` are read only if it needs them to be placed.
///
/// # Errors
/// Returns the errors of the readers, and [`Kind::BadData`](engine::Kind::BadData) if the set needs a volume and there is none.
pub fn read_splats(path: &Path, files: &Files) -> Result<SplatSet> {
    let splats = splat::read_some(path)?;
    let volume = files.volume.as_ref().filter(|_| splats.needs_volume());
    let shown = volume.map(|volume| read_volume(volume, None, files)).transpose()?;
    splats.placed(shown.map(|shown| place(&shown.volume, shown.roi.as_ref())).as_ref())
}

/// Reads a volume, unless it is `there` already, with the series and the region that `files` name.
///
/// # Errors
/// Returns the errors of the readers, with the file.
pub fn read_volume(path: &Path, there: Option<Arc<Volume>>, files: &Files) -> Result<LoadedVolume> {
    let options = ReadOptions { series: files.series.clone(), ..ReadOptions::default() };
    let volume = match &there {
        Some(volume) => Arc::clone(volume),
        None => Arc::new(Volume::read(path, &options)?),
    };
    // A number counts in the folder as it is today.
    let series = match &files.series {
        Some(asked) if there.is_none() && !dicom::is_key(asked) => dicom::series_files(path, &options)?.key,
        asked => asked.clone(),
    };
    let (roi, labels) = match files.region() {
        None => (None, None),
        Some(Region::Threshold(threshold)) => {
            (Some(threshold.find(&volume).map_err(|e| e.or_file(path))?), None)
        }
        Some(Region::Mask { path: mask, labels }) => {
            let (roi, labels) =
                read_mask(&mask, labels.as_deref(), &options, &volume).map_err(|e| e.or_file(&mask))?;
            (Some(roi), labels)
        }
    };
    Ok(LoadedVolume::new(volume, roi, labels, series))
}

fn read_mask(
    path: &Path,
    labels: Option<&str>,
    options: &ReadOptions,
    volume: &Volume,
) -> Result<(Roi, Option<Labels>)> {
    let choice = labels.map_or(Ok(LabelChoice::Whole), str::parse)?;
    let mask = Volume::read_mask(path, options, &choice, volume)?;
    Ok((Roi::from_mask(&mask, &choice, volume)?, Labels::chosen(&mask, &choice, volume)?))
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use engine::Kind;

    use super::*;
    use crate::model::region::Threshold;

    #[test]
    fn a_volume_is_shown_with_the_edges_that_are_asked_for() {
        let (sender, woken) = channel();
        let mut loader = Loader::new(move || sender.send(()).expect("the test listens"));
        let phantom = engine::volume::phantom::Phantom::new([16; 3], glam::DVec3::ONE, 1);
        let volume = Arc::new(phantom.volume());
        let of = |roi: Option<Roi>| Arc::new(LoadedVolume::new(Arc::clone(&volume), roi, None, None));
        let weights = |shown: &LoadedVolume| {
            let latest = shown.latest().expect("made");
            shown.source(&latest).roi.map(|roi| (roi.size, roi.weight.clone()))
        };
        let roi = phantom.roi().expect("a region");
        let binary = of(Some(roi.clone()));
        binary.shown(Edges::Voxel);
        let blocks = weights(&binary);
        assert!(!binary.lacks(Edges::Voxel) && binary.lacks(Edges::Within(1.0)));
        loader.edge(Arc::clone(&binary), Edges::Within(1.0));
        assert!(loader.is_doing(EDGING));
        let mut loaded = Vec::new();
        while loaded.is_empty() {
            woken.recv_timeout(std::time::Duration::from_secs(20)).expect("an answer");
            loaded.extend(loader.take());
        }
        assert!(matches!(&loaded[..], [Loaded::Edges(of)] if Arc::ptr_eq(of, &binary)));
        assert!(!binary.lacks(Edges::Within(1.0)) && weights(&binary) != blocks);
        // Nothing else depends on edges.
        for other in [of(Some(Roi { soft: true, ..roi })), of(None)] {
            other.shown(Edges::Voxel);
            assert!(!other.lacks(Edges::Within(1.0)));
        }
    }

    #[test]
    fn what_is_missing_is_said_and_the_rest_is_read() {
        let (sender, woken) = channel();
        let mut loader = Loader::new(move || sender.send(()).expect("the test listens"));
        let folder = tempfile::tempdir().unwrap();
        let nothing = folder.path().join("none.ply");
        let files = Files { splats: vec![nothing.clone()], ..Files::default() };
        loader.open(&files, &Files::default(), None, Edges::default());
        let mut loaded = Vec::new();
        while loaded.is_empty() {
            woken.recv_timeout(std::time::Duration::from_secs(20)).expect("an answer");
            loaded.extend(loader.take());
        }
        let [Loaded::Failed(Some(Subject::Splats), error)] = loaded.as_slice() else {
            panic!("one failure of splats")
        };
        assert_eq!((error.kind, error.file.as_ref()), (Kind::Missing, Some(&nothing)));
    }

    #[test]
    fn what_is_opened_next_takes_no_histogram_away() {
        let (sender, woken) = channel();
        let mut loader = Loader::new(move || sender.send(()).expect("the test listens"));
        let folder = tempfile::tempdir().unwrap();
        let [ct, ply] = ["ct.nii", "a.ply"].map(|name| folder.path().join(name));
        let volume = Volume::new([8, 9, 10], glam::DAffine3::IDENTITY, (0..720).map(|i| i as f32).collect());
        engine::volume::nifti::write(&ct, &volume, false).unwrap();
        let splat = splat::Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Default::default() };
        splat::write(&ply, &SplatSet { splats: vec![splat], ..SplatSet::default() }, false).unwrap();
        let mut files = Files { volume: Some(ct), ..Files::default() };
        loader.open(&files, &Files::default(), None, Edges::default());
        let (mut read, mut counted) = (None, 0);
        while counted < 2 {
            woken.recv_timeout(std::time::Duration::from_secs(20)).expect("both are counted");
            for loaded in loader.take() {
                match loaded {
                    Loaded::Volume(volume) => {
                        // Before its intensities are counted, as far as anybody knows.
                        let had = files.clone();
                        files.splats = vec![ply.clone()];
                        loader.open(&files, &had, Some(&volume.volume), Edges::default());
                        read = Some(volume);
                    }
                    Loaded::VolumeHistogram(volume, histogram) => {
                        assert!(
                            histogram.is_some() && read.as_ref().is_some_and(|r| Arc::ptr_eq(r, &volume))
                        );
                        counted += 1;
                    }
                    Loaded::Counted(..) => counted += 1,
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn splats_that_count_in_voxels_are_placed_by_the_volume_that_is_opened_with_them() {
        let folder = tempfile::tempdir().unwrap();
        let [ply, ct] = ["theirs.ply", "ct.nii"].map(|name| folder.path().join(name));
        let affine = glam::DAffine3::from_translation(glam::DVec3::new(100.0, -50.0, 7.0));
        let volume = Volume::new([8, 9, 10], affine, (0..720).map(|i| i as f32).collect());
        engine::volume::nifti::write(&ct, &volume, false).unwrap();
        let splat = splat::Splat {
            mean: [3.0, 4.0, 5.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            intensity: 40.0,
            ..Default::default()
        };
        let set = SplatSet::from_voxel(&[splat], &affine, splat::Field::default());
        let whole = Roi::new(vec![1.0; 720], &volume).unwrap();
        let layout = splat::PlyLayout::named("reference").expect("a layout");
        let place = Some(place(&volume, Some(&whole)));
        splat::write_as(&ply, &set, &splat::WriteOptions { layout, place, ..splat::WriteOptions::default() })
            .unwrap();
        let with_volume = Files { volume: Some(ct), ..Files::default() };
        let read = read_splats(&ply, &with_volume).unwrap();
        let mean = read.splats[0].mean.map(f64::from);
        let apart = glam::DVec3::from_array(mean) + read.origin_mm - glam::DVec3::new(103.0, -46.0, 12.0);
        assert!(apart.length() < 1e-4 && read.splats[0].intensity == 40.0, "{read:?}");
        let error = read_splats(&ply, &Files::default()).unwrap_err();
        assert!(error.code == "VGS-PLY-026" && error.help.contains("vgs view"), "{error}");
    }

    #[test]
    fn a_region_is_a_threshold_or_labels_of_a_volume_that_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let [ct, map] = ["ct.nii", "map.nii"].map(|name| folder.path().join(name));
        let volume = |value: fn(usize) -> f32| {
            Volume::new([8, 9, 10], glam::DAffine3::IDENTITY, (0..720).map(value).collect())
        };
        engine::volume::nifti::write(&ct, &volume(|i| i as f32), false).unwrap();
        engine::volume::nifti::write(&map, &volume(|i| (i % 4) as f32), false).unwrap();
        let mut files = Files { volume: Some(ct.clone()), ..Files::default() };
        let whole = read_volume(&ct, None, &files).unwrap();
        assert!(whole.roi.is_none() && whole.size.is_none());
        // From here on nothing can be read from the file.
        std::fs::remove_file(&ct).unwrap();
        let mut with = |region| {
            files.set_region(Some(region));
            read_volume(&ct, Some(Arc::clone(&whole.volume)), &files)
        };
        let found = with(Region::Threshold(Threshold::new(100.0, 109.0))).unwrap();
        assert!(Arc::ptr_eq(&found.volume, &whole.volume) && found.labels.is_none());
        assert_eq!(found.size.map(|size| size.voxels), Some(10));
        let mask =
            |labels: Option<&str>| Region::Mask { path: map.clone(), labels: labels.map(str::to_owned) };
        let found = with(mask(Some("1,3"))).unwrap();
        assert_eq!((found.size.map(|size| size.voxels), found.labels.is_some()), (Some(360), true));
        let error = with(mask(None)).err().expect("labels must be chosen");
        assert_eq!((error.code, error.file.as_ref()), ("VGS-ROI-008", Some(&map)));
        let error = with(Region::Threshold(Threshold::new(9e3, 9e4))).err().expect("nothing is so bright");
        assert_eq!((error.code, error.file.as_ref()), ("VGS-ROI-003", Some(&ct)));
    }
}
