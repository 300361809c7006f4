"""The workflow with vgs on phantoms."""

import csv
import re
import time

import cases
import psutil
import pytest
from conftest import Cohort


def test_five_cases_are_done_and_a_broken_one_costs_itself_alone(program, phantom, tmp_path):
    cohort = Cohort(tmp_path, program)
    rows = [
        f"case {i},{phantom}/ct.nii.gz,{phantom}/mask.nii.gz,{splats}" for i, splats in enumerate([20, 40, 80, "", ""])
    ]
    cohort.table(*rows, f"broken,{phantom}/cut.nii.gz,{phantom}/mask.nii.gz,", columns="name,volume,roi,splats")
    code, said = cohort.run()
    assert code == 1 and "results/report.html tells which cases are not done" in said, said
    assert cohort.record("broken", "fit")["error"]["code"] == "VGS-VOL-008"
    assert [cohort.record(f"case {i}", "fit")["results"]["splats"] for i in range(4)] == [20, 40, 80, 40]
    for i in range(5):
        folder = tmp_path / f"results/cases/case {i}"
        files = {path.name: path.stat().st_size for path in folder.iterdir() if path.name[0] != "."}
        ends = [".ply", ".run.json", ".csv", ".svg", ".vgs", "-error.png", ".png", ".html"]
        assert files.keys() == {f"case {i}{end}" for end in ends} and all(files.values()), files

    table = {row["case"]: row for row in csv.DictReader((tmp_path / "results/report.csv").open())}
    assert {name: row["state"] for name, row in table.items()} == {
        **{f"case {i}": "done" for i in range(5)},
        "broken": "failed",
    }
    measured = cohort.record("case 2", "evaluate")["results"]
    assert float(table["case 2"]["p99_hu"]) == measured["p99_hu"] < float(table["case 0"]["p99_hu"])
    assert (
        float(table["case 2"]["small_file_kb"]) * 1000 == (tmp_path / "results/cases/case 2/case 2.vgs").stat().st_size
    )
    report = cohort.report()
    assert "<b>5</b> done, <b>1</b> failed, <b>0</b> unfinished" in report
    assert re.search(
        r"<b>broken</b>, failed at fit <code>VGS-VOL-008</code>.*<em>the file was cut short; copy it", report
    )
    worst = re.findall(r"<figcaption><a href=\"#[^\"]*\">([^<]*)</a>: 99 % of the voxels within ([0-9.]+)", report)
    assert len(worst) == 5 and [float(hu) for _, hu in worst] == sorted((float(hu) for _, hu in worst), reverse=True)
    assert report.count('src="data:image/webp;base64,') == 5 and not re.search(r"https?://|@import|url\(", report)
    assert report.count("<circle") == 15, "a dot for each case in each plot"
    links = re.findall(r'<a href="(cases/[^"]*)">page</a>', report)
    assert len(links) == 5 and (tmp_path / "results" / links[0].replace("%20", " ")).exists()

    # Again: nothing is done but the report. A case that is mended is done, and others stay.
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("results/cases/*/*")}
    code, said = cohort.run()
    assert code == 1 and "\n1 of 1 steps" not in said and re.findall(r"^total +(\d+)$", said, re.M) == ["1"], said
    rows[-1:] = [rows[-1], f"broken,{phantom}/ct.nii.gz,{phantom}/mask.nii.gz,"]
    cohort.table(*rows, columns="name,volume,roi,splats")
    code, said = cohort.run()
    assert code == 0, said
    assert all(path.stat().st_mtime_ns == time for path, time in before.items()), "what is done stays"
    assert "<b>6</b> done" in cohort.report() and "Failed and unfinished" not in cohort.report()


def test_a_fit_that_is_killed_is_taken_up_where_it_was(program, phantom, tmp_path):
    cohort = Cohort(tmp_path, program)
    cohort.settings |= {"fit": {"splats": 40, "iterations": 1000}, "checkpoint-every": 20}
    cohort.table(
        f"long,{phantom}/ct.nii.gz,{phantom}/mask.nii.gz,1000",
        f"short,{phantom}/ct.nii.gz,{phantom}/mask.nii.gz,20",
        columns="name,volume,roi,iterations",
    )
    process = cohort.start()
    state = tmp_path / "results/cases/long/long.state"
    end = time.monotonic() + 60
    while not state.exists():
        assert time.monotonic() < end and process.poll() is None, (tmp_path / "said").read_text()
        time.sleep(0.02)
    children = psutil.Process(process.pid).children(recursive=True)
    fits = [child for child in children if "--output=results/cases/long/long.ply" in child.cmdline()]
    assert fits
    for fit in fits:
        fit.kill()
    assert process.wait(timeout=120) == 1
    assert not (tmp_path / "results/records/long/fit.json").exists() and state.exists()
    assert cohort.record("short", "page")["state"] == "done", "the other case goes on"
    assert re.search(r"<b>long</b>, unfinished at fit: not done; see logs/long/fit.log", cohort.report())

    code, said = cohort.run()
    assert code == 0, said
    assert cohort.record("long", "fit")["resumed"] and not cohort.record("short", "fit")["resumed"]
    names = {path.name for path in (tmp_path / "results/cases/long").iterdir()}
    assert not [name for name in names if "state" in name or "begun" in name or re.search(r"\.\d+\.ply", name)], names


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (["name,volume", "a,ct.nii"], "line 2: there is no region: give roi, a mask, or roi-threshold"),
        (["name,roi", "a,m.nii"], "line 2: 'volume' is missing"),
        (
            ["volume,roi", "x/ct.nii.gz,m.nii", "# a comment", "y/ct.nii.gz,m.nii"],
            "line 4: another case has the name 'ct'",
        ),
        (["name,volume,roi", "../a,ct.nii,m.nii"], "line 2: '../a' cannot be the name of a case"),
        (
            ["volume,roi,output", "ct.nii,m.nii,b.ply"],
            "line 2: the column 'output' is the workflow's own; leave it out",
        ),
        (["volume,roi", "ct.nii"], "line 2 has 1 columns, and the first one 2"),
        (["volume,roi"], "there is no case"),
    ],
)
def test_a_table_that_cannot_be_used_is_told_by_its_line(rows, words, tmp_path):
    (tmp_path / "cases.csv").write_text("\n".join(rows) + "\n")
    with pytest.raises(cases.BadTable, match=re.escape(words)):
        cases.read(tmp_path / "cases.csv")


def test_cells_are_flags_and_paths_count_from_the_table(tmp_path):
    (tmp_path / "cases.csv").write_text(
        'name,volume,roi,roi_label,quality,roi-fill\na,/b/ct.nii,m.nii,"liver,aorta",,yes\nb,ct.nii,m.nii,,fine,no\n'
    )
    a, b = cases.read(tmp_path / "cases.csv").values()
    usual = {"quality": "standard", "seed": 3}
    roi = f"--roi={tmp_path}/m.nii"
    assert cases.flags(a, usual) == [
        "/b/ct.nii",
        "--quality=standard",
        roi,
        "--roi-fill",
        "--roi-label=liver,aorta",
        "--seed=3",
    ]
    assert cases.flags(b, usual, cases.READING) == [f"{tmp_path}/ct.nii", roi]
    assert cases.flags(b, usual)[1] == "--quality=fine", "a row's flag comes first"


def test_settings_that_do_not_exist_are_told(stand_in, tmp_path):
    cohort = Cohort(tmp_path, stand_in)
    cohort.settings["qualty"] = "fine"
    cohort.table("a,ct.nii,m.nii")
    code, said = cohort.run()
    assert code == 1 and "'qualty' was unexpected" in said, said
