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
from layoutrl.env.scenes import ItemSimulator, Scenes, ScenesObservation
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

    simulator: ItemSimulator

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
        make = _of_whole_rooms if method.scope == "room" else _of_one_item
        self.simulator, self.observe, self._begin = make(rooms, method, reward, self.categories, device)
        scene = (self.simulator.columns,) if isinstance(self.simulator, Scenes) else ()
        self.replay = Replay(method.replay_capacity, method.moves.count, device, scene)

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


def _of_whole_rooms(
    designs: Sequence[Room], method: Method, reward: Reward, categories: Sequence[str], device: torch.device
) -> tuple[Scenes, Observe, Begin]:
    """Return what furnishes the briefs of designs, what is seen there, and what makes the episodes."""
    designs = [upright(room)[0] for room in designs]  # rooms are furnished upright, too
    rooms = RoomsSimulator([brief_of(room) for room in designs], designs, method.moves, reward)
    scenes = Scenes(BatchRoomsSimulator(rooms, device))
    check_can_move(scenes.simulator.one_item)

    def begin(generator: torch.Generator) -> Episodes:
        near, own = method.near_share, method.own_share
        return SceneEpisodes(scenes, rooms, _ages(method), method.max_moves, generator, near=near, own=own)

    return scenes, ScenesObservation(scenes, RoomsObservation(rooms, categories, device)), begin


def _of_one_item(
    rooms: Sequence[Room], method: Method, reward: Reward, categories: Sequence[str], device: torch.device
) -> tuple[BatchSimulator, Observe, Begin]:
    """Return what moves the targets of rooms, what is seen there, and what makes the episodes."""
    exact = Simulator(rooms, method.moves, reward)
    simulator = BatchSimulator(exact, device)
    check_can_move(simulator)
    designed = torch.as_tensor(exact.designer_position, device=device)
    near = (method.near_share, designed) if method.near_share else None

    def begin(generator: torch.Generator) -> Episodes:
        return Episodes(simulator, _ages(method), method.max_moves, generator, method.goal_iou, near)

    return simulator, observation_of(method.observation, rooms, device, categories), begin


def _ages(method: Method) -> np.ndarray:
    """Return moves that count as made (episodes,): staggered, so that not all episodes end in the same step."""
    return np.arange(method.episodes) * method.max_moves // method.episodes


def check_can_move(simulator: BatchSimulator) -> None:
    """Raise InputError unless a move is legal from any of the starts that are drawn, one or more in each room."""
    generator = torch.Generator(simulator.device).manual_seed(0)  # its own: training does not depend on it
    rooms = len(simulator.rooms)
    starts = torch.tensor(np.resize(np.arange(rooms), max(rooms, STARTS_AT_ONCE)), device=simulator.device)
    blocks = starts.split(STARTS_AT_ONCE)
    if not any(bool(simulator.reach(room, simulator.starts(room, generator))[1].any()) for room in blocks):
        raise InputError("method.steps: no item can move in any room; expected shorter steps or larger rooms")
