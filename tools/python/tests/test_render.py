"""Pictures: the pixels of the command line, and what may be said of them."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from PIL import Image

import vgs
from vgs._render import png

SIZE = (96, 64)


@pytest.mark.parametrize(
    ("flags", "arguments"),
    [
        ([], {}),
        (["--tf", "CT-Bones-Steep", "--camera", "left"], {"tf": "CT-Bones-Steep", "camera": "left"}),
        (["--background", "#804020", "--zoom", "1.5"], {"background": "#804020", "zoom": 1.5}),
        (["--mode", "slab", "--shade", "off"], {"mode": "slab", "shade": False}),
        (["--light-direction", "40,10", "--fill-light", "0.3"], {"light": (40, 10), "fill_light": 0.3}),
        (["--headlight", "--occlusion", "0.5", "--shade", "on"], {"light": "head", "occlusion": 0.5, "shade": True}),
        (["--tf", "window:900,500", "--tf-shift", "-40"], {"tf": "window:900,500", "tf_shift": -40}),
        (["--background", "transparent"], {"background": None}),
    ],
)
def test_pictures_are_those_of_the_program(program, splats, tmp_path, flags, arguments):
    splats.save(tmp_path / "a.ply")
    program("render", tmp_path / "a.ply", "-o", tmp_path / "a.png", "--size", "96x64", *flags)
    theirs = np.asarray(Image.open(tmp_path / "a.png"))
    ours = vgs.render(vgs.load(tmp_path / "a.ply"), size=SIZE, **arguments)
    assert ours.shape == theirs.shape and ours.dtype == np.uint8
    assert np.abs(ours.astype(int) - theirs.astype(int)).max() <= 1


def test_a_volume_is_rendered_in_its_region(program, phantom, ct, bone, tmp_path):
    program(
        "render", phantom, "--roi-threshold", "226,3071", "-o", tmp_path / "a.png", "--size", "96x64", "--camera", "A"
    )
    theirs = np.asarray(Image.open(tmp_path / "a.png"))[..., :3]
    for volume, roi in ((ct, bone), (phantom, (226, 3071))):
        assert np.abs(vgs.render(volume, roi=roi, size=SIZE).astype(int) - theirs).max() <= 1
    assert vgs.render(ct, size=SIZE).any()


def test_cameras_planes_objects_and_points(ct, bone, splats):
    plain = vgs.render(splats, size=SIZE)
    low, high = splats.means.min(0), splats.means.max(0)
    middle = (low + high) / 2
    camera = vgs.Camera(middle + [0, 400, 0], middle)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = [-1, 0, 0], [0, 0, 1], [0, 1, 0], middle + [0, 400, 0]
    again = vgs.Camera.from_matrix(pose)
    np.testing.assert_array_equal(
        vgs.render(splats, camera=camera, size=SIZE), vgs.render(splats, camera=again, size=SIZE)
    )
    half = vgs.render(splats, box=(low - 9, [middle[0], *(high[1:] + 9)]), size=SIZE)
    plane = vgs.render(splats, planes=[((-2, 0, 0), -2 * middle[0])], size=SIZE)
    assert half.any() and (half != plain).any()
    np.testing.assert_array_equal(half, plane)
    red = vgs.render(splats, tf=[(200, (1, 0, 0), 0.0), (300, (1, 0, 0), 0.9)], shade=False, size=SIZE)
    assert red[..., 0].any() and not red[..., 1:].any()
    labelled = splats.replace(labels=np.ones(len(splats), np.uint8))
    assert not vgs.render(labelled, hide=[1], size=SIZE).any()
    green = vgs.render(labelled, objects={1: {"colour": "#00ff00", "opacity": 0.8}}, size=SIZE)
    assert green[..., 1].sum() > green[..., 0].sum()
    floats = vgs.render(splats, background=None, as_float=True, size=SIZE)
    assert floats.shape == (64, 96, 4) and floats.dtype == np.float32


def test_pictures_are_compared(splats):
    a, b = vgs.render(splats, size=SIZE), vgs.render(splats[::2], size=SIZE)
    same, other = vgs.compare(a, a), vgs.compare(a, b)
    assert same.psnr_db == float("inf") and same.ssim == pytest.approx(1) and same.flip == 0
    assert other.psnr_db < 60 and other.ssim < 1 and other.flip > 0
    with pytest.raises(vgs.UsageError):
        vgs.compare(a, b[:10])
    with pytest.raises(vgs.UsageError):
        vgs.compare(a[..., 0], b)


def test_a_notebook_shows_a_picture(splats):
    shown = splats._repr_png_()
    assert Image.open(io.BytesIO(shown)).size == (512, 512)
    picture = np.random.default_rng(1).integers(0, 255, (5, 7, 4), np.uint8)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png(picture)))), picture)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"tf": "CT-Bon"}, "CT-Bone"),
        ({"camera": "front"}, "anterior"),
        ({"size": (0, 10)}, "0 x 10"),
        ({"size": (100_000, 10)}, "16384"),
        ({"mode": "volume"}, "mode"),
        ({"mode": "splat"}, "splat"),
        ({"zoom": 0.0}, "zoom"),
        ({"fov": 180.0}, "fov"),
        ({"zoom": float("inf")}, "zoom"),
        ({"occlusion": 2.0}, "occlusion"),
        ({"background": "blau"}, "blau"),
        ({"background": (255, 0, 0)}, "background"),
        ({"background": (1, 0)}, "three"),
        ({"zoom": "1"}, "zoom"),
        ({"size": (64.5, 64)}, "size"),
        ({"camera": None}, "camera"),
        ({"camera": vgs.Camera((0, 400, 0), (0, 0, 0)), "zoom": 2.0}, "zoom"),
        ({"hide": "liver"}, "liver"),
        ({"planes": [((0, 0, 0), 1)]}, "normal"),
        ({"objects": {"liver": {"hue": 1}}}, "hue|liver"),
        ({"roi": (0, 1)}, "region"),
        ({"tf": []}, "colour"),
        ({"camera": vgs.Camera((0, 0, 0), (0, 0, 0))}, "eye"),
    ],
)
def test_wrong_arguments_are_named(splats, arguments, says):
    with pytest.raises(vgs.Error) as raised:
        vgs.render(splats, **{"size": SIZE, **arguments})
    assert re.search(says, str(raised.value)) and raised.value.exit_code in (2, 65), raised.value


def test_what_bone_does_not_show_is_shown(ct):
    tissue = vgs.fit(ct, (-50, 200), density=0.02, iterations=20, progress=False)
    assert vgs.render(tissue, size=SIZE).mean() > 3
