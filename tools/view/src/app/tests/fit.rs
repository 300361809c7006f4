use std::path::{Path, PathBuf};

use super::*;
use crate::model::fit_plan::Stage;
use crate::model::region::{Region, Threshold};
use crate::panels::slices::Shade;

fn status(stage: Stage) -> FitStatus {
    FitStatus {
        stage,
        doing: "",
        done: None,
        splats: Some(1234),
        iteration: 50,
        iterations: 200,
        seconds: 10.0,
        psnr_db: Some(41.25),
        rmse: Some(23.4),
        p99: None,
        stopping: false,
    }
}

/// Returns the actions of a click on a button or a link.
fn click(bench: &mut Bench, text: &str) -> Vec<Action> {
    let at = bench.find(text);
    bench.click(at)
}

fn shade(bench: &Bench) -> Option<Shade> {
    let info = PanelInfo { volume: true, region: bench.region, ..PanelInfo::default() };
    bench.app.fit_form.shade(&bench.app.state.files, &info)
}

/// Opens the panel of fits and lets it unfold.
fn open(bench: &mut Bench) {
    bench.press(Key::G, Modifiers::NONE);
    for _ in 0..20 {
        bench.rest();
    }
}

#[test]
fn a_region_is_chosen_and_fitted_from_the_panel() {
    let mut bench = Bench::new();
    assert_eq!(shade(&bench), None, "the panel is closed");
    bench.app.act(Action::ToggleFit, &PanelInfo::default());
    assert!(bench.app.messages.latest().is_some_and(|m| m.text.contains("VGS-VIEW-041")), "no volume");
    assert!(!bench.app.fit_form.open);
    open(&mut bench);
    assert!(bench.app.state.slices.shown, "the region is judged in the slices");
    bench.find("Axial");
    assert_eq!(shade(&bench), Some(Shade::Between([226.0, 3071.0])), "bones of a CT");
    assert_eq!(click(&mut bench, "Fit splats"), [], "there is no region yet");

    let mut wanted = Threshold::new(226.0, 3071.0);
    let actions = click(&mut bench, "Find");
    assert_eq!(actions, [Action::Region(Some(Region::Threshold(wanted.clone())))]);
    // What the window does then.
    bench.app.state.files.set_region(Some(Region::Threshold(wanted.clone())));
    bench.rest();
    assert_eq!(shade(&bench), Some(Shade::Between([226.0, 3071.0])), "it is still being found");
    bench.region = Some(RegionSize { voxels: 1010, weight: 1000.0, ml: 12.3 });
    bench.rest();
    assert_eq!(shade(&bench), Some(Shade::Region));
    bench.find("1010 voxels, 12.3 ml");
    let estimate = |splats: usize, iterations: usize| {
        let size = engine::figures::bytes(crate::model::fit_plan::ply_bytes(splats));
        format!("{splats} splats, {iterations} iterations, {size} as .ply")
    };
    bench.find("as many splats as it takes for 99 % of the voxels to be within 30 HU; 200 iterations");
    click(&mut bench, "preview");
    bench.find(&estimate(100, 50));
    bench.app.settings.fit_took("default", "preview", 101, 0.3);
    bench.rest();
    bench.find(&format!("{}, about 3.0 s", estimate(100, 50)));
    click(&mut bench, "fine");
    bench.find("as many splats as it takes for 99 % of the voxels to be within 15 HU; 200 iterations");
    assert_eq!(click(&mut bench, "Fit splats"), [Action::StartFit { profile: "default", quality: "fine" }]);

    // Another cleaning is another region, which must be found first.
    let box_beside = bench.find("Largest") + vec2(80.0, 0.0);
    bench.click(box_beside);
    bench.find(" kept");
    assert_eq!(shade(&bench), Some(Shade::Between([226.0, 3071.0])));
    assert_eq!(click(&mut bench, "Fit splats"), []);
    wanted.largest = Some(1);
    assert_eq!(click(&mut bench, "Find"), [Action::Region(Some(Region::Threshold(wanted)))]);
    assert_eq!(click(&mut bench, "Whole volume"), [Action::Region(None)]);
    bench.app.state.files.set_region(None);
    bench.region = None;
    bench.rest();
    assert_eq!(click(&mut bench, "Whole volume"), [], "it is whole");
}

