"""The page docs/results/outsiders.md, made of the results."""

import collections
import importlib.metadata
import pathlib
import re

from known import ALONE, DISSENT, KNOWN_WRONG

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/results/outsiders.md"
PACKAGES = ["pydicom", "SimpleITK", "highdicom", "nibabel", "pynrrd", "numpy", "shapely"]

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


def text(results, real):
    """Returns the page; a result is a case, its outcome and what the outsiders say, a real one a row of `real_files`."""
    packages = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    parts = [HEAD.format(packages=packages)]
    count = collections.defaultdict(collections.Counter)
    for case, outcome, _ in results:
        count[case.family][outcome.what] += 1
    total = sum(count.values(), collections.Counter())
    rows = [[family, sum(n.values()), n["equal"], n["refused"], n["wrong"]] for family, n in count.items()]
    rows.append(
        ["**all**", *(f"**{n}**" for n in [sum(total.values()), total["equal"], total["refused"], total["wrong"]])]
    )
    parts.append(table(["subject", "files", "equal", "refused", "wrong"], rows))
    parts.append("## Refused\n")
    codes = collections.defaultdict(list)
    for case, outcome, _ in results:
        if outcome.what == "refused":
            codes[outcome.told.split()[0]].append(case)
    parts.append(
        table(
            ["code", "files", "without a right reading", "such as"],
            [
                [code, len(cases), sum(case.truth is None for case in cases), cases[0].name.replace("|", "/")]
                for code, cases in sorted(codes.items())
            ],
        )
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
    parts.append("## What no other program confirms\n")
    parts.append(
        table(
            ["files", "why it is right"],
            [
                [
                    sum(alone(case, said) and bool(re.match(pattern, case.name)) for case, _, said in results),
                    f"{why} ({example(pattern, results)})",
                ]
                for pattern, why in ALONE
            ],
        )
    )
    parts.append(
        "## Files of scanners and programs\n\nThe test files of pydicom, pydicom-data and nibabel; *equal* is to pydicom or "
        "nibabel.\n"
    )
    groups = collections.defaultdict(list)
    for row in real:
        groups[row.became].append(row)
    parts.append(
        table(
            ["became", "files", "such as"],
            [[became, len(rows), f"{rows[0].file}: {told(rows[0])}"] for became, rows in sorted(groups.items())],
        )
    )
    if KNOWN_WRONG:
        parts.append("## Known to be wrong\n")
        parts.append(table(["file", "what is wrong"], KNOWN_WRONG.items()))
    return "\n".join(parts)


def told(row):
    """Returns what was told of a file, without the folder that it lay in."""
    return re.sub(r"/\S*/real\d+/", "", row.told).split(" (")[0].replace("|", "/")[:100]


def alone(case, said):
    return case.truth is not None and None not in said.values()


def dissenting(what):
    return what is not None and not what.startswith("does not read")


def matches(row, program, case, said):
    return bool(re.match(row[1], case.name)) and any(dissenting(said.get(name)) for name in program.split("|"))


def example(pattern, results):
    return next((case.name for case, _, said in results if alone(case, said) and re.match(pattern, case.name)), "none")
