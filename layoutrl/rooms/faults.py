"""What is wrong with the items of whole layouts, worked out from polygons, of all rooms at once.

Drawing noise is no fault: what overlaps, stands outside or in the way by TOLERANCE, a centimetre, or less does not
count, and a passage may be a centimetre too narrow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
import shapely

from layoutrl.rooms.clearances import HOSTS, RAISED, RUGS, front_depth, may_stand_before, period
from layoutrl.rooms.doors import bars, empty_floor, entrance, kept_free, way_width
from layoutrl.rooms.room import CIRCLE_SEGMENTS, TOLERANCE, Room

ROUNDING = 1e-9  # square metres: no area
MISSING = "not placed"  # the fault that leaves no room for others
OVERLAPS, OUTSIDE, BLOCKS = "overlaps", "outside", "blocks an opening"
OUT_OF_REACH, FRONT_NOT_FREE = "out of reach", "front not free"
FAULTS = (MISSING, OVERLAPS, OUTSIDE, BLOCKS, OUT_OF_REACH, FRONT_NOT_FREE)
Fault = tuple[int, str]  # index of an item in its room, what is wrong with it
CORNERS = np.array([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])


def faults(layout: Room) -> list[Fault]:
    """(index of the item, what is wrong with it), item by item: the names are those of `item_faults`.

    Of what is not placed nothing else is said.
    """
    return faults_of_all([layout])[0]


def faults_of_all(layouts: Sequence[Room]) -> list[list[Fault]]:
    """The `faults` of each layout, in a tenth of the time that they take one by one."""
    items = Items.of(layouts)
    found = item_faults(layouts, items)
    first = np.searchsorted(items.room, np.arange(len(layouts)))
    return [
        [
            (k, name)
            for k in range(len(layout.furniture))
            for name, faulty in found.items()
            if faulty[start + k] and (items.placed[start + k] or name == MISSING)
        ]
        for layout, start in zip(layouts, first.tolist(), strict=True)
    ]


def new_faults(wrong: Sequence[Fault], before: Sequence[Fault]) -> list[Fault]:
    """What is wrong with a layout, without what was wrong with what stood there before anything was placed."""
    return [(k, fault) for k, fault in wrong if fault == MISSING or (k, fault) not in before]


@dataclass(frozen=True)
class Items:
    """All N items of B layouts, one layout after the other."""

    room: np.ndarray  # (N,)
    category: np.ndarray  # (N,)
    size: np.ndarray  # (N, 2)
    center: np.ndarray  # (N, 2), NaN where it is not placed
    degrees: np.ndarray  # (N,), NaN where it is to be chosen
    round: np.ndarray  # (N,)
    tucked: np.ndarray  # (N,)
    bars: np.ndarray  # (N,), whether a door that meets it does not open, as `doors.bars` has it
    period: np.ndarray  # (N,), degrees as `clearances.period` has them
    front: np.ndarray  # (N,), metres as `clearances.front_depth` has them

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
        """Where each stands, as Item.footprint: (N,), None where it is not placed."""
        return self.grown(0)

    def grown(self, by: float) -> np.ndarray:
        """The footprints (N,), so many metres larger on all sides."""
        shape = rectangles(self.center, self.size + 2 * by, self.degrees)
        shape[self.round] = shapely.buffer(
            shapely.points(self.center[self.round]), self.size[self.round, 0] / 2 + by, quad_segs=CIRCLE_SEGMENTS
        )
        shape[~self.placed] = None
        return shape

    @cached_property
    def placed(self) -> np.ndarray:
        """Whether it stands somewhere, facing somewhere: (N,)."""
        return ~np.isnan(self.center[:, 0]) & (self.round | ~np.isnan(self.degrees))

    @cached_property
    def hosts(self) -> np.ndarray:
        """Whether what is tucked may stand under it: (N,)."""
        return np.isin(self.category, list(HOSTS)) & ~self.tucked


def rectangles(center: np.ndarray, size: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Rectangles (N,) with these centres (N, 2), sizes (N, 2) along their own axes, turned; None where one is NaN."""
    # Rounded, since a sine of 180 degrees is not quite 0.
    cosine, sine = (np.round(f(np.radians(degrees)), 15)[:, None] for f in (np.cos, np.sin))
    x, y = np.moveaxis(CORNERS * size[:, None], 2, 0)
    corners = np.stack([cosine * x - sine * y, sine * x + cosine * y], -1) + center[:, None]
    known = ~np.isnan(corners).any((1, 2)) & (size > 0).all(1)
    result = np.full(len(center), None)
    result[known] = shapely.polygons(corners[known])
    return result


