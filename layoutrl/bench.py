"""python -m layoutrl.bench [parts=[speed,memory,growth,training,paper,sb3]] [device=cpu]

Measures on one machine, in one run, what the project promises; prints a table and writes bench.json.
"""

from __future__ import annotations

import contextlib
import io
import multiprocessing
import os
import platform
import re
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from copy import copy
from dataclasses import asdict, astuple, replace
from datetime import datetime
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import hydra
import numpy as np
import shapely
import torch
from gymnasium.wrappers import TransformReward
from matplotlib.figure import Figure
from omegaconf import DictConfig, OmegaConf
from torch import Tensor, nn
from torch.utils.benchmark import Timer

import layoutrl
from layoutrl import build
from layoutrl.agents.dqn import DQN
from layoutrl.agents.exploration import LinearSchedule, explore
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.agents.training import REWARD_SCALE, Progress, _turned, train
from layoutrl.config import BenchConfig, config_directory, register
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes, Step
from layoutrl.env.layout_env import LayoutEnv
from layoutrl.env.observation import categories_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Simulator
from layoutrl.env.symmetry import symmetries
from layoutrl.errors import InputError
from layoutrl.evaluation.report import evaluate
from layoutrl.monitor import Probe
from layoutrl.rooms.room import Item, Room
from layoutrl.runs import write_json

ITEMS = 5  # at least so many in the rooms of `speed`
TRAINING_IOU, SB3_IOU = 0.95, 0.80  # mean IoU on the held-out rooms, to be reached soon
ENDLESS = 10**9  # updates, of a training that the clock stops
REPORT = 5  # updates timed together
ROUNDS = 5  # in turn, of two timings whose ratio counts
POINTS = 20  # of the learning curve of `paper`

Targets = str | dict[str, str]  # on two cores; of a measurement by name, by its names
ROWS: dict[str, dict[str, tuple[str, Targets]]] = {
    "speed": {
        "moves_a_second": (f"exact moves a second, rooms with {ITEMS} items or more", "500,000"),
        "shapely_moves_a_second": ("  by the shapely simulator", ""),
        "times_shapely": ("  ratio", "200"),
        "observations_a_second": (
            "observations a second, geometry or image",
            {"geometric": "500,000", "paper": "20,000"},
        ),
        "learner_samples_a_second": ("learner, samples a second", {"geometric": "20,000", "paper": "1,500"}),
        "bare_samples_a_second": ("  bare passes of the networks", ""),
        "share_of_bare": ("  share", {"geometric": "0.8", "paper": "0.8"}),
        "training_samples_a_second": ("  with acting: the whole loop", ""),
        "setup_seconds": ("set-up for the training rooms, seconds", ""),
        "evaluation_seconds": ("evaluation of the held-out rooms, set-up included, seconds", "10"),
    },
    "memory": {
        "bytes_a_transition": ("bytes a transition", "48"),
        "peak_gigabytes": ("peak memory of training with a full replay, GB", "1.5"),
        "peak_device_gigabytes": ("  on the GPU, GB", ""),
    },
    "growth": {
        "moves_a_second_by_episodes": ("moves a second, by parallel episodes", {"65536": "(GPU: 20,000,000)"}),
        "moves_a_second_by_items": ("moves a second, by items a room", ""),
    },
    "training": {
        "minutes_to_goal": (f"minutes to a mean IoU of {TRAINING_IOU} in the held-out rooms", "3"),
        "setup_minutes": ("  set-up in this", ""),
        "minutes": ("  minutes of all updates, set-up included", ""),
        "iou": ("  mean IoU after them", ""),
    },
    "paper": {
        "iou": ("mean IoU of the paper's network with the method's moves", "0.93"),
        "minutes": ("  minutes of training", ""),
        "updates": ("  updates", ""),
    },
    "sb3": {
        "minutes_to_goal": (f"minutes to a mean IoU of {SB3_IOU} (SB3: no mask, illegal moves are dropped)", ""),
        "times_sb3": ("  ratio (at least, where SB3 did not reach it)", "10"),
        "updates": ("  updates", ""),
        "minutes": ("  minutes of them", ""),
        "iou": ("  mean IoU after them", ""),
    },
}


