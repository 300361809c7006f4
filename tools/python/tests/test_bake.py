"""Baking: the bits of the command line, progress, stops, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from test_render import SIZE

import vgs

#: Baking that takes a second.
QUICK = {"iterations": 12, "views": 4, "size": 32}
FLAGS = ["--iterations", 12, "--views", 4, "--size", 32]


@pytest.mark.parametrize(
    ("name", "flags", "arguments"),
    [
        ("a.ply", ["--shade", "off"], {"shade": False}),
        ("b.ply", ["--tf", "CT-Bones-Steep", "--headlight"], {"tf": "CT-Bones-Steep", "light": "head"}),
        ("c.glb", ["--max-splats", 200, "--degree", 1], {"max_splats": 200, "degree": 1}),
        ("d.spz", ["--seed", 4, "--clip", "x<0"], {"seed": 4, "planes": [((1, 0, 0), 0)]}),
    ],
)
def test_it_has_the_bits_of_the_command_line(program, splats, tmp_path, name, flags, arguments):
    splats.save(tmp_path / "splats.ply")
    theirs, ours = tmp_path / f"program-{name}", tmp_path / f"python-{name}"
    program("bake", tmp_path / "splats.ply", "-o", theirs, *FLAGS, *flags)
    vgs.bake(splats, progress=False, **QUICK, **arguments).save(ours)
    assert ours.read_bytes() == theirs.read_bytes()


def test_baked_splats_come_nearer_and_a_file_may_hold_both(splats, tmp_path):
    first = vgs.bake(splats, progress=False, **{**QUICK, "iterations": 0})
    baked = vgs.bake(splats, progress=False, **QUICK)
    assert baked.psnr_db > first.psnr_db + 1 and baked.seconds > 0 and not baked.stopped
    assert baked.unit == "luminance" and splats.psnr_db is None
    assert vgs.render(baked, size=SIZE).any()
    baked.save(tmp_path / "both.spz", live=splats)
    again = vgs.load(tmp_path / "both.spz")
    assert again.unit == "hu" and len(again) == len(splats)
    with pytest.raises(vgs.UsageError, match="SPZ"):
        baked.save(tmp_path / "both.ply", live=splats)


def test_progress_is_told_and_stops_it(splats, caplog):
    news: list[dict[str, object]] = []
    vgs.bake(splats, progress=news.append, **QUICK)
    stages = [new["stage"] for new in news if "stage" in new]
    assert stages == ["rendering the pictures", "fitting the splats to them"]
    assert all(0 <= new["share"] <= 1 for new in news if "share" in new)
    stopped = vgs.bake(splats, progress=lambda new: "fitting" not in str(new), **{**QUICK, "iterations": 10_000})
    assert stopped.stopped and len(stopped) and "stopped after" in caplog.text


def test_what_cannot_be_baked_is_refused(ct, bone, splats):
    baked = vgs.bake(splats, progress=False, **{**QUICK, "iterations": 0})
    with pytest.raises(vgs.UsageError, match="colours already"):
        vgs.bake(baked, progress=False)
    with pytest.raises(vgs.UsageError, match="coded voxels"):
        vgs.bake(vgs.code(ct, bone), progress=False)
    with pytest.raises(vgs.NothingToDoError, match="shows none"):
        vgs.bake(splats[:0], tf="CT-Bone", progress=False)
    with pytest.raises(vgs.NothingToDoError, match="shows none"):
        vgs.bake(splats, tf=[(5000, (1, 1, 1), 0.0), (6000, (1, 1, 1), 0.5)], progress=False)
    for wrong in ({"views": 0}, {"size": 5}, {"degree": 4}, {"max_splats": 0}, {"time_budget": 0}, {"occlusion": 2}):
        with pytest.raises(vgs.UsageError) as raised:
            vgs.bake(splats, progress=False, **wrong)
        assert raised.value.help
    with pytest.raises(vgs.UsageError):
        vgs.bake(splats, progress=False, views=np.pi)
