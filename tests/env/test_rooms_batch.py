"""The batched simulator of whole rooms. The reference is the oracle, at random states of random rooms."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.simulator import Moves
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Room
from tests.builders import random_brief, random_room

seeds = st.integers(0, 2**32 - 1)
DISC = 0.03  # of a reward: the reference has polygons of 256 corners for discs


def as_tensors(state: State[np.ndarray]) -> State[torch.Tensor]:
    return State(*map(torch.tensor, state))


def assert_plays_as_the_reference(simulator: RoomsSimulator, seed: int, batch: int, steps: int) -> None:
    """At every step of random play both allow the same, lead to the same places and pay the same."""
    rng = np.random.default_rng(seed)
    tensors = BatchRoomsSimulator(simulator, dtype=torch.float64)
    state = simulator.begin(rng.integers(len(simulator.rooms), size=batch), rng)
    every = np.arange(batch)
    discs = any(item.form == "circle" for room in simulator.rooms for item in room.furniture)
    for _ in range(steps):
        here = as_tensors(state)
        item, center, quarter, legal = simulator.destinations(state)
        length, allowed = tensors.reach(here)
        np.testing.assert_array_equal(allowed.numpy(), legal)
        for one, other in zip(tensors.reward(here), simulator.reward(state), strict=True):
            np.testing.assert_allclose(one.numpy(), other, rtol=0, atol=DISC if discs else 1e-9)
        action = (rng.random(legal.shape) * legal).argmax(1)
        chosen = torch.tensor(action)
        moved = tensors.moved(here, chosen, length.gather(1, chosen[:, None])[:, 0])
        state = simulator.put(state, item[every, action], center[every, action], quarter[every, action])
        for one, other in zip(moved, state, strict=True):
            np.testing.assert_allclose(one.numpy(), other, rtol=0, atol=1.001e-6)


@given(seeds)
def test_it_plays_as_the_reference_in_random_rooms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    designs: list[Room] = [random_room(rng) for _ in range(3)]
    simulator = RoomsSimulator([random_brief(rng, room) for room in designs], designs, Moves(), Reward(theta4=-100.0))
    assert_plays_as_the_reference(simulator, seed, batch=4, steps=8)


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_it_plays_as_the_reference_in_designed_rooms(room_type: str) -> None:
    rooms = design_rooms(room_type, "train", 0, 4).rooms
    simulator = RoomsSimulator([brief_of(room) for room in rooms], rooms, Moves(), Reward(theta4=-50.0))
    assert_plays_as_the_reference(simulator, 0, batch=16, steps=25)


def test_items_start_where_and_as_they_fit_and_as_the_generator_says() -> None:
    rooms = design_rooms("bedroom", "train", 0, 4).rooms
    simulator = RoomsSimulator([brief_of(room) for room in rooms], rooms, Moves(), Reward())
    tensors = BatchRoomsSimulator(simulator)
    room = torch.arange(200) % 4

    def begun(seed: int) -> State[torch.Tensor]:
        return tensors.begin(room, torch.Generator().manual_seed(seed))

    state = begun(0)
    assert not state.stands.any()
    for n in range(simulator.room_index.shape[1]):
        there = n < simulator.count[room]
        room_index = simulator.room_index[room, n, state.quarter[:, n]][there]
        assert simulator.one_item.is_legal(room_index, state.center[:, n].numpy()[there]).all()
    assert len(state.quarter[:, 0].unique()) == 4
    assert all(torch.equal(one, other) for one, other in zip(begun(0), state, strict=True))
    assert not torch.equal(begun(1).center, state.center)
