"""Scores of PlanIT in held-out rooms: of one item among all others, as in Table 1 of Di & Yu; of all, from nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from layoutrl.env.device import generator_of
from layoutrl.env.measures import iou_of, matched, means
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation.metrics import Score, blocks_openings, score_of
from layoutrl.evaluation.statistics import standard_error
from layoutrl.rivals.planit.generator import sample
from layoutrl.rivals.planit.graph import Graph, Relation, scene_of
from layoutrl.rivals.planit.placement import Choosing, Layout, Placer, Query
from layoutrl.rivals.planit.training import planned, with_last
from layoutrl.rooms.brief import brief_of, standing
from layoutrl.rooms.room import Item, Room

CHOICES = ("sampled", "argmax")  # of places, facings and sizes
SIZES = ("own size", "true size")  # the true one with form and rotation, which the agent knows, too
DRAWS = 10  # graphs at most, until one has the category that is asked for
TRIES = 4  # graphs at most, until every item has a place; PlanIT sets no limit
FURNISHED = 24  # rooms at most that are furnished from nothing: seconds each
CHUNK = 64  # rooms whose heat maps are worked out at once


@dataclass(frozen=True)
class OneItemResult:
    """Where one item went, in each of B rooms; None where there was no place."""

    items: list[Item | None]
    iou: np.ndarray  # (B,), 0 without a place
    score: Score
    missing: float  # share of the rooms without a place


def place_targets(placer: Placer, seed: np.random.SeedSequence) -> dict[str, OneItemResult]:
    """Place the moving item of each of the placer's rooms among the others. Keys are "graph, choice, whose size".

    Where there is no place, what is drawn of the graph is drawn again, TRIES times in all. The true size comes with
    form and rotation, as the agent knows them; a sampled graph has no item to take it from.
    """
    rng, noise = _generators(placer, seed)
    found: dict[str, list[Item | None]] = {}
    for first in tqdm(range(0, len(placer.rooms), CHUNK), "one item", leave=False, disable=sys.stderr is None):
        for graph in GRAPHS:
            rooms = range(first, min(first + CHUNK, len(placer.rooms)))
            queries = [QUERIES[graph](placer, room, rng) for room in rooms]
            for query, heat in zip(queries, placer.heat(queries), strict=True):
                for choice, whose in _variants(graph):
                    choosing = Choosing(rng, noise) if choice == "sampled" else Choosing()
                    size = placer.rooms[query.room].moving if whose == "true size" else None
                    item = placer.target(query, heat, choosing, size)
                    redrawing = rng.spawn(1)[0]  # of its own: drawing again does not change what rng draws
                    for _ in range(_tries(graph) - 1):
                        if item is None:
                            again = QUERIES[graph](placer, query.room, redrawing)
                            item = placer.target(again, placer.heat([again])[0], choosing, size)
                    found.setdefault(f"{graph}, {choice}, {whose}", []).append(item)
    return {name: scored(placer.rooms, items) for name, items in found.items()}


def _variants(graph: str) -> Iterator[tuple[str, str]]:
    """Return pairs of CHOICES and SIZES; a sampled graph has no true sizes."""
    return product(CHOICES, SIZES[:1] if graph == "sampled graph" else SIZES)


def _tries(graph: str) -> int:
    """Return how many graphs are tried at most: of the designer's there is only one."""
    return 1 if graph == "given graph" else TRIES


def _generators(placer: Placer, seed: np.random.SeedSequence) -> tuple[np.random.Generator, torch.Generator]:
    drawing, noise = seed.spawn(2)
    generator = generator_of(noise, placer.model.device)
    return np.random.default_rng(drawing), generator


def _bare_query(placer: Placer, room: int) -> tuple[Query, int]:
    """Return the query for the moving item among all others, as they stand, without edges; and its node."""
    own, scene = placer.rooms[room], placer.scenes[room]
    stand = [k for k, item in enumerate(own.furniture) if item.center is not None]
    assert own.target in stand
    target = scene.fixed + stand.index(own.target)
    others = {scene.fixed + n: own.furniture[k] for n, k in enumerate(stand) if k != own.target}
    return Query(room, scene.category[target], [], others), target


