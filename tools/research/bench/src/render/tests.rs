//! All sections on the phantom, and the tables of figures that are known.

use std::path::Path;

use engine::gpu::GpuOptions;
use engine::render::MODES;
use engine::transfer::Material;
use glam::DVec3;

use super::plan::Source;
use super::record::{Comparison, Role, Sight, Timing};
use super::scenes::{Place, volume_bytes};
use super::*;
use crate::cost::{Cost, Passes};
use crate::scene::Scene;
use crate::store::hash;

const PHANTOM: &str = include_str!("phantom.toml");

fn phantom(edge: usize) -> Place {
    let scene = Scene::phantom(edge).expect("a phantom");
    Place::new(scene.volume, scene.roi)
}

fn has(mode: &str) -> bool {
    MODES.iter().any(|row| row.name == mode)
}

fn arguments(folder: &Path) -> RenderArguments {
    let config = folder.join("phantom.toml");
    std::fs::write(&config, PHANTOM).expect("written");
    RenderArguments {
        data: folder.join("none"),
        out: folder.join("out"),
        config: Some(config),
        quick: false,
        only: Vec::new(),
        force: false,
    }
}

#[test]
fn all_sections_run_on_the_phantom_and_only_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let a = arguments(folder.path());
    let options = GpuOptions { validation: true, ..GpuOptions::default() };
    run(&options, &a).expect("a run with silent validation layers");
    let out = a.out.clone();
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let (markdown, csv, json) = (read("render.md"), read("render.csv"), read("render.json"));

    let all: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let records: Vec<(String, Record)> = all["units"]
        .as_array()
        .expect("units")
        .iter()
        .map(|unit| {
            let record = serde_json::from_value(unit["record"].clone()).expect("a record");
            (unit["unit"]["section"].as_str().expect("a section").to_owned(), record)
        })
        .collect();
    let of =
        |section: Section| records.iter().filter(move |(name, _)| name == section.name()).map(|(_, r)| r);
    let comparisons =
        |section, role: Role| of(section).flat_map(|r| &r.comparisons).filter(move |row| row.role == role);

    let modes: Vec<_> = comparisons(Section::RendererError, Role::Mode).collect();
    assert!(modes.len() >= 4, "two slabs in two transfer functions");
    assert!(modes.iter().all(|row| row.sights.len() == 2 && row.psnr() > 15.0), "{modes:?}");
    let slab = |step: f64| {
        let row = modes.iter().find(|row| row.mode == "slab" && row.step == step && row.transfer == "bone");
        row.expect("a slab").psnr()
    };
    assert!(slab(0.5) > slab(2.0) + 3.0, "finer slabs are closer: {} {}", slab(0.5), slab(2.0));
    let eyes: Vec<_> = comparisons(Section::RendererError, Role::TwoEyes).collect();
    assert!(
        !eyes.is_empty() && eyes.iter().all(|row| row.sights.len() == 4 && row.psnr() > 40.0),
        "{eyes:?}"
    );
    let packed: Vec<_> = comparisons(Section::Storage, Role::Packed).collect();
    assert!(packed.iter().all(|row| row.psnr() > 40.0 && row.packed_bytes > Some(300 * 16)), "{packed:?}");
    assert_eq!(packed.len(), 1);
    assert_eq!(has("volume"), of(Section::EndToEnd).next().is_some());
    assert_eq!(
        has("volume"),
        !markdown.contains("end-to-end: reference is left out: this build has no mode")
    );
    if has("volume") {
        let downsampled: Vec<_> = comparisons(Section::EndToEnd, Role::Downsampled).collect();
        assert!(
            downsampled.iter().all(|row| row.psnr().is_finite() && row.volume_bytes > Some(0)),
            "{downsampled:?}"
        );
        assert!(comparisons(Section::EndToEnd, Role::Mode).all(|row| row.psnr() > 10.0));
        // A band where there is nothing is told, not measured.
        assert!(
            of(Section::EndToEnd).any(|r| r.left_out.iter().any(|line| line.contains("nothing is seen")))
        );
    }
    for section in [Section::Speed, Section::Table5] {
        let timings: Vec<&Timing> = of(section).flat_map(|r| &r.timings).collect();
        assert!(timings.iter().any(|row| row.mode == "slab"));
        for row in timings {
            assert_eq!(row.frames.len(), 3);
            assert!(!row.changes.is_empty() && row.change(true).is_some());
            assert!(row.frames.iter().all(|(_, cost)| cost.wall_ms > 0.0 && cost.core_ms != Some(0.0)));
            assert!(row.psnr() > Some(15.0) && !row.memory.is_empty() && !row.passes.a_frame(3).is_empty());
        }
    }
    for title in
        ["## Error of the modes", "## Storage", "## Speed", "### Device memory", "## The paper's Table 5"]
    {
        assert!(markdown.contains(title), "{title}");
    }
    assert!(!markdown.contains("NaN") && !markdown.contains("failed"), "{markdown}");
    let width = |line: &str| {
        line.split('"').step_by(2).flat_map(|part| part.chars()).filter(|&c| c == ',').count() + 1
    };
    assert!(csv.lines().count() > 20 && csv.lines().all(|l| width(l) == 14), "{csv}");
    for plot in ["accuracy-cost.svg", "slab-distance.svg"] {
        let text = read(plot);
        assert!(text.contains("</svg>") && text.contains("slab, point") && !text.contains("NaN"), "{plot}");
    }

    // Times would differ if anything were measured again, and splats are there.
    run(&options, &a).expect("again");
    assert_eq!(read("render.json"), json);
    let splats = || std::fs::read_dir(out.join("splats")).expect("splats").count();
    assert_eq!(splats(), 2, "sections share their fits");
    run(&options, &RenderArguments { force: true, only: vec![Section::Speed], ..a }).expect("by force");
    let after: serde_json::Value = serde_json::from_str(&read("render.json")).expect("JSON");
    assert_eq!(after["units"].as_array().map(Vec::len), Some(1), "the sections that were asked for");
    assert_ne!(after["units"][0]["record"]["timings"], all["units"][0]["record"]["timings"]);
    assert_eq!(splats(), 2);
}

