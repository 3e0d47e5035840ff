"""Placement of furniture along a graph (Wang et al. 2019, section 6.4): where its edges say, if nothing is in the way.

No item lies more than a centimetre outside the room or in another, unless it stands under or on that by intent. Where
an item finds no place, what is in its way is taken back, a limited number of times.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import shapely
import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from layoutrl.env.geometry import GRID
from layoutrl.rivals.planit.canvas import Canvas, box_of, in_frame, overlapping
from layoutrl.rivals.planit.graph import (
    ADJACENT,
    DISTANT,
    SUPPORT,
    TURN,
    Graph,
    Relation,
    Scene,
    distance_of,
    faces_across,
    gap,
    placing_order,
)
from layoutrl.rivals.planit.model import PlanIT
from layoutrl.rivals.planit.networks import HEAT_SIDE, SIDE
from layoutrl.rooms.room import TOLERANCE, Item, Point, Room

TEMPERATURE = 0.8  # of draws from heat maps
TRIALS = 15  # of places for one item
BACKTRACKS = 25  # of one room
PATIENCE = 0.25  # share of BACKTRACKS after which relations may be missed
SNAP = 0.24  # metres at most that an item is moved, to touch the anchor of an edge that says adjacent
TOUCHES = 0.05  # metres: most for an adjacent edge to hold after that
PROXIMAL_WITHIN, DISTANT_BEYOND = 0.71, 0.38  # metres: most for a proximal edge to hold, least for a distant one
MISSED = 1.2  # metres off at which a relation counts for nothing
BLOCK = 128  # edges seen at once: memory, not speed


class Query(NamedTuple):
    """An item to place in a room, after those that are `placed`, by node, and along the edges that lead to it."""

    room: int
    category: str
    edges: Sequence[Relation]
    placed: Mapping[int, Item]


@dataclass(frozen=True)
class Layout:
    """What was placed, by node, and the nodes for which there was no place."""

    placed: dict[int, Item]
    missing: list[int]


@dataclass
class Choosing:
    """How places, facings and sizes are chosen: the likeliest, or drawn by `rng`, sizes by `noise`."""

    rng: np.random.Generator | None = None
    noise: torch.Generator | None = None
    in_the_way: Counter[int] = field(default_factory=Counter)  # how often trials met each node


class Placer:
    """A trained PlanIT, and the rooms that it furnishes. It must know all categories of their furniture."""

    def __init__(self, model: PlanIT, rooms: Sequence[Room], scenes: Sequence[Scene]):
        self.model, self.rooms, self.scenes = model, rooms, scenes
        self.canvas = Canvas(rooms, model.statistics.categories, model.device)
        envelopes = [room.envelope.buffer(GRID, join_style="mitre") for room in rooms]  # for sides without a wall
        self.floors = [
            shapely.intersection(room.indoor.buffer(TOLERANCE, join_style="mitre"), envelope)
            for room, envelope in zip(rooms, envelopes, strict=True)
        ]
        shapely.prepare(self.floors)
        self.pixel = 2 * model.statistics.span / HEAT_SIDE  # metres a side of a pixel of heat maps
        axis = (np.arange(HEAT_SIDE // 2) + 0.5 - HEAT_SIDE // 4) * self.pixel
        bounds = np.array([room.envelope.bounds for room in rooms])
        middle = (bounds[:, :2] + bounds[:, 2:]) / 2
        self.cells = middle[:, None] + np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)  # (R, cells, 2)
        self.sizes = {
            category: np.array([size[:2] for size in sizes]) for category, sizes in model.statistics.sizes.items()
        }

    @torch.no_grad()
    def heat(self, queries: Sequence[Query]) -> list[np.ndarray]:
        """Return heat maps (cells,), one for each query: the product over its edges, which adds up to 1.

        They are zero outdoors. Without edges all cells indoors are alike.
        """
        model, span = self.model, self.model.statistics.span
        wanted = [(k, relation) for k, query in enumerate(queries) for relation in query.edges]
        logs = [np.zeros(len(self.cells[0])) for _ in queries]
        for first in range(0, len(wanted), BLOCK):
            block = wanted[first : first + BLOCK]
            asked = [queries[k] for k, _ in block]
            nodes = [self._node(query, edge.anchor) for query, (_, edge) in zip(asked, block, strict=True)]
            anchor = torch.tensor(np.array([box for box, _ in nodes]), dtype=torch.float32, device=model.device)
            quarters = torch.tensor([facing for _, facing in nodes], device=model.device)
            center = (anchor[:, :2] + anchor[:, 2:]) / 2
            straight = torch.zeros(len(block), dtype=torch.bool, device=model.device)
            room = torch.tensor([query.room for query in asked], device=model.device)
            furniture = self.canvas.furniture([list(query.placed.values()) for query in asked])
            picture = self.canvas.draw(
                room, furniture, center, quarters, straight, reach=span, side=SIDE, anchor=anchor
            )
            type = torch.tensor([edge.type for _, edge in block], device=model.device)
            chance = model.location(picture, type).softmax(1)
            classes = [1 + self.canvas.categories[query.category] for query in asked]
            chance = chance[torch.arange(len(block)), classes]
            cells = torch.tensor(self.cells[[q.room for q in asked]], dtype=torch.float32, device=model.device)
            where = in_frame(torch.cat([cells, cells], -1), center, quarters, straight)[..., :2] / span
            found = grid_sample(chance[:, None], where[:, None], align_corners=False)[:, 0, 0]
            found = (found / found.sum(1, keepdim=True).clamp(min=1e-12)).clamp(min=1e-12).log()
            for (k, _), log in zip(block, found.cpu().numpy(), strict=True):
                logs[k] += log
        heats = []
        for query, log in zip(queries, logs, strict=True):
            inside = shapely.contains_xy(self.rooms[query.room].indoor, self.cells[query.room])
            heat = np.exp(log - log[inside].max(initial=-np.inf)) * inside if inside.any() else np.ones_like(log)
            heats.append(heat / heat.sum())
        return heats

    def find(
        self,
        query: Query,
        heat: np.ndarray,
        choosing: Choosing,
        *,
        size: Item | None = None,
        tolerance: float = 0.0,
        avoid: Sequence[Point] = (),
    ) -> Item | None:
        """Return the item at the first legal place of TRIALS at which edges hold within `tolerance`, or None.

        `size` is an item whose size, form and, if it has one, rotation are taken; `avoid` are centres that were tried
        before.
        """
        tried = self._trials(query, heat, choosing, size, avoid)
        return next((item for item, held in tried if held >= 1 - tolerance), None)

    def target(self, query: Query, heat: np.ndarray, choosing: Choosing, size: Item | None = None) -> Item | None:
        """Return the item, while all others stay, at the first legal place of TRIALS at which all edges hold, or else
        at the one at which they hold best; None if no place is legal."""
        best: tuple[float, Item | None] = (-1.0, None)
        for item, held in self._trials(query, heat, choosing, size):
            if held > best[0]:
                best = held, item
            if held == 1:
                break
        return best[1]

    def _trials(
        self, query: Query, heat: np.ndarray, choosing: Choosing, size: Item | None, avoid: Sequence[Point] = ()
    ) -> Iterator[tuple[Item, float]]:
        """Yield the item at each legal place, in the order in which they are tried, and how well edges hold, 0 to 1."""
        cells, heat = self.cells[query.room], heat.copy()
        for number, center in enumerate(avoid, 1):
            self._forget(heat, cells, np.array(center), number)
        trial = 0
        for together in (1, TRIALS - 1):  # the first is often good; the others are cheaper all at once
            centers: list[np.ndarray] = []
            while len(centers) < together and heat.sum() > 0:
                centers.append(self._center(heat, cells, choosing))
                trial += 1
                self._forget(heat, cells, centers[-1], trial)
            for item in self._items(query, np.array(centers), choosing, size) if centers else ():
                snapped = self._snapped(query, item)
                met = self._collisions(query, snapped)
                choosing.in_the_way.update(met)
                if not met and self._indoors(query.room, snapped):
                    yield snapped, self._held(query, snapped)

    def furnish(
        self,
        room: int,
        names: Sequence[str],
        graph: Graph,
        choosing: Choosing,
        sizes: Sequence[Item] | None = None,
    ) -> Layout:
        """Place all items of a graph in an empty room. `names` are their categories, from the scene's first item on.

        `sizes` are items whose sizes and forms they take, and rotations, where these are known. Where no place is
        found, what was in the way most often is taken back, with all that came after it; after BACKTRACKS of these
        an item is left out.
        """
        fixed = self.scenes[room].fixed
        area = {fixed + k: float(np.prod(self.sizes[name], 1).mean()) for k, name in enumerate(names)}
        order = placing_order(graph, area)
        placed: dict[int, Item] = {}
        missing: list[int] = []
        tried: dict[int, list[Point]] = {}
        heats: dict[tuple[Any, ...], np.ndarray] = {}
        backtracks, k = 0, 0
        while k < len(order):
            node = order[k]
            edges = [r for r in graph[node] if r.anchor < fixed or r.anchor in placed]
            query = Query(room, names[node - fixed], edges, dict(placed))
            choosing.in_the_way.clear()
            known = node, *placed.items()
            if known not in heats:  # what is taken back is often put where it was
                heats[known] = self.heat([query])[0]
            item = self.find(
                query,
                heats[known],
                choosing,
                size=None if sizes is None else sizes[node - fixed],
                tolerance=_tolerance(backtracks),
                avoid=tried.get(node, ()),
            )
            if item is not None:
                placed[node] = item
                k += 1
            elif backtracks == BACKTRACKS:
                missing.append(node)
                k += 1
            else:
                backtracks += 1
                k = self._back_to(order, k, placed, choosing)
                if order[k] in placed:
                    tried.setdefault(order[k], []).append(placed[order[k]].center or (0.0, 0.0))
                for later in order[k + 1 :]:
                    tried.pop(later, None)
                for later in order[k:]:
                    placed.pop(later, None)
        return Layout(placed, missing)

    @staticmethod
    def _back_to(order: Sequence[int], k: int, placed: Mapping[int, Item], choosing: Choosing) -> int:
        """Return the step to take back: that of what was in the way most often, or the last that placed something."""
        conflicts = [(count, node) for node, count in choosing.in_the_way.items() if node in placed]
        if conflicts:
            return order.index(max(conflicts)[1])
        return max((n for n in range(k) if order[n] in placed), default=k)

    def _node(self, query: Query, node: int) -> tuple[np.ndarray, int]:
        """Return the box and the facing, in quarters, of an anchor: a wall or opening of the room, or a placed item."""
        scene = self.scenes[query.room]
        if node < scene.fixed:
            return scene.box[node], int(scene.facing[node])
        item = query.placed[node]
        return np.array(box_of(item)), int(item.degrees // 90) % 4

    def _center(self, heat: np.ndarray, cells: np.ndarray, choosing: Choosing) -> np.ndarray:
        """Return the middle (2,) of the likeliest cell, or of one that is drawn, averaged with its neighbours by heat.

        PlanIT has twice as many pixels a side, and takes a pixel's middle.
        """
        if choosing.rng is None:
            chosen = int(heat.argmax())
        else:
            chance = (heat / heat.max()) ** (1 / TEMPERATURE)
            chosen = int(choosing.rng.choice(len(chance), p=chance / chance.sum()))
        near = np.abs(cells - cells[chosen]).max(1) < 1.5 * self.pixel
        return np.average(cells[near], axis=0, weights=heat[near])

    def _forget(self, heat: np.ndarray, cells: np.ndarray, center: np.ndarray, times: int) -> None:
        """Set the heat to 0, in place, in a circle around a tried place that grows with the number of trials."""
        heat[np.linalg.norm(cells - center, axis=1) <= self.pixel * (0.5 + 0.25 * times)] = 0.0

    @torch.no_grad()
    def _items(self, query: Query, centers: np.ndarray, choosing: Choosing, size: Item | None) -> list[Item]:
        """Return the item at each of n centres, with the facing and the size that the networks predict unless given."""
        if size is not None and size.rotation is not None:
            return [replace(size, category=query.category, center=(float(x), float(y))) for x, y in centers]
        model, canvas, many = self.model, self.canvas, len(centers)
        furniture = canvas.furniture([[*query.placed.values()]]).expand(many, -1, -1)
        room = torch.full((many,), query.room, device=model.device)
        here = torch.tensor(centers, dtype=torch.float32, device=model.device)
        straight = torch.zeros(many, dtype=torch.bool, device=model.device)
        category = torch.zeros(many, len(canvas.categories), device=model.device)
        category[:, canvas.categories[query.category]] = 1.0
        reach = model.statistics.span / 2

        def picture(quarters: Tensor) -> Tensor:
            return canvas.draw(room, furniture, here, quarters, straight, reach=reach, side=SIDE)

        chance = model.orientation(picture(torch.zeros_like(room)), category).softmax(1).cpu().double().numpy()
        draws = None if choosing.rng is None else choosing.rng.random((many, 1))
        facing = chance.argmax(1) if draws is None else (chance.cumsum(1) > draws).argmax(1)
        if size is not None:
            return [
                replace(size, category=query.category, center=(float(x), float(y)), rotation=90.0 * int(quarter))
                for (x, y), quarter in zip(centers, facing, strict=True)
            ]
        said = model.size(picture(torch.tensor(facing, device=model.device)), category, choosing.noise).cpu().numpy()
        known, sizes = self.sizes[query.category], model.statistics.sizes[query.category]
        nearest = np.linalg.norm(known - said[:, None] * reach, axis=-1).argmin(1)
        return [
            Item(
                query.category, sizes[k][:2], (float(x), float(y)), 90.0 * int(quarter),
                "circle" if sizes[k][2] else "rectangle",
            )
            for (x, y), quarter, k in zip(centers, facing, nearest, strict=True)
        ]  # fmt: skip

    def _snapped(self, query: Query, item: Item) -> Item:
        """Return the item, moved to touch what it is adjacent to if it is no more than SNAP away."""
        for edge in query.edges:
            if distance_of(edge.type) != ADJACENT or edge.type == SUPPORT:
                continue
            if self._stands_under(item, query.placed.get(edge.anchor)):
                continue
            anchor, box = self._node(query, edge.anchor)[0], np.array(box_of(item))
            quarter = self._direction(query, edge, anchor, box)
            off = gap(anchor, box, quarter)
            if abs(off) <= SNAP:
                assert item.center is not None
                along = np.array(((1, 0), (0, 1), (-1, 0), (0, -1))[quarter]) * off
                item = replace(item, center=(float(item.center[0] - along[0]), float(item.center[1] - along[1])))
        return item

    def _direction(self, query: Query, edge: Relation, anchor: np.ndarray, box: np.ndarray) -> int:
        """The quarter of the room in which an edge leads; from a round anchor, that in which the item lies."""
        _, facing = self._node(query, edge.anchor)
        circle = edge.anchor in query.placed and query.placed[edge.anchor].form == "circle"
        if circle:
            return int(np.argmax([gap(anchor, box, quarter) for quarter in range(4)]))
        return (facing + TURN[edge.type // 3]) % 4

    def _stands_under(self, item: Item, other: Item | None) -> bool:
        """Return whether one of the two may, by their categories, stand partly under the other."""
        tucked = self.model.statistics.tucked
        return other is not None and (
            (item.category, other.category) in tucked or (other.category, item.category) in tucked
        )

    def _collisions(self, query: Query, item: Item) -> list[int]:
        """Return the nodes that the item overlaps by more than a centimetre, but for those it stands under or on."""
        supports = {edge.anchor for edge in query.edges if edge.type == SUPPORT}
        return [
            node
            for node, other in query.placed.items()
            if node not in supports and not self._stands_under(item, other) and overlapping(box_of(item), box_of(other))
        ]

    def _indoors(self, room: int, item: Item) -> bool:
        return bool(shapely.covers(self.floors[room], shapely.box(*box_of(item))))

    def _held(self, query: Query, item: Item) -> float:
        """How well the worst of the edges holds, 0 to 1."""
        box, worst = np.array(box_of(item)), 1.0
        for edge in query.edges:
            anchor, distance = self._node(query, edge.anchor)[0], distance_of(edge.type)
            if edge.type == SUPPORT:
                beyond = max((anchor[:2] - box[:2]).max(), (box[2:] - anchor[2:]).max())
                worst = min(worst, 1.0 if beyond <= TOLERANCE else 0.0)
                continue
            quarter = self._direction(query, edge, anchor, box)
            off = gap(anchor, box, quarter)
            if not faces_across(anchor, box, quarter):
                missed = MISSED
            elif distance == DISTANT:
                missed = DISTANT_BEYOND - off
            else:
                missed = off - (TOUCHES if distance == ADJACENT else PROXIMAL_WITHIN)
                if not self._stands_under(item, query.placed.get(edge.anchor)):
                    missed = max(missed, -TOUCHES - off)  # in it, or on its other side
            worst = min(worst, 1 - missed / MISSED if missed > 0 else 1.0)
        return max(worst, 0.0)


def _tolerance(backtracks: int) -> float:
    """How far a relation may be missed, 0 to 1: nothing at first, anything in the end."""
    begin = PATIENCE * BACKTRACKS
    return float(max(0.0, (backtracks - begin) / (BACKTRACKS - begin)) ** 1.5)
