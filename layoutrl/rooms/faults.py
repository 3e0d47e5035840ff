"""Faults of the items in whole layouts, computed from polygons, for all rooms at once.

Drawing noise is no fault: an item that overlaps another, or is outside or in the way, by TOLERANCE (a centimetre) or
less does not count, and a passage may be a centimetre too narrow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
import shapely

from layoutrl.rooms.clearances import HOSTS, RAISED, RUGS, front_depth, may_stand_before, period
from layoutrl.rooms.doors import (
    bars,
    empty_floor,
    entrance,
    kept_free,
    way_width,
    with_a_free_door_first,
    without_furniture,
)
from layoutrl.rooms.room import CIRCLE_SEGMENTS, TOLERANCE, Room

ROUNDING = 1e-9  # square metres: smaller areas are rounding
MISSING = "not placed"  # `faults` gives such an item no other fault
OVERLAPS, OUTSIDE, BLOCKS = "overlaps", "outside", "blocks an opening"
OUT_OF_REACH, FRONT_NOT_FREE = "out of reach", "front not free"
FAULTS = (MISSING, OVERLAPS, OUTSIDE, BLOCKS, OUT_OF_REACH, FRONT_NOT_FREE)
ILL_PLACED = frozenset({MISSING, OVERLAPS, OUTSIDE, BLOCKS})  # what nobody can leave so: it is no better than no place
Fault = tuple[int, str]  # index of an item in its room, what is wrong with it
ALONG_WALLS = 0.15  # metres: what lies so near to walls, as a radiator, takes no floor before an item; unsourced
CORNERS = np.array([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])


def faults(layout: Room) -> list[Fault]:
    """Return (index of the item, name of the fault) of all FAULTS of a layout, item by item.

    An item that is not placed has MISSING alone.
    """
    return faults_of_all([layout])[0]


def faults_of_all(layouts: Sequence[Room]) -> list[list[Fault]]:
    """The `faults` of each layout, in a tenth of the time that they take one by one.

    Where furniture stands before the `entrance` of a layout, one enters by the first door that is free.
    """
    return faults_from_entrance([with_a_free_door_first(layout) for layout in layouts])


def faults_from_entrance(layouts: Sequence[Room]) -> list[list[Fault]]:
    """The `faults` of each layout, entered by its `entrance` whatever stands before it, as in the measures."""
    items = Items.of(layouts)
    found = item_faults(layouts, items)
    return by_layout({n: faulty & (items.placed | (n == MISSING)) for n, faulty in found.items()}, items, len(layouts))


def by_layout(found: dict[str, np.ndarray], items: Items, count: int) -> list[list[Fault]]:
    """Return what is found of the items of each layout (count,), item by item; `found` are arrays (N,) by its name."""
    names, first = list(found), np.searchsorted(items.room, np.arange(count)).tolist()
    lists: list[list[Fault]] = [[] for _ in first]
    for n, name in np.argwhere(np.stack(list(found.values()), 1)).tolist():
        layout = int(items.room[n])
        lists[layout].append((n - first[layout], names[name]))
    return lists


def new_faults(wrong: Sequence[Fault], before: Sequence[Fault]) -> list[Fault]:
    """Return the faults that a layout has but did not have `before` anything was placed; MISSING always counts."""
    return [(k, fault) for k, fault in wrong if fault == MISSING or (k, fault) not in before]


@dataclass(frozen=True)
class Items:
    """All N items of B layouts, one layout after the other."""

    room: np.ndarray  # (N,), index of the layout
    category: np.ndarray  # (N,)
    size: np.ndarray  # (N, 2)
    center: np.ndarray  # (N, 2), NaN where it is not placed
    degrees: np.ndarray  # (N,), NaN where it is to be chosen
    round: np.ndarray  # (N,)
    tucked: np.ndarray  # (N,)
    bars: np.ndarray  # (N,), whether it stops a door that meets it, as in `doors.bars`
    period: np.ndarray  # (N,), degrees, as in `clearances.period`
    front: np.ndarray  # (N,), metres, as in `clearances.front_depth`

    @classmethod
    def of(cls, layouts: Sequence[Room]) -> Items:
        """All items of these layouts."""
        items = list(chain.from_iterable(layout.furniture for layout in layouts))
        return cls(
            np.repeat(np.arange(len(layouts)), [len(layout.furniture) for layout in layouts]),
            np.array([item.category for item in items], dtype=str),
            np.array([item.size for item in items], dtype=float).reshape(-1, 2),
            np.array([item.center or (np.nan, np.nan) for item in items], dtype=float).reshape(-1, 2),
            np.array([np.nan if item.rotation is None else item.rotation for item in items], dtype=float),
            np.array([item.form == "circle" for item in items], dtype=bool),
            np.array([item.tucked for item in items], dtype=bool),
            np.array([bars(item) for item in items], dtype=bool),
            np.array([period(item) for item in items], dtype=float),
            np.array([front_depth(item) for item in items], dtype=float),
        )

    @cached_property
    def footprint(self) -> np.ndarray:
        """The polygon of each item, as Item.footprint: (N,), None where it is not placed."""
        return self.grown(0)

    def grown(self, by: float) -> np.ndarray:
        """Return the footprints (N,), grown by so many metres on all sides, or shrunk by a negative number."""
        shape = rectangles(self.center, self.size + 2 * by, self.degrees)
        shape[self.round] = shapely.buffer(
            shapely.points(self.center[self.round]), self.size[self.round, 0] / 2 + by, quad_segs=CIRCLE_SEGMENTS
        )
        shape[~self.placed] = None
        return shape

    @cached_property
    def placed(self) -> np.ndarray:
        """Whether an item has a center and, unless it is round, a rotation: (N,)."""
        return ~np.isnan(self.center[:, 0]) & (self.round | ~np.isnan(self.degrees))

    @cached_property
    def hosts(self) -> np.ndarray:
        """Whether tucked items may stand under an item: (N,)."""
        return np.isin(self.category, list(HOSTS)) & ~self.tucked


def rectangles(center: np.ndarray, size: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Return rectangles (N,) with these centres (N, 2), sizes (N, 2) along their own axes, and degrees (N,).

    None where a centre or the degrees are NaN, or a size is not above zero.
    """
    # Rounded, since a sine of 180 degrees is not quite 0.
    cosine, sine = (np.round(f(np.radians(degrees)), 15)[:, None] for f in (np.cos, np.sin))
    x, y = np.moveaxis(CORNERS * size[:, None], 2, 0)
    corners = np.stack([cosine * x - sine * y, sine * x + cosine * y], -1) + center[:, None]
    known = ~np.isnan(corners).any((1, 2)) & (size > 0).all(1)
    result = np.full(len(center), None)
    result[known] = shapely.polygons(corners[known])
    return result