#[test]
fn a_mask_is_opened_or_dropped() {
    let mut bench = Bench::new();
    open(&mut bench);
    click(&mut bench, "Mask");
    assert_eq!(shade(&bench), Some(Shade::Nothing), "none is chosen");
    assert_eq!(click(&mut bench, "Find"), []);
    click(&mut bench, "Open…");
    bench.find("Open a mask or a label map");
    bench.press(Key::Escape, Modifiers::NONE);
    let path = PathBuf::from("/data/bones.nii.gz");
    let region = Region::Mask { path: path.clone(), labels: None };
    let asked = bench.app.act(Action::Mask(path.clone()), &PanelInfo::default());
    assert_eq!(asked, Some(Action::Region(Some(region.clone()))));
    bench.rest();
    bench.find("bones.nii.gz");
    assert_eq!(click(&mut bench, "Find"), [Action::Region(Some(region))], "as after a failure");
    // Labels of a map.
    let field = bench.find("as it is");
    bench.click(field);
    bench.frame(vec![Event::Text("5,aorta".into())], Modifiers::NONE);
    bench.rest();
    let chosen = Region::Mask { path, labels: Some("5,aorta".into()) };
    assert_eq!(click(&mut bench, "Find"), [Action::Region(Some(chosen))]);

    // What is dropped at once is opened at once; the panel follows what it has become.
    #[derive(Debug)]
    struct Dropped(PathBuf);
    impl egui::DroppedFile for Dropped {
        fn path(&self) -> &Path {
            &self.0
        }
        fn bytes(&self) -> std::result::Result<Vec<u8>, String> {
            Err("nobody reads it here".into())
        }
    }
    let paths: Vec<PathBuf> = ["/data/ct.nii.gz", "/data/liver.nii.gz"].map(PathBuf::from).into();
    bench.dropped =
        paths.iter().map(|p| std::sync::Arc::new(Dropped(p.clone())) as egui::DroppedFileHandle).collect();
    assert_eq!(bench.frame(Vec::new(), Modifiers::NONE), [Action::Open(paths.clone())]);
    let liver = Region::Mask { path: paths[1].clone(), labels: None };
    bench.app.state.files.set_region(Some(liver));
    bench.region = Some(RegionSize { voxels: 5, weight: 5.0, ml: 0.1 });
    bench.rest();
    bench.find("liver.nii.gz");
    assert_eq!(shade(&bench), Some(Shade::Region));
}

#[test]
fn a_fit_is_watched_stopped_kept_and_dropped() {
    let mut bench = Bench::new();
    open(&mut bench);
    let doing = FitStatus { splats: None, psnr_db: None, rmse: None, ..status(Stage::Preparing) };
    bench.fit = Some(FitStatus { doing: "finding the number of splats", done: Some(0.25), ..doing });
    bench.rest();
    bench.find("finding the number of splats");
    assert_eq!(click(&mut bench, "Stop"), [Action::StopFit]);
    bench.fit = Some(status(Stage::Running));
    bench.rest();
    for text in ["50 of 200, 30 s left", "error 23.4 HU, PSNR 41.2 dB", "1234 splats"] {
        bench.find(text);
    }
    assert!(bench.place_of("Find").is_none() && bench.place_of("Keep…").is_none());
    assert_eq!(click(&mut bench, "Stop"), [Action::StopFit]);
    assert!(bench.place_of("99 % of the voxels").is_none(), "not measured yet");
    bench.fit = Some(FitStatus { p99: Some(61.5), ..status(Stage::Ended) });
    bench.rest();
    bench.find("50 of 200 iterations in 10 s");
    bench.find("99 % of the voxels are within 61.5 HU of the scan");
    let folder = tempfile::tempdir().expect("a folder");
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    click(&mut bench, "Keep…");
    bench.find("Keep the splats: .ply, or .vgs for a small file");
    let path = folder.path().join("a-2.ply");
    assert_eq!(click(&mut bench, "Keep"), [Action::Keep { path: path.clone(), force: false }]);
    // A file that is there is replaced only by its own button.
    std::fs::write(&path, "").expect("written");
    click(&mut bench, "Keep…");
    click(&mut bench, "a-2.ply");
    assert_eq!(bench.press(Key::Enter, Modifiers::NONE), []);
    assert_eq!(click(&mut bench, "Replace"), [Action::Keep { path, force: true }]);
    assert_eq!(click(&mut bench, "Discard"), [Action::DiscardFit]);
}

#[test]
fn a_fit_is_not_lost_unasked() {
    let mut bench = Bench::new();
    assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), [Action::Quit], "nothing would be lost");
    for stage in [Stage::Running, Stage::Ended] {
        bench.fit = Some(status(stage));
        assert_eq!(bench.press(Key::Q, Modifiers::COMMAND), []);
        bench.find("The fit has not been saved");
        assert!(bench.place_of("Save session").is_none(), "the session has not changed");
        assert_eq!(click(&mut bench, "Cancel"), []);
        assert!(bench.place_of("The fit has not been saved").is_none());
    }
    // The window's own button, however often it is clicked.
    for _ in 0..3 {
        bench.app.ask_to_leave();
        bench.rest();
        bench.find("The fit has not been saved");
    }
    assert_eq!(click(&mut bench, "Quit without saving"), [Action::Quit]);
}