#[test]
fn the_region_fills_every_view() {
    let place = phantom(24);
    let orbit = config::Orbit { count: 8, elevation: 15.0, fov: 30.0 };
    let cameras = place.cameras(&orbit, &(0..8).collect::<Vec<_>>()).expect("cameras");
    let corner = place.volume.world_from_voxel;
    for (view, camera) in cameras.iter().enumerate() {
        assert_eq!(camera.eye.z > place.centre.z, view % 2 == 0, "above and below in turn");
        let mut widest = 0.0f64;
        for (i, _) in place.roi.weight.iter().enumerate().filter(|&(_, &w)| w > 0.0) {
            let voxel = DVec3::new((i % 24) as f64, (i / 24 % 24) as f64, (i / 576) as f64);
            let from_eye = corner.transform_point3(voxel) - camera.eye;
            let depth = from_eye.dot(camera.forward());
            let edge = from_eye.dot(camera.right).abs().max(from_eye.dot(camera.up).abs()) / depth;
            widest = widest.max(edge / camera.fov.up);
        }
        assert!(widest < 1.0 && widest > 0.5, "view {view}: {widest} of half the picture");
    }
    let front = cameras[0].eye - place.centre;
    assert!(front.y > 0.9 * front.length() && front.x.abs() < 1e-9);
}

#[test]
fn a_band_lies_at_the_median_of_the_region() {
    let place = phantom(24);
    let transfer = |preset: Option<&str>, band, shade| config::Transfer {
        name: "t".into(),
        preset: preset.map(str::to_owned),
        band,
        shade,
    };
    let band = place.transfer(&transfer(None, Some(60.0), Some(false))).expect("a band");
    let [low, high] = band.visible().expect("something");
    assert!((high - low - 60.0).abs() < 1e-9 && ((low + high) / 2.0 - place.middle).abs() < 1e-9);
    assert!(!band.material.shade && band.at(place.middle).1 > 0.5);
    let inside = place.roi.weight.iter().zip(&place.volume.samples).filter(|(w, _)| **w > 0.0);
    let (below, all) =
        inside.fold((0, 0), |(b, n), (_, &v)| (b + i32::from(f64::from(v) < place.middle), n + 1));
    assert!((below - all / 2).abs() <= all / 20, "{below} of {all} lie below the median");
    let shaded = place.transfer(&transfer(Some("CT-Bones-Steep"), None, None)).expect("a preset");
    assert!(shaded.material != Material::default() && shaded.material.shade);
}

