"""How splats and volumes are shown: transfer functions, light, objects and cuts."""

from __future__ import annotations

import numbers
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _vgs
from ._errors import usage_error

#: Names of the transfer functions of vgs: what each is for, and the unit of its intensities.
TRANSFER_FUNCTIONS: dict[str, tuple[str, str]] = {
    name: (about, unit) for name, about, unit in _vgs.transfer_functions()
}

#: Three numbers.
Numbers = Union[Sequence[float], npt.NDArray[Any]]
#: How objects are shown, by name or number.
Objects = Union[
    Mapping[str, Mapping[str, Any]], Mapping[int, Mapping[str, Any]], Mapping[Union[str, int], Mapping[str, Any]]
]
#: Control points of a transfer function: intensity, (red, green, blue) and opacity per mm, 0 to 1.
Points = Sequence[tuple[float, tuple[float, float, float], float]]


def look(
    tf: str | os.PathLike[str] | Points | None,
    tf_shift: float,
    shade: bool | None,
    occlusion: float | None,
    light: str | tuple[float, float] | None,
    fill_light: float,
    box: tuple[Numbers, Numbers] | None,
    planes: Iterable[tuple[Numbers, float]],
    objects: Objects | None,
    hide: str | int | Iterable[str | int],
) -> dict[str, Any]:
    """Returns the look that the arguments of :func:`vgs.render` describe, for the native half."""
    hidden = [hide] if isinstance(hide, (str, int)) else list(hide)
    return {
        "tf": _function(tf),
        "tf_shift": number("tf_shift", tf_shift),
        "shade": None if shade is None else bool(shade),
        "occlusion": None if occlusion is None else number("occlusion", occlusion),
        "light": light if light is None or isinstance(light, str) else list(light),
        "fill_light": number("fill_light", fill_light),
        "box_mm": None if box is None else [floats(corner) for corner in box],
        "planes": [[floats(normal), float(offset)] for normal, offset in planes],
        "objects": [_object(name, how) for name, how in (objects or {}).items()],
        "hide": [str(name) for name in hidden],
    }


def number(name: str, value: Any) -> float:
    """Returns a finite number."""
    if isinstance(value, numbers.Real) and np.isfinite(float(value)):
        return float(value)
    raise usage_error(f"{name} is {value!r}", help="give a finite number")


def floats(three: Numbers) -> list[float]:
    """Returns a place or a direction."""
    found = [number("a coordinate", n) for n in three]
    if len(found) != 3:
        raise usage_error(f"{found}, where a place or a direction is needed", help="give three numbers")
    return found


def _function(tf: str | os.PathLike[str] | Points | None) -> Union[str, dict[str, Any], None]:
    if tf is None or isinstance(tf, str):
        return tf
    if isinstance(tf, os.PathLike):
        return os.fspath(tf)
    return {
        "points": [
            [number("an intensity", value), *floats(colour), number("an opacity", opacity)]
            for value, colour, opacity in tf
        ]
    }


def _object(name: str | int, how: Mapping[str, Any]) -> str:
    words = [key if value is True else f"{key}={value}" for key, value in how.items() if value is not False]
    return f"{name}:{','.join(words)}"
