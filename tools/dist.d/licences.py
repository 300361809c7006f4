#!/usr/bin/env python3
"""Prints the licences of what is linked into programs of this workspace, for x86-64 Linux.

Of every crate: name, version, SPDX expression, and the texts that lie in its source, each text once. What only builds
the programs is left out: procedural macros, and shaderc, of whose work the kernels are, not a part.

usage: tools/dist.d/licences.py PACKAGE...        as: vgs vgs-xr
"""

import html
import json
import pathlib
import re
import subprocess
import sys

REPO = pathlib.Path(__file__).resolve().parent.parent.parent
TARGET = "x86_64-unknown-linux-gnu"
NAMES = re.compile(r"(?i)(li[cs]en[cs]e|copying|copyright|notice|unlicense|ofl|ufl)([-._].*)?$")
# These are no licences (REUSE's notes on single files), or are those of one alternative that deny.toml does not allow.
OTHERS = re.compile(r"(?i)gpl|\.(license|py|rs)$")
# Sources that are in a crate and not in the programs.
UNUSED = {"tests", "benches", "examples", "OpenXR-SDK"}
# Whose text lies elsewhere: in the opening comment of a source, in a crate of the same project.
ELSEWHERE = {"nv-flip-sys": ("nv-flip-sys", "extern/cpp/CPP/color.h"), "pulp-wasm-simd-flag": ("pulp", "LICENSE")}
# For crates without any: licences whose text is the same for everyone, and the file of another crate that has it.
STANDARD = {"Apache-2.0": "LICENSE-APACHE", "CC0-1.0": "LICENSE-CC0"}


def linked(metadata, names):
    """Returns the packages from elsewhere that are linked into those of these names."""
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    todo = [p["id"] for p in packages.values() if p["name"] in names and p["source"] is None]
    if len(todo) != len(set(names)):
        sys.exit(f"licences: not all of these are packages of the workspace: {' '.join(names)}")
    seen = set()
    while todo:
        package = packages[todo.pop()]
        if package["id"] in seen or any("proc-macro" in target["kind"] for target in package["targets"]):
            continue
        seen.add(package["id"])
        dependencies = nodes[package["id"]]["deps"]
        todo += [d["pkg"] for d in dependencies if any(kind["kind"] is None for kind in d["dep_kinds"])]
    found = [packages[key] for key in seen if packages[key]["source"]]
    return sorted(found, key=lambda package: (package["name"], package["version"]))


def folder(package):
    return pathlib.Path(package["manifest_path"]).parent


def own_texts(package):
    """Returns the texts of the licence files in the source of a package."""
    root = folder(package)
    paths = sorted(p for p in root.rglob("*") if NAMES.match(p.name) and not OTHERS.search(p.name) and p.is_file())
    return [p.read_text(errors="replace") for p in paths if not UNUSED & set(p.relative_to(root).parts)]


def other_texts(package, packages):
    """Returns the texts for what a package has no licence file of."""
    texts = []
    by_name = {other["name"]: other for other in packages}
    if package["name"] in ELSEWHERE:
        crate, path = ELSEWHERE[package["name"]]
        text = (folder(by_name[crate]) / path).read_text()
        comment = re.match(r"/\*(.*?)\*/", text, re.DOTALL)
        texts.append(re.sub(r"(?m)^ \*? ?", "", comment[1]) if comment else text)
    for identifier, name in STANDARD.items():
        if re.search(rf"\b{re.escape(identifier)}\b", package["license"] or ""):
            texts.append(next((folder(p) / name).read_text() for p in packages if (folder(p) / name).is_file()))
            break
    if not texts:
        sys.exit(
            f"licences: {package['name']} {package['version']} ({package['license']}) has no licence file.\n"
            "  Find where its text lies, and add that to ELSEWHERE in tools/dist.d/licences.py."
        )
    return texts


def standard_library():
    """Returns version and copyright notices of Rust's own library, as the toolchain has them."""

    def rustc(*arguments):
        return subprocess.run(["rustc", *arguments], check=True, capture_output=True, text=True, cwd=REPO).stdout.strip()

    notices = pathlib.Path(rustc("--print", "sysroot")) / "share/doc/rust/COPYRIGHT-library.html"
    if not notices.is_file():
        sys.exit(f"licences: this Rust has no {notices}.\n  One from rustup has.")
    text = html.unescape(re.sub(r"<[^>]*>", "", re.sub(r"(?s)<head>.*?</head>", "", notices.read_text())))
    return rustc("--version").split()[1], re.sub(r"\n\s*\n+", "\n\n", text)


def main(names):
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", TARGET]
    asked = subprocess.run(command, cwd=REPO, stdout=subprocess.PIPE)
    if asked.returncode != 0:
        sys.exit("licences: cargo does not tell the dependencies (its message is above).")
    packages = linked(json.loads(asked.stdout), names)
    version, notices = standard_library()
    parts = [(f"Rust's standard library {version}", "MIT OR Apache-2.0", [notices])]
    for package in packages:
        texts = own_texts(package)
        # A file may be there for one half of an expression alone.
        if not texts or " AND " in (package["license"] or ""):
            texts += other_texts(package, packages)
        parts.append((f"{package['name']} {package['version']}", package["license"] or "see its text", texts))
    # Texts that differ in their line breaks alone are one.
    numbers, unique = {}, []
    for _, _, texts in parts:
        for text in texts:
            key = " ".join(text.split())
            if key not in numbers:
                unique.append(text)
                numbers[key] = len(unique)
    print(f"{' and '.join(names)} are under MIT or Apache-2.0, at your option. Linked into them is also the work of")
    print("others, under the licences that are named here; the numbers are those of the texts below.\n")
    for name, expression, texts in parts:
        listed = sorted({numbers[" ".join(text.split())] for text in texts})
        print(f"{name}: {expression} [{', '.join(map(str, listed))}]")
    for number, text in enumerate(unique, 1):
        print(f"\n{'=' * 20} {number} {'=' * 20}\n\n{text.strip()}")


if __name__ == "__main__":
    if not sys.argv[1:] or sys.argv[1] in ("-h", "--help"):
        print(__doc__.strip())
        sys.exit(0 if sys.argv[1:] else 2)
    main(sys.argv[1:])
