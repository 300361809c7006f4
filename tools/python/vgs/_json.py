"""Arguments as JSON, for the native half."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ._errors import usage_error


def as_json(arguments: Mapping[str, Any]) -> str:
    """Returns arguments by name as a JSON object; numbers and arrays of NumPy become plain ones.

    Raises:
        UsageError: If one has a number that is not finite, or is of a type that no argument has.
    """
    words = []
    for name, value in arguments.items():
        try:
            words.append(f"{json.dumps(name)}:{json.dumps(value, default=_plain, allow_nan=False)}")
        except (TypeError, ValueError) as error:
            raise usage_error(f"{name} is {value!r}: {error}", help="give finite numbers") from None
    return "{" + ",".join(words) + "}"


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"not a number, a text or a list of these but {type(value).__name__}")
