"""Constraint search for whole rooms, after Holodeck (Yang et al. 2024): greedy with restarts over a grid of places.

Items are placed largest first, where they break no rule among those that stand already. The places that keep relations
best are tried first, with noise from the second restart on; if an item finds no place, the one before it is moved.
Where a restart finds no whole layout, each item in turn takes its best place, if need be one that cannot be reached or
that bars others: reach is the only rule that is ever broken. The best restart lacks the fewest items, counting those
out of reach, and then keeps relations best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.rooms.cost import Cost
from layoutrl.rivals.rooms.relations import Relations
from layoutrl.rivals.rooms.scene import FACINGS, STRIP, Array, Scene, boxes_at, depth, scene_of, unreached
from layoutrl.rooms.brief import largest_first
from layoutrl.rooms.room import FIT, Room

Pose = tuple[Array, int]  # centre (2,) and facing
LOOKED_AT = 4  # times as many places are tested for reach as are tried, so that some pass; unsourced
AWAY = np.full(4, -1e3)  # a box outside the room, for items that are not placed


@dataclass(kw_only=True)
class Searching:
    """Settings of the search; `conf/rival/search.yaml` has the values and their sources."""

    grid: float  # metres between places
    flush: bool  # whether it also tries places that touch standing items, not walls alone
    best: int  # most places of an item that are tried before the one before it is moved
    nodes: int  # most places that are tried in a restart
    noise: float  # scale of the noise on the costs by which places are ranked, so that restarts differ
    weights: dict[str, float]  # of PREFERENCES


class CandidatePoses(NamedTuple):
    """Poses (N) of one item that break no rule of the bare room, with their boxes and the floor before them (N, 4)."""

    center: Array  # (N, 2)
    quarter: Array  # (N,)
    box: Array
    front: Array
    cost: Array  # (N,) weighted sum of ALONE_TERMS

    def some(self, which: Array) -> CandidatePoses:
        """Return those that a mask or indices select."""
        return CandidatePoses(*(values[which] for values in self))

    def then(self, more: CandidatePoses) -> CandidatePoses:
        """Return these poses, followed by more."""
        return CandidatePoses(*map(np.concatenate, zip(self, more, strict=True)))


def search(brief: Room, relations: Relations, settings: Searching, spent: Spent, rng: np.random.Generator) -> Room:
    """Return the best layout found. `spent` counts restarts, of which the first is never cut short.

    Items that find no place have no centre.
    """
    spent(0)  # a clock begins here, not after the first restart
    scene = scene_of(brief)
    if not len(scene.movable):
        return brief
    finder = Finder(scene, relations, settings, rng)
    while not finder.restarts or spent(finder.restarts) < 1:
        finder.restart(lambda: spent(finder.restarts) >= 1)
    return scene.layout(*finder.best)


class Finder:
    """The search in one room; `best` is the best layout so far: centres (n, 2), facings (n,), which are placed (n,)."""

    def __init__(self, scene: Scene, relations: Relations, settings: Searching, rng: np.random.Generator):
        self.scene, self.settings, self.rng = scene, settings, rng
        self.cost = Cost(scene, relations, settings.weights)
        self.order = largest_first(scene.brief)
        self.poses = {i: self._legal(i, *self._grid(i)) for i in self.order}
        self.center, self.quarter = scene.center.copy(), scene.quarter.copy()  # of the layout in the making
        self.placed = ~np.isin(np.arange(len(scene.center)), scene.movable)
        self.lowest = (len(scene.center) + 1, np.inf)  # items without a place or out of reach, and cost
        self.best = self.center.copy(), self.quarter.copy(), self.placed.copy()
        self.restarts = 0

    def restart(self, over: Callable[[], bool]) -> None:
        """Make one more layout and keep the best. But for the first, it is cut short when the budget is `over`."""
        standing = self.placed.copy()
        self.nodes = self.settings.nodes
        if not self._extended(0, over):
            self.placed[:] = standing
            for i in self.order:  # without going back: an item that has no place, even out of reach, is left out
                for place in (self._ranked(i) or self._ranked(i, anywhere=True))[:1]:
                    self._put(i, place)
            self._remember()
        self.placed[:] = standing
        self.restarts += 1

    def _extended(self, k: int, over: Callable[[], bool]) -> bool:
        """Place items `k` and following in order, and return whether all find places."""
        if k == len(self.order):
            self._remember()
            return True
        i = self.order[k]
        for place in self._ranked(i):
            if self.nodes <= 0 or (self.restarts and over()):
                return False
            self.nodes -= 1
            self._put(i, place)
            if self._extended(k + 1, over):
                return True
            self.placed[i] = False
        return False

    def _put(self, i: int, place: Pose) -> None:
        self.center[i], self.quarter[i] = place
        self.placed[i] = True

    def _ranked(self, i: int, anywhere: bool = False) -> list[Pose]:
        """Return the best places of an item among the standing ones, ranked without noise in the first restart.

        The item, and as many of the standing ones as before, can be reached there, unless it may be `anywhere`.
        """
        poses = self.poses[i]
        if self.settings.flush and self.placed.any():
            poses = poses.then(self._legal(i, *self._beside(i)))
        others = np.flatnonzero(self.placed)
        box = self.cost.boxes(self.center[None], self.quarter[None])[0, others]
        front = self.cost.fronts(self.center[None], self.quarter[None])[0, others]
        scene, costs, weights = self.scene, self.cost.relation_costs, self.cost.pair_weights
        clash = (depth(poses.box[:, None], box) > FIT) & ~scene.may_overlap[i, others]
        clash |= (depth(poses.front[:, None], box) > FIT) & ~scene.may_stand_before[i, others]
        clash |= (depth(poses.box[:, None], front) > FIT) & ~scene.may_stand_before[others, i]
        poses = poses.some(~clash.any(1))
        mine, facing, its = poses.box[:, None], poses.quarter[:, None], self.quarter[others]
        pairs = costs.pairs(mine, facing, box, its, i, others) + costs.pairs(box, its, mine, facing, others, i)
        cost = poses.cost + self.cost.best_partners(pairs @ weights, others)
        if self.restarts:
            cost = cost + self.settings.noise * self.rng.gumbel(size=len(cost))
        best = poses.some(np.argsort(cost, kind="stable")[: LOOKED_AT * self.settings.best])
        if not anywhere:
            boxes = np.tile(AWAY, (1 + len(best.box), len(self.placed), 1))
            boxes[:, others], boxes[1:, i] = box, best.box
            lost = unreached(scene, boxes)  # row 0 is without the item, which counts as not reached
            best = best.some(lost[1:] <= max(lost[0] - 1, 0))
        return list(zip(best.center, best.quarter.tolist(), strict=True))[: self.settings.best]

    def _remember(self) -> None:
        """Keep the layout if it is the best so far."""
        on = self.placed
        boxes = self.cost.boxes(self.center[None], self.quarter[None])
        lost = np.maximum(unreached(self.scene, np.where(on[:, None], boxes, AWAY)), (~on).sum())  # 0 without doors
        soft = self.cost.preference(self.center[None], self.quarter[None], boxes)
        score = int(lost[0]), float(soft[0])
        if score < self.lowest:
            self.lowest, self.best = score, (self.center.copy(), self.quarter.copy(), on.copy())

    def _grid(self, i: int) -> tuple[Array, Array]:
        """Return centres (N, 2) and facings (N,): of a grid, and of places that touch a wall along an axis.

        The strips of slanting walls are left out: they would make tens of thousands of places.
        """
        found = []
        solids = self.scene.solids[self.scene.solids[:, 2] - self.scene.solids[:, 0] > STRIP + FIT]
        for quarter in self._facings(i):
            half = self.scene.half[i, quarter]
            lines = []
            for axis in (0, 1):
                low, high = self.scene.bounds[axis] + half[axis], self.scene.bounds[axis + 2] - half[axis]
                touching = np.concatenate([solids[:, axis] - half[axis], solids[:, axis + 2] + half[axis]])
                line = np.concatenate([np.arange(low, high, self.settings.grid), touching])
                lines.append(np.unique(line[(line > low - FIT) & (line < high + FIT)].round(6)))
            x, y = np.meshgrid(*lines)
            found.append((np.stack([x.ravel(), y.ravel()], -1), np.full(x.size, quarter)))
        return np.concatenate([c for c, _ in found]), np.concatenate([q for _, q in found])

    def _beside(self, i: int) -> tuple[Array, Array]:
        """Return centres (N, 2) and facings (N,) that touch a standing item on a side, middles or ends in line."""
        others = np.flatnonzero(self.placed)
        j, side, end, quarter = (
            a.ravel() for a in np.meshgrid(others, np.arange(4), (-1, 0, 1), self._facings(i), indexing="ij")
        )
        mine, its = self.scene.half[i, quarter], self.scene.half[j, self.quarter[j]]
        way = FACINGS[side]
        along = (its - mine) * end[:, None] * (way == 0)
        return self.center[j] + way * (its + mine) + along, quarter

    def _facings(self, i: int) -> Array:
        return np.arange(4) if self.scene.turnable[i] else self.scene.quarter[[i]]

    def _legal(self, i: int, center: Array, quarter: Array) -> CandidatePoses:
        """Return the poses, of those given, that break no rule in the bare room."""
        scene, cost = self.scene, self.cost
        box = boxes_at(center, scene.half[i, quarter])
        front = boxes_at(center + scene.front_offset[i, quarter], scene.front_half[i, quarter])
        solids = np.concatenate([scene.solids, cost.doors, *([cost.windows] if cost.tall[i] else [])])
        fits = (depth(box[:, None], solids) <= FIT).all(1)
        fits &= (depth(front[:, None], scene.solids) <= FIT).all(1)
        alone = cost.relation_costs.alone(box[fits], quarter[fits], i) @ cost.alone_weights
        return CandidatePoses(center[fits], quarter[fits], box[fits], front[fits], alone)
