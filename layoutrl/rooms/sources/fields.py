"""Values of documents of houses: JSON, and lengths in it. Raises RoomError for what is none."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from layoutrl.rooms.documents import LARGEST
from layoutrl.rooms.room import RoomError


def loaded(text: bytes) -> Any:
    """A document of JSON. Raises RoomError for what is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:  # brackets or digits without end, too
        reason = error.msg if isinstance(error, json.JSONDecodeError) else "numbers and nesting of a usual size"
        raise RoomError("text", f"expected whole JSON; {reason}") from None


def lengths(values: Iterable[Any]) -> tuple[float, ...]:
    """Numbers of a document, metres. Raises RoomError for what is none, or is no length in a house."""
    return tuple(map(length, values))


def length(number: Any) -> float:
    """A number of a document, as `lengths` has them."""
    if isinstance(number, bool) or not isinstance(number, int | float) or not abs(number) <= LARGEST:
        raise RoomError("a number", f"expected a finite one of at most {LARGEST:g} (metres); got {_short(number)}")
    return float(number)


def _short(value: Any) -> str:
    return "a huge integer" if isinstance(value, int) else repr(value)[:40]
