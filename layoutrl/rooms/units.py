"""Lengths of rooms in JSON: metres, centimetres or millimetres, as a file says or as its rooms are large."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

UNITS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}  # in a metre
LONGEST = {"m": 60.0, "cm": 1300.0}  # side of a room: below 1.3 m none is one, above 13 m few are
WIDEST = {"m": 8.0, "cm": 300.0}  # door or window: the narrowest of a room is between 0.3 and 3 m
LENGTHS = ("outline", "holes", "walls", "doors", "windows", "furniture", "polygon", "center", "size")


def unit_of(documents: Iterable[Any]) -> str:
    """The unit of most rooms of a file."""
    votes = Counter(unit for document in documents if (unit := _guess(document)))
    return votes.most_common(1)[0][0] if votes else "m"


def _guess(document: Any) -> str | None:
    """The unit of a room: metres where it is no larger than a house, else by its doors, else by its own size."""
    try:
        side = _extent(document["outline"])
        if side <= LONGEST["m"]:
            return "m"
        widths = [_extent(door["polygon"]) for kind in ("doors", "windows") for door in document[kind]]
        limits = WIDEST if widths else LONGEST
        return next((unit for unit, limit in limits.items() if min(widths or [side]) <= limit), "mm")
    except (LookupError, TypeError, ValueError, ArithmeticError):  # no room; it is left out later, and said why
        return None


def _extent(ring: Any) -> float:
    return max(max(axis) - min(axis) for axis in zip(*ring, strict=True))


def in_metres(document: Any, per_metre: float) -> Any:
    """A document with its lengths in metres; what is no length is as it was."""
    if per_metre == 1 or not isinstance(document, dict):
        return document
    scaled = {name: _divided(value, per_metre) for name, value in document.items() if name in LENGTHS}
    return document | scaled


def _divided(value: Any, by: float, depth: int = 4) -> Any:
    """Numbers divided, in lists and in what has lengths by name, as deep as a room has them."""
    if isinstance(value, list) and depth:
        return [_divided(each, by, depth - 1) for each in value]
    if isinstance(value, dict):
        return {name: _divided(each, by) if name in LENGTHS else each for name, each in value.items()}
    try:
        return value / by if isinstance(value, int | float) and not isinstance(value, bool) else value
    except OverflowError:  # of an integer, which is refused later
        return value
