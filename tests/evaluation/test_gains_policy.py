"""Greedy rollouts of what moves gain: exact gains lead to the best place, and say how much better it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.reward import REWARD_SCALE, Reward
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.gains_policy import GainsPolicy
from layoutrl.evaluation.rollout import MeanQ
from tests.builders import perfect_at_gains
from tests.evaluation.builders import STEPS, Place, unturned, wide_room


def test_what_moves_gain_adds_up_to_how_much_better_a_place_is_than_the_start():
    simulator, discount = Simulator([wide_room()], STEPS, Reward()), 0.6
    batch_simulator = BatchSimulator(simulator, dtype=torch.float64)
    starts = np.array([(0.5, 0.5), (3.5, 2.5), (0.5, 2.5)])
    perfect = perfect_at_gains(simulator, discount)
    policy = GainsPolicy(MeanQ(perfect, unturned(STEPS)), 12, discount)
    run = policy.rollout(batch_simulator, Place(), np.zeros(3, int), starts)
    earned = simulator.reward(np.zeros(39, int), run.path.reshape(-1, 2)).total.reshape(13, 3) / REWARD_SCALE
    np.testing.assert_allclose(run.value - run.value[0], earned - earned[0], atol=1e-4)
    assert run.final.tolist() == [[2.5, 1.5]] * 3
    once = replace(policy, max_moves=1).rollout(batch_simulator, Place(), np.zeros(1, int), np.array([(2.0, 1.5)]))
    assert once.final.tolist() == [[2.5, 1.5]]


def test_it_looks_no_further_once_moves_in_a_row_have_gained_nothing(monkeypatch):
    simulator = Simulator([wide_room()], STEPS, Reward())
    starts = np.array([(1.5, 1.0), (2.5, 1.5)])
    policy = GainsPolicy(MeanQ(perfect_at_gains(simulator, 0.6), unturned(STEPS)), 12, 0.6)
    patient = policy.rollout(BatchSimulator(simulator, dtype=torch.float64), Place(), np.zeros(2, int), starts)
    monkeypatch.setattr("layoutrl.evaluation.gains_policy.FRUITLESS", 3)
    run = policy.rollout(BatchSimulator(simulator, dtype=torch.float64), Place(), np.zeros(2, int), starts)
    assert run.best.tolist() == patient.best.tolist() == [3, 0]
    for b, looked in enumerate(run.best + 3):
        np.testing.assert_array_equal(run.path[: looked + 1, b], patient.path[: looked + 1, b])
        assert (run.path[looked:, b] == run.path[looked, b]).all()
        assert np.isneginf(run.value[looked + 1 :, b]).all()
