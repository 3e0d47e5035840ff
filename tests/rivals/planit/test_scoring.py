"""What PlanIT is scored for: the moving item among the others, and whole rooms matched with the designer's."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from layoutrl.env.measures import iou_of
from layoutrl.rivals.planit import scoring
from layoutrl.rivals.planit.graph import graph_of, scene_of
from layoutrl.rivals.planit.placement import Choosing, Layout, Placer, Query
from layoutrl.rivals.planit.scoring import (
    QUERIES,
    TRIES,
    evaluated,
    furnish_all,
    furnished_rooms,
    given_query,
    place_targets,
    room_graph,
    scored,
    scored_layouts,
    table,
)
from layoutrl.rooms.brief import brief_of, facings
from layoutrl.rooms.room import Item, Room
from tests.builders import rectangular_room
from tests.rivals.planit.rooms import designed, placer_of
from tests.rivals.rooms.builders import disarranged

ROOMS = designed("bathroom", 3)
pytestmark = pytest.mark.usefixtures("small_networks")


def test_the_designers_places_score_one_and_no_place_scores_nothing() -> None:
    best = scored(ROOMS, [room.moving for room in ROOMS])
    assert best.iou.tolist() == pytest.approx([1.0] * 3)
    assert best.score.mean_iou == pytest.approx(1)
    assert best.score.overlap == pytest.approx(0, abs=1e-6)
    none = scored(ROOMS, [ROOMS[0].moving, None, None])
    assert none.iou.tolist() == pytest.approx([1.0, 0.0, 0.0])
    assert none.missing == pytest.approx(2 / 3)


def test_what_is_put_elsewhere_is_scored_where_it_is_and_as_large_as_it_is() -> None:
    bed, desk = Item("bed", (2.0, 1.0), (2.0, 0.5)), Item("desk", (1.0, 1.0), (2.0, 2.5))
    room = rectangular_room(4.0, 3.0, bed, others=(desk,))
    put = scored([room], [Item("bed", (1.0, 2.0), (2.0, 2.0), 0)])
    assert put.iou[0] == pytest.approx(0.0)
    assert put.score.overlap == pytest.approx(0.5)
    half = scored([room], [Item("bed", (2.0, 1.0), (3.0, 0.5))])
    assert half.iou[0] == pytest.approx(1 / 3)
    assert iou_of(Item("a", (1, 1), (0, 0)).footprint, Item("a", (1, 1), (0.5, 0)).footprint) == pytest.approx(1 / 3)


def test_items_are_matched_within_their_category_for_the_highest_sum() -> None:
    room = designed("dining_room", 3)[0]
    rng = np.random.default_rng(0)

    def mean_iou(items: Sequence[Item]) -> float:
        return scored_layouts([room], [Layout(dict(enumerate(items)), [])]).mean_iou

    assert mean_iou(room.furniture) == pytest.approx(1.0)
    moved = [replace(item, center=tuple(np.add(item.center, rng.normal(0, 0.3, 2)))) for item in room.furniture[::-1]]
    best = 0.0
    for category in {item.category for item in room.furniture}:
        theirs = [item for item in room.furniture if item.category == category]
        ours = [item for item in moved if item.category == category]
        best += max(
            sum(iou_of(a.footprint, b.footprint) for a, b in zip(theirs, order, strict=True))
            for order in itertools.permutations(ours)
        )
    assert mean_iou(moved) == pytest.approx(best / len(room.furniture))


def test_an_item_too_few_counts_as_nothing() -> None:
    room = ROOMS[0]
    found = scored_layouts([room], [Layout({k: item for k, item in enumerate(room.furniture) if k}, [0])])
    assert found.mean_iou == pytest.approx(1 - 1 / len(room.furniture))
    assert found.missing == pytest.approx(1 / len(room.furniture))


def test_every_room_counts_alike_however_many_items_it_has() -> None:
    few, many = (
        replace(room, furniture=room.furniture[:n], target=None) for room, n in zip(ROOMS, (1, 3), strict=False)
    )
    found = scored_layouts([few, many], [Layout({0: few.furniture[0]}, []), Layout({}, [0, 1, 2])])
    assert found.iou.tolist() == pytest.approx([1.0, 0.0])
    assert found.mean_iou == pytest.approx(0.5)


@pytest.mark.parametrize("graph", list(QUERIES))
def test_a_query_holds_nothing_of_where_the_item_is_but_a_given_graph(graph: str) -> None:
    """The same room with its item elsewhere: only the given graph may ask for something else."""
    rooms = designed("study", 3)
    placer = placer_of(rooms)
    elsewhere = [moved(room) for room in rooms]
    other = Placer(placer.model, elsewhere, [scene_of(room) for room in elsewhere])
    asked = [[QUERIES[graph](who, k, np.random.default_rng(k)) for k in range(len(rooms))] for who in (placer, other)]
    if graph == "given graph":
        assert [q.edges for q in asked[0]] != [q.edges for q in asked[1]]
    else:
        assert [q.edges for q in asked[0]] == [q.edges for q in asked[1]]
    for query, room in zip(asked[0], rooms, strict=True):
        assert query.category == room.moving.category
        assert room.moving not in query.placed.values()
        assert len(query.placed) == len(room.furniture) - 1
        assert all(r.target not in query.placed for r in query.edges)


@pytest.mark.parametrize("tries", [1, TRIES])
def test_no_place_hangs_on_the_items_own_but_by_a_given_graph(tries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor on its size, unless that is told. (How often a graph is drawn hangs on it then.)"""
    monkeypatch.setattr(scoring, "TRIES", tries)
    rooms = designed("study", 3)
    placer = placer_of(rooms)
    known: list[object] = []
    sample = scoring.sample

    def spied(*given: Any) -> Any:
        known.append(given[7:])
        return sample(*given)

    monkeypatch.setattr(scoring, "sample", spied)
    first = place_targets(placer, np.random.SeedSequence(0))
    asked, known = known, []
    for change in (shifted, moved)[: 2 if tries == 1 else 1]:
        changed = [change(room) for room in rooms]
        found = place_targets(
            Placer(placer.model, changed, [scene_of(room) for room in changed]), np.random.SeedSequence(0)
        )
        assert known == asked
        known.clear()
        for name, places in first.items():
            # What is told may differ; and another size takes other draws, also from what comes after it.
            told = "given graph" in name or (change is moved and not name.endswith("argmax, own size"))
            assert told or found[name].items == places.items, name
        assert found["given graph, argmax, own size"].items != first["given graph, argmax, own size"].items
        if change is moved:
            name = "given categories, argmax, true size"
            assert {item.size for item in found[name].items if item} == {(0.9, 0.7)}


