"""What a fit from Python costs beside the same fit by the program, in turns.

    VGS_PROGRAM=target/release/vgs tools/run PYTHON tools/python/tests/benchmark.py CT MASK [ROUNDS]

PYTHON has the package installed. Written: seconds of the program from the inputs that were read to the splats (its own
record), those of vgs.fit on an array, preparation included, and the ratio of the medians.
"""

from __future__ import annotations

import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import vgs

ct_path, mask_path = sys.argv[1:3]
rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 5
settings = {"density": 0.1, "iterations": 200, "seed": 1}
flags = [word for key, value in settings.items() for word in (f"--{key}", str(value))]
runner = os.environ.get("VGS_RUNNER")
command = [*([runner] if runner else []), os.environ.get("VGS_PROGRAM", "vgs")]

ct = vgs.read(ct_path)
roi = vgs.Roi.from_mask(mask_path, ct)
vgs.fit(ct, roi, progress=False, **{**settings, "iterations": 1})
theirs, ours = [], []
with tempfile.TemporaryDirectory() as folder:
    out = pathlib.Path(folder) / "splats.ply"
    for _ in range(rounds):
        subprocess.run(
            [*command, "fit", "-q", ct_path, "--roi", mask_path, "-o", out, "--no-eval", "--force", *flags], check=True
        )
        record = json.loads(out.with_suffix(".run.json").read_text())["timings"]
        theirs.append(record["initialise"] + record["fit"])
        begun = time.monotonic()
        splats = vgs.fit(ct, roi, progress=False, **settings)
        ours.append(time.monotonic() - begun)
program, python = statistics.median(theirs), statistics.median(ours)
print(
    f"{len(splats)} splats, {rounds} rounds: program {program:.3f} s, Python {python:.3f} s, ratio {python / program:.3f}"
)
