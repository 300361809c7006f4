"""Splats with colours for other viewers."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable

from . import _vgs
from ._bar import Progress, watched
from ._json import as_json
from ._look import Numbers, Objects, Points, look
from ._splats import SplatSet


def bake(
    splats: SplatSet,
    *,
    tf: str | os.PathLike[str] | Points | None = None,
    tf_shift: float = 0.0,
    shade: bool | None = None,
    occlusion: float | None = None,
    light: str | tuple[float, float] | None = None,
    fill_light: float = 0.0,
    box: tuple[Numbers, Numbers] | None = None,
    planes: Iterable[tuple[Numbers, float]] = (),
    objects: Objects | None = None,
    hide: str | int | Iterable[str | int] = (),
    iterations: int | None = None,
    time_budget: float | None = None,
    max_splats: int | None = None,
    views: int | None = None,
    size: int | None = None,
    degree: int | None = None,
    seed: int = 0,
    progress: bool | Progress = True,
    device: str | int | None = None,
) -> SplatSet:
    """Bakes what a transfer function shows of splats into colours and opacities, for viewers that know no intensities.

    Other viewers then show what :func:`render` shows in mode ``"decoded"``, as near as splats of fixed colours come:
    :attr:`SplatSet.psnr_db` tells it. Ctrl-C ends it with the splats that there are, and a warning, as in :func:`fit`; the
    splats are those of ``vgs bake``, bit for bit.

    Args:
        splats: The splats, with HU. Keep them: baked ones have none.
        tf, tf_shift, shade, occlusion, light, fill_light, box, planes, objects, hide: As of :func:`render`.
        iterations: Steps, a picture each; None: 240. 0 for the colours that are found without pictures.
        time_budget: Seconds that the steps may take.
        max_splats: Most splats: of more the most important are kept, of fewer some are split where the pictures ask for
            it. None: twice as many as the transfer function shows.
        views: Pictures, all around, that the splats are fitted to; None: 96.
        size: Width and height of these pictures, pixels; None: 256. The splats are made for pictures of 1024 either way.
        degree: Degree of the harmonics by which colours depend on the direction, 0 to 3. None: 3 with a light that turns
            with the camera, 2 with one of the patient, else 0.
        seed: Seed of the order of the pictures.
        progress: As of :func:`fit`; a callable gets ``stage`` and ``share``.
        device: As of :func:`fit`.

    Returns:
        Splats with colours, which :meth:`SplatSet.save` writes as .ply, .spz, .sog or .glb.

    Raises:
        UsageError: For splats that have colours already, or coded voxels.
        NothingToDoError: If the transfer function shows none of the splats.
        KeyboardInterrupt: If Ctrl-C comes before there are splats.

    Example:
        >>> baked = vgs.bake(bones, tf="CT-Bones-Steep")
        >>> baked.save("bones.spz", live=bones)
    """
    asked = {
        "look": look(tf, tf_shift, shade, occlusion, light, fill_light, box, planes, objects, hide),
        "iterations": iterations,
        "time_budget": time_budget,
        "max_splats": max_splats,
        "views": views,
        "size": size,
        "degree": degree,
        "seed": seed,
    }
    with watched(progress, "preparing the pictures") as (watch, close):
        native, told = _vgs.bake(
            splats._native, as_json(asked), device=None if device is None else str(device), watch=watch
        )
        baked = SplatSet(native)
        baked.seconds, baked.stopped, baked.psnr_db = told["seconds"], told["stopped"], told["psnr_db"]
        close(f"{len(baked):,} splats, {told['iterations']} steps in {told['seconds']:.1f} s")
    if baked.stopped:
        logging.getLogger("vgs").warning("baking was stopped after %d steps", told["iterations"])
    return baked
