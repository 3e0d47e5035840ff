"""How fast agents observe, learn and are evaluated, and how much memory that takes."""

from __future__ import annotations

import multiprocessing
import os
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch

from layoutrl import InputError
from layoutrl.agents.learner import Learner
from layoutrl.agents.replay import Transitions
from layoutrl.agents.training import transitions
from layoutrl.benchmarks.simulation import moves, random_moves, seconds_of
from layoutrl.rooms.room import Room
from layoutrl.runs.config import BenchConfig, seeds
from layoutrl.runs.machine import keep_freed_memory, resident_bytes
from layoutrl.runs.report import scored

ENDLESS = 10**9  # updates, of a training that the clock stops
REPORT = 5  # updates timed together
ACTING = ("act", "simulate", "store")  # stages of training that are not the learner's


def untrained(config: BenchConfig, rooms: Sequence[Room], device: torch.device, updates: int = ENDLESS) -> Learner:
    """Return the learner that `layoutrl.train` begins with at this seed."""
    network_seed, training_seed, *_ = seeds(config)
    return Learner(rooms, config.method, config.reward, updates, network_seed, training_seed, device)


def fill(learner: Learner) -> None:
    """Fill the replay buffer with random moves, so that samples are spread over much memory, as late in training."""
    play = random_moves(learner.simulator, learner.method.batch, learner.method.max_moves, np.random.SeedSequence(0))
    while learner.replay.size < learner.replay.capacity:
        learner.replay.add(transitions(next(play), learner.method.discount))


def sample(learner: Learner, count: int) -> Transitions:
    """Return `count` transitions of the replay buffer, the same every time."""
    return learner.replay.sample(count, torch.Generator(learner.simulator.device).manual_seed(0))


def bare_passes(learner: Learner) -> Callable[[], None]:
    """Return a function that only makes the forward and backward passes of one update: no learner is faster."""
    dqn, batch = learner.dqn, sample(learner, learner.method.batch)
    observation = learner.observe(batch.room, batch.position)
    next_observation = learner.observe(batch.room, batch.next_position)

    def passes() -> None:
        with torch.no_grad():
            dqn.target(next_observation)
            if dqn.double:
                dqn.network(next_observation)
        dqn.network.zero_grad()
        dqn.network(observation).sum().backward()

    return passes


def speed(config: BenchConfig, rooms: Sequence[Room], held_out: Sequence[Room], device: torch.device) -> dict[str, Any]:
    """Measure the speed of simulators, observations and learners, and the seconds of set-up and evaluation."""
    began = time.perf_counter()
    learner = untrained(config, rooms, device)
    result: dict[str, Any] = {"setup_seconds": time.perf_counter() - began}
    result |= moves(config, rooms, device)
    pictured = untrained(replace(config, method=config.paper), rooms, device)
    rates = {
        each.method.name: learning(each, poses, config.seconds)
        for each, poses in ((learner, config.batch), (pictured, config.images))
    }
    result |= {name: {method: rates[method][name] for method in rates} for name in rates[config.method.name]}
    result["evaluation_seconds"] = evaluating(config, learner, rooms, held_out)
    return result


def learning(learner: Learner, poses: int, seconds: float) -> dict[str, float]:
    """Measure observations a second, `poses` at once, and samples a second: of the learner, of its bare passes, and of
    the whole loop.

    The learner's time is that of the loop without acting; on a GPU, whose stages the host cannot time, that of the
    whole loop. Loop and bare passes are timed in turn, as their ratio counts.
    """
    fill(learner)
    device, sampled = learner.simulator.device, sample(learner, poses)
    observations = poses / seconds_of(partial(learner.observe, sampled.room, sampled.position), seconds)
    reports, passes = iter(learner.training(REPORT)), bare_passes(learner)
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


def evaluating(config: BenchConfig, learner: Learner, training: Sequence[Room], held_out: Sequence[Room]) -> float:
    """Return the seconds of an evaluation in the held-out rooms: new here, so that all set-up is included.

    The agent has hardly learned: its episodes are longer than those of a trained one.
    """
    began = time.perf_counter()
    scored(learner.agent, config.reward, held_out, training, np.random.SeedSequence(config.seed))
    return time.perf_counter() - began


def memory(
    config: BenchConfig, rooms: Sequence[Room], _held_out: Sequence[Room], device: torch.device
) -> dict[str, float]:
    """Measure the bytes of a transition, and the peak memory of a new process that trains with a full replay buffer."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(train_with_full_replay, config, rooms, device).result()


def train_with_full_replay(config: BenchConfig, rooms: Sequence[Room], device: torch.device) -> dict[str, float]:
    """Train with a full replay buffer; return the bytes of a transition and the peak memory of this process."""
    keep_freed_memory()  # in this process, too
    method = replace(config.method, replay_capacity=config.transitions)
    learner = untrained(replace(config, method=method), rooms, device)
    fill(learner)
    training_pace(learner, config.seconds)
    result = {"bytes_a_transition": learner.replay.bytes_per_transition, "peak_gigabytes": peak_bytes() / 1e9}
    if device.type == "cuda":
        result["peak_device_gigabytes"] = torch.cuda.max_memory_allocated(device) / 1e9
    return result


def training_pace(learner: Learner, seconds: float) -> float:
    """Updates a second, over so many seconds; warm-up left out."""
    reports = iter(learner.training(REPORT))
    next(reports)
    began, first = time.perf_counter(), learner.dqn.updates
    while time.perf_counter() - began < seconds:
        next(reports)
    return (learner.dqn.updates - first) / (time.perf_counter() - began)


def peak_bytes() -> int:
    """Peak resident memory of this process. Raises InputError where it cannot be told."""
    if (peak := resident_bytes(os.getpid(), peak=True)) is None:
        raise InputError("parts: memory expects Linux, which says how much a process had at most")
    return peak
