"""Splats as arrays, their files and their field."""

from __future__ import annotations

import dataclasses
import json
import pickle

import numpy as np
import pytest

import vgs


def test_arrays_are_those_of_the_file(splats, tmp_path):
    splats.save(tmp_path / "a.ply")
    again = vgs.load((tmp_path / "a.ply").read_bytes())
    for name in ("means", "scales", "rotations", "opacities", "intensities"):
        np.testing.assert_allclose(getattr(again, name), getattr(splats, name), rtol=1e-5, atol=1e-4, err_msg=name)
    assert (again.form, again.kernel, again.unit) == (splats.form, splats.kernel, splats.unit)
    assert again.grid[0] == splats.grid[0]
    np.testing.assert_allclose(again.grid[1], splats.grid[1], atol=1e-5)


def test_covariances_are_those_of_scales_and_rotations(splats):
    w, x, y, z = splats.rotations.T.astype(float)
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    squares = splats.scales.astype(float) ** 2
    np.testing.assert_allclose(splats.covariances, np.einsum("nij,nj,nkj->nik", axes, squares, axes), atol=1e-5)


def test_means_lie_in_the_region(ct, bone, splats):
    voxels = np.linalg.solve(ct.affine, np.c_[splats.means, np.ones(len(splats))].T)[:3].T
    nearest = np.clip(np.rint(voxels).astype(int), 0, np.array(ct.shape) - 1)
    assert np.mean(bone.array[tuple(nearest.T)] > 0) > 0.4


def test_the_field_is_what_rasterize_has_at_the_voxels(ct, splats):
    field, occupancy = splats.rasterize(ct, quantity="field"), splats.rasterize(ct, quantity="occupancy")
    chosen = np.argwhere(occupancy.array > 0)[::37]
    points = chosen @ ct.affine[:3, :3].T + ct.affine[:3, 3]
    intensities, occupancies = splats.field(points)
    np.testing.assert_allclose(occupancies, occupancy.array[tuple(chosen.T)], atol=1e-4)
    np.testing.assert_allclose(intensities, field.array[tuple(chosen.T)], atol=0.2)
    far, nothing = splats.field([1e4, 0, 0])
    assert np.isnan(far[0]) and nothing[0] == 0


def test_rasterize_finds_its_grid(ct, splats):
    own = splats.rasterize()
    assert own.shape == ct.shape and own.unit == "hu"
    np.testing.assert_allclose(own.affine, ct.affine, atol=1e-5)
    around = splats.rasterize(spacing_mm=2.0, outside=-500)
    assert around.spacing_mm == (2.0, 2.0, 2.0) and around.array.min() == -500 and around.array.max() > 226
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(vgs.UsageError, match="spacing"):
            splats.rasterize(spacing_mm=wrong)
    with pytest.raises(vgs.UsageError, match="colour"):
        splats.rasterize(quantity="colour")
    with pytest.raises(vgs.HostMemoryError):
        splats.rasterize(spacing_mm=1e-4)


def test_evaluate_says_what_the_program_says(program, phantom, ct, bone, splats, tmp_path):
    splats.save(tmp_path / "a.ply")
    told = json.loads(program("eval", tmp_path / "a.ply", phantom, "--roi-threshold", "226,3071", "--json").stdout)
    ours = vgs.load(tmp_path / "a.ply").evaluate(ct, bone)
    for field in dataclasses.fields(ours):
        assert getattr(ours, field.name) == pytest.approx(told[field.name], rel=1e-6), field.name
    assert ours.psnr_db > splats[::2].evaluate(ct, bone).psnr_db


def test_some_splats_of_a_set(splats):
    assert len(splats[splats.intensities > 500]) == np.count_nonzero(splats.intensities > 500)
    assert len(splats[10:20]) == 10 and len(splats[-1]) == 1 and len(splats[[]]) == 0
    np.testing.assert_array_equal(splats[[5, 2]].means, splats.means[[5, 2]])
    middle = np.median(splats.means, axis=0)
    part = splats.inside([-1e9] * 3, middle)
    assert 0 < len(part) < len(splats) and (part.means <= middle).all()
    with pytest.raises(IndexError):
        splats[len(splats)]
    with pytest.raises(vgs.UsageError, match="labels"):
        splats.with_label(1)


