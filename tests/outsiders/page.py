"""The page docs/results/outsiders.md and the tables that it links, made of the results."""

import collections
import csv
import importlib.metadata
import io
import pathlib
import re

from known import ALONE, DISSENT, KNOWN_WRONG

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "docs/results"
PACKAGES = ["pydicom", "SimpleITK", "highdicom", "nibabel", "pynrrd", "numpy", "shapely", "zarr"]

HEAD = """\
# What other programs read

`tests/outsiders` writes small files over the product of options at the edges of their formats, and compares each voxel that
vgs reads with what is right, confirmed by {packages}.
A file passes if it is *equal* (size, every value, place and orientation) or *refused* by an error that names what is odd in
it. A doubtful value that is read must be named by a warning.

`tools/test -E 'test(/^outsiders::/)'` runs it in a minute or two and checks this page; `VGS_WRITE_OUTSIDERS=1` writes the
page anew. `tools/setup outsiders` gets the programs.
"""


def table(head, rows):
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join(lines + [f"| {' | '.join(str(cell) for cell in row)} |" for row in rows]) + "\n"


def rows_of(head, rows):
    """Returns a table as CSV."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([head, *rows])
    return out.getvalue()


def files(results, real):
    """Returns the page and its tables by their names in FOLDER; a result is a case, its outcome and what the outsiders say, a real one a row of `real_files`."""
    packages = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    parts = [HEAD.format(packages=packages)]
    count = collections.defaultdict(collections.Counter)
    for case, outcome, _ in results:
        count[case.family][outcome.what] += 1
    total = sum(count.values(), collections.Counter())
    rows = [[family, sum(n.values()), n["equal"], n["refused"], n["wrong"]] for family, n in count.items()]
    made = {"data/outsiders.csv": rows_of(["subject", "files", "equal", "refused", "wrong"], rows)}
    codes = collections.defaultdict(list)
    for case, outcome, _ in results:
        if outcome.what == "refused":
            codes[outcome.told.split()[0]].append(case)
    refused = [
        [code, len(cases), sum(case.truth is None for case in cases), cases[0].name]
        for code, cases in sorted(codes.items())
    ]
    made["data/outsiders-refused.csv"] = rows_of(["code", "files", "without a right reading", "such as"], refused)
    parts.append(
        f"Of {sum(total.values())} files {total['equal']} are equal, {total['refused']} refused and {total['wrong']} "
        f"wrong: [by subject](data/outsiders.csv), [by the error](data/outsiders-refused.csv).\n"
    )
    parts.append("## Where others read otherwise\n\nvgs reads these rightly or refuses them.\n")
    parts.append(
        table(
            ["program", "what it does", "files"],
            [
                [program.replace("|", ", "), what, sum(matches(row, program, case, said) for case, _, said in results)]
                for row in DISSENT
                for program, _, what in [row]
            ],
        )
    )
    confirmed = [
        [
            sum(alone(case, said) and bool(re.match(pattern, case.name)) for case, _, said in results),
            f"{why} ({example(pattern, results)})",
        ]
        for pattern, why in ALONE
    ]
    made["data/outsiders-alone.csv"] = rows_of(["files", "why it is right"], confirmed)
    groups = collections.defaultdict(list)
    for row in real:
        groups[row.became].append(row)
    became = [[what, len(rows), f"{rows[0].file}: {told(rows[0])}"] for what, rows in sorted(groups.items())]
    made["data/outsiders-real.csv"] = rows_of(["became", "files", "such as"], became)
    parts.append(
        f"For {sum(n for n, _ in confirmed)} files [no other program confirms](data/outsiders-alone.csv) what is right by the "
        f"standard. Of {len(real)} test files of pydicom, pydicom-data and nibabel, "
        f"{sum(row.became == 'read, equal' for row in real)} are equal to what these read; [the rest]"
        "(data/outsiders-real.csv) is refused by name.\n"
    )
    if KNOWN_WRONG:
        parts.append("## Known to be wrong\n")
        parts.append(table(["file", "what is wrong"], KNOWN_WRONG.items()))
    made["outsiders.md"] = "\n".join(parts)
    return made


def told(row):
    """Returns what was told of a file, without the folder that it lay in."""
    return re.sub(r"/\S*/real\d+/", "", row.told).split(" (")[0][:100]


def alone(case, said):
    return case.truth is not None and None not in said.values()


def dissenting(what):
    return what is not None and not what.startswith("does not read")


def matches(row, program, case, said):
    return bool(re.match(row[1], case.name)) and any(dissenting(said.get(name)) for name in program.split("|"))


def example(pattern, results):
    return next((case.name for case, _, said in results if alone(case, said) and re.match(pattern, case.name)), "none")
