"""Measures of whole-room layouts compared with the designer's, for all rooms at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from layoutrl.rooms.clearances import RAISED, angle_off
from layoutrl.rooms.faults import (
    BLOCKS,
    FRONT_NOT_FREE,
    OUT_OF_REACH,
    OUTSIDE,
    OVERLAPS,
    ROUNDING,
    Items,
    free_floor,
    item_faults,
    meeting,
    pairs,
    unions,
)
from layoutrl.rooms.room import TOLERANCE, Room

ROBOT = 0.3  # metres: width of the robot that walks in PhyScene's measures (Yang et al. 2024)

NEARER = 1e-9  # IoU per square metre: of matches with the same sum of IoU, prefer the one that moves items less


@dataclass(frozen=True)
class Measures:
    """Measures of B layouts, an array (B,) each: shares unless a unit is named, NaN where there is nothing to count.

    An item that is not placed has IoU 0, does not face as the designer's, is not reached and its front is not free;
    it does not overlap, stand outside, block or move. A layout that lacks an item is not faultless.
    """

    iou: np.ndarray  # mean over the designer's items of the IoU with their match, see `matched`
    # Share of designer's items whose match faces alike, without round ones and square ones without a front.
    facing: np.ndarray
    overlap: np.ndarray  # share of items more than 1 cm deep in another that may not share their floor
    overlap_area: np.ndarray  # mean over items: share of the footprint that such others cover
    outside: np.ndarray  # share of items more than 1 cm outside the indoor area
    outside_area: np.ndarray  # mean over items: share of the footprint that is not indoors
    blocked: np.ndarray  # share of items in a door, in a window, or in the 30 cm before and behind a door: `kept_free`
    reached: np.ndarray  # share of items that somebody as wide as `way_width`, entering by the `entrance`, can touch
    fronts: np.ndarray  # share, of items with a FRONT_DEPTH above 0, whose front is free of walls and other items
    walkable: np.ndarray  # share, connected with the `entrance`, of the floor where the middle of the ROBOT can be
    reach: np.ndarray  # share of items touched from a connected part of that floor; mean over parts, weighted by area
    moved: np.ndarray  # metres from the middle of the matched item, mean over items with a match
    missing: np.ndarray  # share of the designer's items without a match
    faultless: np.ndarray  # 1 where no item is missing or has a fault, else 0
    group: np.ndarray  # `Room.group`: rooms of one group are not independent


def measured(layouts: Sequence[Room], designed: Sequence[Room]) -> Measures:
    """Return all measures of layouts (B,) compared with the designer's (B,), of the same rooms in the same order.

    Raises ValueError where their numbers differ.
    """
    if len(layouts) != len(designed):
        raise ValueError(f"expected as many layouts as designs; got {len(layouts)} and {len(designed)}")
    count, items, matches = len(layouts), Items.of(layouts), matched(layouts, designed)
    found = item_faults(layouts, items)
    walkable, reach = walked(layouts, items)

    def share(value: np.ndarray) -> np.ndarray:
        return means(value.astype(float), items.room, count)

    missing = means(np.isnan(matches.moved).astype(float), matches.room, count)
    faulty = np.bincount(items.room, np.any(list(found.values()), axis=0), count) > 0
    return Measures(
        iou=means(matches.iou, matches.room, count),
        facing=means(matches.facing, matches.room, count),
        overlap=share(found[OVERLAPS]),
        overlap_area=share(covered(items)),
        outside=share(found[OUTSIDE]),
        outside_area=share(beyond(layouts, items)),
        blocked=share(found[BLOCKS]),
        reached=share(~found[OUT_OF_REACH]),
        fronts=share(np.where(items.front > 0, ~found[FRONT_NOT_FREE], np.nan)),
        walkable=walkable,
        reach=reach,
        moved=means(matches.moved, matches.room, count),
        missing=missing,
        faultless=1.0 * ~(faulty | (missing > 0)),
        group=np.array([room.group for room in designed]),
    )


def covered(items: Items) -> np.ndarray:
    """Return the share of each item's footprint that others cover, without those that may share its floor: (N,)."""
    a, b = meeting(items)
    shared = unions(shapely.intersection(items.footprint[a], items.footprint[b]), a, len(items.room))
    return np.nan_to_num(shapely.area(shared) / shapely.area(items.footprint))


