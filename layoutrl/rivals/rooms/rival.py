"""Search and annealer, as they furnish rooms of a user's own: layouts that differ, of rooms of all types."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.rooms.annealer import Annealing, anneal
from layoutrl.rivals.rooms.cost import PREFERENCES
from layoutrl.rivals.rooms.relations import Relations, mine
from layoutrl.rivals.rooms.search import Searching, search
from layoutrl.rooms.brief import largest_first
from layoutrl.rooms.clearances import off, period
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.faults import faults
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Item, Room

DESIGNED = 100  # rooms of a type and seed, whose relations are kept; of more the designer would start processes
SEEDS = (0, 1)  # of fewer rooms rare categories would not be known
APART = 0.3  # metres: layouts in which no item stands further elsewhere are one
TURNED = 45.0  # degrees
VARIETY = 0.7  # of these weights: the standard deviation of their logarithms
TRIES = 2  # for each layout that is asked for, until that many differ

Layouts = Callable[[Sequence[Room], Sequence[int]], Iterable[Furnished]]  # one of each brief, by these seeds


def designed(room_type: str) -> list[Room]:
    """The rooms whose relations are kept."""
    return [room for seed in SEEDS for room in design_rooms(room_type, "train", seed, DESIGNED).rooms]


class Rival:
    """Search or annealer, with a budget a layout. It keeps relations of designed rooms of each type.

    Where one layout of a room is there, preferences are weighed otherwise for the next, else it would be the same.
    """

    def __init__(self, settings: Searching | Annealing, budget: Callable[[], Spent]):
        self.settings, self.budget = settings, budget
        self.relations = cache(lambda room_type: mine(designed(room_type)))

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """See Furnishes. The value is how few faults there are."""
        return several(lambda some, seeds: [self._layout(brief, seeds) for brief in some], briefs, choices, seed)

    def _layout(self, brief: Room, seeds: Sequence[int]) -> Furnished:
        spent, rng = self.budget(), dice(brief, seeds)
        relations, (_, attempt) = self.relations(brief.room_type), seeds
        often = {name: rng.lognormal(0, VARIETY) for name in PREFERENCES} if attempt else {}
        weights = {name: weight * often.get(name, 1.0) for name, weight in self.settings.weights.items()}
        layout = by_rules(brief, relations, replace(self.settings, weights=weights), spent, rng)
        return laid_out(brief, layout, -len(faults(layout)))


def by_rules(
    brief: Room, relations: Relations, settings: Searching | Annealing, spent: Spent, rng: np.random.Generator
) -> Room:
    """The layout of search or annealer, whichever the settings are of."""
    if isinstance(settings, Searching):
        return search(brief, relations, settings, spent, rng)
    return anneal(brief, relations, settings, spent, rng)


def laid_out(brief: Room, layout: Room, value: float) -> Furnished:
    """A layout that took each item to its place at once, the largest first."""
    items = [(k, layout.furniture[k]) for k in largest_first(brief)]
    return Furnished(layout, value, [(k, item.center, item.degrees) for k, item in items if item.center is not None])


def several(layouts: Layouts, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
    """Of each brief up to so many layouts that differ, best first: `layouts` makes one of each with other seeds."""
    found: list[list[Furnished]] = [[] for _ in briefs]
    for attempt in range(TRIES * choices if choices > 1 else 1):
        if short := [k for k, answers in enumerate(found) if len(answers) < choices]:
            for k, answer in zip(short, layouts([briefs[k] for k in short], [seed, attempt]), strict=True):
                if not any(same(answer.layout, other.layout) for other in found[k]):
                    found[k].append(answer)
    return [sorted(answers, key=lambda answer: -answer.value) for answers in found]


def same(one: Room, other: Room) -> bool:
    """Whether each item of either layout has one like it in the other that stands there and faces alike."""
    return _covered(one, other) and _covered(other, one)


def _covered(one: Room, other: Room) -> bool:
    return all(any(_alike(item, its) for its in other.furniture) for item in one.furniture)


def _alike(one: Item, other: Item) -> bool:
    if (one.category, one.size, one.form) != (other.category, other.size, other.form):
        return False
    if one.center is None or other.center is None:
        return one.center == other.center
    turned = off((one.rotation or 0) - (other.rotation or 0), period(one))
    return math.dist(one.center, other.center) < APART and (one.form == "circle" or turned < TURNED)


def dice(brief: Room, seeds: Sequence[int]) -> np.random.Generator:
    """Of a room: the same in whichever file, shard or block it is."""
    return np.random.default_rng([*seeds, zlib.crc32(brief.id.encode())])
