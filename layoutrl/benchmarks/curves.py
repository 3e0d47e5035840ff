"""Learning curves over time: of the project's agent, the paper's network, and Stable-Baselines3's DQN."""

from __future__ import annotations

import time
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium.wrappers import TransformReward
from torch import nn

from layoutrl import InputError
from layoutrl.agents.learner import Learner
from layoutrl.benchmarks.learning import ENDLESS, training_pace, untrained
from layoutrl.env.layout_env import LayoutEnv
from layoutrl.env.observation import observation_of
from layoutrl.env.reward import REWARD_SCALE
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.policy import Policy, greedy
from layoutrl.evaluation.probe import ItemProbe
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Room
from layoutrl.runs.config import BenchConfig

TRAINING_IOU, SB3_IOU = 0.95, 0.80  # mean IoU on the held-out rooms: the time to reach it is measured
POINTS = 20  # of the learning curve of `image`


class Point(NamedTuple):
    """A point of a learning curve."""

    updates: int
    seconds: float  # of training so far; what the probing took is not counted
    iou: float  # mean over the held-out rooms


@dataclass
class Curve:
    """A learning curve; the clock runs from when it is made, but not while it probes."""

    probe: ItemProbe
    points: list[Point] = field(default_factory=list)
    _seconds: float = 0.0
    _resumed: float = field(default_factory=lambda: time.perf_counter())

    def add(self, updates: int, policy: Policy) -> Point:
        """Note and print how good a policy is after so many updates. The clock stands still meanwhile."""
        self._seconds += time.perf_counter() - self._resumed
        point = Point(updates, self._seconds, self.probe(policy)[0]["iou"])
        self.points.append(point)
        print(f"  {updates} updates, {point.seconds / 60:.2f} minutes: mean IoU {point.iou:.3f}", flush=True)
        self._resumed = time.perf_counter()
        return point

    def minutes_to(self, iou: float) -> float | None:
        """Return the minutes of training until an IoU was reached; None if it was not."""
        return next((point.seconds / 60 for point in self.points if point.iou >= iou), None)


def training(
    config: BenchConfig, rooms: Sequence[Room], held_out: Sequence[Room], device: torch.device
) -> dict[str, Any]:
    """Measure a whole training: the minutes until TRAINING_IOU, and the IoU at the end."""
    began = time.perf_counter()
    learner = untrained(config, rooms, device, config.method.updates[config.budget.name])
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


def image(config: BenchConfig, rooms: Sequence[Room], held_out: Sequence[Room], device: torch.device) -> dict[str, Any]:
    """Measure how good the paper's network gets in `minutes`, on its pictures but with the moves of the method.

    Exploration and learning rate fall over nearly as many updates as a short trial says there is time for.
    """
    method = replace(
        config.method,
        observation="image",
        snap=0.0,
        batch=config.paper.batch,
        learning_rate=config.paper.learning_rate,
    )
    config = replace(config, method=method)
    pace = training_pace(untrained(config, rooms, device), config.seconds)
    updates = max(1, round(0.95 * 60 * config.minutes * pace))
    learner = untrained(config, rooms, device, updates)
    probe = held_out_probe(config, rooms, held_out, device)
    curve = learned(learner, probe, max(1, updates // POINTS), minutes=config.minutes)
    in_time = [point for point in curve.points if point.seconds <= 60 * config.minutes]
    last = (in_time or curve.points)[-1]
    return {"iou": last.iou, "minutes": last.seconds / 60, "updates": last.updates, "points": curve.points}


def check_sb3(config: BenchConfig) -> None:
    """Raise InputError if Stable-Baselines3 is not installed, or the method does not observe what its network does."""
    if find_spec("stable_baselines3") is None:
        raise InputError(
            "parts: sb3 compares with Stable-Baselines3; install it: pip install stable-baselines3 (extra bench)"
        )
    if config.method.observation != "geometry":
        raise InputError("parts: sb3 expects method.observation=geometry")


def sb3(config: BenchConfig, rooms: Sequence[Room], held_out: Sequence[Room], device: torch.device) -> dict[str, Any]:
    """Compare our learner with SB3's DQN: the same network, initial weights, updates, batch, replay buffer and rates.

    SB3's DQN is not double, uses no symmetries, and has no action mask: the environment drops an illegal move, and the
    network has to learn that it is useless.
    """
    updates = config.method.updates[config.budget.name]
    probe = held_out_probe(config, rooms, held_out, device)
    curves = {
        "layoutrl": learned(untrained(config, rooms, device, updates), probe, config.probe_every, iou=SB3_IOU),
        "SB3": learned_by_sb3(config, rooms, untrained(config, rooms, device, updates), probe),
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


def learned(
    learner: Learner, probe: ItemProbe, probe_every: int, *, iou: float = np.inf, minutes: float = np.inf
) -> Curve:
    """Train to the end, or until an IoU or a time is reached; return the curve."""
    curve, policy = Curve(probe), greedy(learner.dqn.network, learner.method)  # of the network, as it learns
    for progress in learner.training(probe_every):
        point = curve.add(progress.updates, policy)
        if point.iou >= iou or point.seconds >= 60 * minutes:
            break
    return curve


def learned_by_sb3(config: BenchConfig, rooms: Sequence[Room], learner: Learner, probe: ItemProbe) -> Curve:
    """Let Stable-Baselines3 train the learner's network, in single environments that it steps one after another."""
    from stable_baselines3 import DQN as TheirDQN
    from stable_baselines3.common.vec_env import DummyVecEnv

    method, dqn = learner.method, learner.dqn
    env = LayoutEnv(rooms, method.observation, method.moves, config.reward, max_moves=method.max_moves)

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
    model.q_net.q_net = nn.Sequential(nn.Unflatten(1, env.observation_space.shape), dqn.network)
    model.q_net_target.q_net = nn.Sequential(nn.Unflatten(1, env.observation_space.shape), dqn.target)
    model.policy.optimizer = dqn.optimizer

    curve, policy = Curve(probe), greedy(dqn.network, method)

    def goes_on(_locals: dict[str, Any], _globals: dict[str, Any]) -> bool:
        """Called after every step of the environments, before the update that follows."""
        due = model._n_updates > 0 and model._n_updates % config.probe_every == 0
        return not due or curve.add(model._n_updates, policy).iou < SB3_IOU

    steps = learner.total_updates - 1 + -(-method.warmup_moves // method.episodes)  # the last of the warm-up learns
    model.learn(steps * method.episodes, callback=goes_on, log_interval=ENDLESS)
    if curve.minutes_to(SB3_IOU) is None:
        curve.add(model._n_updates, policy)
    return curve


def held_out_probe(
    config: BenchConfig, training: Sequence[Room], held_out: Sequence[Room], device: torch.device
) -> ItemProbe:
    """Return the probe of the mean IoU in the held-out rooms."""
    simulator = Simulator(held_out, config.method.moves, config.reward)
    observe = observation_of(config.method.observation, held_out, device, categories_of(training))
    return ItemProbe(simulator, observe, np.random.default_rng(config.seed), device)
