"""Fitting."""

from __future__ import annotations

import json
import logging
from typing import Any

from . import _vgs
from ._bar import Progress, watched
from ._json import as_json
from ._splats import SplatSet
from ._volume import Labels, RoiLike, VolumeLike, as_roi, as_volume

#: The hyper-parameters by name: what each is, and its default. ``vgs fit --help`` lists the same, with ``-`` for ``_``.
SETTINGS: dict[str, tuple[str, Any]] = {key: (doc, json.loads(default)) for key, doc, default in _vgs.fit_settings()}


def fit(
    volume: VolumeLike,
    roi: RoiLike,
    *,
    quality: str | None = None,
    profile: str = "default",
    labels: Labels = None,
    progress: bool | Progress = True,
    rounded: bool = False,
    max_size: int | None = None,
    time_budget: float | None = None,
    device: str | int | None = None,
    **settings: Any,
) -> SplatSet:
    """Fits splats to the region of interest of a volume.

    The interpreter's lock is released meanwhile. Ctrl-C ends the fit with the splats that there are, and a warning;
    :attr:`SplatSet.stopped` is then true, which a loop over cases should look at. An error that was aimed at and is missed is
    a warning, too, of the logger ``vgs``. The same seed gives the same bits on the same device, and the bits of
    ``vgs fit``.

    Args:
        volume: A :class:`Volume`, a path, an image of nibabel or SimpleITK, or an array [i, j, k].
        roi: A :class:`Roi`; or a mask, as a path, an image or an array; or the bounds ``(low, high)`` of a threshold, HU.
        quality: ``"preview"``, ``"standard"`` (99 % of the voxels within about 30 HU), ``"fine"`` (15 HU) or ``"exact"``
            (6 HU). None: standard, unless another argument says how good, how many or how long.
        profile: Hyper-parameters to start from: ``"default"``, ``"vessels"``, ``"bones"``, ``"organs"``, ``"mr"``,
            ``"field"``, ``"paper"`` or ``"reference"``.
        labels: Which labels of a mask; see :meth:`Roi.from_mask`. Each splat keeps its label.
        progress: True: a bar on terminals and in notebooks. A callable is called a few times a second with a dictionary
            that has some of ``stage`` (text), ``share`` (of the stage, 0 to 1), ``iteration``, ``splats`` and
            ``psnr_db``; it stops the fit by returning False.
        rounded: True for splats that will be saved as .vgs, which rounds: they are rounded here and fitted again, as
            ``vgs fit -o NAME.vgs`` does. The result is a little nearer to the volume.
        max_size: Most bytes of the file: .vgs if ``rounded``, else .ply.
        time_budget: Seconds that the fit may take.
        device: Name or index of the Vulkan device; None: the best one. :func:`devices` lists them.
        **settings: Any hyper-parameter by name, as ``target_hu=20``, ``density=0.05``, ``iterations=300``, ``seed=1``;
            :data:`SETTINGS` lists all.

    Returns:
        The splats, in the space of the patient (mm RAS), with intensities in HU.

    Raises:
        UsageError: For an unknown argument, or one that cannot work; ``help`` names the nearest one.
        NothingToDoError: If the region is empty.
        DeviceUnavailableError: If there is no Vulkan 1.3 device; ``help`` says what to install.
        KeyboardInterrupt: If Ctrl-C comes before there are splats.

    Example:
        >>> ct = vgs.read("ct.nii.gz")
        >>> bones = vgs.fit(ct, (226, 3071), target_hu=30)
        >>> bones.save("bones.ply")
    """
    of = as_volume(volume)
    region = as_roi(roi, of, labels)
    with watched(progress, "preparing the fit") as (watch, close):
        native, told = _vgs.fit(
            of._native(),
            region._native,
            profile=profile,
            quality=quality,
            values=as_json(settings),
            rounded=rounded,
            max_size=max_size,
            time_budget=time_budget,
            device=None if device is None else str(device),
            watch=watch,
        )
        splats = SplatSet(native)
        splats.seconds, splats.stopped = told["seconds"], told["stopped"]
        close(f"{len(splats):,} splats, {told['iterations']} iterations in {told['seconds']:.1f} s")
    if splats.stopped:
        logging.getLogger("vgs").warning("the fit was stopped after %d iterations", told["iterations"])
    return splats


def code(volume: VolumeLike, roi: RoiLike, *, bound: float | None = None, labels: Labels = None) -> SplatSet:
    """Codes the region of interest of a volume in place of splats: no voxel is off by more than a bound.

    It takes a second where a fit takes a minute, and is shown, measured and rasterized as a fit is; .vgs files hold it,
    and pages. There are no splats in it, so its arrays are empty.

    Args:
        volume: A :class:`Volume`, a path, an image of nibabel or SimpleITK, or an array [i, j, k].
        roi: As in :func:`fit`; not soft.
        bound: How far a voxel may be off, in the unit of the volume; 0 keeps whole numbers as they are. None: 30 HU, or
            without HU 1 % of the range of the region.
        labels: As in :func:`fit`.

    Returns:
        The coded region, in the space of the patient (mm RAS).

    Raises:
        UsageError: For a soft mask, or a bound that cannot be kept.
        NothingToDoError: If the region is empty.

    Example:
        >>> vgs.code("ct.nii.gz", "bones.nii.gz", bound=15).save("bones.vgs")
    """
    of = as_volume(volume)
    return SplatSet(_vgs.code(of._native(), as_roi(roi, of, labels)._native, bound))
