"""The reference simulator of whole rooms. The simulator of one item among finished rooms is the oracle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_simulator import RoomsSimulator, State, faces_alike
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.brief import brief_of, facings, without_poses
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Item, Room
from tests.builders import random_brief, random_room, rectangular_room

seeds = st.integers(0, 2**32 - 1)
BED = Item("bed", (2.0, 1.5), (1.0, 1.5), 0.0)


def simulator_of(*rooms: Room, **reward: float) -> RoomsSimulator:
    """Of the briefs of designed rooms."""
    return RoomsSimulator([brief_of(room) for room in rooms], rooms, Moves(), Reward(**reward))


def standing(simulator: RoomsSimulator, seed: int, batch: int = 6, share: float = 0.7) -> State[np.ndarray]:
    """Rooms with some of their items put anywhere, one of which moves."""
    rng = np.random.default_rng(seed)
    state = simulator.begin(rng.integers(len(simulator.rooms), size=batch), rng)
    for n in rng.permutation(simulator.room_index.shape[1]):
        here = (n < simulator.count[state.room]) & (rng.random(batch) < share)
        state.stands[:, n] = here
    moving = (rng.random(batch) * simulator.count[state.room]).astype(int)
    every = np.arange(batch)
    return simulator.put(state, moving, state.center[every, moving], state.quarter[every, moving])


@given(seeds)
def test_one_item_that_moves_is_the_simulator_of_the_room_as_it_stands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    designs = [random_room(rng) for _ in range(3)]
    simulator = RoomsSimulator([random_brief(rng, room) for room in designs], None, Moves(), Reward())
    state = standing(simulator, seed)
    item, center, quarter, legal = simulator.destinations(state)
    terms = simulator.reward(state)
    for b, n in enumerate(state.moving):
        room = simulator.layout(state, b)
        here = simulator.item(state, b, n)
        alone = Simulator([replace(room, target=room.furniture.index(here))], Moves(), Reward())
        at = np.array([here.center])
        reached, allowed = alone.destinations(np.array([0]), at)
        count = Moves().count
        assert (item[b, :count] == n).all()
        assert (quarter[b, :count] == state.quarter[b, n]).all()
        np.testing.assert_array_equal(legal[b, :count], allowed[0])
        np.testing.assert_allclose(center[b, :count], reached[0], rtol=0, atol=2e-6)
        own = alone.reward(np.array([0]), at)
        np.testing.assert_allclose((terms.r2[b], terms.r3[b]), (own.r2[0], own.r3[0]), rtol=0, atol=1e-6)


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_where_the_designer_put_everything_every_item_has_the_whole_first_term(room_type: str) -> None:
    room = design_rooms(room_type, "test", 0, 1).rooms[0]
    simulator = simulator_of(room, theta4=-100.0)
    items = simulator.items[0]
    state = simulator.begin(np.zeros(len(items), dtype=int), np.random.default_rng(0))
    free = list(room.furniture)
    for n, item in enumerate(items):
        there = next(other for other in free if replace(other, center=None, rotation=None) == item)
        free.remove(there)
        quarter = [faces_alike(there, degrees) for degrees in simulator.degrees[0, n]].index(True)
        state.center[:, n], state.quarter[:, n], state.stands[:, n] = there.center, quarter, True
    state = state._replace(moving=np.arange(len(items)))
    assert simulator.reward(state).iou == pytest.approx(1)
    assert simulator.floor_taken(state) == pytest.approx(0, abs=1e-3)  # the designer keeps what is to be free


def test_what_is_taken_of_the_floor_before_items_counts() -> None:
    wardrobe, desk, chair, box = (
        Item("wardrobe", (0.6, 1.0), (0.3, 1.5), 0.0),
        Item("desk", (0.6, 1.2), (2.0, 2.7), 270.0),
        Item("chair", (0.4, 0.4), (2.0, 2.2), 90.0),
        Item("box", (0.3, 0.3), (3.8, 0.2), 0.0),
    )
    simulator = simulator_of(rectangular_room(4, 3, wardrobe, others=(desk, chair, box)), theta4=-100.0)
    names = [item.category for item in simulator.items[0]]
    state = simulator.empty(np.zeros(1, dtype=int))

    def put(state: State[np.ndarray], name: str, center: tuple[float, float], degrees: float) -> State[np.ndarray]:
        n = names.index(name)
        quarter = [faces_alike(replace(simulator.items[0][n], rotation=degrees), d) for d in simulator.degrees[0, n]]
        return simulator.put(state, np.array([n]), np.array([center]), np.array([quarter.index(True)]))

    def taken(state: State[np.ndarray]) -> float:
        assert simulator.reward(state).r4 == pytest.approx(-100 * simulator.floor_taken(state))
        return simulator.floor_taken(state).item()

    alone = put(state, "wardrobe", (0.3, 1.5), 0.0)  # 60 cm before it are free: x from 0.6 to 1.2, y from 1 to 2
    assert taken(alone) == pytest.approx(0)
    boxed = put(alone, "box", (1.05, 1.15), 0.0)  # wholly on that floor: 0.09 of 0.6 square metres
    assert taken(boxed) == pytest.approx(0.15)
    assert taken(boxed._replace(moving=alone.moving)) == pytest.approx(0.15)  # of the wardrobe, it is the same
    assert taken(put(alone, "box", (1.35, 1.15), 0.0)) == pytest.approx(0)  # beside it
    # None of the floor before it is indoors where it faces the wall, and a third of that lies in it.
    facing_the_wall = taken(put(state, "wardrobe", (0.3, 1.5), 180.0))
    assert 1 < facing_the_wall < 1.4
    # Who sits at a desk is welcome there; a wardrobe is not.
    at_desk = put(put(state, "desk", (2.0, 2.7), 270.0), "chair", (2.0, 2.2), 90.0)
    assert taken(at_desk) == pytest.approx(0)
    assert taken(at_desk._replace(moving=np.array([names.index("desk")]))) == pytest.approx(0)
    assert taken(put(at_desk, "wardrobe", (2.0, 2.0), 0.0)) > 0.1


def test_what_is_taken_of_the_floor_hangs_on_no_other_room() -> None:
    fridge, chair = Item("fridge", (0.3, 0.3), (0.2, 0.2), 90.0), Item("chair", (0.2, 0.2), (0.2, 0.5), 270.0)
    small = rectangular_room(
        0.85, 0.7, fridge, others=(chair,), target=None
    )  # the floor before the fridge fits nowhere
    taken = []
    for rooms in ([small], [small, rectangular_room(4, 3, BED)]):
        simulator = simulator_of(*rooms, theta4=-100.0)
        state = simulator.empty(np.zeros(1, dtype=int))
        for n, (center, degrees) in enumerate(((chair.center, 270.0), (fridge.center, 90.0))):
            quarter = np.flatnonzero(simulator.degrees[0, n] % 360 == degrees)
            state = simulator.put(state, np.array([n]), np.array([center]), quarter)
        state = state._replace(moving=np.zeros(1, dtype=int))
        batch = BatchRoomsSimulator(simulator, dtype=torch.float64).reward(State(*map(torch.tensor, state)))
        assert batch.r4.item() == pytest.approx(simulator.reward(state).r4.item(), abs=1e-4)
        taken.append(batch.r4.item())
    assert taken[0] == pytest.approx(taken[1], abs=1e-4)
    assert taken[0] < 0


def test_what_stands_for_good_takes_floor_but_for_what_is_welcome() -> None:
    desk = Item("desk", (0.6, 1.2), None, None)
    for category, is_taken in (("chair", False), ("box", True)):
        fixed = Item(category, (0.4, 0.4), (2.0, 2.2), 90.0)
        brief = rectangular_room(4, 3, desk, others=(fixed,), target=None)
        simulator = RoomsSimulator([brief], None, Moves(), Reward(theta4=-1.0))
        quarter = np.flatnonzero(simulator.degrees[0, 0] % 360 == 270)
        state = simulator.put(simulator.empty(np.zeros(1, int)), np.zeros(1, int), np.array([[2.0, 2.7]]), quarter)
        assert (simulator.floor_taken(state).item() > 0.1) == is_taken


def test_the_reward_knows_what_stands_now_and_nothing_else() -> None:
    desk = Item("desk", (0.6, 1.2), (3.0, 1.0), 180.0)
    simulator = simulator_of(rectangular_room(4, 3, BED, others=(desk,)))
    begun = simulator.begin(np.array([0]), np.random.default_rng(0))
    assert not any(term.item() for term in simulator.reward(begun))  # nothing is taken yet
    bed = simulator.put(begun, np.array([0]), np.array([[2.9, 1.5]]), np.array([0]))
    assert simulator.reward(bed).r2.item() == 0
    both = simulator.put(bed, np.array([1]), np.array([[3.0, 1.0]]), np.array([2]))
    assert simulator.reward(both).r2.item() < 0
    assert simulator.reward(both).r1.item() == pytest.approx(100)
    assert simulator.reward(bed._replace(moving=np.array([1]))).r1.item() == 0


def test_an_item_that_faces_away_counts_less_and_one_without_a_front_does_not_care() -> None:
    table = Item("table", (1.4, 0.8), (3.2, 1.5), 0.0)
    round_table = Item("side_table", (0.5, 0.5), (0.4, 0.4), 90.0, "circle")
    simulator = simulator_of(rectangular_room(4, 3, BED, others=(table, round_table)), faces_away=0.25)
    assert [item.category for item in simulator.items[0]] == ["bed", "side_table", "table"]
    np.testing.assert_array_equal(simulator.ways, [[4, 1, 2]])
    state = simulator.begin(np.zeros(4, dtype=int), np.random.default_rng(0))

    def first_terms(item: int, center: tuple[float, float], quarters: list[int]) -> list[float]:
        size = len(quarters)
        there = np.repeat([center], 4, 0)
        put = simulator.put(state, np.full(4, item), there, np.resize(quarters, 4))
        return simulator.reward(put).r1[:size].tolist()

    assert first_terms(0, (1.0, 1.5), [0, 2]) == pytest.approx([100, 25])
    assert first_terms(2, (3.2, 1.5), [0]) == pytest.approx([100])
    assert first_terms(1, (0.4, 0.4), [0]) == pytest.approx([100])


def test_equal_items_may_stand_for_each_other() -> None:
    stands = [Item("nightstand", (0.5, 0.5), (x, 0.25), 90.0) for x in (0.25, 2.25)]
    simulator = simulator_of(rectangular_room(4, 3, BED, others=tuple(stands)))
    state = simulator.begin(np.zeros(2, dtype=int), np.random.default_rng(0))
    for n in (1, 2):
        put = simulator.put(state, np.full(2, n), np.array([(0.25, 0.25), (2.25, 0.25)]), np.ones(2, dtype=int))
        assert simulator.reward(put).iou == pytest.approx(1)


def test_equal_items_have_a_place_each_and_one_turn_though_one_alone_may_stand_under_others() -> None:
    first, second = (Item("chair", (0.4, 0.4), (x, 1.0), 0.0) for x in (1.0, 3.0))
    design = rectangular_room(4, 3, first, others=(second,), target=None)
    brief = replace(design, furniture=tuple(replace(i, center=None, rotation=None) for i in (first, second)))
    brief = replace(brief, furniture=(replace(brief.furniture[0], tucked=True), brief.furniture[1]))
    simulator = RoomsSimulator([brief], [design], Moves(), Reward())
    center, _ = simulator.designed()
    assert center.tolist() == [[[1.0, 1.0], [3.0, 1.0]]]
    assert simulator.size_rank().tolist() == [[0, 0]]


@pytest.mark.parametrize("lifted", [0, 1])
def test_the_place_of_an_equal_item_that_stands_is_taken(lifted: int) -> None:
    design = rectangular_room(
        4, 3, Item("nightstand", (0.5, 0.5), (0.25, 1.0), 0.0),
        others=(Item("nightstand", (0.5, 0.5), (0.25, 2.0), 0.0),), target=None,
    )  # fmt: skip
    brief = replace(design, furniture=without_poses(design.furniture, {lifted}))
    simulator = RoomsSimulator([brief], [design], Moves(), Reward())
    center, quarter = simulator.designed()
    assert center.tolist() == [[list(design.furniture[lifted].center)]]
    state = simulator.begin(np.array([0]), np.random.default_rng(0))
    assert simulator.reward(simulator.put(state, np.array([0]), center[:, 0], quarter[:, 0])).iou == pytest.approx(1)


def test_an_item_may_stand_where_the_designer_has_locked_it() -> None:
    simulator = simulator_of(rectangular_room(4, 3, replace(BED, locked=True)))
    center, quarter = simulator.designed()
    state = simulator.begin(np.array([0]), np.random.default_rng(0))
    assert simulator.reward(simulator.put(state, np.array([0]), center[:, 0], quarter[:, 0])).iou == pytest.approx(1)


def test_a_turn_stays_in_place_and_is_legal_where_the_item_fits_so_turned() -> None:
    wardrobe = Item("wardrobe", (0.6, 2.8), (0.3, 1.5), 0.0)
    simulator = simulator_of(rectangular_room(2.0, 3.0, wardrobe))  # 2.4 m wide with its walls
    state = simulator.begin(np.array([0]), np.random.default_rng(0))
    assert simulator.room_index[0, 0, 1] == simulator.room_index[0, 0, 3] == -1 == simulator.room_index[0, 0].min()
    lengthwise = simulator.put(state, np.array([0]), np.array([[1.0, 1.5]]), np.array([0]))
    first = Moves().count
    _item, center, quarter, legal = simulator.destinations(lengthwise)
    assert not legal[0, first : first + 2].any()
    assert quarter[0, first : first + 2].tolist() == [1, 3]
    np.testing.assert_array_equal(center[0, first : first + 2], [[1.0, 1.5]] * 2)

    simulator = simulator_of(rectangular_room(4.0, 3.0, wardrobe))
    lengthwise = simulator.put(state, np.array([0]), np.array([[2.0, 1.5]]), np.array([0]))
    assert simulator.destinations(lengthwise)[3][0, first : first + 2].all()


@pytest.mark.parametrize(
    ("room", "ways"),
    [
        (rectangular_room(4, 3, BED), [0, 1, 2, 3]),
        (rectangular_room(2, 3, Item("wardrobe", (0.6, 2.8), (0.3, 1.5), 0.0)), [0, 2]),  # too narrow for others
    ],
)
def test_every_way_that_an_item_fits_is_as_likely_to_begin_with(room: Room, ways: list[int]) -> None:
    begun = simulator_of(room).begin(np.zeros(2000, dtype=int), np.random.default_rng(0))
    found, counts = np.unique(begun.quarter[:, 0], return_counts=True)
    assert found.tolist() == ways
    assert counts == pytest.approx([2000 / len(ways)] * len(ways), rel=0.15)


def test_a_rotation_that_is_given_is_kept() -> None:
    bed = replace(BED, rotation=30.0)
    brief = replace(rectangular_room(4, 4, bed), furniture=(replace(bed, center=None),), target=None)
    simulator = RoomsSimulator([brief], None, Moves(), Reward())
    state = standing(simulator, 0, batch=1)
    assert simulator.item(state, 0, 0).rotation == 30
    assert not simulator.destinations(state)[3][0, Moves().count : Moves().count + 2].any()


def test_in_a_turned_room_items_face_along_its_walls() -> None:
    corners = np.array([(0, 0), (4, 0), (4, 3), (0, 3)]) @ np.array([(0.8, 0.6), (-0.6, 0.8)])
    room = replace(rectangular_room(4, 3, BED), outline=tuple(map(tuple, corners.tolist())), walls=())
    simulator = RoomsSimulator([brief_of(room)], None, Moves(), Reward())
    np.testing.assert_allclose(simulator.degrees[0, 0], facings(room))
    assert simulator.degrees[0, 0, 0] % 90 == pytest.approx(np.rad2deg(np.arctan2(0.6, 0.8)))


def test_until_an_item_is_taken_nothing_moves_and_what_stands_can_be_taken_again() -> None:
    desk = Item("desk", (0.6, 1.2), (3.0, 1.0), 180.0)
    simulator = simulator_of(rectangular_room(4, 3, BED, others=(desk,)), rectangular_room(4, 3, BED))
    takes = simulator.actions - 2
    state = simulator.begin(np.array([0, 1]), np.random.default_rng(0))
    item, center, quarter, legal = simulator.destinations(state)
    np.testing.assert_array_equal(legal[:, takes:], [[True, True], [True, False]])
    assert not legal[:, :takes].any()
    np.testing.assert_array_equal(item[:, takes:], [[0, 1]] * 2)
    np.testing.assert_array_equal(center[:, takes:], state.center)
    np.testing.assert_array_equal(quarter[:, takes:], state.quarter)
    taken = simulator.put(state, item[:, takes], center[:, takes], quarter[:, takes])
    legal = simulator.destinations(taken)[3]
    np.testing.assert_array_equal(legal[:, takes:], [[False, True], [False, False]])
    assert legal[:, :takes].any(1).all()


def test_a_layout_has_what_stands_and_leaves_the_rest() -> None:
    room = design_rooms("bedroom", "test", 0, 1).rooms[0]
    simulator = simulator_of(room)
    state = simulator.begin(np.array([0]), np.random.default_rng(0))
    assert simulator.layout(state, 0) == brief_of(room)
    put = simulator.put(state, np.array([1]), state.center[:, 1], state.quarter[:, 1])
    layout = simulator.layout(put, 0)
    assert [item.center is not None for item in layout.furniture] == [k == 1 for k in range(len(room.furniture))]


def test_an_item_that_fits_in_no_way_is_refused() -> None:
    brief = brief_of(rectangular_room(2, 2, Item("bed", (9.0, 9.0), (1.0, 1.0))))
    with pytest.raises(InputError, match="room: the bed does not fit into it"):
        RoomsSimulator([brief], None, Moves(), Reward())


def test_rooms_with_nothing_to_place_are_refused_but_beside_others() -> None:
    empty = replace(rectangular_room(4, 3, BED), furniture=(), target=None)
    with pytest.raises(InputError, match="rooms: expected furniture to place; there is none"):
        RoomsSimulator([empty], None, Moves(), Reward())
    simulator = RoomsSimulator([empty, brief_of(rectangular_room(4, 3, BED))], None, Moves(), Reward())
    state = simulator.begin(np.array([0, 1]), np.random.default_rng(0))
    *_, legal = simulator.destinations(state)
    assert legal.sum(1).tolist() == [0, 1]
    assert simulator.reward(state).total.tolist() == [0, 0]


def test_items_of_one_size_that_are_given_other_rotations_lie_otherwise() -> None:
    lengthwise, across = (Item("desk", (0.6, 2.6), None, degrees) for degrees in (0.0, 90.0))
    brief = rectangular_room(4.0, 3.0, lengthwise, others=(across,), target=None)
    simulator = RoomsSimulator([brief], None, Moves(), Reward())
    bounds = simulator.one_item.item_bounds[simulator.room_index[0, :, 0]]
    np.testing.assert_allclose(bounds[:, 2:], [(0.3, 1.3), (1.3, 0.3)])


def test_a_bed_faces_its_foot() -> None:
    alike = [faces_alike(BED, degrees) for degrees in (0, 90, 180, 270, 360, -1)]
    assert alike == [True, False, False, False, True, True]
