//! A fit beside a window: its thread tells how far it is, hands out its splats, and writes them when it is told to.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use engine::Error;
use engine::gpu::{GpuOptions, MessageLog};
use engine::splat::{self, ReadOptions, Splat, SplatSet, label_name};
use engine::volume::{LabelChoice, Labels, Roi};
use glam::DVec3;
use vgs_tests::device::{Device, assert_silent, with_validation};
use vgs_tests::fitting::Case;
use view::io::fitting::{FitOrder, Fitting, News};
use view::io::loader::{LoadedSplats, LoadedVolume};
use view::model::deletions::{Bounds, Deletion, Target};
use view::model::fit_plan::{FitStatus, Stage};
use view::model::state::ViewState;

const PATIENCE: Duration = Duration::from_secs(120);

/// A fit, and the window that it is beside.
struct Beside {
    fitting: Fitting,
    woken: Receiver<()>,
    messages: MessageLog,
    pictures: Vec<Arc<LoadedSplats>>,
    kept: Vec<PathBuf>,
    failed: Vec<Error>,
    nothing: bool,
}

impl Beside {
    fn start(case: &Case, roi: Option<Roi>, labels: Option<Labels>, gpu: GpuOptions) -> Self {
        let messages = gpu.messages.clone();
        let volume = Arc::new(LoadedVolume::new(Arc::new(case.volume.clone()), roi, labels, None));
        let order = FitOrder { volume, config: case.config.clone(), gpu: with_validation(gpu) };
        let (sender, woken) = channel();
        // Nobody listens any more while the fit is dropped.
        let fitting = Fitting::start(order, Arc::new(move || _ = sender.send(())));
        let (pictures, kept, failed) = (Vec::new(), Vec::new(), Vec::new());
        Beside { fitting, woken, messages, pictures, kept, failed, nothing: false }
    }

    fn of(case: &Case) -> Self {
        Self::start(case, Some(case.roi.clone()), None, GpuOptions::default())
    }

    /// Takes news until something holds.
    fn wait(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !holds(self) {
            let left = PATIENCE.checked_sub(begin.elapsed()).unwrap_or_else(|| panic!("no {what}"));
            self.woken
                .recv_timeout(left)
                .unwrap_or_else(|_| panic!("no {what}: {:?} {:?}", self.status(), self.failed));
            for news in self.fitting.take() {
                match news {
                    News::Splats(splats) => self.pictures.push(splats),
                    News::Kept(path) => self.kept.push(path),
                    News::Failed(error) => self.failed.push(error),
                    News::Nothing => self.nothing = true,
                }
            }
        }
    }

    fn status(&self) -> &FitStatus {
        self.fitting.status()
    }

    /// Waits for the end of the iterations and the picture of what they made.
    fn wait_for_end(&mut self) {
        self.wait("end", |fit| fit.status().stage == Stage::Ended);
        let last = self.status().iteration;
        self.wait("last picture", |fit| {
            fit.pictures.last().is_some_and(|splats| splats.set.iterations == Some(last))
        });
    }

    /// Ends the fit; the validation layers have said nothing.
    fn end(self) {
        let Beside { fitting, messages, .. } = self;
        drop(fitting);
        assert_silent(&messages);
    }
}

fn read(path: &Path) -> SplatSet {
    splat::read(path, &ReadOptions::default()).expect("a splat file")
}