def given_query(placer: Placer, room: int) -> Query:
    """Return the query for the moving item with the edges that lead to it from all else in the designer's layout."""
    query, target = _bare_query(placer, room)
    return query._replace(edges=with_last(placer.model.statistics, placer.scenes[room], target)[target])


def _query_by_categories(placer: Placer, room: int, rng: np.random.Generator) -> Query:
    """Return the query for the moving item with edges drawn for it, given the graph of the others without it."""
    query, target = _bare_query(placer, room)
    scene = placer.scenes[room]
    *others, (_, _) = graph = list(with_last(placer.model.statistics, scene, target).items())
    drawn_as = {node: scene.fixed + k for k, (node, _) in enumerate(graph)}
    node_of = {number: node for node, number in drawn_as.items()}
    known = [
        [Relation(drawn_as.get(r.anchor, r.anchor), drawn_as[node], r.type) for r in edges] for node, edges in others
    ]
    names = [scene.category[node] for node, _ in graph]
    _, found = _sampled(placer, room, rng, names, known)
    edges = [Relation(node_of.get(r.anchor, r.anchor), target, r.type) for r in found[drawn_as[target]]]
    return query._replace(edges=edges)


def _query_by_sample(placer: Placer, room: int, rng: np.random.Generator) -> Query:
    """Return the query for the moving item with edges from a graph that is drawn for the empty room.

    They are those to the first node of its category. Other nodes stand for the room's own items of their category, one
    after the other; nodes left over are dropped. If none of DRAWS graphs has such a node, there are no edges.
    """
    query, target = _bare_query(placer, room)
    scene = placer.scenes[room]
    for _ in range(DRAWS):
        names, graph = _sampled(placer, room, rng)
        if query.category in names:
            break
    else:
        return query
    stands_for = scene.fixed + names.index(query.category)
    node_of = {k: k for k in range(scene.fixed)}
    left = list(query.placed)
    for node, name in enumerate(names, scene.fixed):
        same = next((k for k in left if scene.category[k] == name), None)
        if node != stands_for and same is not None:
            node_of[node] = same
            left.remove(same)
    edges = [Relation(node_of[r.anchor], target, r.type) for r in graph[stands_for] if r.anchor in node_of]
    return query._replace(edges=edges)


def _sampled(
    placer: Placer,
    room: int,
    rng: np.random.Generator,
    given: Sequence[str] | None = None,
    known: Sequence[Sequence[Relation]] = (),
) -> tuple[list[str], Graph]:
    """Draw categories, unless they are `given`, and a graph for a room; the first items' edges may be `known`."""
    model, scene = placer.model, placer.scenes[room]
    nodes, kept, most = model.statistics.nodes, model.statistics.kept, model.statistics.most
    return sample(model.graphs, scene, nodes, kept, most, rng, given, known)


QUERIES: dict[str, Callable[[Placer, int, np.random.Generator], Query]] = {
    "sampled graph": _query_by_sample,
    "given categories": _query_by_categories,
    "given graph": lambda placer, room, _: given_query(placer, room),
}
GRAPHS = tuple(QUERIES)  # how much of it is the designer's


def scored(rooms: Sequence[Room], items: Sequence[Item | None]) -> OneItemResult:
    """Score items in place of the rooms' moving ones. An item without a place has IoU 0 and overlaps nothing."""
    iou, overlap, outside, blocked = (np.zeros(len(rooms)) for _ in range(4))
    there = [k for k, item in enumerate(items) if item is not None]
    if there:
        furnished = [_with(rooms[k], items[k]) for k in there]
        simulator = Simulator(furnished, Moves(), Reward())
        index, position = np.arange(len(there)), simulator.designer_position  # which is where they were put
        iou[there] = iou_of(
            np.array([room.moving.footprint for room in furnished]),
            np.array([rooms[k].moving.footprint for k in there]),
        )
        overlap[there], outside[there] = simulator.overlap_and_outside(index, position)
        blocked[there] = blocks_openings(simulator, index, position)
    group = np.array([room.group for room in rooms])
    return OneItemResult(list(items), iou, score_of(iou, overlap, outside, blocked, group), 1 - len(there) / len(rooms))


