"""Pictures."""

from __future__ import annotations

import numbers
import os
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _vgs
from ._errors import usage_error
from ._json import as_json
from ._look import Numbers, Objects, Points, floats, look, number
from ._splats import SplatSet, load
from ._volume import RoiLike, Volume, VolumeLike, as_roi, as_volume


@dataclass(frozen=True)
class Camera:
    """A camera in the space of the patient.

    Attributes:
        eye_mm: Position of the eye, mm RAS.
        target_mm: Point in the middle of the picture, mm RAS.
        up: Direction that is upwards in the picture.
        fov: Angle from the upper to the lower edge, degrees.
    """

    eye_mm: Numbers
    target_mm: Numbers
    up: Numbers = (0.0, 0.0, 1.0)
    fov: float = 30.0

    @staticmethod
    def from_matrix(world_from_camera: npt.ArrayLike, fov: float = 30.0) -> Camera:
        """Returns the camera of a 4 x 4 pose: mm RAS from the camera's axes x to the right, y up, z to the viewer, as in
        OpenGL and VTK."""
        try:
            matrix = np.asarray(world_from_camera, dtype=np.float64)
        except (TypeError, ValueError):
            matrix = np.zeros(0)
        if matrix.shape != (4, 4):
            raise usage_error(f"a camera that is {world_from_camera!r}", help="a side, a vgs.Camera or a 4 x 4 matrix")
        eye = matrix[:3, 3]
        return Camera(eye.tolist(), (eye - matrix[:3, 2]).tolist(), matrix[:3, 1].tolist(), fov)


def render(
    what: SplatSet | VolumeLike,
    *,
    tf: str | os.PathLike[str] | Points | None = None,
    camera: str | Camera | npt.NDArray[Any] = "anterior",
    size: Sequence[int] = (1024, 1024),
    roi: RoiLike | None = None,
    mode: str | None = None,
    background: str | tuple[float, float, float] | None = "black",
    fov: float | None = None,
    zoom: float = 1.0,
    tf_shift: float = 0.0,
    shade: bool | None = None,
    occlusion: float | None = None,
    light: str | tuple[float, float] | None = None,
    fill_light: float = 0.0,
    box: tuple[Numbers, Numbers] | None = None,
    planes: Iterable[tuple[Numbers, float]] = (),
    objects: Objects | None = None,
    hide: str | int | Iterable[str | int] = (),
    step: float | None = None,
    as_float: bool = False,
    device: str | int | None = None,
) -> npt.NDArray[Any]:
    """Renders splats, or a volume, through a transfer function.

    Args:
        what: A :class:`SplatSet`; or a volume, as of :func:`fit`. A path of splats (.ply, .vgs, .spz, .sog, .glb) is read.
        tf: A preset (:data:`TRANSFER_FUNCTIONS`), a file (.vp, .vp.json, .xml:NAME, ParaView's .json),
            ``"window:WIDTH,LEVEL"``, or control points. None: CT-Bone, or MR-Default without HU, or the first preset that
            shows these splats; several objects have one for the kind of each.
        camera: A side of the patient (``"anterior"``, ``"left"``, ``"anterior-left"``), a :class:`Camera`, or a 4 x 4 pose as
            of :meth:`Camera.from_matrix`.
        size: Width and height, pixels.
        roi: Of a volume, the region that is shown, as of :func:`fit`.
        mode: ``"volume"``, ``"decoded"``, ``"slab"``, ``"exact"`` or ``"alpha"``. None: the one that suits.
        background: ``"black"``, ``"white"``, ``"grey"``, ``"#rrggbb"``, red, green and blue from 0 to 1, or None for a
            transparent one.
        fov: Field of view from the upper to the lower edge, degrees, for a camera that is a side; None: 30.
        zoom: How near such a camera comes: 1 shows all, 2 half of it.
        tf_shift: Moves the transfer function along the intensities, HU.
        shade: Lights surfaces, or not; None: as the transfer function says.
        occlusion: Share of the light that is lost where all around is opaque, 0 to 1; None: as the transfer function says.
        light: Where the light comes from: degrees to the right and up from the viewer, ``"head"``, or a side of the
            patient. None: above the viewer's left shoulder.
        fill_light: Share of the light that comes from the other side, 0 to 0.5.
        box: Two corners, mm RAS: what lies outside is cut away.
        planes: Cutting planes: a normal and an offset, mm RAS; where normal · x < offset is cut away.
        objects: How objects are shown, by name, number or pattern: ``{"liver": {"colour": "#c03020", "opacity": 0.4},
            "rib_*": {"tf": "CT-Bone"}}``. ``colour`` is #rrggbb, ``opacity`` a factor from 0 to 1, ``tf`` a preset or a file.
        hide: Objects that are not shown, by name, number or pattern.
        step: Steps along a ray, voxels (modes volume and decoded) or standard deviations; None: those of a finished
            picture.
        as_float: True for float32, display-referred and not clipped, instead of uint8.
        device: As of :func:`fit`.

    Returns:
        [height, width, 3] over a background, [height, width, 4] without one: colours that are not premultiplied, and
        opacity. Colours are those of an sRGB picture, as VTK's and Slicer's.

    Example:
        >>> picture = vgs.render(bones, camera="anterior-left", tf="CT-Bones-Steep")
        >>> plt.imshow(picture)
    """
    splats, volume, region = _shown(what, roi)
    if not isinstance(camera, str) and (fov is not None or zoom != 1.0):
        raise usage_error(
            "fov or zoom, and a camera that has its own", help="give them for a side, or Camera(..., fov=)"
        )
    asked = {
        "size": [_whole("size", n) for n in size],
        "mode": mode,
        "look": look(tf, tf_shift, shade, occlusion, light, fill_light, box, planes, objects, hide),
        "camera": _camera(camera),
        "fov": None if fov is None else number("fov", fov),
        "zoom": number("zoom", zoom),
        "step": None if step is None else number("step", step),
    }
    behind = _background(background)
    picture = _vgs.render(
        as_json(asked),
        splats=splats,
        volume=volume,
        roi=region,
        device=None if device is None else str(device),
    )
    colours, opacity = picture[..., :3], picture[..., 3:]
    if behind is None:
        # Colours are premultiplied until here.
        colours = np.divide(colours, opacity, out=np.zeros_like(colours), where=opacity > 0)
        result = np.concatenate([colours, opacity], axis=2)
    else:
        result = colours + (1 - opacity) * np.array(behind, dtype=np.float32)
    if as_float:
        return result
    rounded: npt.NDArray[Any] = np.rint(np.clip(result, 0.0, 1.0) * 255.0).astype(np.uint8)
    return rounded