def item_faults(layouts: Sequence[Room], items: Items) -> dict[str, np.ndarray]:
    """Return which items have each of the FAULTS: arrays (N,) by its name.

    An item that is not placed is MISSING and OUT_OF_REACH, and FRONT_NOT_FREE if it keeps floor free; it has no other.
    """
    found = (
        ~items.placed,
        overlapping(items),
        standing_outside(layouts, items),
        blocking(layouts, items.room, items.category, items.footprint),
        ~within_reach(layouts, items),
        ~free_fronts(layouts, items, items.front),
    )
    return dict(zip(FAULTS, found, strict=True))


def overlapping(items: Items) -> np.ndarray:
    """Which items are more than 1 cm deep in another with which they may not share the floor: (N,)."""
    a, b = meeting(items)
    core = items.grown(-TOLERANCE / 2)
    return np.bincount(a, shapely.intersects(core[a], core[b]), len(items.room)) > 0


def meeting(items: Items) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of items that touch or overlap, each twice, as indices (n,) of the one and of the other.

    Without those that may share the floor: a tucked item and one of the HOSTS; an item that is RAISED and one that is
    not; one of the RUGS and anything.
    """
    raised = np.isin(items.category, list(RAISED))
    rug = np.isin(items.category, list(RUGS))
    a, b = pairs(items.room, items.room)
    hosted = items.tucked[a] & items.hosts[b] | items.hosts[a] & items.tucked[b]
    apart = hosted | (raised[a] != raised[b]) | rug[a] | rug[b]
    meet = (a != b) & ~apart & shapely.intersects(items.footprint[a], items.footprint[b])
    return a[meet], b[meet]


def standing_outside(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Which items are more than 1 cm deep outside the indoor area: (N,)."""
    indoor = np.array([layout.indoor for layout in layouts])[items.room]
    return shapely.area(shapely.difference(items.grown(-TOLERANCE), indoor)) > ROUNDING


def blocking(
    rooms: Sequence[Room], room: np.ndarray, category: Sequence[str] | np.ndarray, footprint: np.ndarray
) -> np.ndarray:
    """Which footprints (N,) are more than 1 cm deep in the area `kept_free` for doors and windows: (N,).

    Each is in the room of index `room` (N,). RAISED categories are floor, and block nothing.
    """
    free = shapely.buffer([kept_free(each) for each in rooms], -TOLERANCE, join_style="mitre")
    in_the_way = shapely.area(shapely.intersection(free[room], footprint)) > 0
    return in_the_way & ~np.isin(category, list(RAISED))


def free_fronts(layouts: Sequence[Room], items: Items, depth: np.ndarray) -> np.ndarray:
    """Whether so many metres of floor, `depth` (N,), before each item are not `floor_taken`: (N,).

    True for an item that keeps no floor free, False for one that does and is not placed.
    """
    keeps = np.flatnonzero(depth > 0)
    floor = floor_ahead(items, keeps, depth[keeps])
    result = np.ones(len(items.room), dtype=bool)
    result[keeps] = ~floor_taken(layouts, items, keeps, floor)
    return result


