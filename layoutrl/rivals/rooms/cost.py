"""What is wrong with many layouts of a scene at once: rules broken, and relations not kept. Metres."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from layoutrl.rivals.rooms.relations import ALONE_TERMS, PAIR_TERMS, Kept, Relations
from layoutrl.rivals.rooms.scene import Array, Scene, boxes_at, daylight, depth, keep_free, unreached
from layoutrl.rooms.room import TOLERANCE

FAULT = 0.3  # metres that anything deeper than TOLERANCE counts on top, so that none is bought for a better place
RULES = ("outside", "overlap", "doors", "daylight", "fronts", "unreached")
SOFT = (*ALONE_TERMS, *PAIR_TERMS, "balance")


class Cost:
    """Costs of layouts, centres (C, n, 2) and facings (C, n): `rules` in metres and items, `soft` weighted."""

    def __init__(self, scene: Scene, relations: Relations, weights: Mapping[str, float]):
        self.scene, self.weights = scene, weights
        self.kept = Kept(scene, relations)
        names = [item.category for item in scene.brief.furniture]
        self.item = np.arange(len(names))
        self.doors = keep_free(scene, relations.clear)
        self.windows = daylight(scene)
        self.tall = np.array([name in relations.tall for name in names], dtype=bool)
        self.alone_weights = np.array([weights[term] for term in ALONE_TERMS])
        self.pair_weights = np.array([weights[term] for term in PAIR_TERMS])
        self.apart = np.triu(~scene.may_overlap, 1)  # each pair once
        self.area = 4 * scene.half[:, 0].prod(-1)
        self.middle = (scene.bounds[:2] + scene.bounds[2:]) / 2

    def boxes(self, center: Array, quarter: Array) -> Array:
        """The boxes (C, n, 4) of the items."""
        return boxes_at(center, self.scene.half[self.item, quarter])

    def faults(self, center: Array, quarter: Array, box: Array) -> dict[str, Array]:
        """By rule (C,): summed depths in metres, FAULT more for each that is more than drawing noise."""
        front = self.fronts(center, quarter)
        others = _fault(depth(front[:, :, None], box[:, None])) * ~self.scene.may_stand_before
        walls = _fault(depth(front[:, :, None], self.scene.solids))
        return {
            "outside": _fault(depth(box[:, :, None], self.scene.solids)).sum((1, 2)),
            "overlap": (_fault(depth(box[:, :, None], box[:, None])) * self.apart).sum((1, 2)),
            "doors": _fault(depth(box[:, :, None], self.doors)).sum((1, 2)),
            "daylight": _fault(depth(box[:, self.tall, None], self.windows)).sum((1, 2)),
            "fronts": (others.sum(2) + walls.sum(2))[:, self.scene.has_front].sum(1),
        }

    def fronts(self, center: Array, quarter: Array) -> Array:
        """The floor (C, n, 4) before the items."""
        at = self.item, quarter
        return boxes_at(center + self.scene.front_offset[at], self.scene.front_half[at])

    def soft(self, center: Array, quarter: Array, box: Array) -> dict[str, Array]:
        """By term (C,), not weighted: relations, summed over items and pairs of items; and visual balance."""
        alone = self.kept.alone(box, quarter).sum(1)
        pairs = self.kept.pairs(
            box[:, :, None], quarter[:, :, None], box[:, None], quarter[:, None], slice(None), slice(None)
        ).sum((1, 2))
        off = (self.area[:, None] * center).sum(1) / self.area.sum() - self.middle
        balance = np.hypot(off[:, 0], off[:, 1])
        return dict(zip(SOFT, (*alone.T, *pairs.T, balance), strict=True))

    def rules(self, center: Array, quarter: Array, box: Array) -> Array:
        """The weighted faults (C,) but for `unreached`, which takes longer."""
        return sum(self.weights[name] * value for name, value in self.faults(center, quarter, box).items())

    def preference(self, center: Array, quarter: Array, box: Array) -> Array:
        """The weighted soft terms (C,)."""
        return sum(self.weights[name] * value for name, value in self.soft(center, quarter, box).items())

    def unreached(self, box: Array) -> Array:
        """The weighted number of items (C,) that nobody reaches."""
        return self.weights["unreached"] * unreached(self.scene, box)


def _fault(depths: Array) -> Array:
    return depths + FAULT * (depths > TOLERANCE)
