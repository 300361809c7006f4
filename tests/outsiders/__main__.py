"""Compares what vgs reads with what is right and with what other programs read.

Files are written over the product of options at the edges of their formats. Each must be read with the right values, or
refused by the name of what is odd in it (case.py, check.py); what is known to be otherwise is listed (known.py). The odd
files that packages bring are read too (real_files.py).

usage: python3 tests/outsiders VOXELS [--vgs VGS] [--write] [--only TEXT]
       VOXELS is the program of that name (cargo build -p vgs-tests --bin voxels), VGS the command line;
       --write writes docs/results/outsiders.md; --only takes the cases whose names have TEXT in them
"""

import argparse
import collections
import concurrent.futures
import multiprocessing
import os
import pathlib
import re
import sys
import tempfile
import time

import dicom_stacks
import dicom_values
import masks
import metaimage_files
import nifti_files
import npy_files
import nrrd_files
import page
import real_files
import zarr_files
from check import Vgs, confirm, judge
from known import ALONE, DISSENT, KNOWN_WRONG

FAMILIES = [dicom_values, dicom_stacks, masks, nifti_files, nrrd_files, metaimage_files, npy_files, zarr_files]


def run(part):
    """Returns an outcome, and what the outsiders say, for each case of a part; `part` is the cases and a scratch folder."""
    numbers, program, scratch = part
    vgs = Vgs(program)
    results = []
    for number in numbers:
        case = CASES[number]
        folder = scratch / str(number)
        folder.mkdir()
        path = case.write(folder)
        options = {key: str(folder / value) if key == "volume" else value for key, value in case.options.items()}
        outcome = judge(case, vgs.ask(path, scratch / f"values{number}", options))
        results.append((number, outcome, {} if case.truth is None else confirm(case, path)))
    vgs.close()
    return results


def faults(results, real, whole):
    """Returns what is not as it must be; `whole` where all cases ran, so that what is listed must be met."""
    out = [
        f"{case.name}: {outcome.told}"
        for case, outcome, _ in results
        if outcome.what == "wrong" and case.name not in KNOWN_WRONG
    ]
    out += [f"{row.file}: {row.told}" for row in real if row.became == "wrong" and row.file not in KNOWN_WRONG]
    for case, _, said in results:
        if page.alone(case, said) and not any(re.match(pattern, case.name) for pattern, _ in ALONE):
            out.append(f"{case.name}: no other program confirms what is right: {said}")
        for name, what in said.items():
            if page.dissenting(what) and not any(
                name in programs.split("|") and re.match(pattern, case.name) for programs, pattern, _ in DISSENT
            ):
                out.append(f"{case.name}: {name} reads otherwise: {what}")
    if whole:
        wrong = {case.name for case, outcome, _ in results if outcome.what == "wrong"}
        wrong |= {row.file for row in real if row.became == "wrong"}
        out += [f"{name}: it is right now; take it from KNOWN_WRONG" for name in KNOWN_WRONG if name not in wrong]
        for row in DISSENT:
            if not any(page.matches(row, row[0], case, said) for case, _, said in results):
                out.append(f"{row}: it is not so any more; take it from DISSENT")
        for pattern, why in ALONE:
            if page.example(pattern, results) == "none":
                out.append(f"{pattern}: {why}: it is not so any more; take it from ALONE")
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("voxels")
    parser.add_argument("--vgs")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    started = time.monotonic()
    cores = os.cpu_count() or 1
    numbers = [i for i, case in enumerate(CASES) if arguments.only in case.name]
    with tempfile.TemporaryDirectory() as folder:
        scratch = pathlib.Path(folder)
        parts = [(numbers[i::cores], arguments.voxels, scratch) for i in range(cores)]
        with concurrent.futures.ProcessPoolExecutor(cores, multiprocessing.get_context("fork")) as pool:
            found = sorted((row for rows in pool.map(run, parts) for row in rows), key=lambda row: row[0])
        real = [] if arguments.only else real_files.run(arguments.voxels, arguments.vgs, scratch)
    results = [(CASES[number], outcome, said) for number, outcome, said in found]
    wrong = faults(results, real, not arguments.only)
    if not arguments.only:
        for name, text in page.files(results, real).items():
            path = page.FOLDER / name
            if arguments.write:
                path.write_text(text)
            elif not path.exists() or path.read_text() != text:
                wrong.append(f"docs/results/{name} is not what was found: VGS_WRITE_OUTSIDERS=1 writes it anew")
    for fault in wrong:
        print(f"WRONG {fault}")
    count = collections.Counter(outcome.what for _, outcome, _ in results)
    print(
        f"{len(results)} files written: {count['equal']} equal, {count['refused']} refused, {count['wrong']} wrong "
        f"({len(KNOWN_WRONG)} known); {len(real)} real files; {time.monotonic() - started:.0f} s"
    )
    sys.exit(bool(wrong))


CASES = [case for family in FAMILIES for case in family.cases()]
assert len({case.name for case in CASES}) == len(CASES), "names are unique"

if __name__ == "__main__":
    main()
