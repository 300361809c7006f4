#!/usr/bin/env python3
"""Measures what other programs make of our PLY: the table of docs/design/file-formats.md, "Other programs".

It fits two balls in an oblique grid far from the origin of the world, writes the splats in every layout, ours and those
that were not chosen, reads each by each program, and reads again what the programs write.

usage: tests/other-programs.py VGS [SPLAT-TRANSFORM]
       VGS is the program, by its path (tools/vgs, say); SPLAT-TRANSFORM that of @playcanvas/splat-transform
Needs numpy; gsply, plyfile and open3d where they are installed.
"""

import csv
import importlib
import importlib.metadata
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import numpy as np

PLACES, SCALES, ROTATIONS = ["x", "y", "z"], [f"scale_{k}" for k in range(3)], [f"rot_{k}" for k in range(4)]
PARTS = {"places": PLACES, "scales": SCALES, "rotations": ROTATIONS, "opacity": ["opacity"],
         "grey": [f"f_dc_{k}" for k in range(3)], "HU": ["intensity"], "labels": ["label"]}
NEEDED = ["places", "scales", "rotations", "opacity", "grey"]
TYPES = {"float": "f4", "double": "f8", "uchar": "u1"}


def nifti(path, values, affine):
    """Writes a volume of i2 or u1 in NIfTI-1."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *values.shape, 1, 1, 1, 1)
    struct.pack_into("<hh", header, 70, *{"i2": (4, 16), "u1": (2, 8)}[values.dtype.str[1:]])
    struct.pack_into("<8f", header, 76, 1, *np.linalg.norm(affine[:, :3], axis=0), 1, 1, 1, 1)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    struct.pack_into("<B", header, 123, 2)
    struct.pack_into("<2h", header, 252, 0, 1)
    struct.pack_into("<12f", header, 280, *affine.ravel())
    header[344:348] = b"n+1\0"
    path.write_bytes(bytes(header) + values.tobytes(order="F"))


def volume(folder):
    """Writes ct.nii and labels.nii: two balls with labels 3 and 7."""
    at = np.indices((24, 24, 24))
    ball = lambda centre, radius: sum((at[k] - centre[k]) ** 2 for k in range(3)) < radius**2
    ct, labels = np.full(at[0].shape, -1000, "i2"), np.zeros(at[0].shape, "u1")
    for label, inside, hu in [(3, ball((8, 9, 11), 6), 100 + 20 * np.sin(at[0])),
                              (7, ball((16, 15, 12), 5), 900 + 150 * np.sin(at[1]))]:
        ct[inside], labels[inside] = hu[inside], label
    c, s = 0.7 * np.cos(0.3), 0.7 * np.sin(0.3)
    affine = np.array([[-c, s, 0, 142.5], [s, c, 0, -217.25], [0, 0, 1.25, -811.5]])
    nifti(folder / "ct.nii", ct, affine)
    nifti(folder / "labels.nii", labels, affine)


def read(path):
    """Returns comments and elements (columns by name) of a binary PLY of numbers."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + 11
    comments, elements, at = [], {}, end
    for line in data[:end].decode().splitlines():
        match line.split():
            case ["comment", *words]:
                comments.append(" ".join(words))
            case ["element", name, count]:
                elements[name] = (int(count), [])
            case ["property", kind, name]:
                elements[list(elements)[-1]][1].append((name, TYPES[kind]))
    for name, (count, row) in elements.items():
        table = np.frombuffer(data, np.dtype(row), count, at)
        at += table.nbytes
        elements[name] = {column: table[column] for column, _ in row}
    return comments, elements


def write(path, comments, elements):
    """Writes a PLY; the comments stand after the first element."""
    names = {v: k for k, v in TYPES.items()}
    head, body = "ply\nformat binary_little_endian 1.0\n", b""
    for index, (name, columns) in enumerate(elements.items()):
        count = len(next(iter(columns.values())))
        head += f"element {name} {count}\n"
        head += "".join(f"property {names[v.dtype.str[1:]]} {k}\n" for k, v in columns.items())
        head += "".join(f"comment {c}\n" for c in comments if index == 0)
        table = np.empty(count, [(k, v.dtype) for k, v in columns.items()])
        for key, value in columns.items():
            table[key] = value
        body += table.tobytes()
    path.write_bytes((head + "end_header\n").encode() + body)


