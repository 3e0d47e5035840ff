"""Build a room around a floor: its walls as drawn, doors and windows in them, and furniture; metres, y up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
import shapely
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.polygon import orient

from layoutrl.rooms.categories import OBSTACLE
from layoutrl.rooms.documents import room_from_dict
from layoutrl.rooms.room import (
    TOLERANCE,
    WALL_THICKNESS,
    Item,
    Ring,
    Room,
    along_and_through,
    is_drawn_before,
    rings,
    rotation,
    without_films,
)
from layoutrl.rooms.sources.floors import polygons_in

LINING = 0.06  # metres: the wall that is assumed at a side without one, where rooms are open to each other
NEAR = 0.1  # metres: walls that are no farther from a floor are its own
ACROSS = 0.12  # metres by which an opening is deepened on both sides before it is cut to the wall
MOST_WALLS = 40  # that are considered along one side
COVERS = 0.2  # the least share of the strip NEAR a side that is of its wall
LEAST = 0.01  # square metres: what reaches indoors through a wall by less is in nobody's way
SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)  # of a box that is cut to a room, the largest that fits
DIGITS = 4  # lengths are rounded to a tenth of a millimetre


@dataclass(frozen=True)
class Wall:
    """A wall as drawn, before openings are cut out of it; its thickness in metres."""

    body: Polygon
    thickness: float


@dataclass(frozen=True)
class DrawnOpening:
    """A door or window as drawn: its shape in plan, within some wall.

    `axis` is a line through it along the wall; None where the format does not say how the wall runs.
    """

    kind: Literal["door", "window"]
    shape: Polygon
    axis: LineString | None = None

    @cached_property
    def sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Its sides along the wall and through it, as vectors (2,) in metres."""
        return along_and_through(self.shape, self.axis)


def oblong(x: float, y: float, width: float, depth: float, degrees: float) -> Polygon:
    """A rectangle around (x, y), `width` along its own x, turned counter-clockwise."""
    return translate(rotate(box(-width / 2, -depth / 2, width / 2, depth / 2), degrees, origin=(0, 0)), x, y)


def room_of(
    room_id: str,
    room_type: str,
    floor: Polygon,
    walls: Sequence[Wall] | None,
    drawn_openings: Iterable[DrawnOpening],
    furniture: Sequence[Item],
    group: str,
) -> tuple[Room, dict[int, Item]]:
    """Return a room around a tidy floor, and the items of `furniture` that it holds, by index, as `cut_to` has them.

    `walls` are all that are near, of which each side takes the one along it; None where the format draws none. Those of
    `drawn_openings` that lie in its walls become its doors and windows. Raises RoomError where no room can be made.
    """
    floor = shapely.set_precision(floor, 10.0**-DIGITS)
    floor = orient(polygons_in(floor)[0])
    outline, holes = _ring(floor.exterior.coords), [_ring(hole.coords) for hole in floor.interiors]
    strips = _strips(outline, walls)
    band = shapely.union_all(strips).difference(Polygon(outline))
    openings: list[DrawnOpening] = []
    for drawn in drawn_openings:
        width = math.hypot(*drawn.sides[0])
        for ring in rings(_drawn_out(drawn).intersection(band)):
            shape = Polygon(ring)
            beside = shape.buffer(TOLERANCE).intersection(floor.exterior).length
            if beside > width / 2 and not is_drawn_before(shape, [other.shape for other in openings]):
                openings.append(DrawnOpening(drawn.kind, shape))
    document: dict[str, object] = {
        "id": room_id,
        "room_type": room_type,
        "outline": [list(corner) for corner in outline],
        "holes": [[list(corner) for corner in hole] for hole in holes],
        "walls": [{"polygon": wall} for wall in _walls(strips, floor, openings)],
        "doors": [{"polygon": _list(opening.shape)} for opening in openings if opening.kind == "door"],
        "windows": [{"polygon": _list(opening.shape)} for opening in openings if opening.kind == "window"],
        "furniture": [],
        "group": group,
    }
    bare = room_from_dict(document)
    held = {k: kept for k, item in enumerate(furniture) if (kept := cut_to(bare, item))}
    return room_from_dict(document | {"furniture": [_document(item) for item in held.values()]}), held


