"""Search and annealer as furnishers of a user's own rooms."""

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
from layoutrl.rooms.called import as_called_here, named_as
from layoutrl.rooms.faults import faults
from layoutrl.rooms.furnished import Furnished, laid_out, rng_of, several
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources import designer_cache

DESIGNED = 100  # rooms of a type and seed to mine relations from; for more the designer would start processes
SEEDS = (0, 1)  # of these rooms; in fewer, rare categories would be missing
VARIETY = 0.7  # standard deviation of the logarithms of random factors of the weights of PREFERENCES


@cache
def relations_of(room_type: str, seeds: tuple[int, ...], count: int) -> Relations:
    """Mine the relations of `count` designed rooms of each seed."""
    return mine([room for seed in seeds for room in designer_cache.read(None, room_type, "train", seed, count).rooms])


class SearchOrAnnealer:
    """Search or annealer, with a budget for each layout. All share the relations of designed rooms of each type.

    From the second layout of a room on, the weights of preferences are varied; else it would be the same.
    """

    def __init__(self, settings: Searching | Annealing, budget: Callable[[], Spent]):
        self.settings, self.budget = settings, budget

    def relations(self, room_type: str) -> Relations:
        """Return the relations of designed rooms of this type."""
        return relations_of(room_type, SEEDS, DESIGNED)

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """See Furnishes. The value of a layout is minus the number of its faults."""
        return several(lambda some, seeds: [self._layout(brief, seeds) for brief in some], briefs, choices, seed)

    def _layout(self, brief: Room, seeds: Sequence[int]) -> Furnished:
        spent, rng = self.budget(), rng_of(brief, seeds)
        relations, (_, attempt) = self.relations(brief.room_type), seeds
        often = {name: rng.lognormal(0, VARIETY) for name in PREFERENCES} if attempt else {}
        weights = {name: weight * often.get(name, 1.0) for name, weight in self.settings.weights.items()}
        settings = replace(self.settings, weights=weights)
        layout = named_as(brief, search_or_anneal(as_called_here(brief), relations, settings, spent, rng))
        return laid_out(brief, layout, -len(faults(layout)))


def search_or_anneal(
    brief: Room, relations: Relations, settings: Searching | Annealing, spent: Spent, rng: np.random.Generator
) -> Room:
    """Return the layout of search or annealer, whichever the settings belong to."""
    if isinstance(settings, Searching):
        return search(brief, relations, settings, spent, rng)
    return anneal(brief, relations, settings, spent, rng)