def test_where_there_is_no_place_what_is_drawn_of_a_graph_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    placer, moving = placer_of(ROOMS[:1]), ROOMS[0].moving
    asked: list[Query] = []

    def never(query: Query, *_: Any) -> Item | None:
        asked.append(query)
        return None

    def every_other_time(query: Query, *_: Any) -> Item | None:
        asked.append(query)
        return moving if len(asked) % 2 == 0 else None

    monkeypatch.setattr(placer, "target", never)
    found = place_targets(placer, np.random.SeedSequence(0))
    assert all(places.missing == 1 for places in found.values())
    assert len(asked) == 6 * TRIES + 4  # rows, of which four are told the only graph
    assert any(query.edges != asked[0].edges for query in asked[1:TRIES])
    asked.clear()
    monkeypatch.setattr(placer, "target", every_other_time)
    found = place_targets(placer, np.random.SeedSequence(0))
    assert len(asked) == 6 * 2 + 4
    assert all(places.missing == 0 for name, places in found.items() if not name.startswith("given graph"))


def test_of_rooms_the_fullest_of_a_few_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    placer, item = placer_of(ROOMS[:1]), ROOMS[0].moving
    layouts = [Layout({9: item}, [8, 7]), Layout({9: item}, [8]), Layout({9: item}, [8, 7, 6]), Layout({}, [8, 7])]
    made: list[Layout] = []

    def furnish(*_: Any) -> Layout:
        made.append(layouts[len(made) % 4])
        return made[-1]

    monkeypatch.setattr(placer, "furnish", furnish)
    found = furnish_all(placer, np.random.SeedSequence(0))
    assert len(made) == 6 * TRIES + 4
    assert found["sampled graph, argmax, own size"].missing == 1 / 2
    layouts[1] = Layout({9: item}, [])
    made.clear()
    assert furnish_all(placer, np.random.SeedSequence(0))["sampled graph, argmax, own size"].missing == 0


def shifted(room: Room) -> Room:
    """With its item somewhere else."""
    there = replace(room.moving, center=moved(room).moving.center)
    return replace(room, furniture=tuple(there if k == room.target else o for k, o in enumerate(room.furniture)))


def moved(room: Room) -> Room:
    """With its item somewhere else, turned, and of another size: at the middle of the room, over whatever is there."""
    furniture = list(room.furniture)
    x0, y0, x1, y1 = room.indoor.bounds
    centre = ((x0 + x1) / 2, (y0 + y1) / 2)
    furniture[room.target] = replace(
        room.moving, center=centre, rotation=(room.moving.rotation + 90) % 360, size=(0.9, 0.7)
    )
    return replace(room, furniture=tuple(furniture))


