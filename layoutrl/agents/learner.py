"""An agent and all that it learns from, made as a method says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from layoutrl import InputError
from layoutrl.agents.dqn import DQN
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.method import Method
from layoutrl.agents.networks import GeometryNetwork, PaperNetwork, weights_of
from layoutrl.agents.replay import Replay
from layoutrl.agents.training import Training
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import COLUMNS, categories_of, observation_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Simulator
from layoutrl.rooms.room import Room


def untrained(
    method: Method, categories: Sequence[str], updates: int, seed: np.random.SeedSequence, device: torch.device
) -> DQN:
    """An agent that knows these furniture categories. Its weights hang on the seed alone."""
    actions = method.moves.count
    with weights_of(seed):
        network: nn.Module = (
            PaperNetwork(actions, method.dueling)
            if method.observation == "image"
            else GeometryNetwork(len(COLUMNS) + len(categories), actions, dueling=method.dueling)
        )
    return DQN(network.to(device), method.learning_rate, updates, method.target_period, method.double)


class Learner:
    """An untrained agent and all that it learns from.

    Raises InputError where no item can move.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        method: Method,
        reward: Reward,
        updates: int,
        network_seed: np.random.SeedSequence,
        training_seed: np.random.SeedSequence,
        device: torch.device,
    ):
        self.categories = categories_of(rooms)
        self.method = method
        self.updates = updates
        self.simulator = BatchSimulator(Simulator(rooms, method.moves, reward), device)
        self.observe = observation_of(method.observation, rooms, device, self.categories)
        self.agent = untrained(method, self.categories, updates, network_seed, device)
        self.replay = Replay(method.replay_capacity, self.simulator.moves.count, device)
        self._seed = training_seed
        designed = torch.tensor(np.array([room.moving.center for room in rooms]), device=device)
        if not self.simulator.reach(torch.arange(len(rooms), device=device), designed)[1].any():
            raise InputError("steps: no item can move in any of the rooms; expected shorter steps or larger rooms")

    def training(self, report_every: int) -> Training:
        """The training loop, as the method has it."""
        method = self.method
        return Training(
            self.agent,
            self.simulator,
            self.observe,
            self.replay,
            LinearSchedule(method.epsilon_start, method.epsilon_end, int(method.epsilon_share * self.updates)),
            updates=self.updates,
            batch=method.batch,
            episodes=method.episodes,
            max_moves=method.max_moves,
            discount=method.discount,
            goal_iou=method.goal_iou if method.goal_terminates else None,
            warmup_moves=method.warmup_moves,
            report_every=report_every,
            symmetries=method.views(self.simulator.device),
            seed=self._seed,
        )
