"""Fits: the bits of the command line, progress, stops, settings."""

from __future__ import annotations

import logging
import os
import re
import signal
import threading
import time

import numpy as np
import pytest
from conftest import QUICK

import vgs


@pytest.mark.parametrize(
    ("name", "flags", "arguments"),
    [
        ("a.ply", ["--density", "0.05", "--iterations", "40"], {"density": 0.05, "iterations": 40}),
        ("a.vgs", ["--density", "0.05", "--iterations", "40"], {"density": 0.05, "iterations": 40, "rounded": True}),
        ("b.ply", ["--quality", "preview"], {"quality": "preview"}),
        (
            "c.ply",
            ["--target-hu", "90", "--iterations", "60"],
            {"target_hu": np.float32(90), "iterations": np.int64(60)},
        ),
        ("d.ply", ["--max-size", "20K", "--iterations", "30"], {"max_size": 20 * 1024, "iterations": 30}),
        (
            "e.ply",
            ["--profile", "vessels", "--splats", "150", "--iterations", "30", "--hu-range", "-1000,1500"],
            {"profile": "vessels", "splats": 150, "iterations": 30, "hu_range": (-1000, 1500)},
        ),
    ],
)
def test_it_has_the_bits_of_the_command_line(program, phantom, ct, bone, tmp_path, name, flags, arguments):
    theirs, ours = tmp_path / f"program-{name}", tmp_path / f"python-{name}"
    program("fit", phantom, "--roi-threshold", "226,3071", "-o", theirs, "--no-eval", "--seed", 3, *flags)
    vgs.fit(ct, bone, seed=3, progress=False, **arguments).save(ours)
    assert ours.read_bytes() == theirs.read_bytes()


def test_what_is_given_may_be_a_file_an_image_or_an_array(phantom, ct, splats):
    for volume, roi in [(phantom, (226, 3071)), (ct.to_nibabel(), ct.array >= 226), (ct.to_sitk(), (226.0, 3071.0))]:
        again = vgs.fit(volume, roi, **QUICK)
        np.testing.assert_array_equal(again.means, splats.means)
        np.testing.assert_array_equal(again.intensities, splats.intensities)


