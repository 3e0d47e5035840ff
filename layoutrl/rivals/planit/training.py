"""The training of PlanIT: all networks side by side, in each update on a few random decisions in random rooms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import cross_entropy, l1_loss, one_hot, softplus
from torch.nn.utils.rnn import pad_sequence

from layoutrl.agents.networks import weights_of
from layoutrl.env.device import generator_of
from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.planit import generator
from layoutrl.rivals.planit.canvas import Canvas, in_frame
from layoutrl.rivals.planit.graph import MIRRORED, Graph, Relation, Scene, graph_of, graph_with_last, placing_order
from layoutrl.rivals.planit.model import PlanIT, Statistics
from layoutrl.rivals.planit.networks import HEAT_SIDE, SIDE, PictureNetwork, drawn, signed_distance
from layoutrl.rooms.brief import standing
from layoutrl.rooms.room import Item, Room

CENTROID_WEIGHT = 10.0  # in the loss, of a pixel that holds an item's centre; of others 1
DECISIONS = 4  # on each example's graph
SIZE_LOSSES = (20.0, 0.1, 0.1)  # weights: of the absolute error, the divergence, the discriminator
LOSSES = ("location", "orientation", "size", "graph", "discriminator")


@dataclass(frozen=True)
class Report:
    """Mean losses since the last report."""

    updates: int  # since the start
    loss: dict[str, float]  # by name, LOSSES


class Example(NamedTuple):
    """One item of a room that is to be placed next, after `placed`, along `edge`."""

    room: int
    scene: Scene
    graph: Graph
    item: int
    placed: frozenset[int]
    edge: Relation
    last: bool  # whether it comes after all others, whatever its category


class Training:
    """Trains until the budget is spent or `stopping` is set; iterating yields a Report every `report_every` updates.

    The learning rate falls linearly to 0 with the budget. Pictures are mirrored half of the time, and the orientation
    network's are turned. Half of the examples place items in the order of their graph; the other half place one after
    all others, and ask for its edges alone. Time that the caller takes for a report is not counted. A training resumes
    exactly from `state_dict` if its budget is of updates; if of seconds, it resumes with those that are left.
    """

    def __init__(
        self,
        model: PlanIT,
        rooms: Sequence[Room],
        scenes: Sequence[Scene],
        spent: Spent,
        *,
        batch: int,
        learning_rate: float,
        report_every: int,
        seed: np.random.SeedSequence,
    ):
        self.model, self.updates, self.stopping = model, 0, False
        self.share = 0.0  # of the budget that is spent
        self._rooms, self._scenes, self._spent = rooms, scenes, spent
        self._batch, self._learning_rate, self._report_every = batch, learning_rate, report_every
        drawing, weights, noise = seed.spawn(3)
        self._rng = np.random.default_rng(drawing)
        self._noise = generator_of(noise, model.device)
        statistics = model.statistics
        self._canvas = Canvas(rooms, statistics.categories, model.device)
        with weights_of(weights):
            categories = len(statistics.categories)
            self._discriminator = PictureNetwork(self._canvas.channels + 1, categories, 1).to(model.device)
        self._optimizer = torch.optim.Adam(model.parameters(), learning_rate, weight_decay=1e-8, fused=True)
        self._judging = torch.optim.Adam(self._discriminator.parameters(), learning_rate, fused=True)
        self._recent: dict[str, list[Tensor]] = {}
        self._furniture = [standing(room) for room in rooms]
        self._planned: dict[int, tuple[Graph, list[int]]] = {}  # by room, made on demand
        self._last: dict[tuple[int, int], Graph] = {}  # by room and item, made on demand

    def __iter__(self) -> Iterator[Report]:
        self.model.train()
        # What was spent before a resume, less what callers took for reports; of updates it is always 0.
        offset = self.share - self._spent(self.updates)
        while not self.stopping and self.share < 1:
            for optimizer in (self._optimizer, self._judging):
                for group in optimizer.param_groups:
                    group["lr"] = self._learning_rate * (1 - self.share)
            self._update()
            self.share = offset + self._spent(self.updates)
            if self.updates % self._report_every == 0:
                yield self._report()
                offset = self.share - self._spent(self.updates)
        if self._recent and not self.stopping:
            yield self._report()
        self.model.eval()

    def _report(self) -> Report:
        losses = {name: float(torch.stack(values).mean()) for name, values in self._recent.items()}
        self._recent = {}
        return Report(self.updates, losses)

    def _update(self) -> None:
        examples = [self._example() for _ in range(self._batch)]
        room = torch.tensor([example.room for example in examples], device=self.model.device)
        placed = [[self._item(e.room, k) for k in sorted(e.placed)] for e in examples]
        furniture = self._canvas.furniture(placed)
        mirrored = torch.tensor(self._rng.random(self._batch) < 0.5, device=self.model.device)
        size, judged = self._size_losses(examples, room, furniture, mirrored)
        losses = {
            "location": self._location_loss(examples, room, furniture, mirrored),
            "orientation": self._orientation_loss(examples, room, furniture, mirrored),
            "size": size,
            "graph": self._graph_loss(examples),
        }
        self._optimizer.zero_grad(set_to_none=True)
        torch.stack(list(losses.values())).sum().backward()
        self._optimizer.step()
        self._judging.zero_grad(set_to_none=True)
        judged.backward()
        self._judging.step()
        self.updates += 1
        for name, value in (losses | {"discriminator": judged}).items():
            self._recent.setdefault(name, []).append(value.detach())

    def _item(self, room: int, node: int) -> Item:
        return self._furniture[room][node - self._scenes[room].fixed]

    def _example(self) -> Example:
        """Draw an example. An item to which no edge leads teaches nothing of where it goes; another one is drawn."""
        while True:
            room = int(self._rng.integers(len(self._rooms)))
            scene = self._scenes[room]
            item = int(self._rng.choice(scene.items))
            last = bool(self._rng.random() < 0.5)
            if last:
                graph = self._with_last(room, item)
                order = list(graph)
            else:
                graph, order = self._plan(room)
            if graph[item]:
                edge = graph[item][int(self._rng.integers(len(graph[item])))]
                return Example(room, scene, graph, item, frozenset(order[: order.index(item)]), edge, last)

    def _plan(self, room: int) -> tuple[Graph, list[int]]:
        if room not in self._planned:
            self._planned[room] = planned(self.model.statistics, self._scenes[room], self._furniture[room])
        return self._planned[room]

    def _with_last(self, room: int, item: int) -> Graph:
        if (room, item) not in self._last:
            self._last[room, item] = with_last(self.model.statistics, self._scenes[room], item)
        return self._last[room, item]

    def _location_loss(self, examples: list[Example], room: Tensor, furniture: Tensor, mirrored: Tensor) -> Tensor:
        """The location network's loss, on where the unplaced items are to which the anchor has this type of edge."""
        model, span = self.model, self.model.statistics.span
        device = model.device
        anchor = torch.tensor(
            np.array([e.scene.box[e.edge.anchor] for e in examples]), dtype=torch.float32, device=device
        )
        center = (anchor[:, :2] + anchor[:, 2:]) / 2
        quarters = torch.tensor([int(e.scene.facing[e.edge.anchor]) for e in examples], device=device)
        type = np.array([e.edge.type for e in examples])
        seen = torch.tensor(np.where(mirrored.cpu(), MIRRORED[type], type), device=device)
        picture = self._canvas.draw(room, furniture, center, quarters, mirrored, reach=span, side=SIDE, anchor=anchor)
        rows, categories = [], self._canvas.categories
        for e in examples:
            alike = (r.target for r in e.scene.relations if r.anchor == e.edge.anchor and r.type == e.edge.type)
            marked = [k for k in alike if k not in e.placed]
            there = [(*(self._item(e.room, k).center or ()), categories[e.scene.category[k]]) for k in marked]
            rows.append(torch.tensor([[x, y, x, y, category] for x, y, category in there]))
        table = pad_sequence(rows, batch_first=True, padding_value=torch.nan).float().to(device)
        where = in_frame(table[..., :4], center, quarters, mirrored)[..., :2]
        pixel = ((where + span) * HEAT_SIDE / (2 * span)).floor()
        which, mark = (~table[..., 4].isnan() & ((pixel >= 0) & (pixel < HEAT_SIDE)).all(-1)).nonzero(as_tuple=True)
        goal = torch.zeros(len(examples), HEAT_SIDE, HEAT_SIDE, dtype=torch.long, device=device)
        column, row = pixel[which, mark].long().unbind(-1)
        goal[which, row, column] = 1 + table[which, mark, 4].long()
        weight = torch.full((1 + len(categories),), CENTROID_WEIGHT, device=device)
        weight[0] = 1.0
        return cross_entropy(model.location(picture, seen), goal, weight)

    def _about(self, examples: list[Example]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the items' centres (B, 2), quarters (B,), one-hot categories (B, C) and sizes (B, 2) in half spans."""
        model = self.model
        items = [self._item(e.room, e.item) for e in examples]
        category = torch.tensor([self._canvas.categories[item.category] for item in items], device=model.device)
        return (
            torch.tensor([item.center for item in items], dtype=torch.float32, device=model.device),
            torch.tensor([int(item.degrees // 90) % 4 for item in items], device=model.device),
            one_hot(category, len(self._canvas.categories)).float(),
            torch.tensor([item.size for item in items], dtype=torch.float32, device=model.device)
            / (model.statistics.span / 2),
        )

    def _orientation_loss(self, examples: list[Example], room: Tensor, furniture: Tensor, mirrored: Tensor) -> Tensor:
        """The orientation network's loss, on which way the item in the middle faces; 0 for a round one."""
        center, facing, category, _ = self._about(examples)
        turned = torch.tensor(self._rng.integers(4, size=len(examples)), device=self.model.device)
        reach = self.model.statistics.span / 2
        picture = self._canvas.draw(room, furniture, center, turned, mirrored, reach=reach, side=SIDE)
        facing = torch.where(mirrored, turned - facing, facing - turned) % 4
        circle = torch.tensor([bool(e.scene.circle[e.item]) for e in examples], device=self.model.device)
        found = cross_entropy(self.model.orientation(picture, category), facing, reduction="none")
        return found.masked_fill(circle, 0.0).mean()

    def _size_losses(
        self, examples: list[Example], room: Tensor, furniture: Tensor, mirrored: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The losses of the size network (error, divergence, discriminator) and of the discriminator."""
        model = self.model
        center, facing, category, true = self._about(examples)
        reach = model.statistics.span / 2
        picture = self._canvas.draw(room, furniture, center, facing, mirrored, reach=reach, side=SIDE)

        def beside(size: Tensor) -> Tensor:
            return torch.cat([picture, signed_distance(size)], 1)

        prior_mean, prior_spread = model.size.prior(picture, category).chunk(2, 1)
        mean, spread = model.size.encoder(beside(true), category).chunk(2, 1)
        again = model.size.decode(drawn(mean, spread, self._noise), category)
        new = model.size.decode(drawn(prior_mean, prior_spread, self._noise), category)
        ratio = (spread.exp() + (mean - prior_mean).square()) / prior_spread.exp()
        divergence = (prior_spread - spread + ratio - 1).sum(1).mean() / 2
        parts = (
            l1_loss(again, true),
            divergence,
            softplus(-self._discriminator(beside(new), category)).mean(),
        )
        size = torch.stack([weight * part for weight, part in zip(SIZE_LOSSES, parts, strict=True)]).sum()
        judge = self._discriminator
        judged = softplus(-judge(beside(true), category)) + softplus(judge(beside(new.detach()), category))
        return size, judged.mean()

    def _graph_loss(self, examples: list[Example]) -> Tensor:
        """The generator's loss on DECISIONS steps in each example's graph: on a node, and on an edge from each side.

        Where an example's item comes last, on edges to that alone: nodes are learned in the order of importance.
        """
        names, nodes = self.model.statistics.nodes, []
        edges: dict[str, list[generator.Decision]] = {"furniture": [], "architecture": []}
        for example in examples:
            for _ in range(DECISIONS):
                items = len(example.graph)
                done = items - 1 if example.last else int(self._rng.integers(items + 1))
                node, found = generator.decisions(example.scene, example.graph, done, names, self._rng)
                if not example.last:
                    nodes.append(node)
                for side, decision in found.items():
                    edges[side].append(decision)
        return generator.loss(self.model.graphs, nodes, edges)

    def state_dict(self) -> dict[str, Any]:
        """Return all that is needed to resume exactly: tensors and plain values."""
        return {
            "networks": self.model.state_dict(),
            "discriminator": self._discriminator.state_dict(),
            "optimizers": [self._optimizer.state_dict(), self._judging.state_dict()],
            "rng": self._rng.bit_generator.state,
            "noise": self._noise.get_state(),
            "updates": self.updates,
            "share": self.share,
            "recent": {name: torch.stack(values) for name, values in self._recent.items()},
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Resume from the state of a training of the same settings."""
        self.model.load_state_dict(state["networks"])
        self._discriminator.load_state_dict(state["discriminator"])
        for optimizer, its_state in zip((self._optimizer, self._judging), state["optimizers"], strict=True):
            optimizer.load_state_dict(its_state)
        self._rng.bit_generator.state = state["rng"]
        self._noise.set_state(state["noise"].cpu())
        self.updates = state["updates"]
        self.share = state["share"]
        self._recent = {name: list(values) for name, values in state["recent"].items()}


def planned(statistics: Statistics, scene: Scene, items: Sequence[Item]) -> tuple[Graph, list[int]]:
    """The graph of a furnished room, and the order in which its items are placed.

    Its edges lead from the more important furniture to the less important, and so never in a cycle.
    """
    graph = graph_of(scene, statistics.kept, _by_importance(statistics, scene))
    areas = {k: item.size[0] * item.size[1] for k, item in zip(scene.items, items, strict=True)}
    return graph, placing_order(graph, areas)


def with_last(statistics: Statistics, scene: Scene, item: int) -> Graph:
    """The graph of a room in which one item is placed after all others."""
    others = [k for k in _by_importance(statistics, scene) if k != item]
    return graph_with_last(scene, statistics.kept, others, item)


def _by_importance(statistics: Statistics, scene: Scene) -> list[int]:
    """A scene's items, the more important categories first."""
    return sorted(scene.items, key=lambda k: statistics.categories.index(scene.category[k]))