class Learner:
    """An untrained agent and all that it learns from, built as `layoutrl.train` builds it."""

    def __init__(self, config: BenchConfig, rooms: Sequence[Room], device: torch.device, updates: int):
        method, categories = config.method, categories_of(rooms)
        network_seed, self._fill_seed, self._training_seed = np.random.SeedSequence(config.seed).spawn(3)
        self.method = method
        self.updates = updates
        self.simulator = BatchSimulator(build.simulator(rooms, method, config.reward), device)
        self.observe = build.observation(rooms, method, categories, device)
        self.agent = build.agent(method, categories, updates, network_seed, device)
        self.replay = Replay(method.replay_capacity, self.simulator.moves.count, device)
        self._symmetries = symmetries(self.simulator.moves, device)[: 8 if method.symmetries else 1]
        self._generator = torch.Generator(device).manual_seed(config.seed)

    def train(self, report_every: int) -> Iterator[Progress]:
        method = self.method
        return train(
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
            symmetries=self._symmetries,
            seed=self._training_seed,
        )

    def fill(self) -> None:
        """Fill the replay with random moves: as late in training, samples are spread over much memory."""
        play = random_moves(self.simulator, self.method.batch, self.method.max_moves, self._fill_seed)
        while self.replay.size < self.replay.capacity:
            step = next(play)
            reward = step.terms.total / REWARD_SCALE
            discount = torch.full_like(reward, self.method.discount)
            before, after = (step.room, step.position, step.action), (step.next_position, step.next_legal)
            self.replay.add(Transitions(*before, reward, discount, *after))

    def sample(self, count: int) -> Transitions:
        return self.replay.sample(count, self._generator)

    def seen(self) -> tuple[Transitions, Tensor, Tensor]:
        """What one update learns from."""
        batch = self.sample(self.method.batch)
        observations = self.observe(batch.room, batch.position), self.observe(batch.room, batch.next_position)
        return _turned(self.observe, self._symmetries, batch, *observations)

    def update(self) -> None:
        """One update as in training, without acting."""
        self.agent.update(*self.seen())

    def bare_update(self) -> Callable[[], None]:
        """The forward and backward passes of one update, on observations that are there: no learner is faster."""
        _, observation, next_observation = self.seen()
        agent = self.agent

        def passes() -> None:
            with torch.no_grad():
                agent.target(next_observation)
                if agent.double:
                    agent.network(next_observation)
            agent.network.zero_grad()
            agent.network(observation).sum().backward()

        return passes


class Point(NamedTuple):
    """Of a learning curve."""

    updates: int
    seconds: float  # of training so far; what the probing took is not counted
    iou: float  # mean over the held-out rooms


class Curve:
    """A learning curve; the clock runs from when it is made, but not while it probes."""

    def __init__(self, probe: Probe):
        self._probe = probe
        self.points: list[Point] = []
        self._seconds = 0.0
        self._resumed = time.perf_counter()

    def add(self, updates: int, agent: DQN) -> Point:
        self._seconds += time.perf_counter() - self._resumed
        point = Point(updates, self._seconds, self._probe(agent)[0])
        self.points.append(point)
        print(f"  {updates} updates, {point.seconds / 60:.2f} minutes: mean IoU {point.iou:.3f}", flush=True)
        self._resumed = time.perf_counter()
        return point

    def minutes_to(self, iou: float) -> float | None:
        """None: it was not reached."""
        return next((point.seconds / 60 for point in self.points if point.iou >= iou), None)


def speed(config: BenchConfig, device: torch.device) -> dict[str, Any]:
    """Simulator, observations, learners, set-up and evaluation."""
    rooms, held_out = read_rooms(config)
    began = time.perf_counter()
    learner = Learner(config, rooms, device, ENDLESS)
    result: dict[str, Any] = {"setup_seconds": time.perf_counter() - began}
    result |= simulating(config, rooms, device)
    pictured = Learner(replace(config, method=config.paper), rooms, device, ENDLESS)
    rates = {
        each.method.name: learning(each, poses, config.seconds)
        for each, poses in ((learner, config.batch), (pictured, config.images))
    }
    result |= {name: {method: rates[method][name] for method in rates} for name in rates[config.method.name]}
    result["evaluation_seconds"] = evaluating(config, learner.agent, rooms, held_out, device)
    return result


