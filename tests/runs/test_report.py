"""What is reported of an agent is what the exact simulator says of the places where its rollouts end."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from layoutrl.agents.dqn import DQN
from layoutrl.agents.networks import GeometryNetwork
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import GeometryObservation
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import symmetries
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.policy import GreedyPolicy
from layoutrl.evaluation.probe import ItemProbe
from layoutrl.evaluation.rollout import MeanQ
from layoutrl.rooms.room import Item
from layoutrl.runs.report import AGENT, evaluate
from tests.builders import l_room, rectangular_room

ROOMS = [
    rectangular_room(2.4, 2.0, Item("bed", (0.6, 0.8), (0.37, 0.43), 30), id="turned"),
    rectangular_room(2.4, 2.0, Item("lamp", (0.8, 0.8), (1.9, 0.5), form="circle"), id="round"),
    l_room(id="l"),
]
EXACT = Simulator(ROOMS, Moves((0.4, 0.1)), Reward())
OBSERVE = GeometryObservation(ROOMS, ["bed", "lamp"])


@pytest.fixture
def agent() -> DQN:
    with torch.random.fork_rng():
        torch.manual_seed(2)
        network = GeometryNetwork(OBSERVE.space.shape[1], EXACT.moves.count, element_width=8, width=16)
    return DQN(network, 1e-3, 10, 10, double=True)


def greedy(agent: DQN) -> GreedyPolicy:
    return GreedyPolicy(MeanQ(agent.network, symmetries(EXACT.moves)), 20, "mask")


def test_an_evaluation_scores_the_stopping_places_exactly(agent):
    seed = np.random.SeedSequence(5)
    result = evaluate(greedy(agent), EXACT, OBSERVE, ROOMS, starts_a_room=10, seed=seed)
    room = np.repeat(np.arange(3), 10)
    assert [position["room"] for position in result["positions"]] == [ROOMS[k].id for k in room]
    iou = EXACT.reward(room, np.array([position["center"] for position in result["positions"]])).iou
    np.testing.assert_array_equal([position["iou"] for position in result["positions"]], iou)
    assert result["rows"][AGENT]["mean_iou"] == iou.mean()


def test_a_probe_scores_one_rollout_in_every_room_exactly(agent):
    probe = ItemProbe(EXACT, OBSERVE, np.random.default_rng(3), torch.device("cpu"))
    room = np.arange(3)
    starts = EXACT.starts(room, np.random.default_rng(3))
    final = greedy(agent).rollout(BatchSimulator(EXACT), OBSERVE, room, starts).final
    found, pictures = probe(greedy(agent))
    assert found == {"iou": EXACT.reward(room, final).iou.mean(), "lattice_ceiling": probe.ceiling}
    assert probe.ceiling == lattice_ceiling(EXACT, room, starts).mean()
    assert len(pictures) == 3
