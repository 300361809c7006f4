//! `vgs batch`: many cases in one process.

use std::time::Duration;

use serde_json::Value;

use crate::support::{Folder, QUICK, finish};

/// A folder with a phantom and a table of cases of it: `rows` of name, volume, mask and iterations.
fn folder(rows: &[[&str; 4]]) -> Folder {
    let folder = Folder::new(16);
    let lines: Vec<String> = rows.iter().map(|row| row.join(",") + "\n").collect();
    folder.write("cases.csv", format!("name,volume,roi,iterations\n{}", lines.concat()));
    folder
}

fn lines(out: &str) -> Vec<Value> {
    out.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect()
}

fn states(lines: &[Value]) -> Vec<&str> {
    lines.iter().map(|line| line["state"].as_str().expect("a state")).collect()
}

/// `batch cases.csv -o out` with flags of the batch, and the flags of quick fits.
fn batch<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["batch", "cases.csv", "-o", "out", "--json"], more, &["--"], &QUICK].concat()
}

#[test]
fn a_broken_case_costs_itself_alone_and_what_is_done_stays() {
    let folder = folder(&[
        ["first", "ct.nii.gz", "mask.nii.gz", ""],
        ["broken", "cut.nii.gz", "mask.nii.gz", ""],
        ["absent", "no.nii.gz", "mask.nii.gz", ""],
        ["wrong", "ct.nii.gz", "mask.nii.gz", "many"],
        ["last", "ct.nii.gz", "mask.nii.gz", "12"],
    ]);
    let whole = folder.read("ct.nii.gz");
    folder.write("cut.nii.gz", &whole[..whole.len() / 2]);
    let ended = folder.run(&batch(&[]));
    assert_eq!(ended.code, 65, "failures of several kinds: {}", ended.err);
    let told = lines(&ended.out);
    assert_eq!(states(&told), ["done", "failed", "failed", "failed", "done"]);
    let exits: Vec<_> = told.iter().map(|line| line["error"]["exit"].as_u64()).collect();
    assert_eq!(exits, [None, Some(65), Some(66), Some(2), None]);
    assert!(
        told[1]["error"]["file"].as_str().is_some_and(|file| file.ends_with("cut.nii.gz")),
        "{}",
        told[1]
    );
    assert_eq!([&told[0]["iterations"], &told[4]["iterations"]], [24, 12], "a row's flag comes first");
    assert_eq!(told[0]["splats"], 60);
    assert!(told.iter().all(|line| line["total_seconds"].as_f64().is_some_and(|s| s >= 0.0)));

    // The same splats as alone.
    folder.run(&crate::support::fit("alone.ply", &[]));
    assert_eq!(folder.read("out/first.ply"), folder.read("alone.ply"));

    // Again: nothing is fitted that is done, and what was broken is tried again.
    let before = folder.read("out/last.run.json");
    folder.write("cut.nii.gz", &whole);
    folder.write("elsewhere.nii.gz", &whole);
    let again = lines(&folder.run(&batch(&[])).out);
    assert_eq!(states(&again), ["present", "done", "failed", "failed", "present"]);
    assert_eq!(folder.read("out/last.run.json"), before);
    assert_eq!(folder.read("out/broken.ply"), folder.read("out/first.ply"));

    // Made of other things it is not done, and not replaced without being told to.
    let other = [&batch(&[])[..], &["--seed", "7"]].concat();
    let refused = folder.run(&other);
    let told = lines(&refused.out);
    assert_eq!(told[0]["error"]["code"], "VGS-CLI-183", "{}", told[0]);
    assert_eq!(folder.read("out/last.run.json"), before);
    let mut forced = batch(&["--force"]);
    forced.extend(["--seed", "7"]);
    assert_eq!(lines(&folder.run(&forced).out)[0]["state"], "done");
    assert_ne!(folder.read("out/last.run.json"), before);
    let remains: Vec<_> = folder
        .contents()
        .into_keys()
        .filter(|path| path.to_string_lossy().contains(".begun") || path.to_string_lossy().ends_with(".lock"))
        .collect();
    assert!(remains.is_empty(), "{remains:?}");
}