#[test]
fn a_volume_counts_the_box_of_its_region() {
    let scene = Scene::phantom(16).expect("a phantom");
    let mut roi = scene.roi;
    roi.weight.fill(0.0);
    assert_eq!(volume_bytes(&roi), 0);
    // Voxels 4..=6 by 5 by 15, which is at the edge: a voxel around them is 5 by 3 by 2.
    for x in 4..=6 {
        roi.weight[x + 16 * (5 + 16 * 15)] = 1.0;
    }
    assert_eq!(volume_bytes(&roi), 5 * 3 * 2 * 3);
}

/// The plan of a configuration as if every mode were there.
fn plan_of(config: &Config, sections: &[Section]) -> Plan {
    Plan::new(config, sections, "a device").expect("a plan")
}

#[test]
fn every_setting_is_in_the_key() {
    let config = Config::parse(PHANTOM).expect("a configuration");
    let first = plan_of(&config, &[Section::RendererError]).units.remove(0);
    let change = |f: &dyn Fn(&mut Unit)| {
        let mut unit = first.clone();
        f(&mut unit);
        unit.key()
    };
    let others = [
        change(&|u| u.device = "another".into()),
        change(&|u| u.part.size += 1),
        change(&|u| u.orbit.elevation += 1.0),
        change(&|u| u.renderings[0].step += 0.25),
        change(&|u| drop(u.renderings.pop())),
        change(&|u| u.transfers[0].shade = Some(true)),
        change(&|u| u.case.mask = "other".into()),
        change(&|u| u.source = Source::File("a.ply".into(), hash(&1))),
        change(&|u| match &mut u.source {
            Source::Fit(fit) => fit.seed += 1,
            Source::File(..) => unreachable!("it is fitted"),
        }),
    ];
    for (i, other) in others.iter().enumerate() {
        assert!(*other != first.key() && !others[..i].contains(other), "{other}");
    }
    assert!(first.key().starts_with("renderer-error-small-300-"), "{}", first.key());
}

#[test]
fn a_mode_that_is_not_there_is_told() {
    let text = PHANTOM.replacen("mode = \"slab\"", "mode = \"holograms\"", 1);
    let config = Config::parse(&text).expect("a configuration");
    let plan = plan_of(&config, &[Section::RendererError]);
    assert!(
        plan.left_out.iter().any(|line| line.contains("slab 0.5") && line.contains("\"holograms\"")),
        "{:?}",
        plan.left_out
    );
    assert!(plan.units.iter().all(|unit| unit.renderings.iter().all(|r| r.mode != "holograms")));
    let text = PHANTOM.replacen("mode = \"exact\"", "mode = \"holograms\"", 1);
    let plan = plan_of(&Config::parse(&text).expect("a configuration"), &[Section::RendererError]);
    assert!(
        plan.units.is_empty() && plan.left_out.iter().any(|line| line.contains("all of it")),
        "{:?}",
        plan.left_out
    );
}

fn cost(core: f64) -> Cost {
    Cost { core_ms: Some(core), wall_ms: core / 2.0, device_ms: core / 4.0 }
}

fn timing(rendering: &str, mode: &str, core: [f64; 3]) -> Timing {
    Timing {
        transfer: "steep bone".into(),
        rendering: rendering.into(),
        mode: mode.into(),
        whole: false,
        mse: Some(1e-3),
        frames: core.map(|core| (0, cost(core))).to_vec(),
        changes: vec![cost(core[1] + 70.0)],
        passes: Passes::default(),
        memory: [("splats".to_owned(), 4_800_000), ("pictures".to_owned(), 12_345_678)].into(),
    }
}