def simulating(config: BenchConfig, rooms: Sequence[Room], device: torch.device) -> dict[str, float]:
    """Random legal moves by both simulators, in the same rooms."""
    furnished = [room for room in rooms if len(room.furniture) >= ITEMS]
    if not furnished:
        raise InputError(f"parts: speed expects {config.room.type}s with {ITEMS} items or more; there are none")
    simulator = build.simulator(furnished, config.method, config.reward)
    fast = moves_a_second(config, BatchSimulator(simulator, device), config.batch)
    slow = 0.0
    for batch in config.shapely_batches:
        play = random_moves_by_shapely(simulator, batch, np.random.default_rng(config.seed))
        slow = max(slow, batch / seconds_of(partial(next, play), config.seconds))
    return {"moves_a_second": fast, "shapely_moves_a_second": slow, "times_shapely": fast / slow}


def learning(learner: Learner, poses: int, seconds: float) -> dict[str, float]:
    """Observations of poses a second; samples a second of updates, of their bare passes, and of the whole loop."""
    learner.fill()
    batch, sampled = learner.method.batch, learner.sample(poses)
    observations = poses / seconds_of(partial(learner.observe, sampled.room, sampled.position), seconds)
    works = learner.update, learner.bare_update()
    rounds = [[seconds_of(work, seconds / ROUNDS) for work in works] for _ in range(ROUNDS)]
    updates, bare = (batch / statistics.median(column) for column in zip(*rounds, strict=True))
    return {
        "observations_a_second": observations,
        "learner_samples_a_second": updates,
        "bare_samples_a_second": bare,
        "share_of_bare": updates / bare,
        "training_samples_a_second": training_pace(learner, seconds),
    }


def evaluating(
    config: BenchConfig, agent: DQN, training: Sequence[Room], held_out: Sequence[Room], device: torch.device
) -> float:
    """Seconds that a user waits for the scores in held-out rooms: they are new here, so that all set-up is included.

    The agent has hardly learned: its episodes are longer than those of a trained one.
    """
    method = config.method
    began = time.perf_counter()
    evaluate(
        agent,
        build.simulator(held_out, method, config.reward),
        build.observation(held_out, method, categories_of(training), device),
        training,
        starts_a_room=1,
        max_moves=method.evaluation_moves,
        on_illegal=method.on_illegal,
        seed=np.random.SeedSequence(config.seed),
    )
    return time.perf_counter() - began


def memory(config: BenchConfig, device: torch.device) -> dict[str, float]:
    """Bytes a transition, and the peak of a process that trains with a full replay."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(train_with_full_replay, config, device).result()


def train_with_full_replay(config: BenchConfig, device: torch.device) -> dict[str, float]:
    method = replace(config.method, replay_capacity=config.transitions)
    rooms, _ = read_rooms(config)
    learner = Learner(replace(config, method=method), rooms, device, ENDLESS)
    learner.fill()
    training_pace(learner, config.seconds)
    result = {"bytes_a_transition": learner.replay.bytes_per_transition, "peak_gigabytes": peak_bytes() / 1e9}
    if device.type == "cuda":
        result["peak_device_gigabytes"] = torch.cuda.max_memory_allocated(device) / 1e9
    return result


def peak_bytes() -> int:
    """Peak resident memory of this process, on Linux. Not `ru_maxrss`, which begins at that of the parent process."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        raise InputError("parts: memory expects Linux, which says how much a process had at most") from None
    peak = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert peak is not None
    return 1024 * int(peak[1])


def growth(config: BenchConfig, device: torch.device) -> dict[str, dict[int, float]]:
    """Moves a second by the number of parallel episodes, and of items in a room."""
    rooms, _ = read_rooms(config)
    simulator = BatchSimulator(build.simulator(rooms, config.method, config.reward), device)
    by_episodes = {batch: moves_a_second(config, simulator, batch) for batch in config.batches}
    by_items = {}
    for count in config.items:
        rng = np.random.default_rng(config.seed)
        crowded = [with_items(room, count, rng) for room in rooms[: config.items_rooms]]
        simulator = BatchSimulator(build.simulator(crowded, config.method, config.reward), device)
        by_items[count] = moves_a_second(config, simulator, config.batch)
    return {"moves_a_second_by_episodes": by_episodes, "moves_a_second_by_items": by_items}


def with_items(room: Room, count: int, rng: np.random.Generator) -> Room:
    """The room with `count` items, the moving one first: some taken away, or small boxes put anywhere indoors."""
    furniture = [room.moving, *room.others][:count]
    x0, y0, x1, y1 = room.indoor.bounds
    while len(furniture) < count:
        width, depth = rng.uniform(0.1, 0.3, 2)  # metres
        x, y = rng.uniform((x0, y0), (x1, y1))
        box = Item("box", (float(width), float(depth)), (float(x), float(y)))
        if room.indoor.covers(box.footprint):
            furniture.append(box)
    return replace(room, furniture=tuple(furniture), target=0)


