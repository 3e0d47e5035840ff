"""Scores by hand, and a ceiling that no stopping place exceeds."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation.metrics import blocks_openings, lattice_ceiling, score
from layoutrl.rooms.room import Item, Room
from tests.builders import l_room, opening, random_room, rectangular_room, room_of

NEAR = 2e-5  # of IoU: what a few micrometres of grid and fit make


def simulator_of(*rooms: Room, moves: Moves | None = None) -> Simulator:
    return Simulator(rooms, moves or Moves((0.2,), slide=False), Reward())


def test_a_score_is_as_worked_out_by_hand():
    # Unit squares: displaced by d along one axis, IoU is (1 - d) / (1 + d).
    rooms = [
        rectangular_room(4, 3, Item("bed", (1.0, 1.0), (2, 1.5)), id="a", others=(Item("chair", (1, 1), (3.25, 1.5)),)),
        rectangular_room(4, 3, Item("bed", (1.0, 1.0), (0.5, 1.5)), id="b"),
    ]
    position = np.array([(2, 1.5), (2.5, 1.5), (0.5, 1.5), (0.4, 1.5), (0.5, 1.7)])
    room = np.array([0, 0, 1, 1, 1])
    iou = np.array([1.0, 1 / 3, 1.0, 0.9 / 1.1, 0.8 / 1.2])
    result = score(simulator_of(*rooms), room, position)
    off = iou - iou.mean()
    assert result.mean_iou == pytest.approx(iou.mean())
    assert result.std_iou == pytest.approx(np.sqrt(((iou - iou.mean()) ** 2).mean()))
    assert result.standard_error == pytest.approx(np.hypot(off[:2].sum(), off[2:].sum()) * np.sqrt(2) / 5)
    assert result.median_iou == pytest.approx(0.9 / 1.1)
    assert result.share_090 == pytest.approx(2 / 5)
    assert result.overlap == pytest.approx(0.25 / 5)  # the second covers a quarter of itself with the chair
    assert result.outside == pytest.approx(0.1 / 5)  # the fourth stands in the wall by a tenth
    assert list(result.as_dict()) == [
        "mean_iou", "std_iou", "standard_error", "median_iou", "share_090", "overlap", "outside", "blocked"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "center", "blocks"),
    [
        ("door", (2.0, 0.5), True),  # right before it
        ("door", (2.0, 0.78), True),
        ("door", (2.0, 0.795), False),  # by half a centimetre
        ("door", (2.0, 0.81), False),
        ("door", (3.05, 0.5), False),  # beside it, at the same wall
        ("door", (2.95, 0.5), True),
        ("window", (2.0, 0.5), False),  # a bed may stand under a window
        ("window", (2.0, 0.45), True),  # but not in it
        ("window", (2.0, 0.495), False),  # half a centimetre deep
    ],
)
@pytest.mark.parametrize("quarters", range(4))
def test_an_opening_is_blocked_by_what_stands_in_it_or_right_before_a_door(kind, center, blocks, quarters):
    hole = opening(kind, 1.5, -0.2, 2.5, 0.0)
    room = rectangular_room(4, 3, Item("bed", (1.0, 1.0), center), openings=(hole,)).turned(quarters)
    simulator, index = simulator_of(room), np.array([0])
    assert blocks_openings(simulator, index, np.array([room.moving.center])).tolist() == [blocks]
    assert score(simulator, index, np.array([room.moving.center])).blocked == blocks


def test_a_platform_is_floor_and_blocks_nothing():
    platform = Item("platform", (2.0, 1.0), (2.0, 0.5), 0.0)
    room = rectangular_room(4, 3, platform, openings=(opening("door", 1.5, -0.2, 2.5, 0.0),))
    assert not blocks_openings(simulator_of(room), np.array([0]), np.array([platform.center])).any()


def test_what_is_thin_blocks_a_door_too():
    screen = Item("screen", (1.0, 0.015), (2.0, 0.1))
    room = rectangular_room(4, 3, screen, openings=(opening("door", 1.5, -0.2, 2.5, 0.0),))
    assert blocks_openings(simulator_of(room), np.array([0]), np.array([screen.center])).all()


def test_the_standard_error_is_over_rooms_and_more_starts_in_a_room_do_not_lower_it():
    rng = np.random.default_rng(0)
    beds = [Item("bed", (1, 1), tuple(rng.uniform((0.5, 0.5), (3.5, 2.5)))) for _ in range(5)]
    rooms = [replace(rectangular_room(4, 3, bed), id=f"r{k}", group=f"r{k}") for k, bed in enumerate(beds)]
    simulator, room = simulator_of(*rooms), np.arange(5)
    position = simulator.starts(room, rng)
    once = score(simulator, room, position)
    iou = simulator.reward(room, position).iou
    assert once.standard_error == pytest.approx(iou.std(ddof=1) / np.sqrt(5))
    often = score(simulator, np.repeat(room, 100), np.repeat(position, 100, 0))
    assert often.standard_error == pytest.approx(once.standard_error)
    assert often.mean_iou == pytest.approx(once.mean_iou)


def test_one_room_has_no_standard_error():
    result = score(simulator_of(rectangular_room()), np.zeros(3, dtype=int), np.full((3, 2), 1.5))
    assert result.standard_error is None


def test_an_iou_of_090_counts_as_good():
    displaced = 0.1 / 1.9  # where (1 - d) / (1 + d) is 0.9
    simulator = simulator_of(rectangular_room(4, 3, Item("bed", (1, 1), (2.0, 1.5))))
    assert score(simulator, np.array([0]), np.array([[2 + displaced - 1e-6, 1.5]])).share_090 == 1
    assert score(simulator, np.array([0]), np.array([[2 + displaced + 1e-6, 1.5]])).share_090 == 0


def reachable(simulator: Simulator, start: np.ndarray, most: int = 3000) -> np.ndarray:
    """Every position (n, 2) that moves can reach from the start, or the first so many, breadth first."""
    known, front = {tuple(start)}, [tuple(start)]
    while front and len(known) < most:
        reached, legal = simulator.destinations(np.zeros(len(front), dtype=int), np.array(front))
        front = sorted({tuple(p) for p in reached[legal].tolist()} - known)
        known.update(front)
    return np.array(sorted(known))


def best_reachable(simulator: Simulator, start: np.ndarray, most: int = 3000) -> float:
    positions = reachable(simulator, start, most)
    return float(simulator.reward(np.zeros(len(positions), dtype=int), positions).iou.max())


ITEMS = st.sampled_from(
    [Item("bed", (0.7, 0.5)), Item("bed", (0.5, 0.7), rotation=90), Item("bed", (0.6, 0.6), form="circle")]
)


@given(ITEMS, st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=12)
def test_in_a_rectangular_room_the_ceiling_is_what_the_best_reachable_position_attains(item, slide, seed):
    rng = np.random.default_rng(seed)
    center = tuple(map(float, rng.uniform((0.4, 0.4), (1.3, 1.1))))
    room = rectangular_room(1.7, 1.5, Item(item.category, item.size, center, item.rotation, item.form))
    simulator = simulator_of(room, moves=Moves((0.4, 0.2), slide=slide))
    start = simulator.starts(np.array([0]), rng)
    ceiling = lattice_ceiling(simulator, np.array([0]), start)[0]
    assert best_reachable(simulator, start[0]) == pytest.approx(ceiling, abs=NEAR)


@given(ITEMS, st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=8)
def test_in_an_l_shaped_room_no_reachable_position_exceeds_the_ceiling(item, slide, seed):
    rng = np.random.default_rng(seed)
    arm = [((0.4, 0.4), (3.6, 1.6)), ((0.4, 0.4), (1.6, 3.6))][rng.integers(2)]
    room = l_room(Item(item.category, item.size, tuple(map(float, rng.uniform(*arm))), item.rotation, item.form))
    simulator = simulator_of(room, moves=Moves((0.32,), slide=slide))
    start = simulator.starts(np.array([0]), rng)
    ceiling = lattice_ceiling(simulator, np.array([0]), start)[0]
    assert best_reachable(simulator, start[0]) <= ceiling + NEAR


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=12)
def test_in_any_room_no_reachable_position_of_an_upright_item_exceeds_the_ceiling(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    size = tuple(map(float, rng.uniform(0.3, 0.9, 2)))
    around = Simulator([room], Moves(), Reward()).starts(np.zeros(1, dtype=int), rng)[0]
    item = Item("bed", size, tuple(map(float, around)))
    room = replace(room, furniture=(item, *room.others), target=0)
    simulator = simulator_of(room, moves=Moves((0.32, 0.16)))
    start = simulator.starts(np.array([0]), rng)
    ceiling = lattice_ceiling(simulator, np.array([0]), start)[0]
    assert best_reachable(simulator, start[0], 1500) <= ceiling + NEAR


def test_the_ceiling_is_one_where_the_start_is_on_the_designers_lattice():
    simulator = simulator_of(
        l_room(Item("bed", (1.0, 0.8), (1.03, 0.77))), moves=Moves((0.32, 0.08, 0.02), slide=False)
    )
    steps = np.array([(0, 0), (5, 0), (0, 9), (37, -4), (-6, 40)])
    starts = simulator.designer_position[0] + 0.02 * steps
    np.testing.assert_allclose(lattice_ceiling(simulator, np.zeros(5, dtype=int), starts), 1, atol=NEAR)


@pytest.mark.parametrize(
    ("off", "left"), [((0.05, 0.0), (0.05, 0)), ((0.13, 0.0), (0.07, 0)), ((0.13, 0.16), (0.07, 0.04))]
)
def test_the_ceiling_off_the_lattice_is_the_iou_at_the_nearest_point_of_it(off, left):
    simulator = simulator_of(
        rectangular_room(4, 3, Item("bed", (1.0, 1.0), (2, 1.5))), moves=Moves((0.2,), slide=False)
    )
    start = np.array([(2.6, 1.9)]) + off
    shared = (1 - left[0]) * (1 - left[1])
    assert lattice_ceiling(simulator, np.array([0]), start)[0] == pytest.approx(shared / (2 - shared))


def test_with_slides_a_place_in_a_corner_can_be_reached_from_anywhere():
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.8), (3.5, 0.4)))
    start = np.array([(1.234, 1.777)])
    with_slides, without = (simulator_of(room, moves=Moves((0.2,), slide=slide)) for slide in (True, False))
    assert lattice_ceiling(with_slides, np.array([0]), start)[0] == pytest.approx(1, abs=NEAR)
    assert lattice_ceiling(without, np.array([0]), start)[0] < 0.9


def test_a_slide_to_a_slanting_wall_reaches_places_off_every_lattice():
    outline = ((0.0, 0.0), (4.0, 0.0), (3.0, 3.0), (0.0, 3.0))
    start, moves = np.array([(1.037, 1.35)]), Moves((0.2,))
    bare = simulator_of(room_of(outline, Item("bed", (0.6, 0.6), (1.0, 1.0))), moves=moves)
    reached, legal = bare.destinations(np.array([0]), start)
    against = tuple(reached[0, 4].tolist())  # the slide to the right
    assert legal[0, 4]
    assert against[0] == pytest.approx(4 - 1.65 / 3 - 0.3, abs=1e-4)  # 3.15; the wall stands at x = 4 - y / 3
    simulator = simulator_of(room_of(outline, Item("bed", (0.6, 0.6), against)), moves=moves)
    assert lattice_ceiling(simulator, np.array([0]), start)[0] == pytest.approx(1, abs=NEAR)


@pytest.mark.parametrize("slide", [False, True])
def test_an_item_at_an_angle_in_a_room_with_few_walls_to_slide_to_has_a_ceiling_too(slide):
    room = rectangular_room(2.4, 2.0, Item("bed", (0.6, 0.8), (0.97, 0.83), 30))
    simulator, start = simulator_of(room, moves=Moves((0.2,), slide=slide)), np.array([[1.37, 1.23]])
    assert lattice_ceiling(simulator, np.array([0]), start)[0] == pytest.approx(1, abs=NEAR)
    assert best_reachable(simulator, start[0]) == pytest.approx(1, abs=NEAR)


def test_the_ceiling_of_a_batch_is_that_of_each_start_in_its_room():
    rooms = [rectangular_room(), l_room(), random_room(np.random.default_rng(3))]
    room, rng = np.array([0, 1, 2, 1, 0]), np.random.default_rng(0)
    moves = Moves((0.3, 0.15))
    together = simulator_of(*rooms, moves=moves)
    starts = together.starts(room, rng)
    alone = [
        lattice_ceiling(simulator_of(rooms[k], moves=moves), np.array([0]), starts[b : b + 1])[0]
        for b, k in enumerate(room)
    ]
    np.testing.assert_allclose(lattice_ceiling(together, room, starts), alone, atol=1e-12)


def test_one_item_at_an_angle_makes_the_ceiling_of_others_no_slower(monkeypatch: pytest.MonkeyPatch) -> None:
    tilted = rectangular_room(2.4, 2.0, Item("bed", (0.6, 0.8), (0.97, 0.83), 30))
    simulator, tried, ious = simulator_of(l_room(), tilted, moves=Moves((0.2,))), Counter[int](), Simulator.ious

    def counted(self: Simulator, room: np.ndarray, *others: np.ndarray) -> np.ndarray:
        tried.update(room.tolist())
        return ious(self, room, *others)

    monkeypatch.setattr(Simulator, "ious", counted)
    room = np.array([0, 1])
    lattice_ceiling(simulator, room, simulator.starts(room, np.random.default_rng(0)))
    assert tried[0] == 3 * 3
    assert tried[1] > tried[0]


def test_the_standard_error_takes_layouts_of_one_room_for_what_they_are():
    rooms = [replace(rectangular_room(4, 3), id=f"r{k}", group="g0" if k == 0 else "g1") for k in range(4)]
    simulator, room = simulator_of(*rooms), np.arange(4)
    position = simulator.starts(room, np.random.default_rng(3))
    iou = simulator.reward(room, position).iou
    off = iou - iou.mean()
    assert score(simulator, room, position).standard_error == pytest.approx(
        np.hypot(off[0], off[1:].sum()) * np.sqrt(2) / 4
    )
