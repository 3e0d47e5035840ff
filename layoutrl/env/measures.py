"""What layouts of whole rooms are worth, beside the designer's: all measures, of all rooms at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

from layoutrl.rooms.clearances import RAISED, off
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

ROBOT = 0.3  # metres wide: who walks in PhyScene's measures (Yang et al. 2024)

NEARER = 1e-9  # of IoU a square metre: of matches with the same sum of IoU, the one that moves items less


@dataclass(frozen=True)
class Measures:
    """What B layouts are worth, an array (B,) each: shares unless a unit is named, NaN where there is nothing to count.

    An item that is not placed has IoU 0, does not face as the designer's, is not reached and its front is not free;
    it does not overlap, stand outside, block or move. A room that lacks an item is not faultless.
    """

    iou: np.ndarray  # mean over the designer's items, matched within a category for the highest sum
    facing: np.ndarray  # of the designer's items but round ones and square ones without a front: matched and alike
    overlap: np.ndarray  # of all items, as what follows: more than 1 cm deep in another, but for a tucked one's HOSTS
    overlap_area: np.ndarray  # mean over items: how much of it others cover
    outside: np.ndarray  # of items: more than 1 cm outside the indoor area
    outside_area: np.ndarray  # mean over items: how much of it is not indoors
    blocked: np.ndarray  # of items: in a door, in a window, or in the 30 cm before and behind a door: `kept_free`
    reached: np.ndarray  # of items: who enters by the `entrance`, as wide as the `way_width`, comes to touch it
    fronts: np.ndarray  # of items that keep a FRONT_DEPTH: free of walls and of other items
    walkable: np.ndarray  # of the floor where the middle of the ROBOT can be: connected with the `entrance`
    reach: np.ndarray  # of items: touched from a connected part of that floor; mean over the parts, by their area
    moved: np.ndarray  # metres from the middle of the matched item, mean over those that have one
    missing: np.ndarray  # of the designer's items: without a match
    faultless: np.ndarray  # 1 where no item is missing or has a fault, else 0
    group: np.ndarray  # of rooms that are not independent


def measured(layouts: Sequence[Room], designed: Sequence[Room]) -> Measures:
    """All measures of layouts beside the designer's (B,), of the same rooms in the same order."""
    assert len(layouts) == len(designed)
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
    """The share of each item's footprint that others cover, but for those that it shares the floor with: (N,)."""
    a, b = meeting(items)
    shared = unions(shapely.intersection(items.footprint[a], items.footprint[b]), a, len(items.room))
    return np.nan_to_num(shapely.area(shared) / shapely.area(items.footprint))


def beyond(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """The share of each item's footprint that is not indoors: (N,)."""
    indoor = np.array([layout.indoor for layout in layouts])[items.room]
    outside = shapely.difference(items.footprint, indoor)
    return np.nan_to_num(shapely.area(outside) / shapely.area(items.footprint))


def walked(layouts: Sequence[Room], items: Items) -> tuple[np.ndarray, np.ndarray]:
    """PhyScene's walkable area and reach (B,), of a ROBOT that walks on what is RAISED; 0 where it can be nowhere."""
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
    """Of the designer's M placed items, one room after the other."""

    room: np.ndarray  # (M,)
    category: np.ndarray  # (M,)
    iou: np.ndarray  # (M,), with the match; 0 without one
    facing: np.ndarray  # (M,): 1 where the match faces alike, 0 where not or without one, NaN of round and square ones
    moved: np.ndarray  # (M,): metres to the middle of the match, NaN without one


def matched(layouts: Sequence[Room], designed: Sequence[Room]) -> Matches:
    """The designer's items, each with one of its category, so that the sum of IoU in a room is the highest."""
    ours, theirs = Items.of(layouts), Items.of(designed)
    a, b = pairs(theirs.room, ours.room)
    alike = (theirs.category[a] == ours.category[b]) & theirs.placed[a] & ours.placed[b]
    a, b = a[alike], b[alike]
    iou = iou_of(theirs.footprint[a], ours.footprint[b])
    away = np.hypot(*(theirs.center[a] - ours.center[b]).T)
    facing = off(theirs.degrees[a] - ours.degrees[b], theirs.period[a]) <= 45
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
    """Of pairs (n,), ascending by their first item, the indices of those that are matched for the highest sum."""
    order = np.lexsort((category, room))  # stable: a category's pairs in a room stay a table, row by row
    ends = np.flatnonzero(np.diff(room[order]) | np.diff(category[order])) + 1
    taken = []
    for block in np.split(order, ends) if len(order) else ():
        table = block.reshape(len(np.unique(first[block])), -1)
        taken.extend(table[linear_sum_assignment(value[table], maximize=True)])
    return np.array(taken, dtype=int)