def test_edited_arrays_make_a_set(splats, tmp_path):
    moved = splats.replace(means=splats.means + [100, 0, 0], intensities=np.clip(splats.intensities, 300, 900))
    np.testing.assert_allclose(moved.means, splats.means + [100, 0, 0], atol=1e-3)
    assert moved.intensities.min() == 300 and moved.form == splats.form
    moved.save(tmp_path / "moved.vgs")
    assert len(vgs.load(tmp_path / "moved.vgs")) == len(splats)
    made = vgs.SplatSet.from_arrays(
        [[0, 0, 0], [5, 0, 0]],
        [[1, 1, 1], [2, 1, 1]],
        [[1, 0, 0, 0], [2, 0, 0, 0]],
        [0.5, 0.9],
        [100, 900],
        [1, 2],
        label_names={1: "liver", 2: "bone"},
        kernel="gaussian",
    )
    assert made.form == "field" and made.kernel == "gaussian" and made.label_names == {1: "liver", 2: "bone"}
    np.testing.assert_allclose(made.rotations, [[1, 0, 0, 0]] * 2)
    np.testing.assert_allclose(made.opacities, [0.5, 0.9], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"means": np.zeros((3, 2))}, "means"),
        ({"scales": np.ones((2, 3))}, "scales"),
        ({"intensities": np.zeros(5)}, "intensities"),
        ({"labels": np.zeros(2, np.uint8)}, "labels"),
        ({"means": np.full((3, 3), np.nan)}, "finite"),
        ({"scales": np.zeros((3, 3))}, "scales"),
        ({"scales": -np.ones((3, 3))}, "scales"),
        ({"scales": np.full((3, 3), 1e30)}, "scale"),
        ({"rotations": np.zeros((3, 4))}, "quaternion"),
        ({"rotations": np.full((3, 4), np.nan)}, "quaternion"),
        ({"labels": np.full(3, 300)}, "labels"),
        ({"labels": np.full(3, 1.7)}, "labels"),
        ({"background": np.nan}, "background"),
        ({"opacities": np.full(3, 1.5)}, "opacity"),
        ({"opacities": np.full(3, np.nan)}, "opacity"),
        ({"intensities": np.full(3, np.inf)}, "finite"),
    ],
)
def test_arrays_that_are_no_splats_are_refused(change, says):
    good = {
        "means": np.zeros((3, 3)),
        "scales": np.ones((3, 3)),
        "rotations": np.tile([1.0, 0, 0, 0], (3, 1)),
        "opacities": np.full(3, 0.5),
        "intensities": np.zeros(3),
    }
    assert len(vgs.SplatSet.from_arrays(**good)) == 3
    with pytest.raises(vgs.UsageError, match=says):
        vgs.SplatSet.from_arrays(**{**good, **change})


def test_files_of_every_format_and_several_at_once(splats, tmp_path):
    for name in ("a.ply", "b.vgs"):
        splats.save(tmp_path / name)
        with pytest.raises(FileExistsError):
            splats.save(tmp_path / name)
    both = vgs.load(tmp_path / "a.ply", tmp_path / "b.vgs")
    assert len(both) == 2 * len(splats) and sorted(both.label_names.values()) == ["a", "b"]
    with pytest.raises(vgs.UsageError, match="splat"):
        splats.save(tmp_path / "a.docx")


@pytest.mark.parametrize("rounded", [False, True])
def test_splats_can_be_pickled(ct, bone, rounded):
    splats = vgs.fit(ct, bone, density=0.05, iterations=20, rounded=rounded, progress=False)
    again = pickle.loads(pickle.dumps(splats))
    assert (len(again), again.form, again.seconds) == (len(splats), splats.form, splats.seconds)
    np.testing.assert_allclose(np.sort(again.means[:, 0]), np.sort(splats.means[:, 0]), atol=1e-3)
    assert again.evaluate(ct, bone).psnr_db == pytest.approx(splats.evaluate(ct, bone).psnr_db, abs=1e-3)


def test_a_volume_elsewhere_and_a_range_that_is_none_are_refused(ct, bone, splats):
    moved = ct.affine.copy()
    moved[:3, 3] += 3000
    there = vgs.Volume(ct.array, moved)
    with pytest.raises(vgs.BadDataError, match="lies in the volume"):
        splats.evaluate(there, vgs.Roi.from_threshold(there, 226, 3071))
    with pytest.raises(vgs.BadDataError):
        splats[:0].evaluate(ct, bone)
    for wrong in ((1000, -1000), (0, 0), (float("nan"), 1), (float("-inf"), float("inf"))):
        with pytest.raises(vgs.UsageError, match="range"):
            splats.evaluate(ct, bone, range=wrong)
    with pytest.raises(vgs.UsageError, match="offsets"):
        splats.evaluate(ct, bone, offsets=10**6)


def test_splats_are_no_array_and_no_list(ct, splats):
    for misuse in (np.asarray, list, lambda s: vgs.render([s, s]), lambda s: s.rasterize(like=s)):
        with pytest.raises((TypeError, vgs.UsageError)):
            misuse(splats)
    for index in (None, (0, 1)):
        with pytest.raises(IndexError):
            splats[index]
    with pytest.raises(vgs.UsageError):
        vgs.load()
    with pytest.raises(vgs.UsageError):
        splats.rasterize(ct, spacing_mm=1)
    with pytest.raises(vgs.UsageError, match="place"):
        splats.rasterize(ct.array)
    assert splats.rasterize(ct, quantity="occupancy").unit == "arbitrary"


def test_errors_can_be_pickled():
    with pytest.raises(vgs.MissingFileError) as raised:
        vgs.load("missing.ply")
    again = pickle.loads(pickle.dumps(raised.value))
    assert (again.code, again.file, again.exit_code) == (raised.value.code, "missing.ply", 66)
    assert isinstance(again, FileNotFoundError)


def test_a_coded_region_is_within_its_bound(ct, bone, tmp_path):
    coded = vgs.code(ct, bone, bound=20)
    assert (coded.bound, len(coded), coded.form) == (20, 0, "region")
    assert "coded voxels within 20 HU" in repr(coded)
    coded.save(tmp_path / "a.vgs")
    for again in (vgs.load(tmp_path / "a.vgs"), pickle.loads(pickle.dumps(coded))):
        field = again.rasterize(like=ct, outside=-5000)
        inside = np.asarray(field) > -5000
        assert inside.sum() == coded._native.coded_count > 1000
        assert np.abs(np.asarray(field)[inside] - np.asarray(ct)[inside]).max() <= 20.01
    assert coded.evaluate(ct, bone).rmse_hu < 13
    assert vgs.render(coded, size=(64, 64)).any()
    with pytest.raises(vgs.UsageError, match="splats"):
        coded.save(tmp_path / "a.ply")
    with pytest.raises(vgs.UsageError, match="bound"):
        vgs.code(ct, bone, bound=-1)
