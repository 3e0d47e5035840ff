"""Units of lengths of rooms in JSON: metres, centimetres, millimetres, inches or feet, as the user says.

If the user does not, metres, centimetres and millimetres are told apart by the width of doors, else by the size of
rooms and their openings. Inches and feet are not: a door of 36 inches may be one of 36 cm, and a room of 12 feet one of
12 m.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from math import inf
from statistics import median
from typing import Any

from layoutrl.rooms.room import RoomError

UNITS = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1 / 0.0254, "ft": 1 / 0.3048}  # in a metre
LONGEST_ROOM_SIDE = {"m": 60.0, "cm": 1300.0}  # side of a room, by unit: no room is below 1.3 m, few are above 13 m
# Of the narrowest door or window, by unit: that of most rooms is between 0.3 and 3 m.
MAX_NARROWEST_OPENING = {"m": 8.0, "cm": 300.0}
DOOR = (0.6, 2.0)  # metres: the width of most doors
INCHES = (20.0, 45.0)  # the width of most doors in inches; in centimetres nobody fits through
LENGTHS = ("outline", "holes", "walls", "doors", "windows", "furniture", "polygon", "center", "size")
MEASURED = re.compile("outline|holes|polygon|center|size")  # of a field of lengths


def unit_of(documents: Iterable[Any]) -> str:
    """Return the unit that most rooms of a file seem to have: m, cm or mm; m where none tells it."""
    return _most(_guess(document) for document in documents)


def _most(told: Iterable[str | None]) -> str:
    votes = Counter(unit for unit in told if unit)
    return votes.most_common(1)[0][0] if votes else "m"


def unit_line(unit: str, documents: Sequence[Any]) -> str:
    """Return a line for the user with the unit that was inferred, and from what: doors or the size of rooms.

    Doors are named where the size of rooms would tell another unit. Where they are as narrow in cm as most are in
    inches, the line says so.
    """
    by_doors = unit == unit_of(documents) != _most(_guess(document, by_doors=False) for document in documents)
    told = "doors are wide" if by_doors else "rooms are large"
    line = f"lengths are read as {unit}, as {told} (unit=m if they are)"
    widths = [width for document in documents for width in _door_widths(document)]
    if unit != "cm" or not widths or not INCHES[0] <= median(widths) <= INCHES[1]:
        return line
    return f"{line}; doors are {median(widths):.0f} cm wide then (unit=in if lengths are inches)"


def read_as(unit: str, error: RoomError) -> str:
    """Return the end of a message about lengths that were turned into metres; nothing for metres and other messages."""
    about = unit != "m" and MEASURED.search(error.field) and not error.problem.startswith("missing")
    return f" (lengths were read as {unit})" if about else ""


def _door_widths(document: Any) -> list[float]:
    """Return the widths of the doors of a room's document, in its own unit; none if it is no room."""
    try:
        return [float(_extent(door["polygon"])) for door in document["doors"]]
    except (LookupError, TypeError, ValueError, ArithmeticError):
        return []


def _guess(document: Any, by_doors: bool = True) -> str | None:
    """Return the unit of a room's document, m, cm or mm; None if it is no room.

    It is the first in which its median door is as wide as a DOOR and the room no narrower than the least of these.
    Where there is none, or without `by_doors`, it is the first in which the room is no longer than LONGEST_ROOM_SIDE or
    its narrowest opening no wider than MAX_NARROWEST_OPENING, else mm.
    """
    try:
        across, side = sorted(_extents(document["outline"]))
        if doors := by_doors and _door_widths(document):
            for unit in ("m", "cm", "mm"):
                if DOOR[0] <= median(doors) / UNITS[unit] <= DOOR[1] and across / UNITS[unit] >= DOOR[0]:
                    return unit
        if side <= LONGEST_ROOM_SIDE["m"]:
            return "m"
        widths = [_extent(door["polygon"]) for kind in ("doors", "windows") for door in document[kind]]
        narrowest = min(widths, default=inf)
        limits = ((unit, LONGEST_ROOM_SIDE[unit], widest) for unit, widest in MAX_NARROWEST_OPENING.items())
        return next((unit for unit, longest, widest in limits if side <= longest or narrowest <= widest), "mm")
    except (LookupError, TypeError, ValueError, ArithmeticError):  # no room: it is left out later, with the reason
        return None


def _extent(ring: Any) -> float:
    return max(_extents(ring))


def _extents(ring: Any) -> list[float]:
    """Return the extents of a ring along x and along y."""
    return [max(axis) - min(axis) for axis in zip(*ring, strict=True)]


def in_metres(document: Any, per_metre: float) -> Any:
    """Return a document with its lengths in metres; all else is unchanged."""
    if per_metre == 1 or not isinstance(document, dict):
        return document
    scaled = {name: _divided(value, per_metre) for name, value in document.items() if name in LENGTHS}
    return document | scaled


def _divided(value: Any, by: float, depth: int = 4) -> Any:
    """Return a value with its numbers divided, in lists and the LENGTHS of objects, as deep as a room has them."""
    if isinstance(value, list) and depth:
        return [_divided(each, by, depth - 1) for each in value]
    if isinstance(value, dict) and depth:
        return {name: _divided(each, by, depth - 1) if name in LENGTHS else each for name, each in value.items()}
    try:
        return value / by if isinstance(value, int | float) and not isinstance(value, bool) else value
    except OverflowError:  # of an integer, which is refused later
        return value
