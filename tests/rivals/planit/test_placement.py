"""Placement: never outside, never into another, within its limits; what edges say, holds."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.env.measures import iou_of
from layoutrl.rivals.planit.canvas import box_of
from layoutrl.rivals.planit.graph import (
    ADJACENT,
    DISTANT,
    FRONT,
    LEFT,
    PROXIMAL,
    RIGHT,
    SUPPORT,
    Graph,
    Relation,
    edge_type,
    faces_across,
    gap,
    scene_of,
    turned,
)
from layoutrl.rivals.planit.networks import HEAT_SIDE
from layoutrl.rivals.planit.placement import BACKTRACKS, TRIALS, Choosing, Placer, Query
from layoutrl.rivals.planit.scoring import scored
from layoutrl.rivals.planit.training import planned, with_last
from layoutrl.rooms.room import MAIN_ITEM, TOLERANCE, Item
from tests.builders import rectangular_room
from tests.rivals.planit.rooms import designed, placer_of

TYPES_OF_ROOMS = ("bathroom", "study", "kitchen", "dining_room")
LOWER_WALL = 0
pytestmark = pytest.mark.usefixtures("small_networks")


def choosing(seed: int) -> Choosing:
    return Choosing(np.random.default_rng(seed), torch.Generator().manual_seed(seed))


def test_a_room_without_walls_lets_nothing_reach_over_its_outline() -> None:
    """By as little as a wall would hide: it could not be scored."""
    bed = Item("bed", (2.0, 1.0), (1.0, 1.5))
    placer = placer_of([replace(rectangular_room(2.0, 3.0, bed), walls=())])
    for width, fits in ((2.0, True), (2.005, False)):
        item = replace(bed, size=(width, 1.0))
        assert placer._indoors(0, item) == fits
        if fits:
            scored(placer.rooms, [item])


@pytest.mark.parametrize("room_type", TYPES_OF_ROOMS)
@pytest.mark.parametrize("sampled", [True, False])
def test_nothing_is_put_outside_or_into_another(room_type: str, sampled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """But what stands under another by intent, by more than a centimetre."""
    monkeypatch.setattr("layoutrl.rivals.planit.placement.BACKTRACKS", 8)
    rooms = designed(room_type, 3)
    placer = placer_of(rooms)
    placed = 0
    for k, room in enumerate(rooms):
        scene = placer.scenes[k]
        graph, _ = planned(placer.model.statistics, scene, list(room.furniture))
        names = [scene.category[node] for node in scene.items]
        layout = placer.furnish(k, names, graph, choosing(k) if sampled else Choosing())
        assert sorted([*layout.placed, *layout.missing]) == list(scene.items)
        placed += len(layout.placed)
        for node, item in layout.placed.items():
            assert item.category == scene.category[node]
            assert room.indoor.buffer(TOLERANCE + 1e-6, join_style="mitre").covers(item.footprint)
        for one, other in itertools.combinations(layout.placed.values(), 2):
            if not placer._stands_under(one, other):
                a, b = (item.footprint.buffer(-TOLERANCE / 2 - 1e-6, join_style="mitre") for item in (one, other))
                assert not a.intersects(b)
    assert placed > 2 * len(rooms)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(TYPES_OF_ROOMS))
def test_an_item_among_others_is_put_outside_or_into_none_of_them(seed: int, room_type: str) -> None:
    rooms = designed(room_type, 3)
    placer = placer_of(rooms, seed % 5)
    room = seed % len(rooms)
    scene, target = placer.scenes[room], rooms[room].target
    others = {scene.fixed + k: item for k, item in enumerate(rooms[room].furniture) if k != target}
    category = rooms[room].moving.category
    edges = [
        r for r in scene.relations if r.target == scene.fixed + target and r.anchor in {*range(scene.fixed), *others}
    ]
    query = Query(room, category, edges, others)
    heat = placer.heat([query])[0]
    assert heat.sum() == pytest.approx(1)
    inside = shapely.contains_xy(rooms[room].indoor, placer.cells[room])
    assert not heat[~inside].any()
    item = placer.target(query, heat, choosing(seed))
    if item is None:
        return
    assert rooms[room].indoor.buffer(TOLERANCE + 1e-6, join_style="mitre").covers(item.footprint)
    for other in others.values():
        if not placer._stands_under(item, other):
            shrunk = (
                item.footprint.buffer(-TOLERANCE / 2 - 1e-6),
                other.footprint.envelope.buffer(-TOLERANCE / 2 - 1e-6),
            )
            assert not shrunk[0].intersects(shrunk[1])


def test_what_was_in_the_way_is_taken_back_and_put_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bed would rather stand where it leaves the desk no place; the lamp is in nobody's way."""
    items = [Item(name, (1.0, 1.0), center) for name, center in (("bed", (0.5, 0.5)), ("lamp", (0.5, 1.9)))]
    desk = Item("desk", (1.0, 1.0), (1.7, 0.5))
    placer = placer_of([rectangular_room(2.2, 2.4, desk, others=items)])
    likes = {
        "bed": {(1.1, 0.55): 1.0, (0.55, 0.55): 0.5},
        "lamp": {(1.1, 1.8): 1.0, (0.55, 1.8): 0.5, (1.6, 1.8): 0.3},
        "desk": {(1.65, 0.55): 1.0},
    }

    def heat(queries: list[Query]) -> list[np.ndarray]:
        found = np.zeros(len(placer.cells[0]))
        for place, value in likes[queries[0].category].items():
            found[np.linalg.norm(placer.cells[0] - place, axis=1).argmin()] = value
        return [found / found.sum()]

    asked: list[str] = []
    find = placer.find

    def spied(query: Query, *rest: Any, **more: Any) -> Item | None:
        asked.append(query.category)
        return find(query, *rest, **more)

    monkeypatch.setattr(placer, "heat", heat)
    monkeypatch.setattr(placer, "find", spied)
    fixed = placer.scenes[0].fixed
    graph: Graph = {fixed + k: [Relation(LOWER_WALL, fixed + k, edge_type(FRONT, DISTANT))] for k in range(3)}
    monkeypatch.setattr("layoutrl.rivals.planit.placement.placing_order", lambda *_: [*graph])
    monkeypatch.setattr(placer, "_held", lambda *_: 1.0)
    layout = placer.furnish(0, ["bed", "lamp", "desk"], graph, Choosing(), [*items, desk])
    assert layout.missing == []
    assert asked == ["bed", "lamp", "desk"] * 2
    found = [layout.placed[fixed + k].center for k in range(3)]
    np.testing.assert_allclose(found, [(0.55, 0.55), (1.1, 1.8), (1.65, 0.55)], atol=placer.pixel)


