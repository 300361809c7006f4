"""Splat sets."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _vgs
from ._errors import DeviceUnavailableError, usage_error
from ._volume import FileLike, RoiLike, Volume, VolumeLike, as_file, as_roi, as_volume

FloatArray = npt.NDArray[np.float32]
DoubleArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Evaluation:
    """How far splats are from their volume, in a region: as what is shown of them. ``vgs eval`` says the same and more.

    Attributes:
        psnr_db: Peak signal-to-noise ratio at the voxels, dB, over ``range``.
        psnr_mean_offset_db: Its mean between the voxels, on grids at sub-voxel offsets, dB; ``psnr_db`` without such.
        psnr_min_offset_db: The worst of these.
        rmse_hu: Root mean square error at the voxels, HU.
        p99_hu: Error that 99 % of the voxels do not exceed, HU.
        occupancy_rmse_on_grid: Root mean square error of the occupancy against the mask, 0 to 1.
        soft_dice: Soft Dice coefficient of occupancy and mask, 0 to 1.
        range: Intensities whose difference is the peak of the PSNR, HU.
    """

    psnr_db: float
    psnr_mean_offset_db: float
    psnr_min_offset_db: float
    rmse_hu: float
    p99_hu: float
    occupancy_rmse_on_grid: float
    soft_dice: float
    range: list[float]


class SplatSet:
    """Splats: 3D Gaussians that carry an intensity. :func:`fit` makes them, :func:`load` reads them and
    :meth:`from_arrays` makes them of arrays. A set does not change: :meth:`replace` and indexing make new ones.

    ``splats[mask]``, ``splats[10:20]`` and ``splats[[3, 1]]`` are sets of some of the splats. The field is the weighted mean of
    the splats that overlap: to take away some of them changes it only near them.

    Attributes:
        seconds: Time of the iterations of the fit, s; None if it was read from a file.
        stopped: True if its fit was stopped before its end.
        psnr_db: Of baked splats, how near their pictures come on views that were not fitted, dB; else None.
    """

    def __init__(self, native: _vgs.Splats):
        self._native = native
        self.seconds: float | None = None
        self.stopped = False
        self.psnr_db: float | None = None

    @staticmethod
    def from_arrays(
        means: npt.ArrayLike,
        scales: npt.ArrayLike,
        rotations: npt.ArrayLike,
        opacities: npt.ArrayLike,
        intensities: npt.ArrayLike,
        labels: npt.ArrayLike | None = None,
        *,
        kernel: str = "compact",
        unit: str = "hu",
        background: float = 0.0,
        label_names: Mapping[int, str] | None = None,
    ) -> SplatSet:
        """Makes a set of arrays.

        Args:
            means: [N, 3], mm RAS.
            scales: [N, 3], standard deviations along the splat's axes, mm, above 0.
            rotations: [N, 4], quaternions w, x, y, z, of any length but 0.
            opacities: [N], 0 to 1.
            intensities: [N], HU.
            labels: [N], 0 to 255, or None.
            kernel: ``"compact"``, ``"gaussian"`` or ``"density"``.
            unit: ``"hu"`` or ``"arbitrary"``.
            background: Intensity where no splat reaches, HU.
            label_names: Names of labels, by number.
        """
        arrays = _arrays(means, scales, rotations, opacities, intensities, labels)
        names = None if label_names is None else dict(label_names)
        return SplatSet(
            _vgs.Splats.of_arrays(arrays, kernel=kernel, unit=unit, background=background, label_names=names)
        )

    def replace(
        self,
        *,
        means: npt.ArrayLike | None = None,
        scales: npt.ArrayLike | None = None,
        rotations: npt.ArrayLike | None = None,
        opacities: npt.ArrayLike | None = None,
        intensities: npt.ArrayLike | None = None,
        labels: npt.ArrayLike | None = None,
    ) -> SplatSet:
        """Returns this set with some arrays replaced; shapes and units are those of :meth:`from_arrays`."""
        arrays = _arrays(
            self.means if means is None else means,
            self.scales if scales is None else scales,
            self.rotations if rotations is None else rotations,
            self.opacities if opacities is None else opacities,
            self.intensities if intensities is None else intensities,
            self.labels if labels is None else labels,
        )
        return self._like(_vgs.Splats.of_arrays(arrays, like=self._native))

    @property
    def means(self) -> DoubleArray:
        """Means [N, 3], mm RAS."""
        return self._native.means

    @property
    def scales(self) -> FloatArray:
        """Standard deviations [N, 3] along the axes of each splat, mm."""
        return self._native.scales

    @property
    def rotations(self) -> FloatArray:
        """Unit quaternions [N, 4], w, x, y, z: from the axes of a splat to RAS."""
        return self._native.rotations

    @property
    def covariances(self) -> DoubleArray:
        """Covariances [N, 3, 3], mm²."""
        return self._native.covariances

    @property
    def opacities(self) -> FloatArray:
        """Opacities [N], 0 to 1."""
        return self._native.opacities

    @property
    def intensities(self) -> FloatArray:
        """Intensities [N], HU of a CT. Of splats of form ``"grid"`` they are what makes the sum right at the voxels, and not the
        HU of a tissue: those beside an edge may lie outside of the region's range. Means over an organ are those of
        :meth:`rasterize`."""
        return self._native.intensities

    @property
    def labels(self) -> npt.NDArray[np.uint8] | None:
        """Labels [N] of the structures that the splats belong to; None if the fit knew none."""
        return self._native.labels

    @property
    def label_names(self) -> dict[int, str]:
        """Names of labels, by number."""
        return self._native.label_names

    @property
    def unit(self) -> str:
        """``"hu"``, or ``"arbitrary"``; ``"luminance"`` for splats of other programs, which have colours."""
        return self._native.unit

    @property
    def kernel(self) -> str:
        """``"compact"``, ``"gaussian"`` or ``"density"``."""
        return self._native.kernel

    @property
    def background(self) -> float:
        """Intensity where no splat reaches, HU."""
        return self._native.background

    @property
    def form(self) -> str:
        """``"field"``: right everywhere. ``"grid"`` and ``"grid-binary"``: right at the voxels of their volume, where
        they are decoded and interpolated to be shown."""
        return self._native.form

    @property
    def bound(self) -> float | None:
        """How far a voxel that is coded in place of splats (:func:`code`) may be off; None for splats."""
        return self._native.bound

    @property
    def iterations(self) -> int | None:
        """Iterations of the fit; None if they are not known."""
        return self._native.iterations

    @property
    def grid(self) -> tuple[tuple[int, int, int], DoubleArray] | None:
        """Shape and affine of the grid that the splats were fitted on: that of the volume, or one with more slices where those
        are thick (``between_slices``). None if it is not known."""
        found = self._native.grid
        if found is None:
            return None
        (i, j, k), affine = found
        return (i, j, k), affine

    def inside(self, low: npt.ArrayLike, high: npt.ArrayLike) -> SplatSet:
        """Returns the splats whose means lie in the box between two corners, mm RAS."""
        means = self.means
        return self[np.all((means >= np.asarray(low)) & (means <= np.asarray(high)), axis=1)]

    def with_label(self, *labels: int | str) -> SplatSet:
        """Returns the splats of labels, by number or name."""
        if self.labels is None:
            raise usage_error("these splats have no labels", help="fit with labels=")
        names = {name: number for number, name in self.label_names.items()}
        unknown = [label for label in labels if isinstance(label, str) and label not in names]
        if unknown:
            known = ", ".join(names) or "none"
            raise usage_error(f"no label is called {unknown[0]!r}", help=f"labels: {known}")
        there = set(self.labels.tolist())
        absent = [label for label in labels if not isinstance(label, str) and label not in there]
        if absent:
            raise usage_error(f"no splat has the label {absent[0]}", help=f"labels: {sorted(there)}")
        numbers = [names[label] if isinstance(label, str) else label for label in labels]
        return self[np.isin(self.labels, numbers)]

    def field(self, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Returns the field at points, as it is shown.

        Args:
            points: [M, 3], mm RAS.

        Returns:
            Intensities [M], HU, NaN where no splat reaches; and occupancies [M], 0 to 1.
        """
        found = np.ascontiguousarray(np.atleast_2d(np.asarray(points, dtype=np.float64)))
        if found.ndim != 2 or found.shape[1] != 3:
            raise usage_error(f"points of shape {found.shape}", help="give an array [M, 3] of mm RAS")
        intensity, occupancy = self._native.field(found)
        return intensity, occupancy

    def rasterize(
        self,
        like: VolumeLike | None = None,
        *,
        spacing_mm: float | tuple[float, float, float] | None = None,
        quantity: str = "intensity",
        outside: float = -1024.0,
        device: str | int | None = None,
    ) -> Volume:
        """Returns the splats as a volume again.

        Args:
            like: A volume whose grid is taken. None: :attr:`grid`, which may have more slices than the volume.
            spacing_mm: Or a grid of this spacing around the splats, its axes RAS, mm.
            quantity: ``"intensity"`` (HU where the occupancy is one half or more), ``"field"`` (HU everywhere),
                ``"occupancy"`` or ``"weight"``.
            outside: Intensity where the occupancy is below one half, HU.
            device: As of :func:`fit`.
        """
        shape, affine = self._grid_of(like, spacing_mm)
        named = None if device is None else str(device)
        made = self._native.rasterize(
            list(shape), np.ascontiguousarray(affine), quantity=quantity, outside=outside, device=named
        )
        return Volume(**made)

    def evaluate(
        self,
        volume: VolumeLike,
        roi: RoiLike,
        *,
        range: tuple[float, float] | None = None,
        offsets: int = 4,
        seed: int = 7,
        device: str | int | None = None,
    ) -> Evaluation:
        """Measures the splats against a volume in a region, as ``vgs eval`` does.

        Args:
            volume: The volume, as of :func:`fit`.
            roi: The region, as of :func:`fit`.
            range: Intensities that the PSNR is over, HU; None: the range of the whole volume.
            offsets: Number of grids between the voxels that are measured as well.
            seed: Seed of their offsets.
            device: As of :func:`fit`.
        """
        of = as_volume(volume)
        region = as_roi(roi, of)
        figures = self._native.evaluate(
            of._native(),
            region._native,
            range=None if range is None else list(range),
            offsets=offsets,
            seed=seed,
            device=None if device is None else str(device),
        )
        return Evaluation(**figures)

    def save(self, path: str | os.PathLike[str], *, force: bool = False, live: SplatSet | None = None) -> None:
        """Writes a file, in the format that its extension names.

        Args:
            path: .ply for all programs; .vgs, which is small and rounded (see ``rounded`` of :func:`fit`), and has the splats in
                another order; with colours (:func:`bake`) also .spz, .sog and .glb.
            force: Replaces a file that exists.
            live: With colours in an .spz: the splats with HU that they were baked from. vgs opens these, with a live transfer
                function, and other viewers show the colours.

        Raises:
            CannotCreateError: If the file exists or its folder does not.
        """
        self._native.save(os.fspath(path), force, None if live is None else live._native)

    def __len__(self) -> int:
        return len(self._native)

    def __getitem__(self, which: Any) -> SplatSet:
        if which is None or isinstance(which, tuple):
            raise IndexError("splats have one axis: an index, a slice, a list of indices or a mask of booleans")
        rows = np.arange(len(self))[np.asarray(which, dtype=int) if isinstance(which, list) and not which else which]
        return self._like(self._native.of_rows(np.atleast_1d(rows).tolist()))

    def __iter__(self) -> Iterator[SplatSet]:
        raise TypeError("splats are no sequence of objects: take their arrays, as splats.means")

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        raise TypeError("splats are no array: take their arrays, as splats.means")

    def __reduce__(self) -> tuple[Any, ...]:
        # As its file: rounded splats as the small one, which keeps them as they are.
        return _unpickled, (_pickled(self), self.seconds, self.stopped, self.psnr_db)

    def _like(self, native: _vgs.Splats) -> SplatSet:
        made = SplatSet(native)
        made.seconds, made.stopped = self.seconds, self.stopped
        return made

    def __repr__(self) -> str:
        intensities = self.intensities
        span = f", {intensities.min():.0f} to {intensities.max():.0f}" if len(self) else ""
        unit = " HU" if self.unit == "hu" and span else ""
        if coded := self._native.coded_count:
            span = f", {coded:,} coded voxels within {self.bound:g}{' HU' if self.unit == 'hu' else ''}" + span
        return f"<vgs.SplatSet {len(self):,} splats{span}{unit}, {self.form}>"

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows: a picture, where there is a device."""
        from ._render import png, render

        try:
            return png(render(self, size=(512, 512))) if len(self) else None
        except DeviceUnavailableError:
            return None

    def _grid_of(
        self, like: VolumeLike | None, spacing_mm: float | tuple[float, float, float] | None
    ) -> tuple[tuple[int, int, int], DoubleArray]:
        if like is not None and spacing_mm is not None:
            raise usage_error("a grid, and a spacing", help="give like= or spacing_mm=, not both")
        if like is not None:
            of = as_volume(like)
            if not of._oriented and isinstance(like, np.ndarray):
                raise usage_error("an array, which has no place", help="give its volume: vgs.Volume(array, affine)")
            return of.shape, of.affine
        if spacing_mm is not None:
            spacing = np.broadcast_to(np.asarray(spacing_mm, dtype=np.float64), 3)
            if not (np.isfinite(spacing).all() and (spacing > 0).all()):
                raise usage_error(f"a spacing of {spacing_mm} mm", help="give mm above 0")
            (i, j, k), affine = self._native.grid_around(spacing.tolist())
            return (i, j, k), affine
        if self.grid is None:
            raise usage_error("the grid of these splats is not known", help="give like= or spacing_mm=")
        return self.grid


def load(*paths: FileLike, volume: VolumeLike | None = None, roi: RoiLike | None = None) -> SplatSet:
    """Reads splats: .ply, .vgs, .spz, .sog, .glb. Several files become one set, whose labels are the files.

    Args:
        *paths: The files, as paths or as :func:`read` takes them.
        volume: The volume of a PLY of the paper's authors, which only that can place.
        roi: Its region.
    """
    if not paths:
        raise usage_error("no file", help="give the path of one or several files of splats")
    of = None if volume is None else as_volume(volume)
    region = None if of is None or roi is None else as_roi(roi, of)
    return SplatSet(
        _vgs.Splats.read(
            [as_file(path) for path in paths],
            None if of is None else of._native(),
            None if region is None else region._native,
        )
    )


def _pickled(splats: SplatSet) -> tuple[str, bytes]:
    ending = "vgs" if splats._native.rounded or splats.bound is not None else "ply"
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, f"splats.{ending}")
        splats.save(path)
        with open(path, "rb") as file:
            return ending, file.read()


def _unpickled(content: tuple[str, bytes], seconds: float | None, stopped: bool, psnr_db: float | None) -> SplatSet:
    ending, content_of_file = content
    splats = SplatSet(_vgs.Splats.read([(f"splats.{ending}", content_of_file)], None, None))
    splats.seconds, splats.stopped, splats.psnr_db = seconds, stopped, psnr_db
    return splats


def _arrays(
    means: npt.ArrayLike,
    scales: npt.ArrayLike,
    rotations: npt.ArrayLike,
    opacities: npt.ArrayLike,
    intensities: npt.ArrayLike,
    labels: npt.ArrayLike | None,
) -> dict[str, Any]:
    return {
        "means": np.ascontiguousarray(means, dtype=np.float64),
        "scales": np.ascontiguousarray(scales, dtype=np.float32),
        "rotations": np.ascontiguousarray(rotations, dtype=np.float32),
        "opacities": np.ascontiguousarray(opacities, dtype=np.float32),
        "intensities": np.ascontiguousarray(intensities, dtype=np.float32),
        "labels": None if labels is None else _bytes(labels),
    }


def _bytes(labels: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    found = np.asarray(labels)
    if found.dtype.kind not in "biu" or found.size and not (0 <= found.min() and found.max() <= 255):
        raise usage_error(f"labels of {found.dtype}, or beyond a byte", help="give whole numbers from 0 to 255")
    return np.ascontiguousarray(found, dtype=np.uint8)
