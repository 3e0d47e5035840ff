"""Briefs: rooms with a list of furniture that is to be placed in them.

A brief is a room in which some items have no center. If such an item has no rotation either, whoever furnishes the
room chooses one along the walls. A layout is the same room, with the same items in the same order, and their poses.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from layoutrl.rooms.clearances import angle_off, may_tuck, period
from layoutrl.rooms.room import Item, Point, Room

LEVEL = 1e-3  # degrees: directions closer than this count as one, a millimetre in 57 m

Pose = tuple[Point, float]  # centre in metres, and degrees


def brief_of(room: Room) -> Room:
    """Return the room with all of its furniture still to be placed: without centers, rotations and a target.

    Items are sorted by category, then by size, so that their order does not reveal the designer's. Nor does `tucked`
    reveal which chairs and stools stood under a table: if there is a desk or table, it is set for every chair that
    stood, and it is never set for anything else that stood.
    """
    told = [replace(item, tucked=item.tucked and item.center is None) for item in room.furniture]
    free = without_poses(told, range(len(told)))
    in_order = sorted(free, key=lambda item: (item.category, item.size, item.form, item.tucked))
    return replace(room, furniture=tuple(in_order), target=None)


def without_poses(items: Sequence[Item], those: Collection[int]) -> tuple[Item, ...]:
    """Return all items, those at the indices `those` to be placed anew: without center and rotation, not locked.

    A chair among those that had a center becomes `tucked` if there is a desk or table, since designs have chairs there.
    All others keep their `tucked`.
    """
    return tuple(
        replace(item, center=None, rotation=None, tucked=_may_stand_under(item, items), locked=False)
        if k in those
        else item
        for k, item in enumerate(items)
    )


def _may_stand_under(item: Item, items: Sequence[Item]) -> bool:
    return item.tucked or (item.center is not None and may_tuck(item, items))


def missing(room: Room) -> list[int]:
    """The indices of the items that are to be placed."""
    return [k for k, item in enumerate(room.furniture) if item.center is None]


def standing(room: Room) -> list[Item]:
    """The items that have a place."""
    return [item for item in room.furniture if item.center is not None]


def largest_first(room: Room) -> list[int]:
    """The indices of the items that are to be placed, the largest first, but tucked ones last."""
    items = room.furniture
    return sorted(missing(room), key=lambda k: (items[k].tucked, -math.prod(items[k].size)))


def facings(room: Room) -> tuple[float, float, float, float]:
    """Return the four rotations that items may have, in degrees: along most of the walls, and its quarter turns."""
    length: dict[float, float] = {}  # metres of wall, by direction in degrees modulo 90
    for (x0, y0), (x1, y1) in pairwise((*room.outline, room.outline[0])):
        along = math.degrees(math.atan2(y1 - y0, x1 - x0)) % 90
        near = min(length, key=lambda known: _apart(known, along), default=along)
        direction = near if _apart(near, along) < LEVEL else along
        length[direction] = length.get(direction, 0.0) + math.dist((x0, y0), (x1, y1))
    first = max(length, key=lambda known: length[known])
    first = 0.0 if _apart(first, 0.0) < LEVEL else first
    return first, first + 90, first + 180, first + 270


def upright(room: Room) -> tuple[Room, float]:
    """Return the room turned until most of its walls are parallel to the axes, and the degrees by which it leaned."""
    lean, *_ = facings(room)
    return (room.rotated(-lean) if lean else room), lean


def distinct_rotations(room: Room, item: Item) -> tuple[float, ...]:
    """Return the rotations, in degrees, in which an item looks different: its own if given, else along the walls."""
    if item.rotation is not None:
        return (item.rotation,)
    return facings(room)[: round(period(item) / 90)]


def _apart(one: float, other: float) -> float:
    return angle_off(one - other, 90.0)


def with_poses(brief: Room, poses: Mapping[int, Pose]) -> Room:
    """The brief with items at the poses given by their index; the others are left as they are."""
    items = list(brief.furniture)
    for k, (center, degrees) in poses.items():
        items[k] = replace(items[k], center=center, rotation=degrees)
    return replace(brief, furniture=tuple(items))


def categories_of(rooms: Iterable[Room], waiting: bool = True) -> list[str]:
    """The furniture categories of the rooms, sorted. Items without a place count only if they are `waiting` for one."""
    items = (item for room in rooms for item in room.furniture)
    return sorted({item.category for item in items if waiting or item.center is not None})