def beyond(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """The share of each item's footprint that is not indoors: (N,)."""
    indoor = np.array([layout.indoor for layout in layouts])[items.room]
    outside = shapely.difference(items.footprint, indoor)
    return np.nan_to_num(shapely.area(outside) / shapely.area(items.footprint))


def walked(layouts: Sequence[Room], items: Items) -> tuple[np.ndarray, np.ndarray]:
    """Return PhyScene's walkable area and reach, (B,) each, for a ROBOT that walks on RAISED items.

    Both are 0 where the robot fits nowhere. Reach is NaN in rooms without items.
    """
    count, radius = len(layouts), ROBOT / 2
    floor = free_floor(layouts, items, ~np.isin(items.category, list(RAISED)), np.full(count, radius))
    area = shapely.area(floor.part)
    whole = np.bincount(floor.room, area, count)
    walkable = np.bincount(floor.room, area * floor.entered, count) / np.maximum(whole, ROUNDING)
    a, b = pairs(floor.room, items.room)
    touched = np.bincount(a, shapely.dwithin(floor.part[a], items.footprint[b], radius + TOLERANCE), len(area))
    of = np.bincount(items.room, minlength=count)
    reach = np.bincount(floor.room, touched * area, count) / np.maximum(whole, ROUNDING) / np.maximum(of, 1)
    return walkable, np.where(of, reach, np.nan)


def means(value: np.ndarray, room: np.ndarray, count: int) -> np.ndarray:
    """The mean of the values (n,) of each of `count` rooms, NaN left out; NaN where there is none."""
    known = ~np.isnan(value)
    total, number = np.bincount(room[known], value[known], count), np.bincount(room[known], minlength=count)
    return np.where(number, total / np.maximum(number, 1), np.nan)


@dataclass(frozen=True)
class Matches:
    """The designer's M placed items, one room after the other, compared with their matches in the layouts."""

    room: np.ndarray  # (M,)
    category: np.ndarray  # (M,)
    iou: np.ndarray  # (M,): with the match, 0 without one
    facing: np.ndarray  # (M,): 1 where the match faces alike, 0 where not or without one, NaN as in `Measures`
    moved: np.ndarray  # (M,): metres to the middle of the match, NaN without one


def matched(layouts: Sequence[Room], designed: Sequence[Room]) -> Matches:
    """Match the designer's items one to one with items of their category, for the highest sum of IoU in each room."""
    ours, theirs = Items.of(layouts), Items.of(designed)
    a, b = pairs(theirs.room, ours.room)
    alike = (theirs.category[a] == ours.category[b]) & theirs.placed[a] & ours.placed[b]
    a, b = a[alike], b[alike]
    iou = iou_of(theirs.footprint[a], ours.footprint[b])
    away = np.hypot(*(theirs.center[a] - ours.center[b]).T)
    facing = angle_off(theirs.degrees[a] - ours.degrees[b], theirs.period[a]) <= 45
    taken = assigned(iou - NEARER * away**2, np.unique(theirs.category, return_inverse=True)[1][a], theirs.room[a], a)
    found = {}
    for name, value, without in (("iou", iou, 0), ("facing", facing, 0), ("moved", away, np.nan)):
        found[name] = np.full(len(theirs.room), without, dtype=float)
        found[name][a[taken]] = value[taken]
    found["facing"][theirs.period == 90] = np.nan
    there = theirs.placed
    return Matches(theirs.room[there], theirs.category[there], **{name: value[there] for name, value in found.items()})


def iou_of(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Intersection over union of footprints (n,), one by one."""
    shared = shapely.area(shapely.intersection(first, second))
    return shared / (shapely.area(first) + shapely.area(second) - shared)


def assigned(value: np.ndarray, category: np.ndarray, room: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return the indices of the pairs that match items for the highest sum of values in each room and category.

    The pairs (n,) ascend by their first item and are all that a category has in a room.
    """
    from scipy.optimize import linear_sum_assignment  # here: it takes a third of a second to load, and few match items

    order = np.lexsort((category, room))  # stable: a category's pairs in a room stay a table, row by row
    ends = np.flatnonzero(np.diff(room[order]) | np.diff(category[order])) + 1
    taken = []
    for block in np.split(order, ends) if len(order) else ():
        table = block.reshape(len(np.unique(first[block])), -1)
        taken.extend(table[linear_sum_assignment(value[table], maximize=True)])
    return np.array(taken, dtype=int)