def plot(measured: dict[str, dict[int, float]]) -> Figure:
    """What `growth` measured."""
    figure = Figure(figsize=(9, 3.5), layout="constrained")
    for axes, name, label in zip(
        figure.subplots(1, 2), measured, ("parallel episodes", "items in a room"), strict=True
    ):
        axes.plot(list(measured[name]), list(measured[name].values()), marker="o")
        axes.set(xlabel=label, ylabel="moves a second")
        axes.grid(alpha=0.3)
    figure.axes[0].set(xscale="log", yscale="log")
    figure.axes[1].set_ylim(bottom=0)
    return figure


def training(config: BenchConfig, device: torch.device) -> dict[str, Any]:
    """A whole training: how long until it is good, and how good it gets."""
    rooms, held_out = read_rooms(config)
    began = time.perf_counter()
    learner = Learner(config, rooms, device, config.method.updates[config.budget.name])
    setup = (time.perf_counter() - began) / 60
    curve = learned(learner, held_out_probe(config, rooms, held_out, device), config.probe_every)
    to_goal = curve.minutes_to(TRAINING_IOU)
    return {
        "minutes_to_goal": None if to_goal is None else setup + to_goal,
        "setup_minutes": setup,
        "minutes": setup + curve.points[-1].seconds / 60,
        "iou": curve.points[-1].iou,
        "points": curve.points,
    }