fn comparison(rendering: &str, role: Role, mse: f64) -> Comparison {
    let sight = |mse| Sight { view: 0, mse, ssim: 0.95, flip: 0.01, cost: cost(100.0) };
    Comparison {
        transfer: "steep bone".into(),
        rendering: rendering.into(),
        role,
        mode: "slab".into(),
        step: 1.0,
        integrated: Some(false),
        volume_bytes: None,
        packed_bytes: None,
        sights: vec![sight(mse), sight(mse * 10.0)],
    }
}

/// The report of the default configuration with one record for each of some units.
fn report_of(section: Section, is_cpu: bool, fill: impl Fn(&Unit) -> Option<Record>) -> String {
    let config = Config::read(None).expect("the default");
    // As if all modes were there.
    let mut plan = Plan { units: Vec::new(), left_out: Vec::new() };
    let part = &config.parts[&section];
    for subject in &part.subjects {
        plan.units.push(Unit {
            section,
            case: config.case_of(subject).expect("a case"),
            source: Source::Fit(Box::new(config.fit(subject).expect("a fit"))),
            coloured: subject.coloured,
            transfers: vec![config.transfer("steep bone").expect("a function").clone()],
            renderings: config.renderings.clone(),
            reference: None,
            stereo: Vec::new(),
            part: part.clone(),
            orbit: config.orbit,
            device: "d".into(),
        });
    }
    let mut records = Records::new();
    for unit in &plan.units {
        if let Some(record) = fill(unit) {
            records.insert(unit.key(), Record { key: unit.key(), ..record });
        }
    }
    let device = Device { text: "a device".into(), is_cpu };
    let skull = plan.units.iter().find(|unit| unit.case.name == "skull").unwrap_or(&plan.units[1]);
    let skipped = BTreeMap::from([(skull.key(), "no time".to_owned())]);
    let report = Results {
        config: &config,
        plan: &plan,
        sections: &[section],
        records: &records,
        skipped: &skipped,
        device: &device,
        quick: false,
        command: "bench render",
    };
    assert!(export::csv(&report).lines().count() > 1);
    report.markdown()
}

/// The line that has all of these.
fn line<'a>(text: &'a str, parts: &[&str]) -> &'a str {
    let found = text.lines().find(|line| parts.iter().all(|part| line.contains(part)));
    found.unwrap_or_else(|| panic!("no line with {parts:?} in\n{text}"))
}

#[test]
fn end_to_end_tells_figures_bytes_and_goals() {
    let text = report_of(Section::EndToEnd, true, |unit| {
        (unit.case.name == "torso bones").then(|| Record {
            splats: 5838,
            comparisons: vec![
                Comparison { volume_bytes: Some(1_234_567), ..comparison("reference", Role::Reference, 0.0) },
                comparison("exact", Role::Mode, 1e-3),
                comparison("slab", Role::Mode, 1.2e-3),
                Comparison {
                    volume_bytes: Some(150_000),
                    ..comparison("volume ÷2", Role::Downsampled, 0.02)
                },
            ],
            left_out: vec!["skin: nothing".into()],
            ..Record::default()
        })
    });
    let cells = |parts: &[&str]| line(&text, parts).to_owned();
    assert!(cells(&["reference |", "torso bones"]).contains("| reference | reference |"));
    let exact = cells(&["| exact |"]);
    assert!(
        exact.contains("5,838 splats") && exact.contains("| 25.00 | 20.00 | 0.9500 | 0.0100 | 100 |"),
        "{exact}"
    );
    assert!(
        exact.contains("| 0.09 (0.28) |") && exact.contains("≥ 27.5 dB: **missed** (prototype 27.8)"),
        "{exact}"
    );
    assert!(cells(&["| slab |"]).contains("within 0.5 dB of exact: **missed**"));
    assert!(cells(&["| volume ÷2 |"]).contains("| 0.15 | (prototype 15.5) |"));
    assert!(text.contains("- torso bones, splats: 0.1 a voxel: skin: nothing\n"));
    assert!(
        text.contains("- skull, splats: 0.05 a voxel: no time\n")
            && text.contains("heart, splats: 0.1 a voxel: not measured yet")
    );
}