def test_a_room_without_a_legal_place_ends_within_its_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """What has no place is named, and what has one is placed."""
    bed, wardrobe = Item("bed", (2.0, 1.6), (1.0, 1.5)), Item("wardrobe", (0.6, 1.0), (3.7, 1.5), 180)
    placer = placer_of([rectangular_room(4.0, 3.0, bed, others=(wardrobe,))])
    room = rectangular_room(1.5, 1.5, replace(bed, center=(0.75, 0.75)), others=(replace(wardrobe, center=(0.5, 0.5)),))
    small = Placer(placer.model, [room], [scene_of(room)])
    first = small.scenes[0].fixed
    graph = {first: [Relation(LOWER_WALL, first, 2)], first + 1: [Relation(LOWER_WALL, first + 1, 2)]}
    tries = 0
    items = small._items

    def counting(query: Query, centres: np.ndarray, *others: object) -> list[Item]:
        nonlocal tries
        tries += len(centres)
        return items(query, centres, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(small, "_items", counting)
    for how in (Choosing(), choosing(0)):
        layout = small.furnish(0, ["bed", "wardrobe"], graph, how)
        assert layout.missing == [first]
        assert list(layout.placed) == [first + 1]
        assert tries <= TRIALS * 2 * (BACKTRACKS + 2)
        tries = 0
        query = Query(0, "bed", graph[first], {})
        assert small.target(query, small.heat([query])[0], how) is None


def test_what_is_given_is_taken_and_sizes_come_from_training_rooms() -> None:
    rooms = designed("bathroom", 3)
    placer = placer_of(rooms)
    query = Query(0, "toilet", [], {})
    heat = placer.heat([query])[0]
    own = placer.find(query, heat, choosing(1), tolerance=1.0)
    assert own is not None
    assert (*own.size, False) in placer.model.statistics.sizes["toilet"]
    given_size = Item("toilet", (0.9, 0.31), (0, 0))
    told = placer.find(query, heat, choosing(1), size=given_size, tolerance=1.0)
    assert told is not None
    assert told.size == (0.9, 0.31)


@pytest.mark.parametrize(
    ("type", "center", "holds"),
    [
        (edge_type(FRONT, ADJACENT), (2.0, 0.25), True),
        (edge_type(FRONT, ADJACENT), (2.0, 0.45), True),  # snapped
        (edge_type(FRONT, ADJACENT), (2.0, 0.60), False),
        (edge_type(FRONT, PROXIMAL), (2.0, 0.90), True),
        (edge_type(FRONT, PROXIMAL), (2.0, 1.10), False),
        (edge_type(FRONT, DISTANT), (2.0, 0.70), True),
        (edge_type(FRONT, DISTANT), (2.0, 0.40), False),
    ],
)
def test_an_edge_holds_or_does_not(type: int, center: tuple[float, float], holds: bool) -> None:
    """From the lower wall to an item of half a metre."""
    item = Item("bed", (0.5, 0.5), center)
    placer = placer_of([rectangular_room(4.0, 3.0, item)])
    query = Query(0, "bed", [Relation(LOWER_WALL, placer.scenes[0].fixed, type)], {})
    snapped = placer._snapped(query, item)
    assert (placer._held(query, snapped) == 1) is holds
    if holds and type == edge_type(FRONT, ADJACENT):
        assert box_of(snapped)[1] == pytest.approx(0)
    else:
        assert snapped == item


def test_an_item_beside_another_is_not_in_front_of_it() -> None:
    table, chair = Item("bed", (1.0, 1.0), (2.0, 1.5), 90), Item("chair", (0.4, 0.4), (1.2, 1.5))
    placer = placer_of([rectangular_room(4.0, 3.0, table, others=(chair,))])
    first = placer.scenes[0].fixed
    for way, holds in ((LEFT, True), (FRONT, False)):
        query = Query(0, "chair", [Relation(first, first + 1, edge_type(way, ADJACENT))], {first: table})
        assert (placer._held(query, placer._snapped(query, chair)) == 1) is holds


@pytest.mark.parametrize("facing", [0, 90, 180, 270])
def test_heat_is_of_the_asked_category_and_where_the_network_sees_it_from_the_anchor(
    facing: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a bed in the middle, by a network that is sure of one pixel a category."""
    ahead_and_left = {"desk": (1.2, 0.4), "chair": (-0.8, 1.4)}  # metres, as the bed faces
    bed = Item("bed", (1.0, 0.8), (3.0, 2.5), facing)
    others = tuple(Item(name, (0.4, 0.4), (0.5 + k, 0.5)) for k, name in enumerate(ahead_and_left))
    placer = placer_of([rectangular_room(6.0, 5.0, bed, others=others)])
    statistics, first = placer.model.statistics, placer.scenes[0].fixed

    def sure(picture: torch.Tensor, _: torch.Tensor) -> torch.Tensor:
        answer = torch.zeros(len(picture), 1 + len(statistics.categories), HEAT_SIDE, HEAT_SIDE)
        for name, place in ahead_and_left.items():
            column, row = (int((along / statistics.span + 1) / 2 * HEAT_SIDE) for along in place)
            answer[:, 1 + statistics.categories.index(name), row, column] = 20.0
        return answer

    monkeypatch.setattr(placer.model.location, "forward", sure)
    for name, (ahead, left) in ahead_and_left.items():
        edges = [Relation(first, first + 1, edge_type(FRONT, DISTANT))]
        (heat,) = placer.heat([Query(0, name, edges, {first: bed})])
        turn = np.deg2rad(facing)
        off = ahead * np.cos(turn) - left * np.sin(turn), ahead * np.sin(turn) + left * np.cos(turn)
        found = placer.cells[0][heat.argmax()]
        np.testing.assert_allclose(found, np.add(bed.center, off), atol=1.5 * placer.pixel)


@pytest.mark.parametrize("room_type", list(MAIN_ITEM))
def test_the_designers_place_holds_and_is_hardly_moved(room_type: str) -> None:
    """Of every item among all others: snapping closes gaps, and pushes nothing off what stands under it."""
    rooms = designed(room_type, 12)
    placer = placer_of(rooms)
    moved, held = [], []
    for k, room in enumerate(rooms):
        scene = placer.scenes[k]
        items = dict(zip(scene.items, room.furniture, strict=True))
        for node, item in items.items():
            edges = with_last(placer.model.statistics, scene, node)[node]
            query = Query(k, item.category, edges, {n: other for n, other in items.items() if n != node})
            snapped = placer._snapped(query, item)
            assert not placer._collisions(query, item)
            moved.append(iou_of(snapped.footprint, item.footprint))
            held.append(placer._held(query, snapped))
    assert np.mean(moved) > 0.97
    assert np.mean(np.array(held) == 1) > 0.95


def test_an_item_on_the_other_side_of_its_anchor_does_not_hold() -> None:
    bed, stand = Item("bed", (2.0, 1.6), (1.0, 1.5)), Item("nightstand", (0.4, 0.4), (0.2, 2.5))  # on its left
    placer = placer_of([rectangular_room(4.0, 3.0, bed, others=(stand,))])
    first = placer.scenes[0].fixed
    for way, distance in itertools.product((LEFT, RIGHT), (ADJACENT, PROXIMAL)):
        query = Query(0, "nightstand", [Relation(first, first + 1, edge_type(way, distance))], {first: bed})
        assert (placer._held(query, stand) == 1) is (way == LEFT)
        assert placer._held(query, replace(stand, center=bed.center)) < 1  # nor within it


def test_a_chair_may_stand_under_its_desk_and_under_nothing_else() -> None:
    placer = placer_of(designed("study", 8))
    desk, chair = Item("desk", (0.6, 1.2), (0.3, 1.0)), Item("chair", (0.5, 0.5), (0.6, 1.0), 180, tucked=True)
    case = Item("bookcase", (0.6, 1.2), (0.3, 1.0))
    assert not placer._collisions(Query(0, "chair", [], {20: desk}), chair)
    assert not placer._collisions(Query(0, "desk", [], {20: chair}), desk)
    assert placer._collisions(Query(0, "chair", [], {20: case}), chair) == [20]
    assert placer._collisions(Query(0, "chair", [], {20: chair}), chair) == [20]


def test_what_is_carried_stands_on_what_carries_it() -> None:
    table, lamp = Item("table", (1.0, 1.0), (2.0, 1.5)), Item("lamp", (0.2, 0.2), (2.0, 1.5))
    placer = placer_of([rectangular_room(4.0, 3.0, table, others=(lamp,))])
    first = placer.scenes[0].fixed
    query = Query(0, "lamp", [Relation(first, first + 1, SUPPORT)], {first: table})
    assert not placer._collisions(query, lamp)
    assert placer._held(query, lamp) == 1
    assert placer._held(query, replace(lamp, center=(3.0, 1.5))) == 0


def test_gaps_are_measured_in_the_asked_direction() -> None:
    anchor, target = np.array([0.0, 0.0, 1.0, 1.0]), np.array([1.5, 0.5, 2.0, 3.0])
    assert gap(anchor, target, 0) == pytest.approx(0.5)
    assert gap(anchor, target, 1) == pytest.approx(-0.5)
    assert gap(anchor, target, 2) == pytest.approx(-2.0)
    assert gap(anchor, target, 3) == pytest.approx(-3.0)
    assert faces_across(anchor, target, 0)
    assert not faces_across(anchor, target, 1)


@given(st.lists(st.floats(-5, 5), min_size=8, max_size=8), st.integers(-3, 4))
def test_gaps_are_those_of_boxes_turned_so_that_the_direction_is_right(corners: list[float], quarters: int) -> None:
    anchor, target = (np.sort(np.reshape(box, (2, 2)), axis=0).ravel() for box in (corners[:4], corners[4:]))
    a, b = turned(anchor, -quarters), turned(target, -quarters)
    assert gap(anchor, target, quarters) == b[0] - a[2]
    assert faces_across(anchor, target, quarters) == (min(a[3], b[3]) - max(a[1], b[1]) > TOLERANCE)
