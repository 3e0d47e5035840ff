"""Which of the poses that an item could take it is put at: one by which nothing is wrong, of the highest value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from layoutrl.env.rooms_simulator import RoomsSimulator, State, rows
from layoutrl.rooms.brief import missing
from layoutrl.rooms.faults import Items, faults, item_faults
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Room

LOOKED_AT = 24  # of poses, the most valued, that are looked at for one by which nothing is wrong
APART = 0.5  # metres: layouts are different whose largest item stands so far away, or faces another way


class Options(NamedTuple):
    """Of each of B items K poses at which it could stay."""

    center: np.ndarray  # (B, K, 2), metres
    quarter: np.ndarray  # (B, K)
    value: np.ndarray  # (B, K), -inf for none
    way: list[list[np.ndarray]]  # to each: centers (moves + 1, 2)

    def of(self, b: np.ndarray) -> Options:
        """Those of some of the items."""
        return Options(self.center[b], self.quarter[b], self.value[b], [self.way[n] for n in b])


class Chosen(NamedTuple):
    """One pose of each of B items."""

    center: np.ndarray  # (B, 2), metres
    quarter: np.ndarray  # (B,)
    value: np.ndarray  # (B,), -inf where there is none
    way: np.ndarray  # (B,) of arrays: to each, centers (moves + 1, 2)
    faults: np.ndarray  # (B,): with how many items more something is wrong than without this one

    def of(self, b: np.ndarray) -> Chosen:
        """Those of some of the items."""
        return Chosen(*(values[b] for values in self))

    def replaced(self, b: np.ndarray, others: Chosen) -> Chosen:
        """These, but of the items b (n,) the others (n,)."""
        new = Chosen(*(values.copy() for values in self))
        for values, those in zip(new, others, strict=True):
            values[b] = those
        return new

    def less_wrong(self, b: np.ndarray, others: Chosen) -> Chosen:
        """These, but of the items b (n,) those of the others (n,) by which less is wrong."""
        better = others.faults < self.faults[b]
        return self.replaced(b[better], others.of(better))


def best_of(rooms: RoomsSimulator, state: State[np.ndarray], options: Options) -> Chosen:
    """Of each item (B,) the option of the highest value by which nothing is wrong that was not before, or the least.

    The LOOKED_AT of the highest value are looked at.
    """
    every = np.arange(len(state.room))
    before = wrong([rooms.layout(state, b) for b in every])
    order = np.argsort(-options.value, 1, kind="stable")
    best, fewest = order[:, 0].copy(), np.full(len(every), np.iinfo(int).max)
    for option in order.T[:LOOKED_AT]:
        b = np.flatnonzero((fewest > before) & np.isfinite(options.value[every, option]))
        if not len(b):
            break
        k = option[b]
        there = rooms.put(rows(state, b), state.moving[b], options.center[b, k], options.quarter[b, k])
        found = wrong([rooms.layout(there, n) for n in range(len(b))])
        better = found < fewest[b]
        best[b[better]], fewest[b[better]] = k[better], found[better]
    way = np.fromiter((options.way[b][k] for b, k in enumerate(best)), dtype=object)
    return Chosen(
        options.center[every, best], options.quarter[every, best], options.value[every, best], way, fewest - before
    )


def unlike(
    rooms: RoomsSimulator, state: State[np.ndarray], options: Options, known: Sequence[Sequence[Furnished]]
) -> Options:
    """The options without those of layouts that are known already."""
    value = options.value.copy()
    for b, layouts in enumerate(known):
        room, n = int(state.room[b]), int(state.moving[b])
        for layout in layouts:
            stands = layout.layout.furniture[missing(rooms.rooms[room])[n]]
            if stands.center is None:  # nor is there a place for it in another
                value[b] = -np.inf
                continue
            near = np.linalg.norm(options.center[b] - stands.center, axis=1) < APART
            value[b, near & (rooms.degrees[room, n, options.quarter[b]] == stands.rotation)] = -np.inf
    return options._replace(value=value)


def wrong(layouts: Sequence[Room]) -> np.ndarray:
    """With how many of the items that stand something is wrong, in each layout: (B,)."""
    standing = [
        replace(room, furniture=tuple(item for item in room.furniture if item.center), target=None) for room in layouts
    ]
    items = Items.of(standing)
    found = item_faults(standing, items)
    return np.bincount(items.room, np.any(list(found.values()), axis=0), len(layouts)).astype(int)


def faulty_items(layout: Room, brief: Room) -> list[int]:
    """Which of the items that were to be placed have a fault: 0 for the first of them."""
    at_fault = {k for k, _ in faults(layout)}
    return [n for n, k in enumerate(missing(brief)) if k in at_fault]
