"""What the tests share. They run on the wheel as it is installed, never on the sources beside them."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
from collections.abc import Callable

import numpy as np
import pytest

import vgs

#: A fit that takes a second.
QUICK = {"density": 0.05, "iterations": 40, "seed": 3, "progress": False}


def through_runner(*command: object) -> list[str]:
    """A command as it finds the Vulkan driver: through tools/run where these tests came through it."""
    runner = os.environ.get("VGS_RUNNER")
    return [*([runner] if runner else []), *(str(word) for word in command)]


@pytest.fixture(scope="session")
def program() -> Callable[..., subprocess.CompletedProcess[str]]:
    """The program vgs: the one of $VGS_PROGRAM, or the one on the PATH."""
    path = os.environ.get("VGS_PROGRAM") or shutil.which("vgs")
    assert path, "the wheel has the program, or VGS_PROGRAM names it"

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(through_runner(path, *arguments), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done

    return run


@pytest.fixture(scope="session")
def phantom(tmp_path_factory: pytest.TempPathFactory, program: Callable[..., object]) -> pathlib.Path:
    """A synthetic CT, as a file: bone, an aorta and a liver, oblique."""
    path = tmp_path_factory.mktemp("phantom") / "ct.nii.gz"
    program("phantom", "-o", path, "--size", 40)
    return path


@pytest.fixture(scope="session")
def ct(phantom: pathlib.Path) -> vgs.Volume:
    return vgs.read(phantom)


@pytest.fixture(scope="session")
def bone(ct: vgs.Volume) -> vgs.Roi:
    return vgs.Roi.from_threshold(ct, 226, 3071)


@pytest.fixture(scope="session")
def splats(ct: vgs.Volume, bone: vgs.Roi) -> vgs.SplatSet:
    return vgs.fit(ct, bone, **QUICK)


@pytest.fixture()
def ball() -> np.ndarray:
    """HU [i, j, k] of a ball of bone in air; no two axes are alike."""
    i, j, k = np.meshgrid(np.arange(24), np.arange(20), np.arange(16), indexing="ij")
    r = np.sqrt((i - 12) ** 2 + (j - 10) ** 2 + (k - 8) ** 2)
    return np.where(r < 6, 700.0, -1000.0)
