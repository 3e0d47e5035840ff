"""Tidy the floors that people draw; metres, y up."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from layoutrl.rooms.documents import MOST
from layoutrl.rooms.room import RoomError, without_narrow
from layoutrl.rooms.sources.fields import lengths

MIN_FLOOR_WIDTH = 0.18  # metres: narrower parts of a floor do not count
MAX_JOG = 0.04  # metres: smaller jogs of a floor's border are slips of the hand
LEAN = 1.0  # degrees: sides of a floor that lean less from an axis do so by a slip
MIN_ROOM_AREA = 1.0  # square metres: smaller areas that walls cut off or enclose are no rooms
MOST_CROSSING = 100  # corners: a border with more must not cross itself


def floor_of(points: Sequence[tuple[float, float]]) -> Polygon:
    """Return the floor that a ring of points bounds, in either direction; where it crosses itself, its largest part.

    Raises RoomError where the points bound no area, are too many or too far off, or where a ring of more than
    MOST_CROSSING crosses itself.
    """
    if len(points) > MOST:
        raise RoomError("outline", f"expected at most {MOST:,} corners; got {len(points):,}")
    for point in points:
        lengths(point)
    if len(points) < 3:
        raise RoomError("outline", f"expected three corners or more; got {len(points)}")
    polygon = Polygon(points)
    if len(points) > MOST_CROSSING and not polygon.is_valid:  # the more crossings, the longer mending takes
        raise RoomError("outline", "expected a border that does not cross itself")
    return polygons_in(shapely.make_valid(polygon))[0]


def tidy(floor: Polygon, walls: shapely.Geometry | None) -> list[Polygon]:
    """Return the parts of a floor that walls leave, without narrow strips and small jogs, the largest first.

    People trace thresholds of doors and jogs of a few centimetres, and one floor through a door frame, on both sides of
    a wall. Parts of at most MIN_ROOM_AREA are left out, but for the largest. Raises RoomError where nothing is left.
    """
    free = floor if walls is None else floor.difference(walls)
    first, *others = polygons_in(without_narrow(free, MIN_FLOOR_WIDTH))
    return [_straight(part) for part in (first, *(part for part in others if part.area > MIN_ROOM_AREA))]


def _straight(part: Polygon) -> Polygon:
    # Normalised first: a ring that starts at its lowest left point starts at a true corner.
    simple = part.normalize().simplify(MAX_JOG)
    straight = Polygon(_upright(simple.exterior.coords[:-1]), [h.coords for h in simple.interiors])
    return orient(straight if straight.is_valid else simple)


def polygons_in(shape: shapely.Geometry) -> list[Polygon]:
    """Return the parts of a floor, the largest first, without tiny ones. Raises RoomError where none is left."""
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, Polygon) and part.area > MIN_FLOOR_WIDTH**2]
    if not parts:
        raise RoomError("outline", "expected a floor; it has no area to stand on")
    return sorted(parts, key=lambda part: -part.area)


def _upright(ring: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the ring with sides that lean less than LEAN laid along an axis: cutting off a jog makes others lean."""
    corners = np.array(ring)
    for k in range(len(corners)):
        n = (k + 1) % len(corners)
        step = np.abs(corners[n] - corners[k])
        across = int(step.argmin())
        if step[across] < math.tan(math.radians(LEAN)) * step[1 - across]:
            corners[[k, n], across] = corners[[k, n], across].mean()
    return [(float(x), float(y)) for x, y in corners]
