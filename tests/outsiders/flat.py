"""What the writers of NIfTI, NRRD, MetaImage and NPY have in common: they write byte by byte."""

import numpy as np

from case import random

SHAPE = (5, 4, 3)
KINDS = ["u1", "i1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]
# An oblique frame in LPS with short decimals.
OBLIQUE = np.array([[0.8, 0.6, 0], [-0.48, 0.64, 0.6], [0.36, -0.48, 0.8]]) * [[0.5], [0.75], [2.5]]
ORIGIN = [-12.5, 30.25, -100.0]


def values_of(name, kind, shape=SHAPE):
    """Returns random values that the type holds, its extremes among them where a 32-bit real holds them."""
    low, high = {"u": (0, 250), "i": (-120, 120), "f": (-2000, 3000)}[kind[0]]
    if kind in ["i2", "i4", "i8"]:
        low, high = -2000, 3000
    out = np.asarray(random(name, shape, low, high))
    if kind[0] in "iu" and int(kind[1]) < 4:
        out.ravel()[:2] = [np.iinfo(kind).min, np.iinfo(kind).max][: out.size]
    return out + (0.25 if kind[0] == "f" else 0)


def text_of(values):
    return " ".join(f"{v:g}" for v in values.ravel(order="F")).encode() + b"\n"
