"""The table of cases, which is that of `vgs batch`: a row a case, a column a flag of `vgs fit`."""

import csv
import pathlib

import jsonschema
import yaml

# Flags without a value, and flags whose value is a path, which counts from the table.
SWITCHES = {"roi-fill", "lenient"}
PATHS = {"volume", "roi", "config"}
# Flags that say how a scan and its region are read: all steps that read them take these.
READING = {
    *("roi", "roi-threshold", "roi-label", "roi-min-ml", "roi-largest", "roi-close", "roi-fill"),
    *("volume-index", "series", "level", "voxels", "voxel-mm", "unit", "max-bytes", "lenient"),
}


class BadTable(Exception):
    """A table that cannot be used, with the line and what to do."""


def read(path):
    """Returns the cases of a table, by name: dictionaries of the cells that are not empty.

    Raises BadTable with all that is wrong.
    """
    path = pathlib.Path(path)
    schema = yaml.safe_load((pathlib.Path(__file__).parents[1] / "schemas/case.schema.yaml").read_text())
    validator = jsonschema.Draft202012Validator(schema)
    cases, wrong = {}, []
    try:
        rows = list(_rows(path))
    except (OSError, UnicodeDecodeError) as error:
        raise BadTable(f"{path}: the table of cases cannot be read: {error}") from error
    for line, row in rows:
        for error in validator.iter_errors(row):
            wrong.append(f"line {line}: {_told(error, row)}")
        if cases.setdefault(row.get("name"), row) is not row:
            wrong.append(f"line {line}: another case has the name {row['name']!r}; give each one of its own")
    if not cases and not wrong:
        wrong.append("there is no case; give a line for each below the names of the columns")
    if wrong:
        raise BadTable(f"{path}: " + "\n  ".join(["the table of cases cannot be used:", *wrong]))
    return cases


def _rows(path):
    with open(path, newline="", encoding="utf-8-sig") as file:
        lines = ((n, line) for n, line in enumerate(file, 1) if line.strip() and not line.startswith("#"))
        numbers = []
        table = csv.reader(line for n, line in lines if numbers.append(n) is None)
        head = [name.strip().replace("_", "-") for name in next(table, [])]
        for cells in table:
            row = {name: cell.strip() for name, cell in zip(head, cells) if cell.strip()}
            if len(cells) != len(head):
                raise BadTable(f"{path}: line {numbers[-1]} has {len(cells)} columns, and the first one {len(head)}")
            for name in PATHS & row.keys():
                row[name] = str(path.parent / row[name])
            if "volume" in row:
                row.setdefault("name", pathlib.Path(row["volume"].removesuffix(".gz")).stem)
            yield numbers[-1], row


def _told(error, row):
    """Returns what is wrong with a row, in words."""
    if error.validator == "required":
        return f"{error.message.split()[0]} is missing"
    if error.validator == "anyOf":
        return "there is no region: give roi, a mask, or roi-threshold"
    if error.validator == "pattern":
        return f"{row['name']!r} cannot be the name of a case: no dot in front, and none of / \\ {{ }}"
    return f"the column {error.instance!r} is the workflow's own; leave it out"


def flags(row, usual, only=None):
    """Returns the arguments of vgs for a case: its scan, and flags, of which those of the row count first.

    With `only`, flags of other names are left out.
    """
    own = {name: value for name, value in row.items() if name not in ("name", "volume", "no-eval")}
    merged = {**usual, **own}
    return [row["volume"], *arguments({name: merged[name] for name in merged if only is None or name in only})]


def arguments(flags):
    """Returns flags, by name, as arguments. A switch is given where its value is true."""
    words = {name: str(value).lower() if isinstance(value, bool) else value for name, value in sorted(flags.items())}
    given = {name: value for name, value in words.items() if name not in SWITCHES or value in ("true", "yes", "1")}
    return [f"--{name}" if name in SWITCHES else f"--{name}={value}" for name, value in given.items()]


def files(row):
    """Returns the files of a case that are there. Of one that is missing vgs tells, so that it costs its case alone."""
    return [row[name] for name in sorted(PATHS & row.keys()) if pathlib.Path(row[name]).exists()]