#[test]
fn speed_tells_medians_and_the_ratio_of_each_round() {
    let fill = |unit: &Unit| {
        (unit.case.name == "bones" && unit.amount() == "100000").then(|| Record {
            splats: 100_000,
            timings: vec![
                timing("volume", "volume", [1000.0, 2000.0, 3000.0]),
                timing("alpha", "alpha", [250.0, 200.0, 600.0]),
            ],
            ..Record::default()
        })
    };
    let text = report_of(Section::Speed, true, fill);
    let alpha = line(&text, &["| alpha |", "×"]);
    assert!(alpha.contains("| 30.00 | 250 | 350 | 125 | 300 | 62.5 | 20.0 | 5.00× |"), "{alpha}");
    assert!(
        alpha.contains("4 times faster: met") && alpha.contains("≤ 464 core-ms: met (web-splat)"),
        "{alpha}"
    );
    assert!(line(&text, &["| volume |", "1500"]).contains("| 2000 | 2000 | 1000 | 1500 | 500 | 70.0 | — |"));
    assert!(text.contains("pictures 12.3, splats 4.80") && text.contains("software driver"));
    // On a GPU the same ratio, of device times, and nothing of CPU time.
    let text = report_of(Section::Speed, false, fill);
    let alpha = line(&text, &["| alpha |", "×"]);
    assert!(
        alpha.contains("5.00×") && !alpha.contains("web-splat") && !text.contains("software driver"),
        "{alpha}"
    );
}

#[test]
fn the_papers_table_has_ours_or_the_reason_beside_it() {
    let text = report_of(Section::Table5, true, |unit| {
        let volume = timing("volume", "volume", [1000.0, 2000.0, 3000.0]);
        let own =
            [timing("slab", "slab", [250.0, 200.0, 600.0]), timing("alpha", "alpha", [20.0, 10.0, 30.0])];
        let timings = match (unit.case.name.as_str(), unit.amount().as_str()) {
            ("bones", "250000") => [vec![volume], own.to_vec()].concat(),
            ("bones", "250000 coloured") => vec![volume, timing("alpha", "alpha", [40.0, 30.0, 60.0])],
            _ => return None,
        };
        Some(Record { splats: 250_000, of_colours: unit.coloured, timings, ..Record::default() })
    });
    let ours = line(&text, &["| ours |", "Case 4", "250k"]);
    assert!(
        ours.contains("| 341 | slab 8.00, alpha 100 | slab 250, alpha 20.0 | slab 62.5, alpha 5.00 |"),
        "{ours}"
    );
    assert!(line(&text, &["volume rendering", "Case 4"]).contains("| 125 | volume 1.00 | volume 2000 |"));
    assert!(line(&text, &["volume rendering", "Case 1"]).contains("| 107 | — (not measured yet) |"));
    assert!(line(&text, &["3DGS", "Case 4"]).contains("| 250k | 281 | alpha 50 |"));
    assert!(line(&text, &["3DGS", "Case 6"]).contains("| 265 | — (not measured yet) |"));
    assert!(line(&text, &["| ours |", "Case 6", "1000k"]).contains("| 143 | — (not measured yet) |"));
    assert_eq!(text.matches("| ours |").count(), 9);
}

#[test]
fn figures_are_written_with_the_digits_that_they_have() {
    for (value, text) in [(0.0, "0.00"), (1.234, "1.23"), (9.999, "10.0"), (99.96, "100"), (1234.5, "1234")] {
        assert_eq!(ms(Some(value)), text);
    }
    assert_eq!((db(f64::INFINITY), db(31.456)), ("∞".to_owned(), "31.46".to_owned()));
    for (value, text) in [(7, "7"), (999, "999"), (1000, "1,000"), (1_234_567, "1,234,567")] {
        assert_eq!(figures::thousands(value), text);
    }
}

#[test]
fn the_default_cases_are_in_the_data_folder() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../shared/data"));
    if !data.exists() {
        println!("SKIPPED: no real data: ../shared/data is not there");
        return;
    }
    for case in Config::read(None).expect("the default").cases {
        for file in [&case.volume, &case.mask] {
            assert!(data.join(&case.folder).join(file).is_file(), "{} {file}", case.name);
        }
    }
}