def paper(config: BenchConfig, device: torch.device) -> dict[str, Any]:
    """The paper's network on its pictures, with the moves of the method: how good it gets in `minutes`.

    Exploration and learning rate fall over as many updates as a short trial says that there is time for.
    """
    method = replace(
        config.method, observation="image", batch=config.paper.batch, learning_rate=config.paper.learning_rate
    )
    config = replace(config, method=method)
    rooms, held_out = read_rooms(config)
    pace = training_pace(Learner(config, rooms, device, ENDLESS), config.seconds)
    updates = max(1, round(60 * config.minutes * pace / method.batch))
    learner = Learner(config, rooms, device, updates)
    probe = held_out_probe(config, rooms, held_out, device)
    curve = learned(learner, probe, max(1, updates // POINTS), minutes=config.minutes)
    in_time = [point for point in curve.points if point.seconds <= 60 * config.minutes]
    last = (in_time or curve.points)[-1]
    return {"iou": last.iou, "minutes": last.seconds / 60, "updates": last.updates, "points": curve.points}


def sb3(config: BenchConfig, device: torch.device) -> dict[str, Any]:
    """Our learner beside Stable-Baselines3's DQN: the same network and first weights, updates, batch, replay and rates.

    Its DQN is not double, turns no rooms, and knows no mask: a move that is illegal is dropped by the environment, and
    learned to be useless.
    """
    updates = config.method.updates[config.budget.name]
    rooms, held_out = read_rooms(config)
    probe = held_out_probe(config, rooms, held_out, device)
    curves = {
        "layoutrl": learned(Learner(config, rooms, device, updates), probe, config.probe_every, iou=SB3_IOU),
        "SB3": learned_by_sb3(config, rooms, Learner(config, rooms, device, updates), probe),
    }
    ours, theirs = (curve.minutes_to(SB3_IOU) for curve in curves.values())
    last = {name: curve.points[-1] for name, curve in curves.items()}
    at_least = theirs or last["SB3"].seconds / 60
    return {
        "minutes_to_goal": {"layoutrl": ours, "SB3": theirs},
        "times_sb3": None if ours is None else at_least / ours,
        "updates": {name: point.updates for name, point in last.items()},
        "minutes": {name: point.seconds / 60 for name, point in last.items()},
        "iou": {name: point.iou for name, point in last.items()},
        "points": {name: curve.points for name, curve in curves.items()},
    }


def learned(learner: Learner, probe: Probe, probe_every: int, *, iou: float = np.inf, minutes: float = np.inf) -> Curve:
    """Train, to the end or until an IoU or a time is reached."""
    curve = Curve(probe)
    for progress in learner.train(probe_every):
        point = curve.add(progress.updates, learner.agent)
        if point.iou >= iou or point.seconds >= 60 * minutes:
            break
    return curve


def learned_by_sb3(config: BenchConfig, rooms: Sequence[Room], learner: Learner, probe: Probe) -> Curve:
    """Let Stable-Baselines3 train the learner's network, in single environments that it steps one after another."""
    from stable_baselines3 import DQN as TheirDQN
    from stable_baselines3.common.vec_env import DummyVecEnv

    method, agent = learner.method, learner.agent
    env = LayoutEnv(
        rooms,
        method.observation,
        build.moves(method),
        Reward(*astuple(config.reward)),
        on_illegal="drop",
        max_moves=method.max_moves,
    )

    def one() -> TransformReward[Any, Any]:
        """Copies share rooms and simulator, which hold no state."""
        return TransformReward(copy(env), lambda reward: float(reward) / REWARD_SCALE)

    model = TheirDQN(
        "MlpPolicy",
        DummyVecEnv([one] * method.episodes),
        learning_rate=lambda remaining: method.learning_rate * remaining,
        buffer_size=method.replay_capacity,
        learning_starts=method.warmup_moves - 1,  # it learns when more are stored
        batch_size=method.batch,
        gamma=method.discount,
        train_freq=1,
        target_update_interval=method.target_period * method.episodes,
        exploration_fraction=method.epsilon_share,
        exploration_initial_eps=method.epsilon_start,
        exploration_final_eps=method.epsilon_end,
        max_grad_norm=np.inf,
        policy_kwargs={"net_arch": []},
        seed=config.seed,
        device=learner.simulator.device,
    )
    # Its policy flattens what it observes.
    assert env.observation_space.shape is not None
    model.q_net.q_net = nn.Sequential(nn.Unflatten(1, env.observation_space.shape), agent.network)
    model.q_net_target.q_net = nn.Sequential(nn.Unflatten(1, env.observation_space.shape), agent.target)
    model.policy.optimizer = agent.optimizer

    curve = Curve(probe)

    def goes_on(_locals: dict[str, Any], _globals: dict[str, Any]) -> bool:
        """Called after every step of the environments, before the update that follows."""
        due = model._n_updates > 0 and model._n_updates % config.probe_every == 0
        return not due or curve.add(model._n_updates, agent).iou < SB3_IOU

    steps = learner.updates + -(-method.warmup_moves // method.episodes) - 1  # the last of the warm-up learns already
    model.learn(steps * method.episodes, callback=goes_on, log_interval=ENDLESS)
    if curve.minutes_to(SB3_IOU) is None:
        curve.add(model._n_updates, agent)
    return curve


def random_moves(
    simulator: BatchSimulator, episodes: int, max_moves: int, seed: np.random.SeedSequence
) -> Iterator[Step]:
    """Steps of many episodes, of legal moves drawn at random."""
    generator = torch.Generator(simulator.device).manual_seed(int(seed.generate_state(1)[0]))
    running = Episodes(simulator, np.arange(episodes) % max_moves, max_moves, generator)
    none = torch.zeros(episodes, dtype=torch.int64, device=simulator.device)
    while True:
        yield running.step(explore(none, running.legal, 1.0, generator))


def random_moves_by_shapely(simulator: Simulator, episodes: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Rewards (B,) of the same by the reference simulator; its episodes never end, which spares it the new ones."""
    room = rng.integers(len(simulator.rooms), size=episodes)
    position = simulator.starts(room, rng)
    reached, legal = simulator.destinations(room, position)
    while True:
        action = (rng.random(legal.shape) * legal).argmax(1)
        can_move = legal.any(1)
        position[can_move] = reached[can_move, action[can_move]]
        reward = simulator.reward(room, position).total
        reached, legal = simulator.destinations(room, position)
        yield reward


def moves_a_second(config: BenchConfig, simulator: BatchSimulator, episodes: int) -> float:
    play = random_moves(simulator, episodes, config.method.max_moves, np.random.SeedSequence(config.seed))
    return episodes / seconds_of(partial(next, play), config.seconds)


def training_pace(learner: Learner, seconds: float) -> float:
    """Samples a second of the whole training loop: the median over some updates at a time, warm-up left out."""
    reports = learner.train(REPORT)
    next(reports)
    times: list[float] = []
    while sum(times) < seconds:
        began = time.perf_counter()
        next(reports)
        times.append(time.perf_counter() - began)
    return REPORT * learner.method.batch / statistics.median(times)


def seconds_of(work: Callable[[], object], at_least: float) -> float:
    """Median time of a call, after a warm-up, repeated for `at_least` seconds; waits for the GPU."""
    timer = Timer("work()", globals={"work": work}, num_threads=torch.get_num_threads())
    return timer.blocked_autorange(min_run_time=at_least).median


def read_rooms(config: BenchConfig) -> tuple[list[Room], list[Room]]:
    """(training, held-out) rooms, new ones each time: rooms that were used keep what was worked out about them."""
    with contextlib.redirect_stdout(io.StringIO()):
        training, held_out = build.rooms(config.room, config.data, config.fold)
    if not training or not held_out:
        raise InputError("fold: expected rooms to train on and rooms held out (more rooms, or another fold)")
    return training, held_out


def held_out_probe(
    config: BenchConfig, training: Sequence[Room], held_out: Sequence[Room], device: torch.device
) -> Probe:
    """Greedy episodes in all held-out rooms."""
    method = config.method
    return Probe(
        build.simulator(held_out, method, config.reward),
        build.observation(held_out, method, categories_of(training), device),
        method.evaluation_moves,
        method.on_illegal,
        np.random.default_rng(config.seed),
        device,
    )


def machine(device: torch.device) -> dict[str, Any]:
    """What it was measured on, and with which versions."""
    cpuinfo = Path("/proc/cpuinfo")
    name = re.search(r"model name\s*: (.*)", cpuinfo.read_text()) if cpuinfo.exists() else None
    package = Path(layoutrl.__file__).resolve().parent
    describe = ["git", "-C", str(package), "describe", "--always", "--dirty", "--exclude=*"]
    checkout = (package.parent / ".git").exists()
    commit = subprocess.run(describe, capture_output=True, text=True, check=False).stdout.strip() if checkout else ""
    return {
        "cpu": name[1] if name else platform.processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "torch threads": torch.get_num_threads(),
        "load before": round(os.getloadavg()[0], 1),  # processes that want a core, this one not yet
        "gpu": torch.cuda.get_device_name(device) if device.type == "cuda" else None,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "shapely": shapely.__version__,
        "layoutrl": f"{layoutrl.__version__} {commit}".strip(),
    }


def table(about: dict[str, Any], parts: dict[str, dict[str, Any]]) -> str:
    """What, measured, to reach."""
    rows = [("", "measured", "to reach on two cores")]
    for part, measured in parts.items():
        for key, (what, targets) in ROWS[part].items():
            values = measured.get(key, {})  # the GPU's are missing on a CPU
            for name, value in values.items() if isinstance(values, dict) else [("", values)]:
                target = targets.get(str(name), "") if isinstance(targets, dict) else targets
                rows.append((f"{what}, {name}" if name else what, _short(value), target))
    width = max(len(what) for what, _, _ in rows)
    lines = [", ".join(f"{name} {value}" for name, value in about.items() if value is not None)]
    lines += [f"{what:{width}}  {value:>12}  {target}".rstrip() for what, value, target in rows]
    return "\n".join(lines)


def _short(value: float | None) -> str:
    if value is None:
        return "not reached"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


PARTS: dict[str, Callable[[BenchConfig, torch.device], dict[str, Any]]] = {
    "speed": speed,
    "memory": memory,
    "growth": growth,
    "training": training,
    "paper": paper,
    "sb3": sb3,
}


def run(config: BenchConfig) -> Path:
    """Measure the parts and return the folder of bench.json, and of growth.png."""
    device = build.device(config.device)
    if "sb3" in config.parts and find_spec("stable_baselines3") is None:
        raise InputError(
            "parts: sb3 compares with Stable-Baselines3; install it: pip install stable-baselines3 (extra bench)"
        )
    if "sb3" in config.parts and config.method.observation != "geometry":
        raise InputError("parts: sb3 expects method.observation=geometry")
    folder = Path(config.runs) / "bench" / (config.name or datetime.now().strftime("%Y-%m-%d-%H%M%S"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"runs: cannot create {folder} ({error.strerror}); expected a folder to write to") from None
    about = machine(device)
    measured: dict[str, dict[str, Any]] = {}
    for part in config.parts:
        print(f"measuring {part}", flush=True)
        measured[part] = PARTS[part](config, device)
        write_json(folder / "bench.json", {"machine": about, "config": asdict(config), **measured})
    if "growth" in measured:
        plot(measured["growth"]).savefig(folder / "growth.png", dpi=120)
    print(table(about, measured))
    print(f"wrote {folder}")
    return folder


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="bench")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