#[test]
fn the_same_content_at_another_place_is_the_same_case() {
    let folder = folder(&[["a", "ct.nii.gz", "mask.nii.gz", ""]]);
    assert_eq!(states(&lines(&folder.run(&batch(&[])).out)), ["done"]);
    folder.write("moved.nii.gz", folder.read("ct.nii.gz"));
    folder.write("cases.csv", "name,volume,roi\na,moved.nii.gz,mask.nii.gz\n");
    assert_eq!(states(&lines(&folder.run(&batch(&[])).out)), ["present"]);
    let other = Folder::with_seed(16, 2);
    folder.write("mask.nii.gz", other.read("mask.nii.gz"));
    let told = lines(&folder.run(&batch(&[])).out);
    assert_eq!(told[0]["error"]["code"], "VGS-CLI-183", "another mask: {}", told[0]);
}

#[test]
fn shards_share_the_cases_and_time_leaves_whole_ones() {
    // The first one takes longer than the time, and is brought to its end.
    let row = |name| [name, "ct.nii.gz", "mask.nii.gz", if name == "a" { "2000" } else { "" }];
    let rows = ["a", "b", "c", "d", "e"].map(row);
    let folder = folder(&rows);
    let told = folder.run(&batch(&["--time-budget", "1s"]));
    assert_eq!(told.code, 75, "{}", told.err);
    assert_eq!(states(&lines(&told.out)), ["done", "left", "left", "left", "left"]);
    for (shard, expected) in [
        ("1/2", [("a", "present"), ("c", "done"), ("e", "done")].as_slice()),
        ("2/2", &[("b", "done"), ("d", "done")]),
    ] {
        let told = lines(&folder.run(&batch(&["--shard", shard])).out);
        let names = told.iter().map(|line| line["case"].as_str().expect("a name"));
        let found: Vec<_> = names.zip(states(&told)).collect();
        assert_eq!(found, expected);
    }
    let text = folder.run(&["batch", "cases.csv", "-o", "out", "--", "--splats", "60", "--iterations", "24"]);
    assert_eq!(text.code, 73, "other settings: {}", text.out);
    assert!(text.out.contains("1 of 5: a: failed [VGS-CLI-183]"), "{}", text.out);
}

#[cfg(unix)]
#[test]
fn a_signal_and_a_kill_leave_whole_cases_and_the_next_run_goes_on() {
    let rows: Vec<[&str; 4]> =
        ["a", "b", "c"].iter().map(|name| [*name, "ct.nii.gz", "mask.nii.gz", ""]).collect();
    for signal in ["TERM", "KILL"] {
        let folder = folder(&rows);
        // Long enough to be met in its middle.
        let long =
            ["batch", "cases.csv", "-o", "out", "--json", "--", "--splats", "60", "--iterations", "20000"];
        let child = folder.start(&long);
        let begun = folder.path("out/.a.ply.begun");
        for _ in 0..600 {
            if begun.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        assert!(begun.exists(), "the first case begins");
        std::thread::sleep(Duration::from_millis(1500));
        if signal == "TERM" {
            // Another process keeps away from a case that is being fitted.
            let other = folder.run(&batch(&["--shard", "1/3"]));
            assert_eq!(other.code, 75, "{}", other.out);
            assert_eq!(lines(&other.out)[0]["error"]["code"], "VGS-CLI-011", "{}", other.out);
            assert!(begun.exists(), "what another process fits is not whole");
        }
        let id = child.id().to_string();
        std::process::Command::new("kill").args(["-s", signal, &id]).status().expect("kill");
        let ended = finish(child);
        if signal == "TERM" {
            assert_eq!(ended.code, 143, "{}", ended.err);
            assert_eq!(states(&lines(&ended.out)), ["stopped", "left", "left"], "{}", ended.out);
            assert!(
                !begun.exists() && !folder.path("out/a.ply").exists() && !folder.path("out/a.state").exists()
            );
        }
        assert!(!folder.path("out/a.run.json").exists());
        let again = lines(&folder.run(&batch(&[])).out);
        assert_eq!(states(&again), ["done", "done", "done"], "after {signal}: {again:?}");
        if signal == "TERM" {
            // A stop keeps what was done before, also where it was to be replaced.
            let before = folder.contents();
            let mut forced = long.to_vec();
            forced.insert(4, "--force");
            let child = folder.start(&forced);
            std::thread::sleep(Duration::from_millis(2500));
            std::process::Command::new("kill")
                .args(["-s", signal, &child.id().to_string()])
                .status()
                .expect("kill");
            assert_eq!(finish(child).code, 143);
            assert!(folder.contents() == before, "nothing is lost, and nothing left behind");
        }
    }
}
