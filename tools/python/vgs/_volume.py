"""Volumes and regions of interest."""

from __future__ import annotations

import importlib
import numbers
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, Union

import numpy as np
import numpy.typing as npt

from . import _vgs
from ._errors import usage_error

FloatArray = npt.NDArray[np.float32]
#: What is taken for a file: a path, its bytes, or a binary file that is open.
FileLike = Union[str, "os.PathLike[str]", bytes, BinaryIO]
#: What is taken for a volume: one of vgs, a file, an image of nibabel or SimpleITK, or an array [i, j, k] of voxels of
#: 1 mm.
VolumeLike = Union["Volume", str, "os.PathLike[str]", bytes, Any]
#: What is taken for a region: one of vgs, the bounds of a threshold, or whatever is taken for a volume, as a mask.
RoiLike = Union["Roi", tuple[float, float], VolumeLike]
#: Which labels of a mask.
Labels = Union[str, int, Iterable[Union[str, int]], None]


class Volume:
    """A scalar volume on a regular grid.

    Args:
        array: Samples [i, j, k], as nibabel has them: HU of a CT. Anything with ``__array__`` or DLPack. An array of
            float32 in Fortran order, which is nibabel's, is kept as it is; any other is copied once.
        affine: 4 x 4 matrix from [i, j, k, 1] to [x, y, z, 1] in mm RAS (x to the patient's right, y to the front, z to
            the head). None: voxels of 1 mm, and nothing is known of how the patient lies.
        unit: ``"hu"`` for a CT or ``"arbitrary"`` for any other scan. None: guessed from the values.
        labels: Names of label values, if the volume is a map of labels.

    Attributes:
        array: The samples, float32. They may be changed in place.
        affine: The matrix.
        labels: Names of label values, by number.

    Raises:
        UsageError: If the array has not three axes, or the matrix cannot be used.

    Example:
        >>> ct = vgs.Volume(np.zeros((64, 64, 40), np.float32), np.diag([0.8, 0.8, 2.5, 1.0]))
        >>> ct.spacing_mm
        (0.8, 0.8, 2.5)
    """

    def __init__(
        self,
        array: npt.ArrayLike,
        affine: npt.ArrayLike | None = None,
        *,
        unit: str | None = None,
        labels: Mapping[int, str] | None = None,
        oriented: bool | None = None,
        frame_of_reference: str | None = None,
    ):
        if isinstance(array, (Volume, Roi)) or _is_image(array):
            raise usage_error(
                f"a volume of a {type(array).__name__}, whose place would be lost", help="vgs.Volume.of takes it over"
            )
        if unit not in (None, "hu", "arbitrary"):
            raise usage_error(f"no unit is called {unit!r}", help='"hu" for a CT, "arbitrary" for any other scan')
        self.array = _voxels(array)
        self.affine = np.eye(4) if affine is None else np.array(affine, dtype=np.float64, order="C", ndmin=2)
        self.labels = {int(number): str(name) for number, name in (labels or {}).items()}
        self._unit = unit
        self._oriented = affine is not None if oriented is None else oriented
        self._frame_of_reference = frame_of_reference
        _vgs.check_affine(self.affine)

    @staticmethod
    def of(what: VolumeLike, *, unit: str | None = None) -> Volume:
        """Returns a path, an image of nibabel or SimpleITK, or an array as a volume, as :func:`fit` takes it.

        Args:
            what: What is taken for a volume. A ``Volume`` is returned as it is, unless ``unit`` is another.
            unit: As of ``Volume``.
        """
        found = as_volume(what)
        if unit in (None, found._unit):
            return found
        return Volume(
            found.array,
            found.affine,
            unit=unit,
            labels=found.labels,
            oriented=found._oriented,
            frame_of_reference=found._frame_of_reference,
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along i, j, k."""
        i, j, k = self.array.shape
        return i, j, k

    @property
    def spacing_mm(self) -> tuple[float, float, float]:
        """Distances of neighbouring voxels along i, j, k, mm."""
        x, y, z = (float(round(n, 9)) for n in np.linalg.norm(self.affine[:3, :3], axis=0))
        return x, y, z

    @property
    def unit(self) -> str:
        """``"hu"`` or ``"arbitrary"``: as it was given, else guessed from the values."""
        if self._unit is None:
            self._unit = self._native().unit
        return self._unit

    @property
    def axis_codes(self) -> str:
        """The direction in which each index grows, as ``"RAS"`` or ``"LPS"``; ``"???"`` if it is not known."""
        return self._native().axis_codes

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes NIfTI (.nii or .nii.gz) or OME-Zarr (.zarr, a folder), float32; an existing one is kept unless ``force`` is set."""
        self._native().save(os.fspath(path), force)

    def compare(
        self, other: VolumeLike, roi: RoiLike | None = None, *, range: tuple[float, float] | None = None
    ) -> VolumeDifference:
        """Returns how far another volume on the same grid is from this one, as ``vgs compare`` does.

        Args:
            other: The other volume; an array lies on this grid.
            roi: The region that is compared, as of :func:`fit`; None: all voxels.
            range: Intensities whose difference is the peak of the PSNR, to which both are clipped for it, HU; None: the
                range of this volume.
        """
        region = None if roi is None else as_roi(roi, self)._native
        there = as_volume(other, like=self)._native()
        return VolumeDifference(**self._native().compare(there, region, None if range is None else list(range)))

    def to_nibabel(self) -> Any:
        """Returns a ``nibabel.Nifti1Image`` of the same samples, without a copy."""
        nibabel: Any = importlib.import_module("nibabel")
        image = nibabel.Nifti1Image(self.array, self.affine)
        image.header.set_xyzt_units("mm")
        return image

    def to_sitk(self) -> Any:
        """Returns a ``SimpleITK.Image``, LPS as SimpleITK has it; the samples are copied."""
        simpleitk: Any = importlib.import_module("SimpleITK")
        lps = np.diag([-1.0, -1.0, 1.0]) @ self.affine[:3]
        spacing = np.linalg.norm(lps[:, :3], axis=0)
        image = simpleitk.GetImageFromArray(self.array.T)
        image.SetSpacing(spacing.tolist())
        image.SetDirection((lps[:, :3] / spacing).ravel().tolist())
        image.SetOrigin(lps[:, 3].tolist())
        return image

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if dtype is not None and np.dtype(dtype) != self.array.dtype:
            return self.array.astype(dtype)
        return self.array.copy() if copy else self.array

    def __repr__(self) -> str:
        i, j, k = self.shape
        size = " x ".join(f"{n:g}" for n in self.spacing_mm)
        return f"<vgs.Volume {i} x {j} x {k}, {size} mm, {self.unit}>"

    def _native(self) -> _vgs.Volume:
        array = _voxels(self.array)
        return _vgs.Volume(
            array,
            np.ascontiguousarray(self.affine),
            unit=self._unit,
            oriented=self._oriented,
            labels=self.labels,
            frame_of_reference=self._frame_of_reference,
        )


@dataclass(frozen=True)
class VolumeDifference:
    """How far a volume is from another one.

    Attributes:
        voxels: Number of voxels that were compared.
        psnr_db: Peak signal-to-noise ratio, dB; infinite for equal ones.
        mean_hu: Mean difference, HU.
        rmse_hu: Root mean square difference, HU.
        p99_hu: Absolute difference that 99 % of the voxels do not exceed, HU.
        largest_hu: Largest difference, HU, with its sign.
        largest_voxel: Indices i, j, k of the voxel that has it.
    """

    voxels: int
    psnr_db: float
    mean_hu: float
    rmse_hu: float
    p99_hu: float
    largest_hu: float
    largest_voxel: list[int]


class Roi:
    """A region of interest: the voxels of a volume that are fitted. Made by :meth:`from_mask` and
    :meth:`from_threshold`."""

    def __init__(self, native: _vgs.Roi):
        self._native = native

    @staticmethod
    def from_mask(mask: VolumeLike, volume: VolumeLike, labels: Labels = None) -> Roi:
        """Returns the region that a mask marks in a volume.

        Args:
            mask: A mask of 0 and 1, a soft one in [0, 1], or a map of labels; a file, also a DICOM segmentation or
                structure set, or what is taken for a volume. On another grid of the same space it is resampled. An
                array lies on the grid of the volume.
            volume: The volume.
            labels: Which labels: a number, a name, several of them, ranges (``"1-24"``), patterns (``"rib_*"``) or
                ``"all"``. A fit keeps the label of each splat. None: the mask as a whole.

        Raises:
            UsageError: If labels must be chosen, or there are no such ones.
            BadDataError: If the values are no mask, or mask and volume lie apart.
            NothingToDoError: If the region is empty.
        """
        of = as_volume(volume)
        native = of._native()
        chosen = _labels(labels)
        if isinstance(mask, (str, os.PathLike, bytes)) or hasattr(mask, "read"):
            marks = Volume(**_vgs.read_mask(as_file(mask), native, chosen))
        else:
            marks = as_volume(mask, like=of)
        return Roi(_vgs.Roi.from_mask(marks._native(), native, chosen))

    @staticmethod
    def from_threshold(
        volume: VolumeLike,
        low: float,
        high: float,
        *,
        min_ml: float | None = None,
        largest: int | None = None,
        close_mm: float | None = None,
        fill_holes: bool = False,
    ) -> Roi:
        """Returns the voxels with ``low`` <= sample <= ``high`` (HU), cleaned in the order of the arguments.

        Args:
            volume: The volume.
            low: Least sample.
            high: Greatest sample.
            min_ml: Connected pieces below this volume, ml, are left out.
            largest: Only so many of the largest connected pieces are kept.
            close_mm: Gaps are closed with a ball of this radius, mm.
            fill_holes: What is enclosed on all sides is filled.
        """
        native = as_volume(volume)._native()
        return Roi(
            _vgs.Roi.from_threshold(
                native,
                float(low),
                float(high),
                min_ml=min_ml,
                largest=largest,
                close_mm=close_mm,
                fill_holes=fill_holes,
            )
        )

    @property
    def array(self) -> FloatArray:
        """Membership [i, j, k] of each voxel, 0 to 1; a copy."""
        return self._native.array()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along i, j, k: those of the volume."""
        i, j, k = self._native.shape
        return i, j, k

    @property
    def voxels(self) -> int:
        """Number of voxels of the region."""
        return self._native.voxels

    @property
    def ml(self) -> float:
        """Its volume, ml."""
        return self._native.ml

    @property
    def label_names(self) -> dict[int, str]:
        """Names of the chosen labels, by number."""
        return self._native.label_names

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return self.array if dtype is None else self.array.astype(dtype)

    def __repr__(self) -> str:
        return f"<vgs.Roi {self.voxels:,} voxels, {self.ml:.1f} ml>"


def read(
    path: FileLike,
    *,
    volume_index: int | None = None,
    level: int | None = None,
    voxels: Sequence[Sequence[int]] | None = None,
    series: str | int | None = None,
    voxel_mm: float | tuple[float, float, float] | None = None,
    unit: str | None = None,
    lenient: bool = False,
    max_bytes: int | None = None,
) -> Volume:
    """Reads a volume: a file (NIfTI, NRRD, MetaImage, NumPy, InVesalius, DICOM), a folder or zip of DICOM slices, or OME-Zarr.

    Args:
        path: The file or the folder; or the bytes of one file, or such a file that is open (``io.BytesIO``).
        volume_index: Which volume of a series (4-D file), counted from 0.
        level: Which resolution of an OME-Zarr image, from 0, the finest and the default.
        voxels: Only these voxels: [first, end] along x, y, z, where end is the one behind the last. Of a file that is not
            compressed, and of chunks, no others are read.
        series: Which series of a DICOM folder: its number in ``vgs info``, its UID, or a part of its description.
        voxel_mm: How far voxels are apart along x, y, z, mm, in a file that does not say (.npy, whose array is [z, y, x]).
        unit: ``"hu"`` or ``"arbitrary"``, where the file is wrong about it.
        lenient: Accepts damage that leaves every voxel readable.
        max_bytes: Largest volume that is accepted, bytes; None: 2 GiB.

    Raises:
        MissingFileError: If there is no such file.
        BadDataError: If it cannot be used; the message says what was found.

    Example:
        >>> ct = vgs.read("ct.nii.gz")
        >>> ct
        <vgs.Volume 512 x 512 x 241, 0.957 x 0.957 x 0.5 mm, hu>
    """
    edges = None if voxel_mm is None else np.broadcast_to(np.asarray(voxel_mm, dtype=np.float64), 3).tolist()
    return Volume(
        **_vgs.read_volume(
            as_file(path),
            volume_index=volume_index,
            level=level,
            voxels=voxels,
            series=None if series is None else str(series),
            voxel_mm=edges,
            unit=unit,
            lenient=lenient,
            max_bytes=max_bytes,
        )
    )


def as_volume(what: VolumeLike, like: Volume | None = None) -> Volume:
    """Returns what a user has given as a volume. An array without a matrix lies on the grid of ``like``."""
    if isinstance(what, Volume):
        return what
    if isinstance(what, Roi):
        return Volume(what.array, None if like is None else like.affine, oriented=like is not None)
    if isinstance(what, (str, os.PathLike, bytes)) or hasattr(what, "read"):
        return read(what)
    if what is None:
        raise usage_error("no volume, or no region", help="give a path, an image, an array or an object of vgs")
    if hasattr(what, "affine") and hasattr(what, "dataobj"):  # nibabel
        return Volume(np.asanyarray(what.dataobj), what.affine)
    if _is_image(what):  # SimpleITK
        if what.GetDimension() != 3:
            raise usage_error(f"an image of {what.GetDimension()} axes", help="give an image of three axes")
        simpleitk: Any = importlib.import_module("SimpleITK")
        affine = np.eye(4)
        affine[:3, :3] = np.array(what.GetDirection()).reshape(3, 3) * np.array(what.GetSpacing())
        affine[:3, 3] = what.GetOrigin()
        return Volume(simpleitk.GetArrayFromImage(what).T, np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine)
    if like is None:
        return Volume(what)
    found = _voxels(what)
    if found.shape != like.shape:
        raise usage_error(
            f"an array of {found.shape} for a volume of {like.shape} voxels",
            help="give an array of the volume's shape, [i, j, k]; or an image or a vgs.Volume with an affine of its own",
        )
    return Volume(found, like.affine, oriented=like._oriented)


def as_roi(what: RoiLike, volume: Volume, labels: Labels = None) -> Roi:
    """Returns what a user has given as a region of a volume."""
    bounds: list[Any] = list(what) if isinstance(what, (tuple, list)) else []
    is_threshold = len(bounds) == 2 and all(isinstance(bound, numbers.Real) for bound in bounds)
    if labels is not None and (is_threshold or isinstance(what, Roi)):
        raise usage_error("labels, and a region without a mask", help="give the mask, or leave labels out")
    if isinstance(what, Roi):
        return what
    if is_threshold:
        return Roi.from_threshold(volume, float(bounds[0]), float(bounds[1]))
    return Roi.from_mask(what, volume, labels)


def as_file(what: Any) -> str | tuple[str, bytes]:
    """Returns the path of a file, or its bytes with a name for messages."""
    if isinstance(what, bytes):
        return "bytes", what
    if isinstance(what, (str, os.PathLike)):
        return os.fspath(what)
    return str(getattr(what, "name", "bytes")), what.read()


def _is_image(what: Any) -> bool:
    """True of images of SimpleITK and nibabel."""
    sitk = all(hasattr(what, name) for name in ("GetSpacing", "GetDirection", "GetOrigin"))
    return sitk or (hasattr(what, "affine") and hasattr(what, "dataobj"))


def _labels(labels: Labels) -> str | None:
    if labels is None or isinstance(labels, str):
        return labels
    if isinstance(labels, numbers.Integral):
        return str(labels)
    assert isinstance(labels, Iterable)
    return ",".join(f'"{name}"' if "," in str(name) else str(name) for name in labels)


def _voxels(array: npt.ArrayLike) -> FloatArray:
    """Returns samples as float32, i fastest: the array itself where it is so already."""
    given: Any = array
    tensor = hasattr(given, "__dlpack__") and not isinstance(given, np.ndarray)
    found: npt.NDArray[Any] = np.from_dlpack(given) if tensor else np.asarray(given)
    if found.ndim == 4 and found.shape[3] == 1:
        found = found[..., 0]
    if found.ndim != 3:
        raise usage_error(
            f"an array of {found.ndim} axes {found.shape}",
            help="give three axes, [i, j, k]; of a series choose one volume: array[..., n]",
        )
    if found.dtype.kind not in "biuf":
        raise usage_error(f"an array of {found.dtype}", help="give numbers, as HU in float32")
    return np.asfortranarray(found, dtype=np.float32)
