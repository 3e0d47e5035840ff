"""Builds an agent, its simulator, replay buffer and training loop as a method configures them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from layoutrl import InputError
from layoutrl.agents.dqn import DQN
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.gains import EveryMove
from layoutrl.agents.method import Method
from layoutrl.agents.networks import GeometryNetwork, PaperNetwork, weights_of
from layoutrl.agents.replay import Replay
from layoutrl.agents.training import Begin, Training
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes
from layoutrl.env.observation import COLUMNS, Observe, observation_of
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import ROOM_COLUMNS, RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator
from layoutrl.env.scene_episodes import SceneEpisodes
from layoutrl.env.scenes import Scenes, ScenesObservation
from layoutrl.env.simulator import Simulator
from layoutrl.rooms.brief import brief_of, categories_of, upright
from layoutrl.rooms.room import Room

STARTS_AT_ONCE = 1024  # starts tried at once: the first block mostly tells whether an item can move


class Agent(NamedTuple):
    """A network, and what has to be known to use it."""

    network: nn.Module
    method: Method
    categories: Sequence[str]  # furniture categories that it knows


def q_network(
    method: Method, categories: Sequence[str], seed: np.random.SeedSequence, device: torch.device
) -> nn.Module:
    """Return an untrained Q-network that knows these furniture categories. Its weights depend on the seed alone."""
    actions = method.moves.count
    columns = len(ROOM_COLUMNS if method.scope == "room" else COLUMNS)
    with weights_of(seed):
        network: nn.Module = (
            PaperNetwork(actions, method.dueling)
            if method.observation == "image"
            else GeometryNetwork(columns + len(categories), actions, dueling=method.dueling)
        )
    return network.to(device)


class Learner:
    """An agent and all that it learns from: rooms whose target moves or, with scope=room, whole designs.

    The agent starts untrained or, if `before` is given, from a copy of that agent's network, which must have the same
    observation (geometry) and moves; categories new to it are added. Raises InputError if an item does not fit into its
    room, and if no item can move in any room.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        method: Method,
        reward: Reward,
        total_updates: int,
        network_seed: np.random.SeedSequence,
        training_seed: np.random.SeedSequence,
        device: torch.device,
        before: Agent | None = None,
    ):
        self.categories = categories_of(rooms)
        self.method = method
        self.total_updates = total_updates
        if before is None:
            network = q_network(method, self.categories, network_seed, device)
        else:
            assert isinstance(before.network, GeometryNetwork)
            new = [category for category in self.categories if category not in before.categories]
            self.categories = [*before.categories, *new]
            network = before.network.knowing(len(new))
        self.dqn = DQN(network, method.learning_rate, total_updates, method.target_period, method.double)
        self._seed = training_seed
        # Staggered, so that not all episodes end in the same step.
        ages, most = np.arange(method.episodes) * method.max_moves // method.episodes, method.max_moves
        if method.scope == "room":
            rooms = [upright(room)[0] for room in rooms]  # rooms are furnished upright, too
            whole = RoomsSimulator([brief_of(room) for room in rooms], rooms, method.moves, reward)
            self.simulator: BatchSimulator | Scenes = (scenes := Scenes(BatchRoomsSimulator(whole, device)))
            self.observe: Observe = ScenesObservation(scenes, RoomsObservation(whole, self.categories, device))
            moves_in = scenes.simulator.one_item
            self.replay = Replay(method.replay_capacity, method.moves.count, device, (scenes.columns,))
            self._begin: Begin = lambda generator: SceneEpisodes(
                scenes, whole, ages, most, generator, near=method.near_share, own=method.own_share
            )
        else:
            exact = Simulator(rooms, method.moves, reward)
            self.simulator = moves_in = simulator = BatchSimulator(exact, device)
            self.observe = observation_of(method.observation, rooms, device, self.categories)
            self.replay = Replay(method.replay_capacity, method.moves.count, device)
            designed = torch.as_tensor(exact.designer_position, device=device)
            near = (method.near_share, designed) if method.near_share else None
            self._begin = lambda generator: Episodes(simulator, ages, most, generator, method.goal_iou, near)
        if not can_move(moves_in):
            raise InputError("method.steps: no item can move in any room; expected shorter steps or larger rooms")

    @property
    def agent(self) -> Agent:
        """The agent as it is now; its network goes on to learn."""
        return Agent(self.dqn.network, self.method, self.categories)

    def training(self, report_every: int) -> Training:
        """Return the training loop, which reports every `report_every` updates. Call it once: it spends the seed."""
        method = self.method
        return Training(
            self.dqn,
            self._begin,
            self.observe,
            self.replay,
            LinearSchedule(method.epsilon_start, method.epsilon_end, int(method.epsilon_share * self.total_updates)),
            total_updates=self.total_updates,
            batch=method.batch,
            discount=method.discount,
            warmup_moves=method.warmup_moves,
            report_every=report_every,
            symmetries=method.views(self.replay.device),
            seed=self._seed,
            every_move=self._every_move() if method.every_move else None,
        )

    def _every_move(self) -> EveryMove:
        assert isinstance(self.simulator, BatchSimulator)
        return EveryMove(self.simulator, self.total_updates, (self.method.discount_start, self.method.discount))


def can_move(simulator: BatchSimulator) -> bool:
    """Return whether a move is legal from any of the starts that are drawn, one or more in each room."""
    generator = torch.Generator(simulator.device).manual_seed(0)  # its own: training does not depend on it
    rooms = len(simulator.rooms)
    starts = torch.tensor(np.resize(np.arange(rooms), max(rooms, STARTS_AT_ONCE)), device=simulator.device)
    return any(
        bool(simulator.reach(room, simulator.starts(room, generator))[1].any()) for room in starts.split(STARTS_AT_ONCE)
    )
