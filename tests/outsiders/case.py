"""A case: a file that is written, the values that are right, and the outsiders that confirm them."""

import dataclasses
import itertools
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

# How far values may differ, as a part of the larger one: vgs keeps 32-bit real numbers.
VALUE = 1e-6
# How far the corner of a grid may lie beside its place, mm: NIfTI rounds affines to 32 bits.
PLACE_MM = 2e-4


@dataclasses.dataclass
class Grid:
    """Values [x, y, z], NaN where there is none, and the map from voxels to mm RAS (4 x 4)."""

    values: np.ndarray
    affine: np.ndarray
    # Whether the file says how the patient lies; without that only distances are compared.
    oriented: bool = True

    def difference(self, other):
        """Returns in words how this grid differs from another one; None if it does not."""
        if self.values.shape != other.values.shape:
            return f"size {sized(self)} where {sized(other)} is right"
        own, right = (np.asarray(grid.values, "f8") for grid in (self, other))
        near = np.isclose(own, right, rtol=VALUE, atol=VALUE, equal_nan=True)
        if not near.all():
            at = tuple(int(i) for i in np.argwhere(~near)[0])
            return f"{(~near).sum()} of {near.size} values, as {own[at]:g} where {right[at]:g} is right at {at}"
        if not self.oriented or not other.oriented:
            own, right = (np.linalg.norm(grid.affine[:3, :3], axis=0) for grid in (self, other))
            return None if np.allclose(own, right, atol=PLACE_MM) else f"distances {own} where {right} is right"
        corners = np.array([[*corner, 1] for corner in itertools.product(*([0, n] for n in right.shape))]).T
        off = np.abs((self.affine - other.affine) @ corners).max()
        return None if off <= PLACE_MM else f"corners are up to {off:.4g} mm off"


def sized(grid):
    return " x ".join(map(str, grid.values.shape))


@dataclasses.dataclass
class Case:
    """A file and what is right for it.

    `write` writes into an empty folder and returns the path that vgs is given. `truth` is what is right; None if the
    file has no right reading, and must be refused. `odd` is what a refusal must name (a regular expression); None if
    the file is plain, and must be read. `warns` is what a warning must name where the file is read. `options` go to
    the reader of vgs. `readers` are the outsiders; each of them that reads the file confirms the truth, or its
    dissent is listed in `known.py`.
    """

    name: str
    write: Callable[[Path], Path]
    truth: Grid | None
    readers: dict = dataclasses.field(default_factory=dict)
    odd: str | None = None
    warns: str | None = None
    options: dict = dataclasses.field(default_factory=dict)

    @property
    def family(self):
        return self.name.split(": ")[0]


def random(name, shape, low, high, dtype="i8"):
    """Returns random whole numbers from `low` to `high`, the same ones for the same name."""
    generator = np.random.default_rng(zlib.crc32(name.encode()))
    return generator.integers(low, high, size=shape, endpoint=True, dtype=dtype)


def product(**axes):
    """Returns the combinations of the named axes, each a dictionary."""
    return [dict(zip(axes, values)) for values in itertools.product(*axes.values())]


def product_of(*axes):
    """Returns the combinations of the axes, each a tuple."""
    return list(itertools.product(*axes))


def affine(columns, origin, flip=(1, 1, 1)):
    """Returns the map from voxels to mm: the steps along x, y, z and the place of the first voxel; `flip` -1, -1, 1
    takes LPS to RAS."""
    out = np.eye(4)
    out[:3] = np.column_stack([*columns, origin]) * np.array(flip)[:, None]
    return out


LPS = (-1, -1, 1)