def floor_taken(layouts: Sequence[Room], items: Items, those: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """Whether a wall or another item takes some of the floor (n,), polygons, that `those` items (n,) need: (n,).

    Others that are RAISED or lie `along_walls`, or MAY_STAND_BEFORE the item, do not count.
    """
    taken = ~shapely.covers(np.array([layout.indoor for layout in layouts])[items.room[those]], floor)
    a, b = pairs(items.room[those], items.room)
    categories = zip(items.category[those[a]], items.category[b], strict=True)
    apart = np.array([not may_stand_before(*both) for both in categories], dtype=bool)
    meets = (those[a] != b) & apart & shapely.intersects(floor[a], items.footprint[b])
    taken[a[meets & ~along_walls(layouts, items)[b]]] = True
    return taken


def floor_ahead(items: Items, those: np.ndarray, depth: np.ndarray, quarter: int = 0) -> np.ndarray:
    """Return the floor, `depth` (n,) metres deep, before `those` items (n,), without 1 cm all round: polygons (n,).

    It is before the side that is so many quarter turns from the front.
    """
    deep, wide = items.size[those].T[:: -1 if quarter % 2 else 1]
    ahead = facing(items, those, quarter) * (deep + depth)[:, None] / 2
    floor = np.stack([depth, wide], -1) - 2 * TOLERANCE
    return rectangles(items.center[those] + ahead, floor, items.degrees[those] + 90 * quarter)


def facing(items: Items, those: np.ndarray, quarter: int = 0) -> np.ndarray:
    """Return where `those` items (n,) face, or a side so many quarter turns from the front: unit vectors (n, 2)."""
    angle = np.radians(items.degrees[those] + 90 * quarter)
    return np.stack([np.cos(angle), np.sin(angle)], -1)


def along_walls(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether all of an item is within ALONG_WALLS of the walls: (N,). False for one that is not placed."""
    middle = np.array([off_walls(layout) for layout in layouts])
    return shapely.disjoint(middle[items.room], items.footprint)


@without_furniture
def off_walls(room: Room) -> shapely.Geometry:
    """Return the floor that is farther than ALONG_WALLS from the walls."""
    return room.indoor.buffer(-ALONG_WALLS - TOLERANCE)


@dataclass(frozen=True)
class Floor:
    """Where the centre of a disc that walks in B rooms can be: P connected parts, one room after the other."""

    part: np.ndarray  # (P,), polygons
    room: np.ndarray  # (P,), index of the room
    entered: np.ndarray  # (P,), whether it is at the `entrance`, or without a door the largest


def free_floor(layouts: Sequence[Room], items: Items, stands: np.ndarray, radius: np.ndarray) -> Floor:
    """Return where discs of these radii (B,) can be among the items in the way, `stands` (N,). Doors are wide open."""
    empty = [empty_floor(layout, r) for layout, r in zip(layouts, radius.tolist(), strict=True)]
    stands = stands & items.placed
    solid = gathered(items.footprint[stands], items.room[stands], len(layouts))
    part, room = shapely.get_parts(shapely.difference(empty, shapely.buffer(solid, radius)), return_index=True)
    area = shapely.area(part)
    part, room, area = part[area > ROUNDING], room[area > ROUNDING], area[area > ROUNDING]
    doors_in = [entrance(layout) for layout in layouts]
    door = np.array([door and door.shape for door in doors_in])[room]
    largest = np.zeros(len(layouts))
    np.maximum.at(largest, room, area)
    at_door = shapely.dwithin(part, door, TOLERANCE)
    return Floor(part, room, np.where(shapely.is_missing(door), area == largest[room], at_door))


def within_reach(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether a person as wide as the `way_width` less 1 cm who enters by the `entrance` can touch each item: (N,).

    Tucked items are moved aside, RAISED ones walked on, and RUGS reached under whatever stands on them. False for items
    that are not placed.
    """
    radius = np.array([way_width(layout) / 2 for layout in layouts])
    floor = free_floor(layouts, items, items.bars, radius - TOLERANCE / 2)
    entered = unions(floor.part[floor.entered], floor.room[floor.entered], len(layouts))[items.room]
    touched = shapely.dwithin(entered, items.footprint, radius[items.room] + TOLERANCE)
    return touched | (items.placed & np.isin(items.category, list(RUGS)))


def pairs(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (indices into the first, into the second) of all pairs in one room; both hold rooms, the second sorted."""
    start, stop = np.searchsorted(second, first, "left"), np.searchsorted(second, first, "right")
    count = stop - start
    a = np.repeat(np.arange(len(first)), count)
    return a, np.arange(len(a)) - np.repeat(np.cumsum(count) - count - start, count)


def unions(shapes: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """Return the union (count,) of the shapes (n,) of each owner, empty if it has none; `owner` (n,) are indices."""
    return shapely.union_all(gathered(shapes, owner, count)[:, None], axis=1)


def gathered(shapes: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """Return the shapes (n,) of each owner as collections (count,); `owner` (n,) are indices."""
    order = np.argsort(owner, kind="stable")
    owned = np.full(count, shapely.GeometryCollection())
    shapely.geometrycollections(shapes[order], indices=owner[order], out=owned)
    return owned
