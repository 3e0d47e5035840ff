"""Parse the JSON documents of houses and check the lengths in them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from layoutrl.rooms.documents import LARGEST, not_utf8
from layoutrl.rooms.room import RoomError


def loaded(text: bytes) -> Any:
    """Parse a JSON document. Raises RoomError where the text is not JSON."""
    try:
        return json.loads(text)
    except UnicodeDecodeError as error:
        raise not_utf8(error) from None
    except (ValueError, RecursionError) as error:  # also for brackets or digits without end
        reason = error.msg if isinstance(error, json.JSONDecodeError) else "numbers and nesting of a usual size"
        raise RoomError("text", f"expected whole JSON; {reason}") from None


def lengths(values: Iterable[Any]) -> tuple[float, ...]:
    """Return numbers of a document as floats, in metres. Raises RoomError as `length` does."""
    return tuple(map(length, values))


def length(number: Any) -> float:
    """Return a number of a document as a float, in metres.

    Raises RoomError unless it is a number of at most LARGEST in absolute value.
    """
    if isinstance(number, bool) or not isinstance(number, int | float) or not abs(number) <= LARGEST:
        raise RoomError("a number", f"expected a finite one of at most {LARGEST:g} (metres); got {_short(number)}")
    return float(number)


def _short(value: Any) -> str:
    return "a huge integer" if isinstance(value, int) else repr(value)[:40]
