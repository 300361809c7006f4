"""Odd files of scanners and programs, which pydicom and nibabel bring for their own tests: what becomes of each."""

import collections
import gzip
import importlib.util
import json
import pathlib
import re
import shutil
import subprocess

import readers
from check import Vgs

# Packages, and their folders of files.
SOURCES = [
    ("pydicom", "data/test_files"),
    ("pydicom", "data/charset_files"),
    ("data_store", "data"),
    ("nibabel", "tests/data"),
    ("nibabel", "nicom/tests/data"),
]
TEXTS = {".py", ".pyc", ".txt", ".m", ".rst", ".json", ".icc", ".bin", ".gitignore", ".dump", ".md5"}
SECONDS = 60
# The exit codes of errors that vgs knows; another one is a crash.
EXITS = {0, 2, 3, 65, 66, 69, 71, 74}


def files():
    for package, folder in SOURCES:
        spec = importlib.util.find_spec(package)
        root = pathlib.Path(spec.submodule_search_locations[0])
        for path in sorted((root / folder).rglob("*")):
            if (
                path.is_file()
                and path.suffix not in TEXTS
                and path.name not in TEXTS
                and "__pycache__" not in path.parts
            ):
                yield f"{package}/{folder}/{path.relative_to(root / folder)}", path


def alone(path, folder):
    """Copies a file, with the others of its name, into an empty folder: slices beside it may be of its series."""
    folder.mkdir()
    for other in path.parent.glob(f"{glob_safe(path.name.split('.')[0])}.*"):
        if other.suffix.lower() in [".hdr", ".img"] or other == path:
            shutil.copy(other, folder)
    shutil.copy(path, folder)
    own = folder / path.name
    if path.name.endswith(".dcm.gz"):
        own.write_bytes(gzip.decompress(own.read_bytes()))
        own = own.rename(own.with_suffix(""))
    return own


def glob_safe(name):
    return re.sub(r"([\[\]*?])", r"[\1]", name)


Row = collections.namedtuple("Row", "file became told")


def run(voxels, vgs, scratch):
    """Returns a row for each file: what became of it in vgs, and what others say."""
    reader = Vgs(voxels)
    rows = []
    for number, (name, path) in enumerate(files()):
        own = alone(path, scratch / f"real{number}")
        answer = reader.ask(own, scratch / "values", {})
        rows.append(Row(name, *became(own, answer)))
        if vgs and (fault := info_fault(vgs, own, answer)):
            rows.append(Row(name, "wrong", fault))
    reader.close()
    return rows


def became(path, answer):
    if "panic" in answer:
        return "wrong", f"crashed or hung: {answer['panic']}"
    other, said = opinion(path)
    with open(path, "rb") as file:
        is_dicom = file.read(132).endswith(b"DICM")
    if "code" in answer:
        if is_dicom and not re.match("VGS-(DCM|VOL)-", answer["code"]):
            return "wrong", f"DICOM, refused as something else: {answer['code']}"
        return f"refused, {answer['code']}", f"{answer['message']} ({said})"
    if other is None:
        return "read, not by others", said
    difference = answer["grid"].difference(other)
    return ("wrong", difference) if difference else ("read, equal", said)


def opinion(path):
    """Returns what others read of a file, or why they do not."""
    for read in [readers.pydicom_, readers.nibabel_]:
        try:
            return read(path), f"{read.__name__.strip('_')} reads it"
        except Exception as e:  # Whatever an outsider raises, it does not read the file.
            said = f"{read.__name__.strip('_')}: {type(e).__name__}: {e}"[:160]
            if read is readers.pydicom_:
                first = said
    return None, first if path.suffix in ["", ".dcm"] else said


def info_fault(vgs, path, answer):
    """Returns what is wrong with `vgs info --json`; None if nothing is."""
    try:
        done = subprocess.run([vgs, "info", "--json", str(path)], capture_output=True, timeout=SECONDS, text=True)
    except subprocess.TimeoutExpired:
        return f"vgs info: nothing within {SECONDS} s"
    if done.returncode not in EXITS:
        return f"vgs info: exit {done.returncode}: {done.stderr[-300:]}"
    told = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode == 0:
        if not told or "size" in told[0] and "size" in answer and list(told[0]["size"]) != answer["size"]:
            return f"vgs info: told {done.stdout[:200]}"
        return None
    if done.returncode != 0 and not re.search(r"VGS-[A-Z]+-\d+", done.stdout + done.stderr):
        return f"vgs info: exit {done.returncode} without a code"
    return None
