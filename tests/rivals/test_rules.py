"""Yardsticks without an agent: legal places beside walls, and the designer's place in the most similar room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely import box

from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rivals.rules import (
    best_wall_place,
    far_end_place,
    nearest_room_place,
    nearest_wall_place,
    random_wall_place,
    wall_places,
)
from layoutrl.rooms.room import TOLERANCE, Item, Opening, symmetry
from tests.builders import l_room, opening, random_room, rectangle, rectangular_room, room_of


def simulator_of(*rooms) -> Simulator:
    return Simulator(rooms, Moves(), Reward())


def as_set(places: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(row) for row in np.round(places, 6).tolist()}


@pytest.mark.parametrize("item", [Item("bed", (1.0, 0.6), (2, 1.5)), Item("bed", (0.6, 1.0), (2, 1.5), 270)])
def test_the_wall_places_of_a_rectangular_room_are_its_corners_and_the_middles_of_its_walls(item):
    right = {(0.5, 0.3), (2, 0.3), (3.5, 0.3), (0.5, 1.5), (3.5, 1.5), (0.5, 2.7), (2, 2.7), (3.5, 2.7)}
    places = wall_places(rectangular_room(4, 3, item))
    assert places.shape == (8, 2)
    assert as_set(places) == right


def test_wall_places_of_another_shape_are_those_of_its_own_walls():
    item = Item("bed", (0.8, 0.8), (1, 1), form="circle")
    corners = {(0.4, 0.4), (3.6, 0.4), (3.6, 1.6), (1.6, 1.6), (1.6, 3.6), (0.4, 3.6)}
    middles = {(2.0, 0.4), (3.6, 1.0), (2.6, 1.6), (1.6, 2.6), (1.0, 3.6), (0.4, 2.0)}
    assert as_set(wall_places(l_room(item))) == corners | middles


def test_what_spans_a_room_has_its_places_once():
    assert as_set(wall_places(rectangular_room(4, 3, Item("bed", (1.0, 3.0), (2, 1.5))))) == {
        (0.5, 1.5), (2, 1.5), (3.5, 1.5)
    }  # fmt: skip


def test_what_fits_nowhere_has_the_places_of_the_box_around_the_outline():
    places = wall_places(rectangular_room(4, 3, Item("bed", (1.0, 3.2), (2, 1.5))))  # 10 cm into two walls
    assert {x for x, _ in as_set(places)} == {0.5, 2.0, 3.5}


def test_only_legal_wall_places_are_drawn_each_of_them():
    room = l_room(Item("bed", (1.0, 1.0), (1.0, 1.0)))  # the upper right arm of the L is not there
    simulator, rng = simulator_of(room), np.random.default_rng(0)
    index = np.zeros(300, dtype=int)
    starts = simulator.starts(index, rng)
    chosen = random_wall_place(simulator, index, starts, rng)
    assert simulator.is_legal(index, chosen).all()
    assert as_set(chosen) == as_set(wall_places(room))
    counts = np.unique(chosen, axis=0, return_counts=True)[1]
    assert counts.min() > 300 / 12 / 3


def test_where_no_wall_place_is_legal_the_start_is_kept():
    diamond = ((2.0, 0.0), (4.0, 2.0), (2.0, 4.0), (0.0, 2.0))
    rooms = [room_of(diamond, Item("bed", (2.1, 2.1), (2, 2))), rectangular_room(id="plain")]
    simulator, rng = simulator_of(*rooms), np.random.default_rng(0)
    index = np.array([0, 1, 0])
    starts = simulator.starts(index, rng)
    copy = starts.copy()
    chosen = random_wall_place(simulator, index, starts, rng)
    np.testing.assert_array_equal(chosen[[0, 2]], starts[[0, 2]])
    assert not np.array_equal(chosen[1], starts[1])
    np.testing.assert_array_equal(starts, copy)


@given(st.integers(0, 2**32 - 1))
@example(1_663_036_330)
@example(87_046_486)
@settings(max_examples=15)
def test_wall_places_lie_indoors_at_a_wall_and_drawn_ones_are_legal(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    x0, y0, x1, y1 = room.moving.template.bounds
    boxes = [box(x0 + x, y0 + y, x1 + x, y1 + y) for x, y in wall_places(room)]
    if any(room.indoor.buffer(1e-3).covers(around) for around in boxes):  # it fits
        assert all(room.indoor.buffer(1e-3).covers(around) for around in boxes)
        # A corner of less than a centimetre is none.
        near = TOLERANCE + 2e-3
        assert all(room.indoor.exterior.distance(around.exterior) < near for around in boxes if not room.holes)
    simulator, index = simulator_of(room), np.zeros(5, dtype=int)
    chosen = random_wall_place(simulator, index, simulator.starts(index, rng), rng)
    assert simulator.is_legal(index, chosen).all()


def test_the_best_wall_place_is_the_one_that_meets_the_designers_most():
    designers = [(0.7, 0.5), (2.1, 2.3), (3.4, 1.7), (0.5, 2.7)]
    rooms = [rectangular_room(4, 3, Item("bed", (1.0, 0.6), designer)) for designer in designers]
    places = best_wall_place(simulator_of(*rooms), np.array([3, 0, 1, 2, 0]))
    best = [(0.5, 2.7), (0.5, 0.3), (2, 2.7), (3.5, 1.5), (0.5, 0.3)]
    np.testing.assert_allclose(places, best)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_no_wall_place_is_better_than_the_best(seed):
    room = random_room(np.random.default_rng(seed))
    simulator = simulator_of(room)
    iou = simulator.reward(np.array([0]), best_wall_place(simulator, np.array([0]))).iou
    places = wall_places(room)
    assert iou == simulator.reward(np.zeros(len(places), dtype=int), places).iou.max()


def bath_room(door: float | None, windows: tuple[float, ...] = (), width: float = 1.4):
    """A bath room of 2 m by 1.4 m whose tub spans the short side; door and windows are in the long wall below."""
    at = [("window", x) for x in windows] + ([] if door is None else [("door", door)])
    openings = tuple(Opening(kind, rectangle(x - 0.3, -0.2, x + 0.3, 0)) for kind, x in at)
    return rectangular_room(2.0, 1.4, Item("bathtub", (0.7, width), (1.0, 0.7)), openings=openings)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("quarters", range(4))
@pytest.mark.parametrize(("door", "end"), [(0.4, 1.65), (0.9, 1.65), (1.6, 0.35)])
def test_the_hand_rule_spans_the_short_side_at_the_end_far_from_the_door(door, end, quarters, mirror):
    for width in (1.4, 1.3):  # one that leaves some play stands in the middle of it
        room = bath_room(door, windows=(1.7,), width=width).turned(quarters, mirror)
        place = far_end_place(simulator_of(room), np.array([0]))
        np.testing.assert_allclose(place, [symmetry(quarters, mirror) @ (end, 0.7)], atol=1e-9)


def test_the_hand_rule_follows_the_item_not_the_room_where_they_disagree():
    door = (opening("door", 3.2, -0.2, 3.8, 0),)
    room = rectangular_room(4, 3, Item("bathtub", (3.8, 0.8), (2, 1.5)), openings=door)  # along the longer side
    np.testing.assert_allclose(far_end_place(simulator_of(room), np.array([0])), [(2, 2.6)])


def test_of_several_doors_the_nearest_to_an_end_counts_and_without_doors_the_windows_do():
    both = rectangular_room(
        3, 1.4, Item("bathtub", (0.7, 1.4), (1.5, 0.7)),
        openings=(opening("door", 0, -0.2, 0.6, 0), opening("door", 1.8, -0.2, 2.4, 0)),
    )  # fmt: skip
    rooms = [both, bath_room(None, windows=(1.6,)), bath_room(None, windows=(0.4,)), bath_room(None)]
    places = far_end_place(simulator_of(*rooms), np.array([0, 1, 2, 3]))
    np.testing.assert_allclose(places, [(2.65, 0.7), (0.35, 0.7), (1.65, 0.7), (1.65, 0.7)])


def test_the_nearest_wall_is_reached_by_the_shortest_straight_way():
    simulator = simulator_of(
        rectangular_room(4, 3, Item("bed", (1.0, 0.6), (2, 1.5))), l_room(Item("bed", (1, 1), (1, 1)))
    )
    starts = np.array([(0.9, 1.5), (2.0, 2.4), (1.2, 2.0), (3.6, 1.0)])
    places = nearest_wall_place(simulator, np.array([0, 0, 1, 1]), starts)
    np.testing.assert_allclose(places, [(0.5, 1.5), (2.0, 2.7), (0.5, 2.0), (3.5, 1.0)])


def test_likeness_counts_rooms_in_which_the_same_category_moves():
    bed, desk = (rectangular_room(4, 3, Item(name, (1, 1), (x, 1.5))) for name, x in (("bed", 0.6), ("desk", 3.4)))
    here = rectangular_room(5, 3.5, Item("desk", (1, 1), (2, 1.5)))
    assert nearest_room_place(simulator_of(here), np.array([0]), [bed, desk])[0, 0] > 3
    assert nearest_room_place(simulator_of(here), np.array([0]), [bed])[0, 0] < 3  # any room, if there is no other


def test_the_place_is_never_that_of_a_room_of_the_same_group_if_there_is_another():
    here, twin = (rectangular_room(5, 3.5, Item("desk", (1, 1), (2, 1.5)), id=id, group="one") for id in "ab")
    other = rectangular_room(4, 3, Item("bed", (1, 1), (3.4, 1.5)), id="c")
    for training, x in (([here, other, twin], 0.5 + 4 * 2.9 / 3), ([twin], 2.0)):
        assert nearest_room_place(simulator_of(here), np.array([0]), training)[0, 0] == pytest.approx(x)


def designed_room(seed: int):
    """A rectangular room with a door somewhere and the bed anywhere indoors."""
    rng = np.random.default_rng(seed)
    width, depth, door = rng.uniform(3, 5), rng.uniform(2.5, 4), rng.uniform(0.2, 1.8)
    size = tuple(map(float, rng.uniform(0.8, 1.6, 2)))
    center = tuple(map(float, rng.uniform((0.8, 0.8), (width - 0.8, depth - 0.8))))
    openings = (Opening("door", rectangle(door, -0.2, door + 0.9, 0)),)
    return rectangular_room(width, depth, Item("bed", size, center), openings=openings, id=str(seed))


@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_a_room_that_is_in_the_training_list_mirrored_and_turned_or_not_gets_its_designers_place(seed):
    rooms = [designed_room(10 * seed + k) for k in range(6)]
    rng, index = np.random.default_rng(seed), np.array([3, 0, 3, 5])
    training = [room.turned(int(rng.integers(4)), mirror=bool(rng.integers(2))) for room in rooms[::-1]]
    training = [replace(room, group=f"another {room.id}") for room in training]
    places = nearest_room_place(simulator_of(*rooms), index, training)
    np.testing.assert_allclose(places, [rooms[k].moving.center for k in index], atol=1e-9)


def test_the_most_similar_room_tells_where_within_the_free_play():
    # The bed of 2 m by 1 m plays over 3 m by 2 m there and stands at 1/3 and 1/4 of it; over 4 m by 2 m here.
    there = rectangular_room(5, 3, Item("bed", (2, 1), (2, 1)), id="there")
    far = rectangular_room(9, 8, Item("bed", (0.5, 0.5), (8, 7)), id="far")
    here = rectangular_room(6, 3, Item("bed", (2, 1), (4, 2)), id="here")
    places = nearest_room_place(simulator_of(here), np.array([0, 0]), [far, there])
    np.testing.assert_allclose(places, [(1 + 4 / 3, 0.5 + 0.5)] * 2)


def test_likeness_tells_rooms_apart_by_their_door():
    def room(door: float, x: float):
        openings = (Opening("door", rectangle(door, -0.2, door + 0.9, 0)),)
        return rectangular_room(4, 3, Item("bed", (1, 1), (x, 1.5)), openings=openings)

    training = [room(0.3, 3.2), room(2.7, 0.8)]
    for door, x in ((0.5, 3.2), (2.5, 0.8)):
        places = nearest_room_place(simulator_of(room(door, 2.0)), np.array([0]), training)
        np.testing.assert_allclose(places, [(x, 1.5)])


@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_the_place_of_the_nearest_room_lies_within_the_box_around_the_outline(seed):
    rng = np.random.default_rng(seed)
    room, training = random_room(rng), [random_room(rng) for _ in range(3)]
    place = nearest_room_place(simulator_of(room), np.array([0]), training)[0]
    x0, y0, x1, y1 = room.indoor.bounds
    a, b, c, d = room.moving.footprint_at(tuple(place)).bounds
    assert min(a - x0, b - y0, x1 - c, y1 - d) >= -1e-9


def test_the_designers_place_of_the_room_itself_is_not_read():
    training = [designed_room(k) for k in range(5)]
    rooms = [rectangular_room(4, 3, Item("bed", (1, 1), center)) for center in ((1, 1), (3, 2))]
    for places in (lambda simulator: nearest_room_place(simulator, np.array([0]), training),
                   lambda simulator: far_end_place(simulator, np.array([0]))):  # fmt: skip
        np.testing.assert_array_equal(*(places(simulator_of(room)) for room in rooms))
