"""The interface of all that furnishes rooms, such as agents and rivals; and several layouts of a room that differ."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from layoutrl.rooms.brief import largest_first
from layoutrl.rooms.clearances import angle_off, period
from layoutrl.rooms.room import Item, Point, Room

APART = 0.3  # metres: layouts count as the same if their items stand closer than this
TURNED = 45.0  # degrees: and their rotations differ by less than this
TRIES = 2  # attempts for each layout that is asked for, to find as many that differ

Placement = tuple[int, Point, float]  # index of an item in the room's furniture, its centre in metres, degrees


@dataclass(frozen=True)
class Furnished:
    """A layout of a brief. Items that found no place have no center."""

    layout: Room
    value: float  # as its maker estimates it: the higher, the better
    path: list[Placement] = field(default_factory=list)  # all placements of the items on their way, in order
    taken: frozenset[int] = frozenset()  # indices into `path` at which an item is taken up, where known
    by: str = ""  # its maker, if that is not the one that was asked


class Furnishes(Protocol):
    """An agent, a rival or any other method that places the items without a center in rooms."""

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """Return for each brief one to `choices` different layouts, best first. Random draws depend on the seed."""


def best_layouts(who: Furnishes, briefs: Sequence[Room]) -> list[Room]:
    """The best layout of each brief."""
    return [best.layout for best, *_ in who.furnish(briefs, 1, 0)]


# (briefs, seeds) -> a layout of each brief
LayoutMaker = Callable[[Sequence[Room], Sequence[int]], Iterable[Furnished]]


def laid_out(brief: Room, layout: Room, value: float) -> Furnished:
    """Return a layout whose path takes each item to its place in one step, the largest first."""
    items = [(k, layout.furniture[k]) for k in largest_first(brief)]
    return Furnished(layout, value, [(k, item.center, item.degrees) for k, item in items if item.center is not None])


def several(make: LayoutMaker, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
    """Return for each brief up to `choices` layouts that differ, best first: `make` is called with several seeds."""
    found: list[list[Furnished]] = [[] for _ in briefs]
    for attempt in range(TRIES * choices if choices > 1 else 1):
        if short := [k for k, answers in enumerate(found) if len(answers) < choices]:
            for k, answer in zip(short, make([briefs[k] for k in short], [seed, attempt]), strict=True):
                if not any(same(answer.layout, other.layout) for other in found[k]):
                    found[k].append(answer)
    return [sorted(answers, key=lambda answer: -answer.value) for answers in found]


def same(one: Room, other: Room) -> bool:
    """Whether each item of either layout has one of its kind in the other at nearly the same place and rotation."""
    return _covered(one, other) and _covered(other, one)


def _covered(one: Room, other: Room) -> bool:
    return all(any(_alike(item, its) for its in other.furniture) for item in one.furniture)


def _alike(one: Item, other: Item) -> bool:
    if one.kind != other.kind:
        return False
    if one.center is None or other.center is None:
        return one.center == other.center
    turned = angle_off((one.rotation or 0) - (other.rotation or 0), period(one))
    return math.dist(one.center, other.center) < APART and (one.form == "circle" or turned < TURNED)


def rng_of(brief: Room, seeds: Sequence[int]) -> np.random.Generator:
    """Return a random generator for a room, the same in whichever file, shard or block the room is."""
    return np.random.default_rng([*seeds, zlib.crc32(brief.id.encode())])