def item_faults(layouts: Sequence[Room], items: Items) -> dict[str, np.ndarray]:
    """Which items have each of the FAULTS, (N,) by its name.

    What is not placed has the first, is out of reach and has no free front if it should; it has no other.
    """
    found = (
        ~items.placed,
        overlapping(items),
        standing_outside(layouts, items),
        blocking(layouts, items.room, items.category, items.footprint),
        ~within_reach(layouts, items),
        ~free_fronts(layouts, items),
    )
    return dict(zip(FAULTS, found, strict=True))


def overlapping(items: Items) -> np.ndarray:
    """Which items are more than 1 cm deep in another that they do not share the floor with: (N,)."""
    a, b = meeting(items)
    core = items.grown(-TOLERANCE / 2)
    return np.bincount(a, shapely.intersects(core[a], core[b]), len(items.room)) > 0


def meeting(items: Items) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of items that touch or overlap, each twice, as indices (n,) of the one and of the other.

    What is tucked and what it may stand under, one of the HOSTS, share the floor; so do what is RAISED and what stands
    on it, and RUGS and all else.
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
    """Which footprints (N,) stand more than 1 cm deep in what is `kept_free` of doors and windows: (N,).

    Each is in the room of index `room` (N,). What is RAISED is floor, and blocks nothing.
    """
    free = shapely.buffer([kept_free(each) for each in rooms], -TOLERANCE, join_style="mitre")
    in_the_way = shapely.area(shapely.intersection(free[room], footprint)) > 0
    return in_the_way & ~np.isin(category, list(RAISED))


def free_fronts(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether the floor of FRONT_DEPTH before each item is indoors and free of others, but for 1 cm all round: (N,).

    What is RAISED or MAY_STAND_BEFORE it does not count. True for what keeps no floor free, False for what keeps some
    and is not placed.
    """
    keeps = np.flatnonzero(items.front > 0)
    depth, width = items.front[keeps], items.size[keeps]
    angle = np.radians(items.degrees[keeps])
    ahead = np.stack([np.cos(angle), np.sin(angle)], -1) * (width[:, :1] + depth[:, None]) / 2
    size = np.stack([depth, width[:, 1]], -1) - 2 * TOLERANCE
    floor = rectangles(items.center[keeps] + ahead, size, items.degrees[keeps])
    free = shapely.covers(np.array([layout.indoor for layout in layouts])[items.room[keeps]], floor)
    a, b = pairs(items.room[keeps], items.room)
    welcome = [
        may_stand_before(category, other)
        for category, other in zip(items.category[keeps[a]], items.category[b], strict=True)
    ]
    taken = (keeps[a] != b) & ~np.array(welcome, dtype=bool) & shapely.intersects(floor[a], items.footprint[b])
    free[a[taken]] = False
    result = np.ones(len(items.room), dtype=bool)
    result[keeps] = free
    return result


@dataclass(frozen=True)
class Floor:
    """Where the middle of a disc can be that walks in B rooms: P connected parts, one room after the other."""

    part: np.ndarray  # (P,)
    room: np.ndarray  # (P,)
    entered: np.ndarray  # (P,): by the `entrance`; where there is no door, the largest is


def free_floor(layouts: Sequence[Room], items: Items, stands: np.ndarray, radius: np.ndarray) -> Floor:
    """Where discs of these radii (B,) can be, among the items that stand in the way (N,). Doors are wide open."""
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
    """Whether who enters by the `entrance`, as wide as the `way_width` but for 1 cm, comes to touch each item: (N,).

    Tucked items are moved aside, RAISED ones walked on, and RUGS reached under whatever stands on them. False for what
    is not placed.
    """
    radius = np.array([way_width(layout) / 2 for layout in layouts])
    floor = free_floor(layouts, items, items.bars, radius - TOLERANCE / 2)
    entered = unions(floor.part[floor.entered], floor.room[floor.entered], len(layouts))[items.room]
    touched = shapely.dwithin(entered, items.footprint, radius[items.room] + TOLERANCE)
    return touched | (items.placed & np.isin(items.category, list(RUGS)))


def pairs(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(indices into the first, into the second) of all pairs of one room; both are rooms (n,), ascending."""
    start, stop = np.searchsorted(second, first, "left"), np.searchsorted(second, first, "right")
    count = stop - start
    a = np.repeat(np.arange(len(first)), count)
    return a, np.arange(len(a)) - np.repeat(np.cumsum(count) - count - start, count)


def unions(shapes: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """The union of the shapes (n,) of each of `count` owners (n,); empty for who has none."""
    return shapely.union_all(gathered(shapes, owner, count)[:, None], axis=1)


def gathered(shapes: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """The shapes (n,) of each of `count` owners (n,), as a collection."""
    order = np.argsort(owner, kind="stable")
    owned = np.full(count, shapely.GeometryCollection())
    shapely.geometrycollections(shapes[order], indices=owner[order], out=owned)
    return owned
