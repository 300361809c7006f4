#!/usr/bin/env python3
"""Measures what other programs, and vgs itself, read in the files that `vgs convert` writes for programs that know only
colours, and what vgs reads in those of others: the figures of docs/design/file-formats.md, "Files of colours". Ends with 1 if
the Khronos validator finds more in the `.glb` than names that it does not know.

usage: tests/files-of-colours.py VGS SPLATS [NODE-MODULES]
       VGS is the program, by its path (tools/vgs, say), SPLATS a fit with HU; NODE-MODULES a folder with
       @playcanvas/splat-transform and gltf-validator: npm install @playcanvas/splat-transform gltf-validator
Needs numpy; gsply and pygltflib where they are installed.
"""

import importlib.util
import importlib.metadata
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

SH0 = 0.2820948
# From RAS to the axes of each file. splat-transform turns those of an .spz to right, down, front for a PLY; a .sog has these.
AXES = {"spz": [[1, 0, 0], [0, 0, 1], [0, -1, 0]], "sog": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "glb": [[-1, 0, 0], [0, 0, 1], [0, 1, 0]],
        "ply": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "ras": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
# What the validator says of an extension that it does not know, of the names of its attributes, and of the bytes of
# exceptions, which only `extras` name.
UNKNOWN = {"UNSUPPORTED_EXTENSION", "MESH_PRIMITIVE_INVALID_ATTRIBUTE", "UNUSED_OBJECT"}


def by_ply(path):
    """Returns places, ln of scales, rotations (w, x, y, z), opacities and harmonics (n, k, 3) of a binary PLY of floats."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + 11
    lines = [line.split() for line in data[:end].decode().splitlines()]
    names = [words[2] for words in lines if words[:2] == ["property", "float"]]
    count = next(int(words[2]) for words in lines if words[:2] == ["element", "vertex"])
    table = np.frombuffer(data, "f4", count * len(names), end).reshape(count, len(names)).astype("f8")
    columns = lambda *wanted: np.stack([table[:, names.index(name)] for name in wanted], 1)
    beyond = sum(name.startswith("f_rest_") for name in names)
    dc = columns("f_dc_0", "f_dc_1", "f_dc_2")[:, None]
    rest = columns(*(f"f_rest_{k}" for k in range(beyond))).reshape(count, 3, -1).swapaxes(1, 2)
    return (columns("x", "y", "z"), columns("scale_0", "scale_1", "scale_2"),
            columns("rot_0", "rot_1", "rot_2", "rot_3"), 1 / (1 + np.exp(-columns("opacity")[:, 0])),
            np.concatenate([dc, rest], 1))


def by_gsply(path):
    import gsply
    data = gsply.read_spz(str(path))
    opacity = 1 / (1 + np.exp(-np.ravel(data.opacities).astype("f8")))
    return data.means, data.scales, data.quats, opacity, np.concatenate([data.sh0[:, None], data.shN], 1)


def by_pygltflib(path):
    import pygltflib
    file = pygltflib.GLTF2().load(str(path))
    document, data = json.loads(file.gltf_to_json()), file.binary_blob()
    attributes = document["meshes"][0]["primitives"][0]["attributes"]

    def of(name):
        accessor = document["accessors"][attributes["KHR_gaussian_splatting:" + name if name != "POSITION" else name]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        start = document["bufferViews"][accessor["bufferView"]]["byteOffset"]
        return np.frombuffer(data, "f4", accessor["count"] * width, start).reshape(-1, width).astype("f8")

    harmonics = [of(f"SH_DEGREE_{l}_COEF_{k}") for l in range(3) for k in range(2 * l + 1)]
    origin = np.array(document["nodes"][0].get("translation", [0, 0, 0]))
    return of("POSITION") + origin, np.log(of("SCALE")), of("ROTATION")[:, [3, 0, 1, 2]], of("OPACITY")[:, 0], np.stack(harmonics, 1)


def covariance(rotation, log_scale):
    w, x, y, z = (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).T
    axes = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], 1).reshape(-1, 3, 3)
    spans = axes * np.exp(log_scale)[:, None]
    return spans @ spans.swapaxes(1, 2)


def colour(harmonics, d):
    x, y, z = d
    basis = np.array([SH0, -.48860251 * y, .48860251 * z, -.48860251 * x, 1.0925484 * x * y, -1.0925484 * y * z,
                      .31539157 * (2 * z * z - x * x - y * y), -1.0925484 * x * z, .54627421 * (x * x - y * y)])
    return .5 + np.einsum("k,nkc->nc", basis[:harmonics.shape[1]], harmonics)


def compare(title, truth, found, axes):
    axes = np.array(axes)
    place, shape, turn, opacity, harmonics = map(np.asarray, found)
    wanted = axes @ covariance(truth[2], truth[1]) @ axes.T * 1e-6
    norm = lambda m: np.linalg.norm(m, axis=(1, 2))
    off = norm(covariance(turn, shape) - wanted) / norm(wanted)
    sides = np.array([[1, 0, 0], [0, .6, .8], [-.48, .6, .64]])
    colours = max(np.abs(colour(truth[4], d) - colour(harmonics, axes @ d)).max() for d in sides)
    print(f"{title}: {len(place)} of {len(truth[0])} splats; at most {np.abs(place * 1e3 - truth[0] @ axes.T).max():.2g} mm, "
          f"covariance {off.max():.2g}, opacity {np.abs(opacity - truth[3]).max():.2g}, colour {colours:.2g}")


def ordered(truth, found, axes):
    """Returns the splats that were found in the order of the truth: a .sog has them along a curve."""
    wanted = np.concatenate([truth[0] @ np.array(axes).T * 1e3, truth[3][:, None] * 1e2, truth[4][:, 0] * 1e2], 1)
    there = np.concatenate([found[0] * 1e6, found[3][:, None] * 1e2, found[4][:, 0] * 1e2], 1)
    nearest = [np.abs(there - row).sum(1).argmin() for row in wanted]
    print(f"  {len(set(nearest))} splats of {len(truth[0])} are the nearest to one")
    return [part[nearest] for part in found]


def metres(found):
    """Returns what a file of mm holds, in metres."""
    place, shape, *rest = found
    return place * 1e-3, shape - np.log(1e3), *rest


def validate(modules, path):
    """Prints what the Khronos validator finds, and returns whether it is nothing but what it does not know."""
    script = ("const v = require('gltf-validator');"
              "v.validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])), {maxIssues: 0})"
              ".then(r => console.log(JSON.stringify([v.version(), r.issues.messages])))")
    done = subprocess.run(["node", "-e", script, str(path)], cwd=modules.parent, check=True, capture_output=True, text=True)
    version, found = json.loads(done.stdout)
    counts = {}
    for issue in found:
        counts[issue["code"]] = counts.get(issue["code"], 0) + 1
    print(f".glb by gltf-validator {version}: {counts or 'nothing'}")
    wrong = [issue for issue in found if issue["code"] not in UNKNOWN]
    for issue in wrong:
        print(f"  {issue['code']} at {issue.get('pointer')}: {issue['message']}")
    return not wrong


def main(vgs, splats, modules=None):
    run = lambda *command: subprocess.run([str(word) for word in command], check=True, capture_output=True)
    modules = modules and pathlib.Path(modules).resolve()
    good = True
    with tempfile.TemporaryDirectory() as name:
        out = lambda ending: pathlib.Path(name) / ("a." + ending)
        for ending in ("ply", "spz", "sog", "glb"):
            run(vgs, "convert", splats, "--tf", "CT-Bone", "-o", out(ending))
        truth = by_ply(out("ply"))
        for module, reader, ending in [("gsply", by_gsply, "spz"), ("pygltflib", by_pygltflib, "glb")]:
            if importlib.util.find_spec(module):
                title = f".{ending} by {module} {importlib.metadata.version(module)}"
                compare(title, truth, reader(out(ending)), AXES[ending])
        run(vgs, "convert", out("spz"), "-o", out("back.ply"))
        compare(".spz by vgs", truth, metres(by_ply(out("back.ply"))), AXES["ras"])
        run(vgs, "convert", out("sog"), "-o", out("back.ply"), "--force")
        compare(".sog by vgs", truth, ordered(truth, metres(by_ply(out("back.ply"))), AXES["ras"]), AXES["ras"])
        sizes = [f"{out(ending).stat().st_size / len(truth[0]):.1f} as .{ending}" for ending in ("spz", "sog", "glb")]
        print("bytes a splat:", ", ".join(sizes))
        run(vgs, "convert", out("glb"), "-o", out("hu.ply"))
        run(vgs, "convert", out("hu.ply"), "--tf", "CT-Bone", "-o", out("again.ply"))
        again = by_ply(out("again.ply"))
        print(f".glb by vgs, with its HU, coloured again: {len(again[0])} of {len(truth[0])} splats")
        if modules:
            transform = modules / ".bin" / "splat-transform"
            run(transform, "-w", out("spz"), out("spz.ply"))
            compare(".spz by splat-transform", truth, by_ply(out("spz.ply")), AXES["ply"])
            run(transform, "-w", out("sog"), out("sog.ply"))
            found = ordered(truth, by_ply(out("sog.ply")), AXES["sog"])
            compare(".sog by splat-transform", truth, found, AXES["sog"])
            for ending in ("spz", "glb", "sog"):
                # Of a PLY splat-transform takes the axes for right, down, front, and the unit for metres.
                run(transform, "-w", out("sog.ply" if ending == "sog" else "spz.ply"), out("theirs." + ending))
                run(vgs, "convert", out("theirs." + ending), "-o", out("theirs.ply"), "--force")
                found = metres(by_ply(out("theirs.ply")))
                found = ordered(truth, found, AXES["ras"]) if ending == "sog" else found
                compare(f".{ending} of splat-transform by vgs", truth, found, AXES["ras"])
            good = validate(modules, out("glb"))
    return 0 if good else 1


if __name__ == "__main__":
    if len(sys.argv) in (3, 4):
        sys.exit(main(*sys.argv[1:]))
    else:
        print(__doc__.strip())