@dataclass(frozen=True)
class Difference:
    """How much two pictures differ.

    Attributes:
        psnr_db: Peak signal-to-noise ratio, dB; infinite for equal ones.
        ssim: Structural similarity, 1 for equal ones.
        flip: Mean of FLIP's map of visible differences, 0 for equal ones.
    """

    psnr_db: float
    ssim: float
    flip: float


def compare(a: npt.ArrayLike, b: npt.ArrayLike) -> Difference:
    """Compares two pictures [height, width, 3] of uint8, or of numbers from 0 to 1."""
    return Difference(**_vgs.compare_pictures(_picture(a), _picture(b)))


def png(picture: npt.NDArray[Any]) -> bytes:
    """Returns a picture of uint8, [height, width, 3 or 4], as the bytes of a PNG file."""
    height, width, channels = picture.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)
    head = struct.pack(">IIBBBBB", width, height, 8, 6 if channels == 4 else 2, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b"")]
    written = [
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(written)


def _shown(
    what: SplatSet | VolumeLike, roi: RoiLike | None
) -> tuple[_vgs.Splats | None, _vgs.Volume | None, _vgs.Roi | None]:
    if isinstance(what, (str, os.PathLike)) and str(what).lower().endswith((".ply", ".vgs", ".spz", ".sog", ".glb")):
        what = load(what)
    if isinstance(what, SplatSet):
        if roi is not None:
            raise usage_error("a region, and splats", help="splats are shown whole: choose with splats[...]")
        return what._native, None, None
    volume: Volume = as_volume(what)
    return None, volume._native(), None if roi is None else as_roi(roi, volume)._native


def _whole(name: str, value: Any) -> int:
    if isinstance(value, numbers.Integral) and int(value) >= 0:
        return int(value)
    raise usage_error(f"{name} has {value!r}", help="give whole numbers of pixels: (width, height)")


def _camera(camera: Any) -> Union[str, dict[str, Any]]:
    if isinstance(camera, str):
        return camera
    if not isinstance(camera, Camera):
        camera = Camera.from_matrix(camera)
    return {
        "eye_mm": floats(camera.eye_mm),
        "target_mm": floats(camera.target_mm),
        "up": floats(camera.up),
        "fov_deg": number("fov", camera.fov),
    }


def _background(background: str | tuple[float, float, float] | None) -> tuple[float, float, float] | None:
    if background is None:
        return None
    if not isinstance(background, str):
        red, green, blue = floats(background)
        if not all(0 <= part <= 1 for part in (red, green, blue)):
            raise usage_error(f"a background of {background}", help="give red, green and blue from 0 to 1")
        return red, green, blue
    named = {"black": 0.0, "white": 1.0, "grey": 0.5, "gray": 0.5}
    if background in named:
        grey = named[background]
        return grey, grey, grey
    try:
        red, green, blue = bytes.fromhex(background.removeprefix("#"))
    except ValueError:
        raise usage_error(f"no colour is called {background!r}", help="black, white, grey, #rrggbb, or None") from None
    return red / 255, green / 255, blue / 255


def _picture(picture: npt.ArrayLike) -> npt.NDArray[np.float32]:
    found = np.asarray(picture)
    if found.ndim != 3 or found.shape[2] not in (3, 4):
        raise usage_error(f"a picture of shape {found.shape}", help="give [height, width, 3]")
    scale = 255.0 if found.dtype.kind in "ui" else 1.0
    return np.ascontiguousarray(found[..., :3] / scale, dtype=np.float32)
