"""How fast agents see, learn and are scored, and what memory it takes."""

from __future__ import annotations

import multiprocessing
import re
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from layoutrl import build
from layoutrl.agents.dqn import DQN
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.agents.training import Progress, transitions
from layoutrl.benchmarks.simulation import moves, random_moves, seconds_of
from layoutrl.config import BenchConfig
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import categories_of
from layoutrl.errors import InputError
from layoutrl.evaluation.report import evaluate
from layoutrl.rooms.room import Room

ENDLESS = 10**9  # updates, of a training that the clock stops
REPORT = 5  # updates timed together
ACTING = ("act", "simulate", "store")  # stages of training that are not the learner's


class Learner:
    """An untrained agent and all that it learns from, as `layoutrl.train` has them."""

    def __init__(self, config: BenchConfig, rooms: Sequence[Room], device: torch.device, updates: int):
        method, categories = config.method, categories_of(rooms)
        network_seed, self._training_seed, self._fill_seed = np.random.SeedSequence(config.seed).spawn(3)
        self.method = method
        self.updates = updates
        self.simulator = BatchSimulator(build.simulator(rooms, method, config.reward), device)
        self.observe = build.observation(rooms, method, categories, device)
        self.agent = build.agent(method, categories, updates, network_seed, device)
        self.replay = Replay(method.replay_capacity, self.simulator.moves.count, device)

    def train(self, report_every: int) -> Iterator[Progress]:
        return build.training(
            self.agent,
            self.simulator,
            self.observe,
            self.replay,
            self.method,
            self.updates,
            report_every,
            self._training_seed,
        )

    def fill(self) -> None:
        """Fill the replay with random moves: as late in training, samples are spread over much memory."""
        play = random_moves(self.simulator, self.method.batch, self.method.max_moves, self._fill_seed)
        while self.replay.size < self.replay.capacity:
            self.replay.add(transitions(next(play), self.method.discount))

    def sample(self, count: int) -> Transitions:
        generator = torch.Generator(self.simulator.device).manual_seed(0)
        return self.replay.sample(count, generator)

    def bare_passes(self) -> Callable[[], None]:
        """The forward and backward passes of one update, on observations that are there: no learner is faster."""
        agent, batch = self.agent, self.sample(self.method.batch)
        observation = self.observe(batch.room, batch.position)
        next_observation = self.observe(batch.room, batch.next_position)

        def passes() -> None:
            with torch.no_grad():
                agent.target(next_observation)
                if agent.double:
                    agent.network(next_observation)
            agent.network.zero_grad()
            agent.network(observation).sum().backward()

        return passes


def speed(config: BenchConfig, rooms: Sequence[Room], held_out: Sequence[Room], device: torch.device) -> dict[str, Any]:
    """Simulator, observations, learners, set-up and evaluation."""
    began = time.perf_counter()
    learner = Learner(config, rooms, device, ENDLESS)
    result: dict[str, Any] = {"setup_seconds": time.perf_counter() - began}
    result |= moves(config, rooms, device)
    pictured = Learner(replace(config, method=config.paper), rooms, device, ENDLESS)
    rates = {
        each.method.name: learning(each, poses, config.seconds)
        for each, poses in ((learner, config.batch), (pictured, config.images))
    }
    result |= {name: {method: rates[method][name] for method in rates} for name in rates[config.method.name]}
    result["evaluation_seconds"] = evaluating(config, learner.agent, rooms, held_out, device)
    return result


def learning(learner: Learner, poses: int, seconds: float) -> dict[str, float]:
    """Observations of poses a second; samples a second of the learner, of its bare passes, and of the whole loop.

    The learner's time is the loop's but for acting; the whole loop's on a GPU, of whose stages the host knows nothing.
    Loop and bare passes are timed in turn, as their ratio counts.
    """
    learner.fill()
    device, sampled = learner.simulator.device, learner.sample(poses)
    observations = poses / seconds_of(partial(learner.observe, sampled.room, sampled.position), seconds)
    reports, passes = learner.train(REPORT), learner.bare_passes()
    next(reports)
    loop: list[float] = []
    learned: list[float] = []
    bare: list[float] = []
    while sum(loop) < seconds:
        began = time.perf_counter()
        progress = next(reports)
        loop.append(time.perf_counter() - began)
        acting = 0.0 if device.type == "cuda" else sum(progress.seconds[stage] for stage in ACTING)
        learned.append(loop[-1] - acting)
        bare.append(REPORT * seconds_of(passes, loop[-1]))
    rates = {
        name: REPORT * learner.method.batch / statistics.median(times)
        for name, times in (("learner", learned), ("bare", bare), ("training", loop))
    }
    return {
        "observations_a_second": observations,
        "learner_samples_a_second": rates["learner"],
        "bare_samples_a_second": rates["bare"],
        "share_of_bare": rates["learner"] / rates["bare"],
        "training_samples_a_second": rates["training"],
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


def memory(
    config: BenchConfig, rooms: Sequence[Room], _held_out: Sequence[Room], device: torch.device
) -> dict[str, float]:
    """Bytes a transition, and the peak of a process that trains with a full replay."""
    peak_bytes()  # where it cannot be told, that is said before any work
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(train_with_full_replay, config, rooms, device).result()


def train_with_full_replay(config: BenchConfig, rooms: Sequence[Room], device: torch.device) -> dict[str, float]:
    build.keep_freed_memory()  # in this process, too
    method = replace(config.method, replay_capacity=config.transitions)
    learner = Learner(replace(config, method=method), rooms, device, ENDLESS)
    learner.fill()
    training_pace(learner, config.seconds)
    result = {"bytes_a_transition": learner.replay.bytes_per_transition, "peak_gigabytes": peak_bytes() / 1e9}
    if device.type == "cuda":
        result["peak_device_gigabytes"] = torch.cuda.max_memory_allocated(device) / 1e9
    return result


def training_pace(learner: Learner, seconds: float) -> float:
    """Updates a second, over so many seconds; warm-up left out."""
    reports = learner.train(REPORT)
    next(reports)
    began, first = time.perf_counter(), learner.agent.updates
    while time.perf_counter() - began < seconds:
        next(reports)
    return (learner.agent.updates - first) / (time.perf_counter() - began)


def peak_bytes() -> int:
    """Peak resident memory of this process, on Linux. Not `ru_maxrss`, which begins at that of the parent process."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        raise InputError("parts: memory expects Linux, which says how much a process had at most") from None
    peak = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert peak is not None
    return 1024 * int(peak[1])