def _with(room: Room, item: Item | None) -> Room:
    assert item is not None
    return replace(room, furniture=tuple(item if k == room.target else o for k, o in enumerate(room.furniture)))


@dataclass(frozen=True)
class WholeRoomResult:
    """All items of B rooms, placed from nothing."""

    layouts: list[list[Item]]
    group: np.ndarray  # (B,), equal for rooms that are not independent
    iou: np.ndarray  # (B,), mean over the designer's items: 0 for one that has no match
    missing: float  # share of the graphs' items for which there was no place

    @property
    def mean_iou(self) -> float:
        """The mean over rooms of `iou`."""
        return float(self.iou.mean())

    @property
    def standard_error(self) -> float | None:
        """The standard error of `mean_iou` over groups of rooms; None for a single group."""
        return standard_error(self.iou, self.group)

    def as_dict(self) -> dict[str, float | None]:
        """Return the numbers for a JSON file."""
        return {name: getattr(self, name) for name in ("mean_iou", "standard_error", "missing")}


def furnish_all(placer: Placer, seed: np.random.SeedSequence) -> dict[str, WholeRoomResult]:
    """Place all items of each of the placer's rooms from nothing. Keys are those of `place_targets`.

    Items are matched with the designer's within a category, so that the sum of their IoU is highest.
    """
    rng, noise = _generators(placer, seed)
    found: dict[str, list[Layout]] = {}
    for room in tqdm(range(len(placer.rooms)), "all items", leave=False, disable=sys.stderr is None):
        for kind in GRAPHS:
            for choice, whose in _variants(kind):
                choosing = Choosing(rng, noise) if choice == "sampled" else Choosing()
                layout = _fullest(_layout(placer, room, kind, whose, rng, choosing) for _ in range(_tries(kind)))
                found.setdefault(f"{kind}, {choice}, {whose}", []).append(layout)
    return {name: scored_layouts(placer.rooms, layouts) for name, layouts in found.items()}


def _fullest(layouts: Iterable[Layout]) -> Layout:
    """Return the layout that lacks the fewest items, the first of equals; stop at one that lacks none."""
    made: list[Layout] = []
    for layout in layouts:
        made.append(layout)
        if not layout.missing:
            break
    return min(made, key=lambda layout: len(layout.missing))


def _layout(placer: Placer, room: int, kind: str, whose: str, rng: np.random.Generator, choosing: Choosing) -> Layout:
    """A room furnished by one graph."""
    names, graph, stands_for = room_graph(placer, room, kind, rng)
    own = standing(placer.rooms[room])
    sizes = [own[k] for k in stands_for] if whose == "true size" else None
    return placer.furnish(room, names, graph, choosing, sizes)


def furnished_rooms(placer: Placer, seed: np.random.SeedSequence) -> list[Room]:
    """Furnish the briefs of the placer's rooms: each item at its likeliest place, facing its likeliest way there.

    PlanIT is told the bare room and what a brief lists: categories, true sizes and forms. Items without a place have no
    center.
    """
    rng, _ = _generators(placer, seed)
    briefs = [brief_of(room) for room in placer.rooms]
    bare = [replace(brief, furniture=()) for brief in briefs]
    told = Placer(placer.model, bare, [scene_of(room) for room in bare])
    important = placer.model.statistics.categories.index
    layouts = []
    for number, brief in enumerate(briefs):
        # The most important first, as in training.
        order = sorted(range(len(brief.furniture)), key=lambda k: important(brief.furniture[k].category))
        items = [brief.furniture[k] for k in order]
        names = [item.category for item in items]
        graphs = (_sampled(told, number, rng, names)[1] for _ in range(TRIES))
        best = _fullest(told.furnish(number, names, graph, Choosing(), items) for graph in graphs)
        furniture = list(brief.furniture)
        for n, k in enumerate(order):
            furniture[k] = best.placed.get(told.scenes[number].fixed + n, furniture[k])
        layouts.append(replace(brief, furniture=tuple(furniture)))
    return layouts


