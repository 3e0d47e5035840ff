"""Search and annealer, as they furnish rooms of a user's own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.rooms.annealer import Annealing, anneal
from layoutrl.rivals.rooms.cost import PREFERENCES
from layoutrl.rivals.rooms.relations import Relations, mine
from layoutrl.rivals.rooms.search import Searching, search
from layoutrl.rooms.faults import faults
from layoutrl.rooms.furnished import Furnished, dice, laid_out, several
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources import designer_cache

DESIGNED = 100  # rooms of a type and seed, whose relations are kept; of more the designer would start processes
SEEDS = (0, 1)  # of fewer rooms rare categories would not be known
VARIETY = 0.7  # of these weights: the standard deviation of their logarithms


@cache
def relations_of(room_type: str, seeds: tuple[int, ...], count: int) -> Relations:
    """The relations of so many designed rooms of each seed."""
    return mine([room for seed in seeds for room in designer_cache.read(None, room_type, "train", seed, count).rooms])


class Rival:
    """Search or annealer, with a budget a layout. All share the relations of designed rooms of each type.

    Where one layout of a room is there, preferences are weighed otherwise for the next, else it would be the same.
    """

    def __init__(self, settings: Searching | Annealing, budget: Callable[[], Spent]):
        self.settings, self.budget = settings, budget

    def relations(self, room_type: str) -> Relations:
        """Those of designed rooms of this type."""
        return relations_of(room_type, SEEDS, DESIGNED)

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
