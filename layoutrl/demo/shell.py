"""Geometry for the page: how doors swing, rooms with an opening more or less, and gaps beside items."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, Point

from layoutrl import InputError
from layoutrl.rooms.clearances import RAISED
from layoutrl.rooms.doors import Leaf, drawn_leaves
from layoutrl.rooms.room import TOLERANCE, WALL_THICKNESS, Opening, Room, rings

NARROWEST, WIDEST = 0.3, 10.0  # metres, of a door or window
DEEPEST = 1.0  # metres: a wall that is deeper here is taken for one of WALL_THICKNESS
FAR = 1000.0  # metres, beyond all rooms
LEAST = 0.005  # metres: shorter distances are not drawn

Segment = tuple[tuple[float, float], tuple[float, float]]


def swings(room: Room) -> list[str]:
    """The open leaf of each door and the quarter of a circle that it sweeps, as a path of SVG in metres, y up.

    A door without a leaf has an empty path.
    """
    return [_path(leaf) if leaf else "" for leaf in drawn_leaves(room)]


def _path(leaf: Leaf) -> str:
    (x0, y0), (x1, y1) = leaf.open - leaf.hinge, leaf.shut - leaf.hinge
    width = math.hypot(x0, y0)
    counter_clockwise = int(x0 * y1 > x1 * y0)
    return f"M{_xy(leaf.hinge)}L{_xy(leaf.open)}A{width:g} {width:g} 0 0 {counter_clockwise} {_xy(leaf.shut)}"


def _xy(point: np.ndarray | tuple[float, float]) -> str:
    return "{:.4f} {:.4f}".format(*np.round(point, 4) + 0.0)  # no minus before zeros


def with_opening(room: Room, kind: str, at: tuple[float, float], width: float) -> Room:
    """Return the room with a further door or window in the wall nearest to a point. Raises InputError if none fits."""
    if kind not in ("door", "window"):
        raise InputError(f"kind: expected door or window; got {kind}")
    if not NARROWEST <= width <= WIDEST:
        raise InputError(f"width: expected {NARROWEST:g} to {WIDEST:g} metres; got {width:g}")
    side = min(
        pairwise((*room.outline, room.outline[0])), key=lambda side: shapely.distance(LineString(side), Point(at))
    )
    length = math.dist(*side)
    if length < width:
        raise InputError(f"{kind}: expected a wall of {width:g} m or more; this one is {length:.2f} m long")
    start, along = np.array(side[0]), np.subtract(side[1], side[0]) / length
    out = np.array([along[1], -along[0]])  # the outline is counter-clockwise
    there = float(np.clip(np.dot(np.subtract(at, start), along), width / 2, length - width / 2))
    middle = start + round(there, 2) * along
    through = shapely.intersection(LineString([middle, middle + FAR * out]), room.envelope)
    parts = [part for part in shapely.get_parts(through) if part.distance(Point(middle)) < TOLERANCE]
    depth = min((part.length for part in parts), default=0.0)
    depth = depth if TOLERANCE < depth <= DEEPEST else WALL_THICKNESS
    half = width / 2 * along
    corners = (middle - half, middle - half + depth * out, middle + half + depth * out, middle + half)
    opening = Opening(kind, tuple((round(float(x), 6), round(float(y), 6)) for x, y in corners))  # type: ignore[arg-type]
    if any(opening.shape.intersection(other.shape).area > TOLERANCE**2 for other in room.openings):
        raise InputError(f"{kind}: expected a place without a door or window; there is one already")
    cut = tuple(part for wall in room.wall_shapes for part in rings(wall.difference(opening.shape)))
    doors = (*room.doors, opening) if kind == "door" else room.doors
    windows = (*room.windows, opening) if kind == "window" else room.windows
    return replace(room, walls=cut, openings=(*doors, *windows))


def without_opening(room: Room, index: int) -> Room:
    """The room with wall where one of its openings was."""
    walls = (*room.walls, room.openings[index].polygon)
    return replace(room, walls=walls, openings=room.openings[:index] + room.openings[index + 1 :])


def gaps(room: Room, index: int) -> list[tuple[Segment, float]]:
    """Return segments from the middle of each side of an item straight to the next wall or item, and their metres."""
    item = room.furniture[index]
    if item.center is None:
        return []
    others = [
        other.footprint
        for k, other in enumerate(room.furniture)
        if k != index and other.center is not None and other.category not in RAISED
    ]
    found = []
    for quarter in range(4):
        angle = math.radians(item.degrees + 90 * quarter)
        way = np.array([math.cos(angle), math.sin(angle)])
        start = item.center + way * item.size[quarter % 2] / 2
        if not room.indoor.buffer(TOLERANCE).covers(Point(start)):
            continue
        solid = [shape for shape in others if not shape.buffer(-TOLERANCE).covers(Point(start))]
        barriers = shapely.union_all([room.indoor.boundary, *solid])
        met = shapely.intersection(LineString([start, start + FAR * way]), barriers)
        metres = float(shapely.distance(Point(start), met))
        if metres > LEAST:
            (x0, y0), (x1, y1) = start.tolist(), (start + metres * way).tolist()
            found.append((((x0, y0), (x1, y1)), metres))
    return found
