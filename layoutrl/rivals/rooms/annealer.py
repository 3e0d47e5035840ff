"""Simulated annealing of whole rooms, after Merrell et al. 2011 and Yu et al. 2011.

Many chains of one room are arrays: in a step all of them make a move of the same kind, which costs little more than
one. From training rooms come distances, shares of looks, turns and bearings, which categories are tall, and how much
floor doors keep free (`relations`): counted, not learned by gradients.

Clearance, circulation, distances of pairs and to the wall, and visual balance are from these papers. What differs:

- Access is the floor before an item, as deep as FRONT_DEPTH, which the designer and the measures keep; the papers
  keep floor free on several sides of an item.
- Circulation counts the items that cannot be reached from the door by a passage as wide as the room's, as the measures
  do; Merrell counts the connected parts of the floor that is free for a body 45 cm wide, and Yu lays out curved
  pathways.
- Merrell's angle of pairs, -(8c^4 - 8c^2 + 1), and alignment, -cos 4a, are the same for all items along the walls, and
  here all items are. What tells them apart instead are mined shares of which way an item faces and lies as seen from
  another, and shares of looks at door and window in place of Yu's visibility and Merrell's emphasis.
- Conversation, symmetry and Yu's groups of parent and child are left out: pairs are mined, whatever they are for.
- Slide, place and beside are moves of our own; chains do not swap temperatures; the weights of rules grow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.rooms.cost import Cost
from layoutrl.rivals.rooms.relations import Relations
from layoutrl.rivals.rooms.scene import FACINGS, Array, Scene, ahead, boxes_at, scene_of
from layoutrl.rooms.room import Room

MOVES = ("shift", "turn", "swap", "slide", "place", "beside")


@dataclass(kw_only=True)
class Annealing:
    """Settings of the annealer; `conf/rival/annealer.yaml` has the values and their sources."""

    chains: int
    first_temperature: float
    last_temperature: float
    cold: float  # share of the budget that is left when the last temperature is reached
    first_shift: float  # metres: standard deviation of a shift
    last_shift: float
    first_rules: float  # factor of the weights of rules, which grows from the first to the last
    last_rules: float
    moves: dict[str, float]  # relative frequency of each of MOVES
    weights: dict[str, float]  # of RULES and PREFERENCES


def anneal(brief: Room, relations: Relations, settings: Annealing, spent: Spent, rng: np.random.Generator) -> Room:
    """The best layout that any chain met. `spent` counts moves of single chains."""
    spent(0)  # a clock begins here, not after the chains are made
    scene = scene_of(brief)
    if not len(scene.movable):
        return brief
    chains = Chains(scene, relations, settings, rng)
    while (share := spent(chains.made)) < 1:
        chains.step(share)
    return scene.layout(*chains.best)


class Chains:
    """States of C chains: centres (C, n, 2), facings (C, n), and their costs (C,) by preference and rules."""

    def __init__(self, scene: Scene, relations: Relations, settings: Annealing, rng: np.random.Generator):
        self.scene, self.settings, self.rng = scene, settings, rng
        self.cost = Cost(scene, relations, settings.weights)
        self.kinds = list(settings.moves)
        self.often = np.cumsum(list(settings.moves.values())) / sum(settings.moves.values())
        count, n = settings.chains, len(scene.center)
        self.chain = np.arange(count)
        self.center = np.tile(scene.center, (count, 1, 1))
        self.quarter = np.tile(scene.quarter, (count, 1))
        for i in scene.movable:
            self.center[:, i] = rng.uniform(scene.bounds[:2], scene.bounds[2:], (count, 2))
            if scene.turnable[i]:
                self.quarter[:, i] = rng.integers(4, size=count)
        box = self.cost.boxes(self.center, self.quarter)
        self.preference = self.cost.preference(self.center, self.quarter, box)
        self.rules = self.cost.rules(self.center, self.quarter, box) + self.cost.unreached(box)
        self.made = 0
        self.lowest = np.inf
        self.best = np.zeros((n, 2)), np.zeros(n, dtype=int)
        self._remember()

    def step(self, share: float) -> None:
        """Make one move in every chain, given the share of the budget that is spent."""
        at = min(share / (1 - self.settings.cold), 1.0)
        temperature = _between(self.settings.first_temperature, self.settings.last_temperature, at)
        strictness = _between(self.settings.first_rules, self.settings.last_rules, at)
        center, quarter = self._proposed(_between(self.settings.first_shift, self.settings.last_shift, at))
        box = self.cost.boxes(center, quarter)
        preference = self.cost.preference(center, quarter, box)
        rules = self.cost.rules(center, quarter, box)
        # Metropolis: the limit is drawn first; what exceeds it even without `unreached`, which is slow, is refused.
        highest = self.preference + strictness * self.rules - temperature * np.log(1 - self.rng.random(len(self.chain)))
        maybe = np.flatnonzero(self._within(center) & (preference + strictness * rules <= highest))
        rules[maybe] += self.cost.unreached(box[maybe])
        taken = maybe[(preference + strictness * rules)[maybe] <= highest[maybe]]
        self.center[taken], self.quarter[taken] = center[taken], quarter[taken]
        self.preference[taken], self.rules[taken] = preference[taken], rules[taken]
        self.made += len(self.chain)
        self._remember()

    def _remember(self) -> None:
        cost = self.preference + self.settings.last_rules * self.rules
        k = int(cost.argmin())
        if cost[k] < self.lowest:
            self.lowest, self.best = float(cost[k]), (self.center[k].copy(), self.quarter[k].copy())

    def _proposed(self, width: float) -> tuple[Array, Array]:
        """Return centres and facings after a move of one random kind, of a random item in every chain."""
        center, quarter, rng, chain = self.center.copy(), self.quarter.copy(), self.rng, self.chain
        scene, count = self.scene, len(chain)
        kind = self.kinds[int(np.searchsorted(self.often, rng.random()))]
        i = rng.choice(scene.movable, count)
        turns = scene.turnable[i]
        if kind == "shift":
            center[chain, i] += rng.normal(0, width, (count, 2))
        elif kind == "turn":
            quarter[chain, i] += np.where(turns, rng.integers(1, 4, count), 0)
        elif kind == "swap":
            j = rng.choice(scene.movable, count)
            center[chain, i], center[chain, j] = center[chain, j], center[chain, i]
            both = turns & scene.turnable[j]
            quarter[chain, i], quarter[chain, j] = (
                np.where(both, self.quarter[chain, j], self.quarter[chain, i]),
                np.where(both, self.quarter[chain, i], self.quarter[chain, j]),
            )
        elif kind == "slide":
            box = self.cost.boxes(center, quarter)
            others = box.copy()
            others[chain, i] = np.nan  # it is not in its own way
            blocks = np.concatenate([np.broadcast_to(scene.solids, (count, *scene.solids.shape)), others], 1)
            self._slide(center, i, ahead(box[chain, i], blocks), rng.integers(4, size=count))
        elif kind == "place":  # anywhere, its back to the wall behind it
            center[chain, i] = rng.uniform(scene.bounds[:2], scene.bounds[2:], (count, 2))
            quarter[chain, i] = np.where(turns, rng.integers(4, size=count), quarter[chain, i])
            box = boxes_at(center[chain, i], scene.half[i, quarter[chain, i] % 4])
            self._slide(center, i, ahead(box, scene.solids), quarter[chain, i] + 2)
        elif kind == "beside":  # touching another on a side, their middles or ends in line
            j = rng.integers(quarter.shape[1], size=count)
            side = FACINGS[rng.integers(4, size=count)]
            quarter[chain, i] = np.where(turns & (j != i), rng.integers(4, size=count), quarter[chain, i])
            mine, its = scene.half[i, quarter[chain, i] % 4], scene.half[j, quarter[chain, j]]
            along = (its - mine) * rng.integers(-1, 2, (count, 1)) * (side == 0)
            there = center[chain, j] + side * (its + mine) + along
            center[chain, i] = np.where((j != i)[:, None], there, center[chain, i])
        return center, quarter % 4

    def _within(self, center: Array) -> Array:
        """Return whether all movable items are in the box around the floor (C,): far outside no rule costs anything."""
        there = center[:, self.scene.movable]
        low, high = np.split(self.scene.bounds, 2)
        return np.all((low <= there) & (there <= high), (1, 2))

    def _slide(self, center: Array, i: Array, way: Array, direction: Array) -> None:
        direction = direction % 4
        center[self.chain, i] += FACINGS[direction] * way[self.chain, direction, None]


def _between(first: float, last: float, share: float) -> float:
    """Interpolate geometrically from the first to the last."""
    return float(first * (last / first) ** share)
