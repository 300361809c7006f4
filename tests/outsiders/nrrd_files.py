"""NRRD over the product of its options."""

import bz2
import gzip

import numpy as np

from case import LPS, Case, Grid, affine, product_of
from flat import KINDS, OBLIQUE, ORIGIN, SHAPE, text_of, values_of
from readers import itk, pynrrd

NRRD_TYPES = {
    "u1": "uchar",
    "i1": "signed char",
    "i2": "short",
    "u2": "unsigned short",
    "i4": "int",
    "u4": "uint",
    "i8": "longlong",
    "u8": "ulonglong",
    "f4": "float",
    "f8": "double",
}
SIGNS = {
    "left-posterior-superior": LPS,
    "right-anterior-superior": (1, 1, 1),
    "left-anterior-superior": (-1, 1, 1),
    "LPS": LPS,
    "RAS": (1, 1, 1),
    "LAS": (-1, 1, 1),
}
# How voxels are packed, from values with the first axis fastest.
ENCODINGS = {
    "raw": lambda data, values: data,
    "gzip": lambda data, values: gzip.compress(data, mtime=0),
    "gz": lambda data, values: gzip.compress(data, mtime=0),
    "bzip2": lambda data, values: bz2.compress(data),
    "bz2": lambda data, values: bz2.compress(data),
    "hex": lambda data, values: data.hex().encode(),
    "ascii": lambda data, values: text_of(values),
    "text": lambda data, values: text_of(values),
}