#[test]
fn splats_come_while_they_are_fitted_and_are_kept_at_the_end() {
    let case = Case::phantom([24, 24, 20], 60);
    let folder = tempfile::tempdir().expect("a folder");
    let mut fit = Beside::of(&case);
    assert_eq!((fit.status().stage, fit.status().iterations), (Stage::Preparing, 60));
    fit.wait("first picture", |fit| fit.pictures.len() == 1);
    assert_eq!(fit.pictures[0].set.iterations, Some(0), "the first splats, as they were placed");
    fit.fitting.want_splats(Duration::ZERO);
    fit.wait_for_end();
    let between = fit.pictures.iter().filter(|splats| matches!(splats.set.iterations, Some(1..60))).count();
    assert_eq!(between, 1, "one picture for each time that one was wanted");
    let count = case.config.splat_count(case.roi.weight_sum());
    let status = fit.status();
    assert_eq!((status.splats, status.iteration), (Some(count), 60));
    assert!(status.psnr_db > Some(20.0) && status.rmse > Some(0.0), "{status:?}");

    // A file that is there is left alone, and the splats are still there for another one.
    let there = folder.path().join("there.ply");
    std::fs::write(&there, "mine").expect("written");
    fit.fitting.keep(there.clone(), false);
    fit.wait("refusal", |fit| !fit.failed.is_empty());
    assert_eq!((fit.failed[0].code, fit.status().stage), ("VGS-OUT-001", Stage::Ended));
    assert_eq!(std::fs::read(&there).expect("a file"), b"mine");
    let path = folder.path().join("kept.ply");
    fit.fitting.keep(path.clone(), false);
    fit.wait("file", |fit| !fit.kept.is_empty());
    assert_eq!(fit.kept, std::slice::from_ref(&path));
    let kept = read(&path);
    assert_eq!((kept.splats.len(), kept.iterations), (count, Some(60)));
    assert!(kept.form == fit.pictures.last().expect("pictures").set.form);
    fit.end();

    // A half of it is deleted, and the rest written with its part of the mask.
    let gpu = Device::boot();
    let whole = LoadedSplats::join(vec![(path, kept)]).expect("one set");
    let middle = whole.set.splats.iter().map(|splat| f64::from(splat.mean[0])).sum::<f64>() / count as f64;
    let high_mm = DVec3::new(whole.set.origin_mm.x + middle, 1e4, 1e4);
    let lower = Deletion::Inside(Bounds { low_mm: DVec3::splat(-1e4), high_mm, files: 1 });
    let left = whole.without(&[lower]);
    let share = left.set.splats.len() as f64 / count as f64;
    assert!((0.2..0.8).contains(&share), "{share}");
    let voxels = |splats: &LoadedSplats| splats.set.region.as_ref().expect("a region").voxel_count();
    assert!((1..voxels(&whole)).contains(&voxels(&left)), "it has those of its part");
    let state = ViewState::new(&engine::transfer::load("CT-Bone", [0.0, 1.0]).expect("a preset"));
    for name in ["left.ply", "left.vgs", "left.glb"] {
        let path = folder.path().join(name);
        left.write(&gpu, &state, None, &path, false).expect("written");
        let again = left.write(&gpu, &state, None, &path, false).expect_err("it exists");
        assert_eq!(again.code, "VGS-OUT-001", "{name}");
        if name != "left.glb" {
            let read = read(&path);
            assert_eq!((read.splats.len(), read.labels), (left.set.splats.len(), None), "{name}");
            assert_eq!((read.grid, read.form), (left.set.grid, left.set.form), "{name}");
        }
    }
}

