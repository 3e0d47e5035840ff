"""A design is as good mirrored and turned: what is learned there must look and move as the turned room does."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.env.observation import GeometryObservation, ImageObservation
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import Symmetry, symmetries
from layoutrl.rooms.brief import categories_of
from tests.builders import random_room

EIGHT = [(quarters, mirror) for mirror in (False, True) for quarters in range(4)]


def test_there_are_eight_and_the_first_changes_nothing() -> None:
    eight = symmetries(Moves())
    assert [(symmetry.quarters, symmetry.mirror) for symmetry in eight] == EIGHT
    assert eight[0].action.tolist() == list(range(20))
    assert len({tuple(symmetry.action.tolist()) for symmetry in eight}) == 8
    for symmetry in eight:
        assert symmetry.action[symmetry.inverse].tolist() == list(range(20))


@pytest.mark.parametrize(("quarters", "mirror"), EIGHT)
@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**32 - 1))
def test_looks_moves_and_rewards_are_those_of_the_turned_room(quarters: int, mirror: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    moves = Moves((0.4, 0.1))
    symmetry = Symmetry(quarters, mirror, moves)
    before = Simulator([room], moves, Reward())
    after = Simulator([room.turned(quarters, mirror)], moves, Reward())
    index = np.zeros(4, dtype=int)
    position = before.starts(index, rng)
    turned = position @ symmetry.matrix.numpy().astype(float).T

    reached, legal = before.destinations(index, position)
    steps = slice(4 * len(moves.steps))  # a slide can end at either of two contacts that lie a rounding apart
    there, legal_there = (a[:, symmetry.action.numpy()] for a in after.destinations(index, turned))
    np.testing.assert_array_equal(legal[:, steps], legal_there[:, steps])
    np.testing.assert_allclose(
        (reached @ symmetry.matrix.numpy().astype(float).T)[:, steps], there[:, steps], atol=2e-6
    )
    np.testing.assert_array_equal(legal, legal_there)
    np.testing.assert_allclose(before.reward(index, position).total, after.reward(index, turned).total, atol=1e-4)

    categories = categories_of([room])
    for kind in (lambda r: GeometryObservation([r], categories), lambda r: ImageObservation([r])):
        observe, observe_turned = kind(room), kind(after.rooms[0])
        looks = [torch.as_tensor(p) for p in (position, turned)]
        seen = observe.turned(observe(torch.as_tensor(index), looks[0]), symmetry)
        expected = observe_turned(torch.as_tensor(index), looks[1])
        assert (seen.float() - expected.float()).abs().max() <= (1 if seen.dtype == torch.uint8 else 1e-5)
