"""The costs of many layouts of a scene at once, for broken rules and for relations that are not kept. Metres."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from layoutrl.rivals.rooms.relations import ALONE_TERMS, PAIR_TERMS, RelationCosts, Relations
from layoutrl.rivals.rooms.scene import Array, Scene, boxes_at, daylight, depth, keep_free, unreached
from layoutrl.rooms.room import TOLERANCE

RULES = ("outside", "overlap", "doors", "daylight", "fronts", "unreached")  # terms, each with a weight
PREFERENCES = (*ALONE_TERMS, *PAIR_TERMS, "balance")
FAULT = 0.3  # metres added to each depth above TOLERANCE, so that no better place is worth a fault; unsourced


class Cost:
    """The weighted costs of layouts, centres (C, n, 2) and facings (C, n), by `rules` and by `preference`."""

    def __init__(self, scene: Scene, relations: Relations, weights: Mapping[str, float]):
        self.scene, self.weights = scene, weights
        self.relation_costs = RelationCosts(scene, relations)
        names = [item.category for item in scene.brief.furniture]
        self.item = np.arange(len(names))
        self.doors = keep_free(scene, relations.clear)
        self.windows = daylight(scene)
        self.tall = np.array([name in relations.tall for name in names], dtype=bool)
        self.alone_weights = np.array([weights[term] for term in ALONE_TERMS])
        self.pair_weights = np.array([weights[term] for term in PAIR_TERMS])
        _, self.category, count = np.unique(names, return_inverse=True, return_counts=True)
        self.itself = np.eye(len(names), dtype=bool)
        # An item is not its own partner; the only one of its category has none there, at no cost.
        self.with_itself = np.where(count[self.category] > 1, np.inf, 0.0)
        self.apart = np.triu(~scene.may_overlap, 1)  # each pair once
        self.area = 4 * scene.half[:, 0].prod(-1)
        self.middle = (scene.bounds[:2] + scene.bounds[2:]) / 2

    def boxes(self, center: Array, quarter: Array) -> Array:
        """The boxes (C, n, 4) of the items."""
        return boxes_at(center, self.scene.half[self.item, quarter])

    def faults(self, center: Array, quarter: Array, box: Array) -> dict[str, Array]:
        """Return the summed depths (C,) in metres by rule, with FAULT added to each that is more than drawing noise."""
        front = self.fronts(center, quarter)
        others = _fault(depth(front[:, :, None], box[:, None])) * ~self.scene.may_stand_before
        walls = _fault(depth(front[:, :, None], self.scene.solids))
        return {
            "outside": _fault(depth(box[:, :, None], self.scene.solids)).sum((1, 2)),
            "overlap": (_fault(depth(box[:, :, None], box[:, None])) * self.apart).sum((1, 2)),
            "doors": _fault(depth(box[:, :, None], self.doors)).sum((1, 2)),
            "daylight": _fault(depth(box[:, self.tall, None], self.windows)).sum((1, 2)),
            "fronts": others.sum((1, 2)) + walls.sum((1, 2)),
        }

    def fronts(self, center: Array, quarter: Array) -> Array:
        """Return the floor (C, n, 4) before the items; for those that keep none free a line, which nothing overlaps."""
        at = self.item, quarter
        return boxes_at(center + self.scene.front_offset[at], self.scene.front_half[at])

    def pairs(self, box: Array, quarter: Array) -> Array:
        """Return the weighted cost (C,) of pairs: of every item with its cheapest partner in every category."""
        every = slice(None)
        costs = self.relation_costs.pairs(
            box[:, :, None], quarter[:, :, None], box[:, None], quarter[:, None], every, every
        )
        one_way = costs @ self.pair_weights
        both = np.where(self.itself, self.with_itself, one_way + one_way.swapaxes(1, 2))
        return self.best_partners(both, self.item).sum(1) / 2

    def best_partners(self, both: Array, others: Array) -> Array:
        """Return the sum (...) over categories of the least of the costs (..., k) with other items (k,)."""
        if not len(others):
            return np.zeros(both.shape[:-1])
        order = np.argsort(self.category[others], kind="stable")
        first = np.flatnonzero(np.diff(self.category[others][order], prepend=-1))
        return np.minimum.reduceat(both[..., order], first, axis=-1).sum(-1)

    def rules(self, center: Array, quarter: Array, box: Array) -> Array:
        """Return the weighted sum (C,) of the faults without `unreached`, which takes longer."""
        found = self.faults(center, quarter, box)
        return np.sum([self.weights[name] * value for name, value in found.items()], axis=0)

    def preference(self, center: Array, quarter: Array, box: Array) -> Array:
        """Return the weighted cost (C,) of what is no fault: relations of items and of pairs, and visual balance."""
        alone = self.relation_costs.alone(box, quarter).sum(1) * self.alone_weights
        off = (self.area[:, None] * center).sum(1) / self.area.sum() - self.middle
        balance = self.weights["balance"] * np.hypot(off[:, 0], off[:, 1])
        return np.sum([*alone.T, self.pairs(box, quarter), balance], axis=0)

    def unreached(self, box: Array) -> Array:
        """Return the weighted number (C,) of items that cannot be reached from the entrance."""
        return self.weights["unreached"] * unreached(self.scene, box)


def _fault(depths: Array) -> Array:
    return depths + FAULT * (depths > TOLERANCE)