def cases():
    for encoding, endian, kind in product_of(["raw", "gzip", "ascii"], ["little", "big"], KINDS):
        yield nrrd_case(f"NRRD type: {encoding}, {endian} endian, {kind}", kind, encoding, endian)
    for encoding, detached in product_of(ENCODINGS, [False, True]):
        # `text` and `ascii` are one.
        odd = "(?i)encoding" if encoding in ["hex", "bzip2", "bz2"] else None
        yield nrrd_case(
            f"NRRD encoding: {encoding}{', detached' if detached else ''}", "i2", encoding, detached=detached, odd=odd
        )
    for space, grid in product_of(
        [*SIGNS, "scanner-xyz", "3D-right-handed", "3D-left-handed", "left-posterior-superior-time", None],
        ["directions", "spacings", "none"],
    ):
        if space is None and grid == "directions":
            continue  # `space dimension` in its place, below.
        case = nrrd_case(f"NRRD space: {space or 'absent'}, {grid}", space=space, grid=grid)
        if space and space.endswith("time"):
            case.odd = "(?i)space"
        yield case
    yield nrrd_case("NRRD space: dimension 3, directions", space=None, grid="directions", extra=["space dimension: 3"])
    for extra, odd in {
        'space units: "mm" "mm" "mm"': None,
        'space units: "m" "m" "m"': "(?i)unit",
        'space units: "um" "um" "um"': "(?i)unit",
        "centers: node node node": None,
        "centerings: cell cell cell": None,
        "old min: -5": None,
        "old max: 5": None,
        "measurement frame: (1,0,0) (0,1,0) (0,0,1)": None,
        "content: a: b": None,
        "thicknesses: 1 1 1": None,
        "axis mins: 0 0 0": None,
        'labels: "x" "y" "z"': None,
        "key:=value: more": None,
        "# comment": None,
        "min: 0": None,
        "sample units: HU": None,
        "block size: 4": None,
    }.items():
        case = nrrd_case(f"NRRD field: {extra}", extra=[extra], odd=odd)
        if odd and '"m"' in extra:
            case.truth.affine[:3] *= 1000
        if odd and '"um"' in extra:
            case.truth.affine[:3] *= 0.001
        yield case
    for kinds, place, extra in [
        ("domain domain domain", None, 1),
        ("space space space", None, 1),
        ("list domain domain domain", 0, 1),
        ("domain domain domain list", 3, 1),
        ("domain domain domain time", 3, 1),
        ("stub domain domain domain", 0, 1),
        ("domain domain domain list", 3, 2),
        ("list domain domain domain", 0, 2),
        ("RGB-color domain domain domain", 0, 3),
        ("vector domain domain domain", 0, 2),
        ("domain list domain domain", 1, 2),
    ]:
        number = kinds.split()[place] in ["list", "time"] if place is not None else True
        for index in [None, 1] if extra == 2 and number else [None]:
            case = nrrd_case(
                f"NRRD axes: {kinds}, {extra} of them{f', number {index}' if index else ''}",
                kinds=kinds,
                axis=place,
                volumes=extra,
                index=index or 0,
            )
            if extra > 1 and index is None:
                case.truth, case.odd = None, "(?i)volume|colour|kind|component"
            case.options = {} if index is None else {"volume_index": index}
            yield case
    files = {
        "name": ("data.raw", ["data.raw"]),
        "LIST": ("LIST", [f"s{i}.raw" for i in range(3)]),
        "LIST 2": ("LIST 2", [f"s{i}.raw" for i in range(3)]),
        "pattern": ("s%d.raw 0 2 1", [f"s{i}.raw" for i in range(3)]),
        "pattern with zeros": ("s%03d.raw 1 3 1", [f"s{i:03}.raw" for i in range(1, 4)]),
        "pattern backwards": ("s%d.raw 2 0 -1", [f"s{i}.raw" for i in [2, 1, 0]]),
        "pattern with rank": ("s%d.raw 0 2 1 2", [f"s{i}.raw" for i in range(3)]),
        "name with a blank": ("my data.raw", ["my data.raw"]),
        "name with %": ("100%.raw", ["100%.raw"]),
        "name with % and blanks": ("50 % dose.raw", ["50 % dose.raw"]),
        "folder": ("sub/data.raw", ["sub/data.raw"]),
    }
    for way, encoding in product_of(files, ["raw", "gzip"]):
        odd = "(?i)file|LIST|%" if files[way][0].startswith("LIST") or "%" in files[way][0] else None
        yield nrrd_case(f"NRRD files: {way}, {encoding}", encoding=encoding, files=files[way], odd=odd)
    for lines, count, encoding, detached in product_of([0, 2], [0, 7, -1], ["raw", "gzip", "ascii"], [False, True]):
        if encoding == "gzip" and count > 0 or lines and count < 0:
            continue  # teem skips packed lines and bytes after unpacking, others before.
        odd = None if count >= 0 or encoding == "raw" else "(?i)byte ?skip"
        yield nrrd_case(
            f"NRRD skip: {lines} lines, {count} bytes, {encoding}{', detached' if detached else ''}",
            encoding=encoding,
            skip=(lines, count),
            detached=detached,
            odd=odd,
        )
    for what, bend in {
        "CRLF": lambda head: head.replace("\n", "\r\n"),
        "version 1": lambda head: head.replace("NRRD0004", "NRRD0001"),
        "version 5": lambda head: head.replace("NRRD0004", "NRRD0005"),
        "version 6": lambda head: head.replace("NRRD0004", "NRRD0006"),
        "no endian": lambda head: head.replace("endian: little\n", ""),
        "endian weird": lambda head: head.replace("little", "middle"),
        "blanks before values": lambda head: head.replace(": ", ":    "),
        "no blanks": lambda head: head.replace(": ", ":"),
        "upper case": lambda head: head.replace("encoding: raw", "ENCODING: RAW"),
        "sizes twice": lambda head: head + "sizes: 3 4 5\n",
        "one size less": lambda head: head.replace("sizes: 5 4 3", "sizes: 5 4"),
        "NaN direction": lambda head: head.replace("(0.4,0.3,0)", "(nan,0.3,0)"),
        "size of 0": lambda head: head.replace("sizes: 5 4 3", "sizes: 5 0 3"),
        "zero direction": lambda head: head.replace("(0.4,0.3,0)", "(0,0,0)"),
        "no type": lambda head: head.replace("type: short\n", ""),
        "type block": lambda head: head.replace("type: short", "type: block"),
        "direction with blanks": lambda head: head.replace("(0.4,0.3,0)", "( 0.4 , 0.3 , 0 )"),
        "exponents": lambda head: head.replace("(0.4,0.3,0)", "(4e-1,3E-1,0.0e0)"),
        "no origin": lambda head: head.replace("space origin: (-12.5,30.25,-100)\n", ""),
    }.items():
        bad = [
            "version 6",
            "endian weird",
            "one size less",
            "NaN direction",
            "size of 0",
            "zero direction",
            "no type",
            "type block",
            "sizes twice",
            "no endian",
        ]
        case = nrrd_case(
            f"NRRD header: {what}",
            bend=bend,
            odd="(?i)NRRD|endian|sizes|direction|type|affine|grid|voxels|volume|second" if what in bad else None,
        )
        case.truth = None if what in bad else case.truth
        if what == "no origin":
            case.truth.affine[:3, 3] = 0
        yield case