def room_graph(placer: Placer, room: int, kind: str, rng: np.random.Generator) -> tuple[list[str], Graph, list[int]]:
    """Return categories, a graph, and which standing item each node stands for; `kind` says how much is given."""
    if kind == "sampled graph":
        return *_sampled(placer, room, rng), []
    scene, own = placer.scenes[room], standing(placer.rooms[room])
    graph, _ = planned(placer.model.statistics, scene, own)
    if kind == "given graph":
        return [scene.category[node] for node in scene.items], graph, list(range(len(own)))
    order = [node - scene.fixed for node in graph]  # the most important first, as in training
    given = [own[k].category for k in order]
    return *_sampled(placer, room, rng, given), order


def scored_layouts(rooms: Sequence[Room], layouts: Sequence[Layout]) -> WholeRoomResult:
    """Score layouts of whole rooms."""
    missing, placed = (
        sum(map(len, counted)) for counted in zip(*((x.missing, x.placed) for x in layouts), strict=True)
    )
    items = [list(layout.placed.values()) for layout in layouts]
    ours = [replace(room, furniture=tuple(there)) for room, there in zip(rooms, items, strict=True)]
    found = matched(ours, rooms)
    iou, group = means(found.iou, found.room, len(rooms)), np.array([room.group for room in rooms])
    return WholeRoomResult(items, group, iou, missing / max(missing + placed, 1))


def how_many(furnished: int, rooms: int) -> int:
    """Return how many of `rooms` rooms are furnished from nothing: as many as are asked for, FURNISHED at most."""
    return min(furnished, FURNISHED, rooms)


def score_all(
    placer: Placer, furnished: int, seed: np.random.SeedSequence
) -> tuple[dict[str, OneItemResult], dict[str, WholeRoomResult]]:
    """Place one item in every room, and all items in the first `how_many` of them."""
    one_seed, all_seed = seed.spawn(2)
    few = how_many(furnished, len(placer.rooms))
    every = Placer(placer.model, placer.rooms[:few], placer.scenes[:few])
    return place_targets(placer, one_seed), furnish_all(every, all_seed)


def evaluated(placer: Placer, furnished: int, seed: np.random.SeedSequence) -> dict[str, Any]:
    """Return all scores as plain numbers."""
    one, every = score_all(placer, furnished, seed)
    return {
        "rooms": len(placer.rooms),
        "furnished_rooms": how_many(furnished, len(placer.rooms)),
        "one item": {name: found.score.as_dict() | {"missing": found.missing} for name, found in one.items()},
        "all items": {name: found.as_dict() for name, found in every.items()},
    }


def table(result: dict[str, Any]) -> str:
    """A result of `evaluated` as text."""
    one, every = result["one item"], result["all items"]
    wide = max(map(len, one))
    lines = [
        f"IoU in {result['rooms']} held-out rooms of one item among all others; of all items, placed from nothing in "
        f"{result['furnished_rooms']} rooms",
        f"{'':{wide}}  {'mean IoU':>13} {'median':>6} {'>= 0.9':>6} {'no place':>8} {'all':>6} {'no place':>8}",
    ]
    for name, row in one.items():
        of_all = every.get(name)
        rest = f"{of_all['mean_iou']:6.3f} {of_all['missing']:8.1%}" if of_all else f"{'-':>6} {'-':>8}"
        lines.append(
            f"{name:{wide}}  {row['mean_iou']:.3f} ± {row['std_iou']:.3f} {row['median_iou']:6.3f} "
            f"{row['share_090']:6.1%} {row['missing']:8.1%} {rest}"
        )
    return "\n".join(lines)
