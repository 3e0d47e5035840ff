"""The simulator for one pose. The reference simulator is the oracle, at random poses in random rooms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st

from layoutrl.env.observation import GeometryObservation, ImageObservation
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.single import SingleSimulator
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Item, Room
from tests.builders import rectangular_room, room_of
from tests.env.test_batch import (
    MICRON,
    any_room,
    assert_terms_agree,
    elsewhere,
    kinds_of_moves,
    kinds_of_reward,
    leaning_room,
    seeds,
    some_rooms,
    visited,
)


def assert_is_the_reference(simulator: Simulator, room: np.ndarray, position: np.ndarray) -> None:
    """Steps lead to the same place, slides to within a micrometre, the same are legal, and so are the rewards."""
    singles = [SingleSimulator(simulator, k) for k in range(len(simulator.rooms))]
    poses = list(zip(room.tolist(), position.tolist(), strict=True))
    told = [singles[k].destinations(x, y) for k, (x, y) in poses]
    reached, legal = np.array([ends for ends, _ in told]), np.array([legal for _, legal in told])
    expected, expected_legal = simulator.destinations(room, position)
    assert np.array_equal(legal, expected_legal)
    assert np.abs(reached - expected)[legal].max(initial=0) <= MICRON
    steps = 4 * len(simulator.moves.steps)
    assert np.array_equal(reached[:, :steps], expected[:, :steps])
    terms = [singles[k].reward(x, y) for k, (x, y) in poses]
    assert_terms_agree(simulator, room, position, RewardTerms(*map(np.array, zip(*terms, strict=True))), 1e-9)


@given(seeds, kinds_of_moves, kinds_of_reward)
@example(419, Moves((0.05,)), Reward())  # a wall that leans by a micrometre
@example(22580, Moves(), Reward())  # and a start that touches it, or does not
def test_moves_and_rewards_are_those_of_the_reference(seed: int, moves: Moves, reward: Reward) -> None:
    simulator = Simulator(some_rooms(seed), moves, reward)
    assert_is_the_reference(simulator, *visited(simulator, seed, batch=20))


@pytest.mark.parametrize("room_type", MAIN_ITEM)
@pytest.mark.parametrize("degrees", [0, 30])
def test_they_are_in_designed_rooms_of_all_types(room_type: str, degrees: float) -> None:
    rooms = design_rooms(room_type, "train", seed=1, count=12).rooms
    simulator = Simulator([elsewhere(room, degrees, np.zeros(2)) for room in rooms], Moves(), Reward())
    assert_is_the_reference(simulator, *visited(simulator, 1, batch=60))


@given(seeds)
def test_they_are_where_walls_lean_by_micrometres(seed: int) -> None:
    rng = np.random.default_rng(seed)
    simulator = Simulator([leaning_room(rng) for _ in range(4)], Moves((0.3,)), Reward())
    assert_is_the_reference(simulator, *visited(simulator, seed, batch=20))


def with_discs(room: Room) -> Room:
    """Everything that stands in it round: what moves, too."""
    return replace(
        room,
        furniture=tuple(
            replace(item, size=(min(item.size), min(item.size)), form="circle", rotation=0.0) for item in room.furniture
        ),
    )


@given(seeds, st.booleans())
def test_they_are_where_discs_move_among_discs(seed: int, also_polygons: bool) -> None:
    room = any_room(np.random.default_rng(seed))
    discs = with_discs(room)
    if also_polygons:
        discs = replace(discs, furniture=(discs.furniture[0], *room.furniture[1:]))
    simulator = Simulator([discs], Moves(), Reward())
    assert_is_the_reference(simulator, *visited(simulator, seed, batch=20))


@pytest.mark.parametrize("degrees", [0.0, 0.703125, 45.0])
def test_discs_are_true_circles_from_every_side(degrees: float) -> None:
    """A turned polygon of 256 corners would be up to 0.008 % less wide: by half a corner's angle, for one."""
    stool = Item("stool", (0.6, 0.6), (3.0, 2.0), form="circle")
    rug = Item("rug", (1.0, 1.0), (1.0, 1.0), rotation=degrees)
    for moving, other, indoors in ((rug, stool, 1.0), (stool, rug, 0.09 * math.pi), (stool, stool, 0.09 * math.pi)):
        simulator = Simulator([rectangular_room(4, 3, moving, others=(other,))], Moves(), Reward(inside="iou"))
        terms = SingleSimulator(simulator, 0).reward(*other.center)
        overlap = 100 if other is moving else 9 * math.pi
        assert terms.r2 == pytest.approx(-overlap, abs=1e-9)
        assert terms.r3 == pytest.approx(100 * (indoors / 12 - 1), abs=1e-9)
        at_home = SingleSimulator(simulator, 0).reward(*moving.center)
        assert (at_home.iou, at_home.r1) == (pytest.approx(1), pytest.approx(100))