def test_a_given_query_holds_all_edges_to_the_item_and_the_places_of_all_others() -> None:
    placer = placer_of(ROOMS)
    for k, room in enumerate(ROOMS):
        scene, query = placer.scenes[k], given_query(placer, k)
        target = scene.fixed + room.target
        order = [node for node in scene.items if node != target] + [target]
        assert query.edges == graph_of(scene, placer.model.statistics.kept, order)[target]
        assert query.placed == {scene.fixed + n: item for n, item in enumerate(room.furniture) if n != room.target}


def test_graphs_hold_what_is_given() -> None:
    placer = placer_of(ROOMS)
    rng = np.random.default_rng(0)
    for k, room in enumerate(ROOMS):
        categories = [item.category for item in room.furniture]
        for kind in ("given graph", "given categories"):
            names, graph, stands_for = room_graph(placer, k, kind, rng)
            assert [categories[n] for n in stands_for] == names
            assert sorted(graph) == list(placer.scenes[k].items)
        names, graph, _ = room_graph(placer, k, "sampled graph", rng)
        assert len(names) == len(graph) <= placer.model.statistics.most


@pytest.mark.usefixtures("small_planit")
def test_a_score_hangs_on_the_seed_alone_and_says_what_the_table_shows() -> None:
    placer = placer_of(ROOMS)
    first, again = (evaluated(placer, 1, np.random.SeedSequence(3)) for _ in range(2))
    assert first == again
    assert first["rooms"] == 3
    assert first["furnished_rooms"] == 1
    assert set(first["one item"]) == set(first["all items"])
    text = table(first)
    for name, row in first["one item"].items():
        line = next(line for line in text.splitlines() if line.startswith(name))
        assert f"{row['mean_iou']:.3f}" in line
        assert f"{first['all items'][name]['mean_iou']:.3f}" in line


@pytest.mark.usefixtures("small_planit")
def test_every_room_gets_an_answer() -> None:
    placer = placer_of(ROOMS[:2])
    targets = place_targets(placer, np.random.SeedSequence(0))
    assert len(targets) == 10
    assert all(len(found.items) == 2 for found in targets.values())
    furnished = furnish_all(placer, np.random.SeedSequence(0))
    assert set(furnished) == set(targets)
    for found in furnished.values():
        assert found.iou.shape == (2,)


@pytest.mark.usefixtures("small_planit")
def test_a_room_is_furnished_alike_wherever_in_whichever_order_and_facing_the_designer_has_its_items() -> None:
    rooms = [replace(room, furniture=room.furniture[:3], target=0) for room in ROOMS[:2]]
    chairs = tuple(Item("chair", size, (1.0, 1.0), 90.0) for size in ((0.5, 0.5), (0.4, 0.6)))
    rooms.append(replace(rooms[0], furniture=(*rooms[0].furniture[:1], *chairs)))
    others = [disarranged(room, np.random.default_rng(k)) for k, room in enumerate(rooms)]
    model = placer_of(rooms).model
    first, second = (
        furnished_rooms(Placer(model, those, [scene_of(room) for room in those]), np.random.SeedSequence(0))
        for those in (rooms, others)
    )
    assert [room.furniture for room in first] == [room.furniture for room in second]
    assert any(item.center is not None for room in first for item in room.furniture)
    for room, layout in zip(rooms, first, strict=True):
        assert brief_of(layout).furniture == brief_of(room).furniture
        assert all(item.center is None or item.rotation in facings(room) for item in layout.furniture)


def test_who_is_told_no_rotation_faces_as_the_network_says(monkeypatch: pytest.MonkeyPatch) -> None:
    placer = placer_of(ROOMS[:1])
    query, _ = scoring._bare_query(placer, 0)
    size = replace(ROOMS[0].moving, center=None, rotation=None, size=(0.4, 0.6))
    wanted = torch.tensor([[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    monkeypatch.setattr(placer.model.orientation, "forward", lambda *_: wanted)
    items = placer._items(query, np.array([(1.0, 1.0), (2.0, 1.0)]), Choosing(), size)
    assert items == [replace(size, center=(1.0, 1.0), rotation=180.0), replace(size, center=(2.0, 1.0), rotation=270.0)]
    told = replace(size, rotation=90.0)
    assert placer._items(query, np.array([(1.0, 1.0)]), Choosing(), told) == [replace(told, center=(1.0, 1.0))]
