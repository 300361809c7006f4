"""Phantoms, tables of them, and the workflow run as its users run it."""

import json
import os
import pathlib
import shlex
import subprocess
import sys

import pytest

WORKFLOW = pathlib.Path(__file__).parents[1]
RUNNER = WORKFLOW.parent / "run"


class Cohort:
    """A folder with a table of cases, in which the workflow runs."""

    def __init__(self, folder, vgs):
        self.folder = folder
        self.settings = {
            "vgs": shlex.join(map(str, vgs)),
            "fit": {"quality": "preview", "splats": 40},
            "render": {"size": "64x64"},
            "retry-wait-seconds": 0,
        }

    def table(self, *rows, columns="name,volume,roi"):
        (self.folder / "cases.csv").write_text("\n".join([columns, *rows]) + "\n")

    def start(self, *flags, profile="local", path=None):
        """Starts the workflow, and returns its process."""
        (self.folder / "settings.yaml").write_text(json.dumps(self.settings))
        command = [sys.executable, "-m", "snakemake", "--snakefile", WORKFLOW / "workflow/Snakefile", "--nocolor"]
        command += ["--configfile", "settings.yaml", "--workflow-profile", WORKFLOW / "profiles" / profile, *flags]
        environment = {**os.environ, "PATH": f"{path}:{os.environ['PATH']}"} if path else None
        with open(self.folder / "said", "w") as said:
            return subprocess.Popen(command, cwd=self.folder, stdout=said, stderr=subprocess.STDOUT, env=environment)

    def run(self, *flags, **how):
        """Runs the workflow. Returns its exit code and what it said."""
        code = self.start(*flags, **how).wait(timeout=300)
        return code, (self.folder / "said").read_text()

    def record(self, case, step):
        return json.loads((self.folder / f"results/records/{case}/{step}.json").read_text())

    def report(self, name="report"):
        return (self.folder / f"results/{name}.html").read_text()


@pytest.fixture(scope="session")
def program():
    """The words that run vgs: the program that VGS_PROGRAM names, by tools/run."""
    if "VGS_PROGRAM" not in os.environ:
        pytest.skip("VGS_PROGRAM names no program")
    return [RUNNER, pathlib.Path(os.environ["VGS_PROGRAM"]).resolve()]


@pytest.fixture(scope="session")
def phantom(program, tmp_path_factory):
    """A folder with a small CT, its mask, and a CT whose file was cut short."""
    folder = tmp_path_factory.mktemp("phantom")
    subprocess.run([*program, "phantom", "--quiet", "--output", folder, "--size", "24"], check=True)
    whole = (folder / "ct.nii.gz").read_bytes()
    (folder / "cut.nii.gz").write_bytes(whole[: len(whole) // 2])
    return folder


@pytest.fixture
def stand_in(tmp_path):
    """The words that run a program in the place of vgs, which does at once what `plan.json` in its folder says."""
    return [sys.executable, WORKFLOW / "tests/stand_in.py", tmp_path]
