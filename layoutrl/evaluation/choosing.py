"""Chooses one of several poses for an item: the one of highest value at which nothing is wrong.

What is wrong is geometry alone: faults (`rooms/faults.py`) and, weighing less, oddities (`rooms/oddities.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from layoutrl.env.rooms_simulator import RoomsSimulator, State, rows
from layoutrl.rooms.brief import missing, standing
from layoutrl.rooms.faults import Items, item_faults
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.oddities import WITHOUT_WORKTOP, item_oddities
from layoutrl.rooms.room import Room

NOT_AVOIDED = {WITHOUT_WORKTOP}  # to avoid it, too, cost 0.012 ± 0.004 of IoU in 1,000 kitchens
FAULT = 1000  # an item with a fault is as wrong as so many odd ones: no room has more items
TRIED_UP_TO = 1, 4, 12, 24  # poses of highest value that are tried, until one has nothing wrong; blocks save time
LARGEST_APART = 0.5  # metres: layouts differ if their largest items stand this far apart, or face different ways


class Options(NamedTuple):
    """K poses for each of B items, at which it could stay."""

    center: np.ndarray  # (B, K, 2), metres
    quarter: np.ndarray  # (B, K)
    value: np.ndarray  # (B, K), -inf where there is no pose
    way: list[list[np.ndarray]]  # the path to each pose: centers (moves + 1, 2), metres

    def take(self, b: np.ndarray) -> Options:
        """Return the options of items b (n,)."""
        return Options(self.center[b], self.quarter[b], self.value[b], [self.way[n] for n in b])


class Chosen(NamedTuple):
    """One pose of each of B items."""

    center: np.ndarray  # (B, 2), metres
    quarter: np.ndarray  # (B,)
    value: np.ndarray  # (B,), -inf where there is none
    way: np.ndarray  # (B,) of arrays, the path to each pose: centers (moves + 1, 2), metres
    harm: np.ndarray  # (B,): how much it adds to what is `wrong`; below 0 where it helps, a huge number for no pose

    def take(self, b: np.ndarray) -> Chosen:
        """Return the poses of items b (n,)."""
        return Chosen(*(values[b] for values in self))

    def replaced(self, b: np.ndarray, others: Chosen) -> Chosen:
        """Return a copy in which items b (n,) have the poses of `others` (n,)."""
        new = Chosen(*(values.copy() for values in self))
        for values, those in zip(new, others, strict=True):
            values[b] = those
        return new

    def replaced_where_better(self, b: np.ndarray, others: Chosen) -> Chosen:
        """Return a copy in which those of items b (n,) whose pose in `others` (n,) does less harm have that pose."""
        better = others.harm < self.harm[b]
        return self.replaced(b[better], others.take(better))


def best_of(
    rooms: RoomsSimulator, state: State[np.ndarray], before: np.ndarray, options: Options, every_one: bool = False
) -> Chosen:
    """Return for each item (B,) the option of highest value with which no more is wrong than `before`.

    If there is none, it is the option with which the least is wrong. `before` (B,) is what is `wrong_at` these states.
    At most the last number of TRIED_UP_TO are tried, those of the highest value; with `every_one` the rest follow.
    """
    every = np.arange(len(state.room))
    order = np.argsort(-options.value, 1, kind="stable")
    best, least = order[:, 0].copy(), np.full(len(every), np.iinfo(int).max)
    up_to = (*TRIED_UP_TO, 4 * TRIED_UP_TO[-1], order.shape[1]) if every_one else TRIED_UP_TO
    for first, last in pairwise((0, *up_to)):
        k = order[:, first:last]
        some = np.isfinite(np.take_along_axis(options.value, k, 1))
        b = np.flatnonzero(some[:, :1].any(1) & (least > before))
        if not len(b):
            break
        k = k[:, some[b].any(0)]  # others would only take time
        found = _wrong_with(rooms, state, options, b, k[b])
        free = found <= before[b, None]
        first_best = np.where(free.any(1), free.argmax(1), found.argmin(1))
        lowest = found[np.arange(len(b)), first_best]
        better = lowest < least[b]
        best[b[better]], least[b[better]] = k[b, first_best][better], lowest[better]
    way = np.fromiter((options.way[b][k] for b, k in enumerate(best)), dtype=object)
    return Chosen(
        options.center[every, best], options.quarter[every, best], options.value[every, best], way, least - before
    )


def _wrong_with(
    rooms: RoomsSimulator, state: State[np.ndarray], options: Options, b: np.ndarray, k: np.ndarray
) -> np.ndarray:
    """Return how much is wrong with items b (n,) at each of their options k (n, m): (n, m); a huge number if none."""
    every, option = b.repeat(k.shape[1]), k.ravel()
    there = rooms.put(
        rows(state, every), state.moving[every], options.center[every, option], options.quarter[every, option]
    )
    found = wrong_at(rooms, there)
    return np.where(np.isfinite(options.value[every, option]), found, np.iinfo(int).max).reshape(k.shape)


def unlike(
    rooms: RoomsSimulator, state: State[np.ndarray], options: Options, known: Sequence[Sequence[Furnished]]
) -> Options:
    """Return the options, with value -inf for poses like the item's in a known layout (see LARGEST_APART)."""
    value = options.value.copy()
    for b, layouts in enumerate(known):
        room, n = int(state.room[b]), int(state.moving[b])
        for layout in layouts:
            stands = layout.layout.furniture[missing(rooms.rooms[room])[n]]
            if stands.center is None:  # it found no place there, and so will find none in another
                value[b] = -np.inf
                continue
            near = np.linalg.norm(options.center[b] - stands.center, axis=1) < LARGEST_APART
            value[b, near & (rooms.degrees[room, n, options.quarter[b]] == stands.rotation)] = -np.inf
    return options._replace(value=value)


def wrong(layouts: Sequence[Room]) -> np.ndarray:
    """How much is wrong with what stands in each layout: FAULT for each item with a fault, 1 for each odd one: (B,)."""
    items = Items.of([replace(room, furniture=tuple(standing(room)), target=None) for room in layouts])
    return np.bincount(items.room, _blame(layouts, items), len(layouts)).astype(int)


def wrong_at(rooms: RoomsSimulator, state: State[np.ndarray]) -> np.ndarray:
    """How much is `wrong` with the layouts of states: (B,)."""
    return wrong([rooms.layout(state, b) for b in range(len(state.room))])


def blame(layout: Room, brief: Room) -> np.ndarray:
    """How wrong each item is that was to be placed (n,): FAULT if it has a fault or no place, 1 if it is odd, or 0."""
    return _blame([layout], Items.of([layout]))[list(missing(brief))]


def _blame(layouts: Sequence[Room], items: Items) -> np.ndarray:
    odd = [found for name, found in item_oddities(layouts, items).items() if name not in NOT_AVOIDED]
    faulty = [*item_faults(layouts, items).values()]
    return np.where(np.any(faulty, axis=0), FAULT, np.any(odd, axis=0).astype(int))