def nrrd_case(
    name,
    kind="i2",
    encoding="raw",
    endian="little",
    detached=False,
    space="left-posterior-superior",
    grid="directions",
    kinds="domain domain domain",
    axis=None,
    volumes=1,
    index=0,
    extra=(),
    files=None,
    skip=(0, 0),
    bend=lambda head: head,
    odd=None,
):
    stored = values_of(name, kind, (*SHAPE, volumes))
    if encoding in ["ascii", "text"] and kind == "f4":
        stored = np.round(stored * 4) / 4
    out = stored[..., 0] if axis is None else np.moveaxis(stored, 3, axis)
    spacing = np.linalg.norm(OBLIQUE, axis=1)

    def write(folder):
        vectors = [f"({','.join(f'{v:.10g}' for v in column)})" for column in OBLIQUE]
        lengths = [f"{v:.10g}" for v in spacing]
        if axis is not None:
            vectors.insert(axis, "none")
            lengths.insert(axis, "NaN")
        lines = ["NRRD0004", f"type: {NRRD_TYPES[kind]}", f"dimension: {out.ndim}"]
        lines += [f"space: {space}"] if space else []
        lines += [f"sizes: {' '.join(map(str, out.shape))}"]
        lines += [f"space directions: {' '.join(vectors)}"] if grid == "directions" else []
        lines += [f"spacings: {' '.join(lengths)}"] if grid == "spacings" else []
        lines += [f"kinds: {kinds}", f"endian: {endian}", f"encoding: {encoding}", *extra]
        # `space dimension` comes before what is in it.
        lines.sort(key=lambda line: not line.startswith(("NRRD", "space dimension")))
        lines += ["space origin: (-12.5,30.25,-100)"] if grid == "directions" else []
        lines += [f"line skip: {skip[0]}"] if skip[0] else []
        lines += [f"byte skip: {skip[1]}"] if skip[1] else []
        names = files or (("data.raw", ["data.raw"]) if detached else None)
        listed = names and names[0].startswith("LIST")
        lines += [f"data file: {names[0]}", *(names[1] if listed else [])] if names else []
        head = bend("\n".join(lines) + "\n")
        parts = np.array_split(out, len(names[1]) if names else 1, axis=-1)
        before = b"a line\n" * skip[0] + b"\1" * max(skip[1], 0)
        for name, part in zip(names[1] if names else ["a.nrrd"], parts):
            data = part.astype(("<" if endian == "little" else ">") + kind).tobytes(order="F")
            content = before + ENCODINGS[encoding](data, part)
            if not names:
                content = head.encode() + ("\r\n" if "\r\n" in head else "\n").encode() + content
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)
        if names:
            (folder / "a.nhdr").write_bytes(head.encode())
        return folder / ("a.nhdr" if names else "a.nrrd")

    signs = SIGNS.get((space or "").removesuffix("-time"))
    matrix = np.diag([1.0, 1, 1, 1])
    if grid == "directions":
        matrix = affine(OBLIQUE, ORIGIN, signs or (1, 1, 1))
    elif grid == "spacings":
        matrix = np.diag([*spacing, 1])
    truth = Grid(stored[..., index], matrix, grid == "directions" and signs is not None)
    return Case(
        name,
        write,
        truth,
        {"pynrrd": lambda path: pynrrd(path, index), "SimpleITK": lambda path: itk(path, index)},
        odd,
    )
