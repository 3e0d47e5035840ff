"""What entry points share: objects built from the configuration, errors answered, memory kept."""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import Literal, ParamSpec, TypeVar

import numpy as np
import torch
from omegaconf.errors import OmegaConfBaseException
from torch import nn

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.networks import GeometryNetwork, PaperNetwork, weights_of
from layoutrl.agents.replay import Replay
from layoutrl.agents.training import Training
from layoutrl.config import DataConfig, MethodConfig, RewardConfig, RoomConfig, RunConfig, TrainConfig
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import COLUMNS, GeometryObservation, ImageObservation, categories_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import Symmetry, symmetries
from layoutrl.errors import InputError
from layoutrl.evaluation.probe import Probe
from layoutrl.evaluation.protocols import Greedy
from layoutrl.resume import digest
from layoutrl.rooms.collection import Collection, choose_item, split
from layoutrl.rooms.designer.generator import Part
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources import designer_cache, read_files
from layoutrl.runs import load_checkpoint, load_config, located

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
P = ParamSpec("P")
R = TypeVar("R")


def answers_errors(entry_point: Callable[P, R]) -> Callable[P, R]:
    """Answer what the user can mend in one line, without a traceback."""

    @wraps(entry_point)
    def answering(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return entry_point(*args, **kwargs)
        except (InputError, OmegaConfBaseException) as error:
            sys.exit(f"error: {error}")
        except OSError as error:  # a full disk, no permission
            sys.exit(f"error: {error.filename or 'a file'}: {error.strerror}; expected to be able to read or write it")
        except KeyboardInterrupt:
            sys.exit("interrupted")

    return answering


def rooms(room: RoomConfig, data: DataConfig, fold: int) -> tuple[list[Room], list[Room]]:
    """(training, held-out) rooms with their target chosen; prints what was read, kept and left out, and why.

    Designed rooms of the two parts come from different seeds; all others are split by the hash of their group.
    """
    assert data.source is not None
    if data.source == "designer":
        return designed_rooms(room, data, "train"), designed_rooms(room, data, "test")
    root = None if data.root is None else Path(data.root).expanduser()
    return split(_with_item(read_files(data.source, room.type, root, data.labels, data.strict), room), fold)


def two_parts(room: RoomConfig, data: DataConfig, fold: int) -> tuple[list[Room], list[Room]]:
    """(training, held-out) rooms as `rooms` has them. Raises InputError where either part is empty."""
    training, held_out = rooms(room, data, fold)
    if not training or not held_out:
        raise InputError(
            f"fold: {len(training)} rooms to train on and {len(held_out)} held out; expected some of both "
            "(more rooms, or another fold)"
        )
    return training, held_out


def designed_rooms(room: RoomConfig, data: DataConfig, part: Part) -> list[Room]:
    """One part of the designer's rooms with their target chosen; prints how each template fared."""
    cache = None if data.root is None else Path(data.root).expanduser()
    count = {"train": data.train_rooms, "test": data.test_rooms}[part]
    if count is None or data.seed is None:
        raise InputError(f"data: the designer expects data.{part}_rooms and data.seed as numbers; got null")
    designs = designer_cache.read(cache, room.type, part, data.seed, count)
    print(f"designer, {part} rooms of seed {data.seed}\n{designs}")
    return _with_item(Collection(f"designer, {part}", designs.rooms, inside=True), room)


def _with_item(collection: Collection, room: RoomConfig) -> list[Room]:
    chosen = choose_item(collection, room.item)
    print(chosen)
    if not chosen.rooms:
        held = sorted({item.category for r in collection.rooms for item in r.furniture})
        raise InputError(
            f"room.item: no {room.type} of {collection.source} can be used with item {room.item}; "
            f"expected main, all or one of {', '.join(held)}"
        )
    return chosen.rooms


def moves(method: MethodConfig) -> Moves:
    return Moves(tuple(method.steps), method.unit, method.slide)


def reward_of(reward: RewardConfig) -> Reward:
    return Reward(reward.theta1, reward.theta2, reward.theta3, reward.inside)


def simulator(rooms: Sequence[Room], method: MethodConfig, reward: RewardConfig) -> Simulator:
    return Simulator(rooms, moves(method), reward_of(reward))


def observation(
    rooms: Sequence[Room], method: MethodConfig, categories: Sequence[str], device: torch.device
) -> Observe:
    if method.observation == "image":
        return ImageObservation(rooms, device)
    return GeometryObservation(rooms, categories, device)


def agent(
    method: MethodConfig, categories: Sequence[str], updates: int, seed: np.random.SeedSequence, device: torch.device
) -> DQN:
    """An untrained agent; its weights hang on the seed alone."""
    actions = moves(method).count
    with weights_of(seed):
        network: nn.Module = (
            PaperNetwork(actions, method.dueling)
            if method.observation == "image"
            else GeometryNetwork(len(COLUMNS) + len(categories), actions, dueling=method.dueling)
        )
    return DQN(network.to(device), method.learning_rate, updates, method.target_period, method.double)


def views(method: MethodConfig, device: torch.device) -> list[Symmetry]:
    """The symmetries that the method learns from, and averages over."""
    return symmetries(moves(method), device)[: 8 if method.symmetries else 1]


def greedy(agent: DQN, method: MethodConfig) -> Greedy:
    """The agent's policy, as the method tests it."""
    device = next(agent.network.parameters()).device
    return Greedy(agent, method.evaluation_moves, method.on_illegal, views(method, device))


def trained_agent(
    folder: Path, method: MethodConfig, device: torch.device, which: Literal["last", "best"] = "last"
) -> tuple[DQN, list[str]]:
    """The agent of a run's folder, and the furniture categories that it knows."""
    checkpoint = load_checkpoint(folder, device, which)
    trained = agent(method, checkpoint["categories"], 1, np.random.SeedSequence(0), device)
    trained.network.load_state_dict(checkpoint["training"]["agent"]["network"])
    return trained, checkpoint["categories"]


@dataclass(frozen=True)
class TrainedRun:
    """The agent of a run, and the rooms that it is seen in."""

    policy: Greedy
    simulator: Simulator
    observe: Observe
    training: list[Room]  # what it was trained on
    data: DataConfig
    part: str  # of the rooms of `data`: held_out, training or all
    checkpoint: str  # last or best

    @property
    def name(self) -> str:
        """Of files: the rooms, with a hash of them, and the policy."""
        which = {
            "designer": f"-rooms{self.data.seed}",
            "floorplans": f"-{self.data.labels}",
            "json": f"-{Path(self.data.root or '').stem}",
        }
        rooms = f"{self.data.source}{which.get(self.data.source or '', '')}-{self.part}"
        best = "-best" if self.checkpoint == "best" else ""
        return f"{rooms}-{digest(self.simulator.rooms)[:6]}-{self.policy.on_illegal}{best}"


def trained_run(config: RunConfig) -> TrainedRun:
    """What a run left behind, and the rooms that were asked for; says how many these are.

    Of rooms that are not the run's own, those that it was trained on are left out. Raises InputError where none
    is left.
    """
    folder = Path(config.run)
    trained = load_config(folder, TrainConfig)
    own, data = trained.data, located(config.data)
    chosen_device = device(config.device)
    agent, categories = trained_agent(folder, trained.method, chosen_device, config.checkpoint)

    if data.source is None:  # the run's own, but for what is given
        given = {name: getattr(data, name) for name in ("root", "labels", "train_rooms", "test_rooms", "seed")}
        data = replace(own, **{name: value for name, value in given.items() if value is not None})
    designed = data.source == own.source == "designer"  # wherever their cache lies
    same = data.seed == own.seed if designed else (data.source, data.root) == (own.source, own.root)
    if designed and same:
        data = replace(data, train_rooms=own.train_rooms)  # the agent was trained on no more of them
    parts = rooms(trained.room, own, trained.fold)
    training = parts[0]
    if data != own:
        parts = rooms(trained.room, data, trained.fold)
    part = config.part or ("held_out" if same or data.source == "designer" else "all")
    chosen = {"training": parts[0], "held_out": parts[1], "all": parts[0] + parts[1]}[part]
    if not same:
        trained_on = {room.group for room in training}
        unseen = [room for room in chosen if room.group not in trained_on]
        if len(unseen) < len(chosen):
            print(f"left out {len(chosen) - len(unseen)} rooms that the agent was trained on")
        chosen = unseen
    if not chosen:
        raise InputError(f"part: {data.source} has no {part} rooms to score; expected another part, or more rooms")
    print(f"{len(chosen)} rooms of {data.source} ({part})")
    method = replace(trained.method, on_illegal=config.on_illegal or trained.method.on_illegal)
    return TrainedRun(
        greedy(agent, method),
        simulator(chosen, method, trained.reward),
        observation(chosen, method, categories, chosen_device),
        training,
        data,
        part,
        config.checkpoint,
    )


class Learner:
    """An untrained agent and all that it learns from.

    Raises InputError where no item can move.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        method: MethodConfig,
        reward: RewardConfig,
        updates: int,
        network_seed: np.random.SeedSequence,
        training_seed: np.random.SeedSequence,
        device: torch.device,
    ):
        self.categories = categories_of(rooms)
        self.method = method
        self.updates = updates
        self.simulator = BatchSimulator(simulator(rooms, method, reward), device)
        self.observe = observation(rooms, method, self.categories, device)
        self.agent = agent(method, self.categories, updates, network_seed, device)
        self.policy = greedy(self.agent, method)
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
            symmetries=views(method, self.simulator.device),
            seed=self._seed,
        )


def probe(
    rooms: Sequence[Room],
    method: MethodConfig,
    reward: RewardConfig,
    categories: Sequence[str],
    rng: np.random.Generator,
    device: torch.device,
) -> Probe:
    """One start in each of the rooms, with the method's moves."""
    return Probe(
        simulator(rooms, method, reward),
        observation(rooms, method, categories, device),
        rng,
        device,
    )


def device(name: str) -> torch.device:
    """`auto` is the GPU where there is one."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        chosen = torch.device(name)
        torch.zeros(1, device=chosen).item()  # which a device without memory refuses
    except (RuntimeError, AssertionError) as error:
        raise InputError(
            f"device: expected auto, cpu or a GPU of this machine; got {name} ({str(error).splitlines()[0]})"
        ) from None
    return chosen


def refuse_chance(device: torch.device) -> None:
    """Let torch raise where an operation would not give the same every time. On a GPU that would cost speed."""
    torch.use_deterministic_algorithms(device.type == "cpu")
    # What finds errors, and takes time. (torch's types do not know it.)
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]


def keep_freed_memory() -> None:
    """Let glibc keep what is freed for what comes next; elsewhere nothing changes.

    An update asks for tens of megabytes and frees them. To give them back to the system each time, and get them again
    page by page, costs the paper's network a fifth of its speed.
    """
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL(None)
        # Old versions refuse the first; without it, the second would make large tensors slower.
        if libc.mallopt(M_MMAP_THRESHOLD, 2**30):
            libc.mallopt(M_TRIM_THRESHOLD, 2**31 - 1)