def test_a_turned_rectangle_shares_with_a_disc_what_a_polygon_of_256_corners_lacks() -> None:
    radius, depth, degrees = 0.3, 1e-5, 180 / 256  # metres; its side is parallel to the polygon's, 2e-5 further in
    stool = Item("stool", (2 * radius, 2 * radius), (3.0, 1.5), form="circle")
    rug = Item("rug", (1.0, 1.0), (1.0, 1.0), rotation=degrees)
    single = SingleSimulator(Simulator([rectangular_room(4, 3, rug, others=(stool,))], Moves(), Reward()), 0)
    away = 0.5 + radius - depth
    x, y = 3.0 - away * math.cos(math.radians(degrees)), 1.5 - away * math.sin(math.radians(degrees))
    shared = radius**2 * math.acos(1 - depth / radius) - (radius - depth) * math.sqrt(2 * radius * depth - depth**2)
    assert single.reward(x, y).r2 == pytest.approx(-100 * shared / (1 + math.pi * radius**2), rel=1e-4)


@given(seeds)
def test_it_is_no_matter_which_way_round_the_rings_of_walls_and_openings_go(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = any_room(rng)
    openings = tuple(replace(opening, polygon=opening.polygon[::-1]) for opening in room.openings)
    clockwise = replace(room, walls=tuple(wall[::-1] for wall in room.walls), openings=openings)
    simulator = Simulator([elsewhere(clockwise, rng.uniform(0, 90), np.zeros(2))], Moves(), Reward())
    assert_is_the_reference(simulator, *visited(simulator, seed, batch=20))


def test_a_slide_ends_before_the_outside_and_where_there_is_no_place_for_one() -> None:
    outline = ((0, 0), (6, 0), (6, 4), (4.5, 4), (4.5, 1), (1.5, 1), (1.5, 4), (0, 4))
    court = Simulator([room_of(outline, Item("desk", (0.5, 0.5), (1, 1)))], Moves(), Reward())
    assert not SingleSimulator(court, 0).destinations(1.25, 3.0)[1][-4]  # across the court between the arms
    ends, legal = SingleSimulator(court, 0).destinations(1.25, 0.5)
    assert legal[-4]
    assert ends[-4] == pytest.approx((5.75, 0.5), abs=5e-6)
    over_the_walls = rectangular_room(4, 3, item=Item("bed", (4.2, 1.0), (2.0, 1.5)))
    wide = SingleSimulator(Simulator([over_the_walls], Moves((0.5,)), Reward()), 0)
    assert wide.destinations(2.0, 1.5)[1] == [False] * 2 + [True] * 2 + [False] * 4


@pytest.mark.parametrize("kind", [GeometryObservation, ImageObservation])
def test_one_pose_is_seen_as_among_many(kind: type) -> None:
    rooms = [any_room(np.random.default_rng(seed)) for seed in range(12)]
    extra = (categories_of(rooms),) if kind is GeometryObservation else ()
    observe = kind(rooms, *extra)
    room, position = visited(Simulator(rooms, Moves(), Reward()), 0)
    seen = observe(torch.tensor(room), torch.tensor(position)).numpy()
    for k in range(0, len(room), 5):
        one = observe.single(int(room[k]), tuple(position[k].tolist()))
        assert one.dtype == seen.dtype
        assert np.array_equal(one, seen[k])
        one[:] = 0  # the caller's own
        assert np.array_equal(observe.single(int(room[k]), tuple(position[k].tolist())), seen[k])