def by_gsply(path):
    import gsply
    data = gsply.plyread(path)
    return {"places": data.means, "scales": data.scales, "rotations": data.quats, "opacity": data.opacities, "grey": data.sh0}


def columns_of(table):
    return {part: np.stack([table[name] for name in names], 1) for part, names in PARTS.items() if all(n in table for n in names)}


def by_plyfile(path):
    import plyfile
    return columns_of({p.name: e[p.name] for e in plyfile.PlyData.read(path) for p in e.properties})


def by_open3d(path):
    import open3d
    point = open3d.t.io.read_point_cloud(str(path)).point
    names = {"places": "positions", "rotations": "rot", "opacity": "opacity", "grey": "f_dc", "HU": "intensity", "labels": "label"}
    found = {part: point[name].numpy() for part, name in names.items() if name in point}
    return found | {"scales": np.log(point["scale"].numpy())}


def by_splat_transform(path):
    out = path.with_suffix(".csv")
    run(TRANSFORM, "-w", path, out)
    rows = list(csv.reader(out.open()))
    return columns_of(dict(zip(rows[0], np.array(rows[1:], "f8").T)))


def by_struct(floats):
    """Returns a reader of rows of so many floats, like the INRIA viewer's: the third line has the count."""
    def reader(path):
        data = path.read_bytes()
        count = int(data.split(b"\n", 3)[2].split()[2])
        table = np.frombuffer(data, "f4", count * floats, data.index(b"end_header\n") + 11).reshape(count, floats)
        cut = {"places": (0, 3), "grey": (6, 9), "opacity": (-8, -7), "scales": (-7, -4), "rotations": (-4, floats)}
        return {part: table[:, slice(*ends)] for part, ends in cut.items()}
    return reader


def again_gsply(path, out):
    import gsply
    gsply.plywrite(str(out), gsply.plyread(path))


def again_plyfile(path, out):
    import plyfile
    plyfile.PlyData.read(path).write(out)


def again_open3d(path, out):
    import open3d
    open3d.t.io.write_point_cloud(str(out), open3d.t.io.read_point_cloud(str(path)))


def again_splat_transform(path, out):
    run(TRANSFORM, "-w", path, out)


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{command[0]} ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stdout


def same(a, b):
    """Whether two tables are the same but for rounding; rotations may have any length and sign."""
    a, b = (np.asarray(v, "f8").reshape(len(v), -1) for v in (a, b))
    if a.shape == b.shape and a.shape[1] == 4 and np.isfinite(a).all():
        a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) * np.sign(v[:, :1]) for v in (a, b))
    return a.shape == b.shape and np.allclose(a, b, rtol=2e-6, atol=2e-5)


def verdict(found, truth, parts):
    return [part for part in parts if part not in found or not same(found[part], truth[part])]


def installed(name):
    try:
        importlib.import_module(name)
        return True
    except ImportError as error:
        print(f"{name} is left out: {error}")
        return False


def main(vgs, transform=None):
    global TRANSFORM
    TRANSFORM = transform
    readers, writers = {}, {}
    for name, reader, writer in [("gsply", by_gsply, again_gsply), ("plyfile", by_plyfile, again_plyfile), ("open3d", by_open3d, again_open3d)]:
        if installed(name):
            title = f"{name} {importlib.metadata.version(name)}"
            readers[title], writers[title] = reader, writer
    if transform:
        readers["splat-transform"], writers["splat-transform"] = by_splat_transform, again_splat_transform
    readers |= {"rows of 17 floats": by_struct(17), "rows of 62 floats": by_struct(62)}
    with tempfile.TemporaryDirectory() as name:
        measure(pathlib.Path(name), vgs, readers, writers)