def cut_to(room: Room, item: Item) -> Item | None:
    """Return the item if it is to be placed or lies in the room, else the part of it that is indoors, as an obstacle.

    People draw furniture a few centimetres through a wall: nothing else may stand there. None where next to nothing of
    it is indoors.
    """
    if item.center is None or room.holds(item):
        return item
    indoors = rotate(item.footprint.intersection(room.indoor), -item.degrees, origin=(0, 0))
    if indoors.area < LEAST:
        return None
    middle = np.array(indoors.representative_point().coords[0])
    low, high = np.array(indoors.bounds).reshape(2, 2)
    for share in SHARES:  # if it is at an angle to the wall, a corner of its box may still reach through
        start, end = middle + share * (low - middle), middle + share * (high - middle)
        x, y = rotation(item.degrees) @ ((start + end) / 2)
        depth, width = (end - start).tolist()
        part = Item(OBSTACLE, (depth, width), (float(x), float(y)), item.rotation, tucked=item.tucked)
        if min(part.size) > TOLERANCE and room.holds(part, 0.0):
            return part
    return None


def _strips(outline: Ring, walls: Sequence[Wall] | None) -> list[Polygon]:
    """Return for each side of an outline the wall outside it, as thick as drawn there, extended round both corners."""
    sides = list(pairwise((*outline, outline[0])))
    bodies = shapely.STRtree([wall.body for wall in walls or ()])
    depths = [WALL_THICKNESS if walls is None else _depth(*side, walls, bodies) for side in sides]
    strips = []
    for k, ((x0, y0), (x1, y1)) in enumerate(sides):
        length = math.dist((x0, y0), (x1, y1))
        ax, ay = (x1 - x0) / length, (y1 - y0) / length
        before, depth, after = depths[k - 1], depths[k], depths[(k + 1) % len(depths)]
        start, end = (x0 - ax * before, y0 - ay * before), (x1 + ax * after, y1 + ay * after)
        out = (ay * depth, -ax * depth)  # on the right of a counter-clockwise side
        strips.append(Polygon((start, (start[0] + out[0], start[1] + out[1]), (end[0] + out[0], end[1] + out[1]), end)))
    return strips


def _depth(
    start: tuple[float, float], end: tuple[float, float], walls: Sequence[Wall], bodies: shapely.STRtree
) -> float:
    """Return how far the wall along most of a side reaches outwards, in metres; LINING where there is none."""
    (x0, y0), (x1, y1) = start, end
    length = math.dist(start, end)
    out = ((y1 - y0) / length * NEAR, (x0 - x1) / length * NEAR)
    strip = Polygon((start, (x0 + out[0], y0 + out[1]), (x1 + out[0], y1 + out[1]), end))
    near = [walls[k] for k in sorted(bodies.query(strip, predicate="intersects"))[:MOST_WALLS]]
    shared = [(wall.body.intersection(strip).area, wall) for wall in near]
    area, wall = max(shared, key=lambda found: found[0], default=(0.0, None))
    if wall is None or area < COVERS * strip.area:
        return LINING
    middle = shapely.LineString((start, end))
    return max(LINING, wall.body.intersection(strip).distance(middle) + wall.thickness)


def _walls(strips: list[Polygon], floor: Polygon, openings: list[DrawnOpening]) -> list[list[list[float]]]:
    """Return the walls: strips without floor, openings and earlier strips, and columns, which are solid."""
    taken = shapely.union_all([Polygon(floor.exterior), *(opening.shape for opening in openings)])
    walls = [[list(corner) for corner in hole.coords[:-1]] for hole in floor.interiors]
    for strip in strips:
        kept = without_films(strip.difference(taken), 1e-6)
        walls += [[list(corner) for corner in ring] for ring in rings(kept)]
        taken = taken.union(strip)
    return walls


def _drawn_out(opening: DrawnOpening) -> Polygon:
    """An opening, deeper by ACROSS on both sides."""
    along, through = opening.sides
    degrees = math.degrees(math.atan2(along[1], along[0]))
    center = opening.shape.minimum_rotated_rectangle.centroid
    return oblong(center.x, center.y, math.hypot(*along), math.hypot(*through) + 2 * ACROSS, degrees)


def _document(item: Item) -> dict[str, object]:
    entry: dict[str, object] = {
        "category": item.category,
        "size": [round(side, DIGITS) for side in item.size],
        "shape": item.form,
        "tucked": item.tucked,
    }
    if item.center is not None and item.rotation is not None:
        entry |= {
            "center": [round(c, DIGITS) for c in item.center],
            "rotation": round(item.rotation, DIGITS) % 360,
        }
    return entry


def _ring(coords: Iterable[Sequence[float]]) -> Ring:
    return tuple((round(x, DIGITS), round(y, DIGITS)) for x, y in list(coords)[:-1])


def _list(shape: Polygon) -> list[list[float]]:
    return [list(corner) for corner in shape.exterior.coords[:-1]]
