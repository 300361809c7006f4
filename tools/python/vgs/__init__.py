"""Volumetric Gaussian splatting: 3D Gaussians that are fitted to a CT or MR, and rendered through any transfer function.

    >>> import vgs
    >>> ct = vgs.read("ct.nii.gz")                       # or a folder of DICOM slices, or a NumPy array
    >>> bones = vgs.fit(ct, (226, 3071))                 # or a mask: a file, an image, an array
    >>> bones.save("bones.ply")
    >>> picture = vgs.render(bones, camera="anterior-left")

Arrays of voxels are indexed [i, j, k], with an affine to mm RAS, as nibabel has them. Intensities of a CT are HU. It
is software for looking, not for diagnosis.

The program ``vgs`` comes with this package: ``vgs view bones.ply`` opens the splats in a window.
"""

from __future__ import annotations

from typing import Any

from . import _vgs
from ._bake import bake
from ._errors import (
    BadDataError,
    CannotCreateError,
    DeviceUnavailableError,
    Error,
    HostMemoryError,
    InternalError,
    MissingFileError,
    NothingToDoError,
    ReadWriteError,
    TemporaryError,
    UsageError,
)
from ._fit import SETTINGS, code, fit
from ._look import TRANSFER_FUNCTIONS
from ._render import Camera, Difference, compare, render
from ._splats import Evaluation, SplatSet, load
from ._volume import Roi, Volume, VolumeDifference, read

__version__: str = _vgs.__version__


def devices() -> list[dict[str, Any]]:
    """Returns the Vulkan devices of this machine: ``index``, ``name``, ``kind``, ``driver``, ``vulkan`` (version),
    ``memory_bytes``, and ``missing``, what vgs needs that the device lacks."""
    return _vgs.devices()


__all__ = [
    "SETTINGS",
    "TRANSFER_FUNCTIONS",
    "BadDataError",
    "Camera",
    "CannotCreateError",
    "DeviceUnavailableError",
    "Difference",
    "Error",
    "Evaluation",
    "HostMemoryError",
    "InternalError",
    "MissingFileError",
    "NothingToDoError",
    "ReadWriteError",
    "Roi",
    "SplatSet",
    "TemporaryError",
    "UsageError",
    "Volume",
    "VolumeDifference",
    "bake",
    "code",
    "compare",
    "devices",
    "fit",
    "load",
    "read",
    "render",
]