def test_labels_stay_with_the_splats(ct, bone):
    marks = np.where(bone.array > 0, 1, 0)
    marks[:, :, : ct.shape[2] // 2] *= 7
    splats = vgs.fit(ct, vgs.Volume(marks, ct.affine, labels={1: "upper", 7: "lower"}), labels="all", **QUICK)
    assert splats.label_names == {1: "upper", 7: "lower"}
    lower = splats.with_label("lower")
    assert len(lower) + len(splats.with_label(1)) == len(splats) and set(lower.labels) == {7}
    voxels = np.linalg.solve(ct.affine, np.c_[lower.means, np.ones(len(lower))].T)[2]
    assert np.mean(voxels < ct.shape[2] / 2) > 0.95
    with pytest.raises(vgs.UsageError, match="liver"):
        splats.with_label("liver")


def test_progress_tells_stages_shares_and_figures(ct, bone):
    news = []
    vgs.fit(ct, bone, quality="standard", iterations=80, progress=news.append, seed=1)
    stages = [entry["stage"] for entry in news if "stage" in entry]
    assert "fitting the splats" in stages and any("trials" in stage for stage in stages)
    assert any("psnr_db" in entry for entry in news) and any("iteration" in entry for entry in news)
    assert all(0 <= entry["share"] <= 1 for entry in news if "share" in entry)


def test_a_callable_stops_a_fit_and_what_there_is_is_kept(ct, bone, caplog):
    def progress(news):
        return news.get("iteration", 0) < 20

    with caplog.at_level(logging.WARNING, "vgs"):
        splats = vgs.fit(ct, bone, density=0.05, iterations=100_000, progress=progress)
    assert splats.stopped and 20 <= splats.iterations < 100_000 and len(splats) > 0
    assert "stopped" in caplog.text


def test_what_a_callable_raises_comes_through(ct, bone):
    def progress(news):
        raise ZeroDivisionError("of the callable")

    with pytest.raises(ZeroDivisionError, match="of the callable"):
        vgs.fit(ct, bone, density=0.05, iterations=100_000, progress=progress)


def test_ctrl_c_ends_a_fit_with_what_there_is(ct, bone):
    def progress(news):
        if news.get("iteration", 0) > 20:
            os.kill(os.getpid(), signal.SIGINT)

    splats = vgs.fit(ct, bone, density=0.05, iterations=1_000_000, progress=progress)
    assert splats.stopped and len(splats) > 0 and splats.iterations < 1_000_000


def test_ctrl_c_before_there_are_splats_is_an_interrupt(ct, bone):
    def progress(news):
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        vgs.fit(ct, bone, quality="standard", progress=progress)


def test_other_threads_run_meanwhile(ct, bone):
    counted, running = 0, True

    def count():
        nonlocal counted
        while running:
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    try:
        splats = vgs.fit(ct, bone, density=0.05, iterations=200, progress=False)
    finally:
        running = False
        thread.join()
    assert counted > 20, f"{counted} in {splats.seconds} s"


def test_several_fits_at_once_have_the_same_bits(ct, bone, splats):
    found = [None] * 3

    def fit(i):
        found[i] = vgs.fit(ct, bone, **QUICK)

    threads = [threading.Thread(target=fit, args=(i,)) for i in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for again in found:
        np.testing.assert_array_equal(again.means, splats.means)


def test_a_time_budget_is_kept(ct, bone):
    begun = time.monotonic()
    vgs.fit(ct, bone, time_budget=3.0, progress=False)
    assert time.monotonic() - begun < 15
    with pytest.raises(vgs.UsageError, match="budget"):
        vgs.fit(ct, bone, time_budget=-1.0, progress=False)


@pytest.mark.parametrize("key", sorted(vgs.SETTINGS))
def test_every_setting_is_taken_at_its_default_and_checked(key, ct, bone):
    doc, default = vgs.SETTINGS[key]
    assert doc
    quick = {**QUICK, "iterations": 1} | {key: default}
    if key in ("target_psnr", "target_hu", "topology_every"):
        quick.pop("density")
    if key in ("splats",):
        quick[key] = 50
    assert len(vgs.fit(ct, bone, **quick)) > 0
    with pytest.raises(vgs.UsageError, match=key):
        vgs.fit(ct, bone, **{key: {"wrong": "type"}})


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"densty": 0.1}, "density"),
        ({"density": -1.0}, "density"),
        ({"density": float("nan")}, "density"),
        ({"iterations": 1.5}, "iterations"),
        ({"quality": "best"}, "preview"),
        ({"profile": "bone"}, "bones"),
        ({"kernel": "box"}, "kernel"),
        ({"kernel": object()}, "kernel"),
        ({"device": "no such device"}, "no such device"),
        ({"target_hu": 30, "labels": "liver"}, "liver|label"),
        ({"target_hu": 30, "density": 0.1}, "density and a target"),
        ({"progress": "yes"}, "progress"),
    ],
)
def test_wrong_arguments_are_named(ct, bone, arguments, says):
    roi = (bone.array > 0) if "labels" in arguments else bone
    with pytest.raises((vgs.UsageError, vgs.DeviceUnavailableError)) as raised:
        vgs.fit(ct, roi, **{"progress": False, **arguments})
    assert re.search(says, str(raised.value)), raised.value


def test_an_empty_region_is_nothing_to_do(ct):
    with pytest.raises(vgs.NothingToDoError) as raised:
        vgs.fit(ct, (5000, 6000))
    assert raised.value.exit_code == 3 and isinstance(raised.value, ValueError)


def test_a_region_of_another_volume_is_refused(ct, ball):
    other = vgs.Roi.from_threshold(vgs.Volume(ball), 226, 3071)
    with pytest.raises(vgs.UsageError, match="24 x 20 x 16"):
        vgs.fit(ct, other, **QUICK)


def test_a_region_that_lies_elsewhere_is_refused(ct, bone):
    moved = ct.affine.copy()
    moved[:3, 3] += 300
    with pytest.raises(vgs.UsageError, match="elsewhere"):
        vgs.fit(vgs.Volume(ct.array, moved), bone, **QUICK)


def test_labels_need_a_mask(ct, bone):
    for roi in (bone, (226, 3071)):
        with pytest.raises(vgs.UsageError, match="labels"):
            vgs.fit(ct, roi, labels="liver", **QUICK)


def test_bounds_may_be_any_numbers(ct, bone, splats):
    for bounds in ((np.float32(226), np.int64(3071)), [226, 3071]):
        np.testing.assert_array_equal(vgs.fit(ct, bounds, **QUICK).means, splats.means)
    with pytest.raises(vgs.UsageError, match="region"):
        vgs.fit(ct, None, **QUICK)


def test_an_error_that_is_missed_is_told(ct, bone, caplog):
    with caplog.at_level(logging.WARNING, "vgs"):
        vgs.fit(ct, bone, target_hu=1.0, max_splats=100, iterations=30, progress=False)
    assert "missed" in caplog.text