#[test]
fn deletions_leave_the_rows_of_objects() {
    let set = |xs: &[f32], labels: Option<Vec<u8>>| {
        let splat = |&x| Splat { mean: [x, 0.0, 0.0], rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        SplatSet { splats: xs.iter().map(splat).collect(), labels, ..SplatSet::default() }
    };
    let files = vec![
        ("a.ply".into(), set(&[1.0, 2.0, 3.0], None)),
        ("b.ply".into(), set(&[1.0, 2.0, 3.0, 4.0], Some(vec![4, 9, 9, 4]))),
    ];
    let whole = LoadedSplats::join(files).expect("one scene");
    let counts = |deleted: &[Deletion]| {
        let left = whole.without(deleted);
        let rows = whole.objects.iter().map(|(row, number, _)| (row.clone(), *number));
        assert!(rows.eq(left.objects.iter().map(|(row, number, _)| (row.clone(), *number))));
        assert_eq!(left.intensities.len(), 3);
        left.objects.iter().map(|(.., count)| *count).collect::<Vec<_>>()
    };
    let bounds = |low: f64, high: f64, files| Bounds {
        low_mm: DVec3::new(low, -1.0, -1.0),
        high_mm: DVec3::new(high, 1.0, 1.0),
        files,
    };
    let object = |file, label| Deletion::Object(Target { file, label });
    assert_eq!(counts(&[]), [3, 2, 2]);
    assert_eq!(counts(&[Deletion::Inside(bounds(1.5, 2.5, 2))]), [2, 2, 1]);
    assert_eq!(counts(&[Deletion::Inside(bounds(1.5, 2.5, 1))]), [2, 2, 2], "the second came later");
    assert_eq!(counts(&[Deletion::Outside(bounds(1.5, 3.5, 2)), object(1, Some(9))]), [2, 0, 0]);
    assert_eq!(counts(&[object(0, None), object(1, Some(4)), object(1, Some(9))]), [0, 0, 0]);
}

#[test]
fn a_fit_that_is_stopped_keeps_what_is_there() {
    let case = Case::phantom([24, 24, 20], 1_000_000);
    let mut mask = case.volume.clone();
    mask.samples = case.roi.weight.iter().map(|&w| if w > 0.0 { 5.0 } else { 0.0 }).collect();
    mask.labels = [(5, "bone".to_owned())].into();
    let choice: LabelChoice = "bone".parse().expect("a choice");
    let roi = Roi::from_mask(&mask, &choice, &case.volume).expect("a region");
    let labels = Labels::chosen(&mask, &choice, &case.volume).expect("labels");
    let mut fit = Beside::start(&case, Some(roi), labels, GpuOptions::default());
    fit.wait("first picture", |fit| !fit.pictures.is_empty());
    fit.wait("some iterations", |fit| fit.status().iteration > 0 && fit.status().psnr_db.is_some());
    fit.fitting.stop();
    assert_eq!(fit.status().text(), "stopping the fit");
    fit.wait_for_end();
    assert!((1..1_000_000).contains(&fit.status().iteration), "{:?}", fit.status());
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("part.vgs");
    fit.fitting.keep(path.clone(), false);
    fit.wait("file", |fit| !fit.kept.is_empty());
    let kept = read(&path);
    assert_eq!(kept.label_names, [(5, label_name("bone"))], "with the labels of the map");
    assert!(kept.labels.is_some_and(|labels| labels.iter().all(|&label| label == 5)));
    fit.end();
}

#[test]
fn a_small_file_is_rounded_and_fitted_again() {
    let case = Case::phantom([20, 20, 16], 20);
    let mut fit = Beside::of(&case);
    fit.wait_for_end();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("small.vgs");
    fit.fitting.keep(path.clone(), false);
    fit.wait("file", |fit| !fit.kept.is_empty());
    assert!(read(&path).rounding.is_some());
    fit.end();
}

#[test]
fn a_fit_that_is_dropped_ends() {
    let case = Case::phantom([24, 24, 20], 1_000_000);
    for pictures in [0, 1] {
        let mut fit = Beside::of(&case);
        fit.wait("pictures", |fit| fit.pictures.len() >= pictures);
        let begin = Instant::now();
        fit.end();
        assert!(begin.elapsed() < PATIENCE / 2, "after {pictures} pictures: {:?}", begin.elapsed());
    }
}

#[test]
fn what_fails_is_told_and_the_last_good_splats_stay() {
    let case = Case::phantom([20, 20, 16], 200);
    let mut fit = Beside::start(&case, None, None, GpuOptions::default());
    fit.wait("end", |fit| fit.nothing);
    assert_eq!(fit.failed[0].code, "VGS-VIEW-040");
    fit.end();
    // The device is lost before the iterations, and within them.
    let case = Case::phantom([20, 20, 16], 1_000_000);
    for (at, ends_with_splats) in [(1, false), (500, true)] {
        let fault = format!("submit:{at}:lost").parse().expect("a fault");
        let options = GpuOptions { fault: Some(fault), ..GpuOptions::default() };
        let mut fit = Beside::start(&case, Some(case.roi.clone()), None, options);
        fit.wait("end", |fit| fit.nothing || fit.status().stage == Stage::Ended && !fit.failed.is_empty());
        assert_eq!(fit.failed[0].code, "VGS-GPU-012", "{}", fit.failed[0]);
        assert_eq!(fit.nothing, !ends_with_splats, "{at}");
        if ends_with_splats {
            fit.wait_for_end();
            let folder = tempfile::tempdir().expect("a folder");
            fit.fitting.keep(folder.path().join("rest.ply"), false);
            fit.wait("file", |fit| !fit.kept.is_empty());
            read(&fit.kept[0]);
        }
        drop(fit.fitting);
    }
}
