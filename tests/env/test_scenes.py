"""Scenes: the states of whole rooms as rows of integers, moved in and seen as the item is turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.env.observation import COLUMNS
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import STANDS, RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.scenes import Scenes, ScenesObservation
from layoutrl.env.simulator import DIRECTIONS, Moves
from layoutrl.env.symmetry import mirrored, symmetries
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Item, Room
from tests.builders import random_brief, random_room

seeds = st.integers(0, 2**32 - 1)
MOVES = Moves((0.32, 0.02))


def scenes_of(rooms: list[Room], designs: list[Room]) -> tuple[RoomsSimulator, Scenes]:
    simulator = RoomsSimulator(rooms, designs, MOVES, Reward())
    return simulator, Scenes(BatchRoomsSimulator(simulator, dtype=torch.float64))


def random_state(simulator: RoomsSimulator, seed: int, batch: int) -> State[torch.Tensor]:
    """Some items stand, one of them, or another, moves."""
    rng = np.random.default_rng(seed)
    state = simulator.begin(rng.choice(np.flatnonzero(simulator.count), batch), rng)
    there = np.arange(state.stands.shape[1]) < simulator.count[state.room][:, None]
    moving = (rng.random(batch) * simulator.count[state.room]).astype(int)
    stands = there & (rng.random(there.shape) < 0.6)
    stands[np.arange(batch), moving] = True
    return State(*map(torch.as_tensor, state._replace(stands=stands, moving=moving)))


def position_of(state: State[torch.Tensor]) -> torch.Tensor:
    return state.center[torch.arange(len(state.room)), state.moving]


@given(seeds)
def test_a_scene_and_a_position_are_a_state(seed: int) -> None:
    rng = np.random.default_rng(seed)
    designs = [random_room(rng) for _ in range(3)]
    simulator, scenes = scenes_of([random_brief(rng, room) for room in designs], designs)
    if not simulator.count.any():
        return
    state = random_state(simulator, seed, 6)
    again = scenes.state(scenes.of(state), position_of(state))
    for name in ("room", "moving", "stands"):
        assert torch.equal(getattr(again, name), getattr(state, name)), name
    stands = state.stands
    assert torch.equal(again.quarter[stands], state.quarter[stands])
    torch.testing.assert_close(again.center[stands], state.center[stands], rtol=0, atol=1e-9)


@given(seeds)
def test_actions_are_those_of_the_room_turned_with_the_item_and_are_paid_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    designs = [random_room(rng) for _ in range(3)]
    simulator, scenes = scenes_of([random_brief(rng, room) for room in designs], designs)
    state = random_state(simulator, seed, 6)
    scene, position = scenes.of(state), position_of(state)
    _, reached, _, legal = simulator.destinations(State(*(values.numpy() for values in state)))
    length, allowed = scenes.reach(scene, position)
    for b, (room, item) in enumerate(zip(state.room.tolist(), state.moving.tolist(), strict=True)):
        quarter = round(simulator.degrees[room, item, state.quarter[b, item]] / 90) % 4
        for a in range(MOVES.count):
            x, y = DIRECTIONS[a % 4]
            turned = ((x, y), (-y, x), (-x, -y), (y, -x))[quarter]
            (world,) = np.flatnonzero((turned == DIRECTIONS).all(1)) + a // 4 * 4
            assert allowed[b, a] == legal[b, world]
            if legal[b, world]:
                there = scenes.moved(scene[[b]], position[[b]], torch.tensor([a]), length[b, [a]])
                np.testing.assert_allclose(there[0], reached[b, world], rtol=0, atol=1.001e-6)
    for one, other in zip(scenes.reward(scene, position), scenes.simulator.reward(state), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-9)


@pytest.mark.parametrize("lean", [44.9, 45.0, 45.1])
def test_each_way_to_face_is_another_quarter_however_the_room_leans(lean: float) -> None:
    room = design_rooms("bedroom", "train", 0, 1).rooms[0].rotated(lean)
    _, scenes = scenes_of([brief_of(room)], [room])
    assert sorted(scenes.simulator.turns[0, 0].tolist()) == [0, 1, 2, 3]


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_a_room_that_is_turned_or_mirrored_looks_the_same_to_an_item_that_is_turned_with_it(room_type: str) -> None:
    """Where it is mirrored, left and right of the item change places, as one of the two views has it."""
    rooms = design_rooms(room_type, "train", 0, 4).rooms
    simulator, scenes = scenes_of([brief_of(room) for room in rooms], rooms)
    state = random_state(simulator, 1, 24)
    observe = ScenesObservation(scenes, RoomsObservation(simulator))
    plain = observe(scenes.of(state), position_of(state))
    as_it_is, swapped = mirrored(MOVES)
    for view in symmetries(MOVES):
        turned = [room.turned(view.quarters, view.mirror) for room in rooms]
        there, others = scenes_of([brief_of(room) for room in turned], turned)
        quarter = torch.where(torch.tensor(view.mirror), 2 - state.quarter, state.quarter) + view.quarters
        ways = torch.tensor(there.ways)[state.room]
        same = state._replace(center=state.center @ view.matrix.T.double(), quarter=quarter % ways)
        seen = ScenesObservation(others, RoomsObservation(there))(others.of(same), position_of(same))
        # What has no front lies the same way after half a turn: seen from its other side.
        fronted = torch.tensor(there.ways == 4)[state.room, state.moving]
        assert fronted.any()
        expected = observe.turned(plain, swapped if view.mirror else as_it_is)
        ours, theirs = sorted_elements(seen[fronted]), sorted_elements(expected[fronted])
        torch.testing.assert_close(ours, theirs, atol=1e-5, rtol=0)


def sorted_elements(elements: torch.Tensor) -> torch.Tensor:
    """In an order of their own, places relative to the moving item: only these are looked at."""
    relative = elements.clone()
    relative[..., :2] -= elements[:, :1, :2]
    relative[..., :2] *= elements[..., 2:3]
    rows = [sorted((np.round(row, 3) + 0.0).tolist()) for row in relative.numpy()]
    return torch.tensor(rows)


def test_what_waits_is_nowhere_and_known_by_its_size() -> None:
    rooms = design_rooms("bedroom", "train", 0, 4).rooms
    simulator, scenes = scenes_of([brief_of(room) for room in rooms], rooms)
    state = random_state(simulator, 3, 12)
    elsewhere = state._replace(center=torch.where(state.stands[..., None], state.center, state.center + 0.5))
    observe = ScenesObservation(scenes, RoomsObservation(simulator))
    seen = observe(scenes.of(state), position_of(state))
    assert torch.equal(seen, observe(scenes.of(elsewhere), position_of(state)))
    waits = (seen[..., STANDS] == 0) & (seen[..., COLUMNS.index("present")] == 1)
    assert waits.any()
    assert (seen[waits][:, COLUMNS.index("item")] == 0).all()
    assert (seen[waits][:, COLUMNS.index("extent_x")] > 0).all()


def test_scenes_that_differ_only_in_the_designers_places_look_the_same() -> None:
    rooms = design_rooms("bathroom", "train", 0, 3).rooms
    moved = [
        replace(room, furniture=tuple(replace(item, center=(1.0, 1.0), rotation=90.0) for item in room.furniture))
        for room in rooms
    ]
    seen = []
    for designs in (rooms, moved):
        simulator, scenes = scenes_of([brief_of(room) for room in rooms], designs)
        state = random_state(simulator, 1, 8)
        seen.append(ScenesObservation(scenes, RoomsObservation(simulator))(scenes.of(state), position_of(state)))
    assert torch.equal(*seen)


def test_an_item_whose_rotation_is_given_looks_as_one_that_was_turned_so() -> None:
    rooms = design_rooms("bedroom", "train", 0, 4).rooms
    seen = []
    for briefs in (
        [brief_of(room) for room in rooms],
        [replace(room, target=None, furniture=tuple(replace(i, center=None) for i in _sorted(room))) for room in rooms],
    ):
        simulator, scenes = scenes_of(briefs, rooms)
        center, quarter = map(torch.tensor, simulator.designed())
        state = random_state(simulator, 2, 12)
        stands = torch.zeros_like(state.stands).scatter(1, state.moving[:, None], True)
        state = state._replace(center=center[state.room], quarter=quarter[state.room], stands=stands)
        elements = ScenesObservation(scenes, RoomsObservation(simulator))(scenes.of(state), position_of(state))
        seen.append(elements[elements[..., STANDS] == 1])
    torch.testing.assert_close(*seen, atol=1e-5, rtol=0)


def _sorted(room: Room) -> list[Item]:
    """Its items in the order of its brief."""
    return sorted(room.furniture, key=lambda item: (item.category, item.size, item.form, item.tucked))