def measure(folder, vgs, readers, writers):
    volume(folder)
    ours = folder / "vgs.ply"
    fit = [vgs, "fit", folder / "ct.nii", "--roi", folder / "labels.nii", "--roi-label", "3,7", "--splats", 40, "--iterations", 60, "--no-eval"]
    run(*fit, "-o", ours)
    run(*fit, "-o", folder / "reference.ply", "--ply-layout", "reference")
    run(vgs, "convert", ours, "-o", folder / "inria.ply", "--ply-layout", "inria")
    comments, elements = read(ours)
    vertex = elements["vertex"]
    bare = {k: v for k, v in vertex.items() if k not in ("intensity", "label")}
    hu, label = vertex["intensity"], vertex["label"].astype("u1")
    beside = lambda hu: {"vertex": bare, "splat_intensity": {"intensity": hu, "label": label}}
    write(folder / "second-float.ply", comments, beside(hu))
    write(folder / "second-double.ply", comments, beside(hu.astype("f8")))
    write(folder / "label-byte.ply", comments, {"vertex": vertex | {"label": label}})
    write(folder / "normals.ply", comments, {"vertex": bare | {"nx": hu, "ny": vertex["label"]}})
    write(folder / "beside.ply", comments, {"vertex": bare})
    truth = columns_of(vertex)
    info = json.loads(run(vgs, "info", ours, "--json"))
    assert same(info["bounding_box_mm"], [truth["places"].min(0), truth["places"].max(0)]), "places are those of the world"
    layouts = {"`vgs`: HU and label as float properties": "vgs", "`inria`: 62 floats, HU in a second element of doubles": "inria",
               "`reference`": "reference", "second element of floats (0.2.0)": "second-float", "second element of doubles": "second-double",
               "as `vgs`, the label a byte": "label-byte", "in the normals": "normals", "a file beside it": "beside"}
    print("| layout | " + " | ".join(readers) + " |\n|" + "---|" * (len(readers) + 1))
    for title, name in layouts.items():
        cells = []
        for reader in readers.values():
            try:
                found = reader(folder / f"{name}.ply")
                wrong = verdict(found, truth, NEEDED)
                more = [part for part in ("HU", "labels") if not verdict(found, truth, [part])]
                cells.append(("right" if not wrong else "**wrong** " + ", ".join(wrong)) + (f"; {', '.join(more)}" if more else ""))
            except Exception as error:
                cells.append(f"**fails** ({type(error).__name__})")
        print(f"| {title} | " + " | ".join(cells) + " |")

    keys = ["vgs.kernel", "vgs.grid.affine", "vgs.form"]
    print("\n| written by | kept, as vgs reads it | lost | lost with `--like` |\n|---|---|---|---|")
    for title, writer in writers.items():
        out = folder / "again.ply"
        writer(ours, out)
        lost = []
        for like in ([], ["--like", ours]):
            if like and not lost[0]:
                # The comments are there, and the file needs no other.
                lost.append([])
                continue
            run(vgs, "convert", out, "-o", folder / "back.ply", "--force", *like)
            notes, back = read(folder / "back.ply")
            gone = verdict(columns_of(back["vertex"]), truth, ["places", "scales", "rotations", "opacity", "HU", "labels"])
            stated = lambda all, key: [c for c in all if c.split()[0] == key]
            gone += [key for key in keys if stated(notes, key) != stated(comments, key)]
            gone += ["exceptions"] if "exception" not in back else []
            lost.append(gone)
        kept = [part for part in ["places", "scales", "rotations", "opacity", "HU", "labels", *keys, "exceptions"] if part not in lost[0]]
        print(f"| {title} | {', '.join(kept)} | {', '.join(lost[0]) or 'nothing'} | {', '.join(lost[1]) or 'nothing'} |")


if __name__ == "__main__":
    if len(sys.argv) in (2, 3) and not sys.argv[1].startswith("-"):
        main(*sys.argv[1:])
    else:
        print(__doc__.strip())
