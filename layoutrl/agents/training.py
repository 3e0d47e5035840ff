"""The training loop: act, store, learn; a generator whose consumer logs, evaluates and stops."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.agents.exploration import LinearSchedule, explore
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.env.simulator import Simulator
from layoutrl.errors import InputError

REWARD_SCALE = 100.0  # rewards are learned divided by this, so that the Huber loss is quadratic where it matters


@dataclass(frozen=True)
class Progress:
    """What happened since the last report."""

    updates: int  # since the start
    moves: int  # since the start
    epsilon: float
    loss: float
    mean_q: float
    max_q: float
    episode_return: float  # mean over the episodes that ended, in units of the paper's reward; NaN if none did
    episode_iou: float  # mean over the episodes that ended, at their last position
    seconds: dict[str, float]  # by stage


@dataclass
class Stopwatch:
    """Seconds spent in each stage since the last reading."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start

    def read(self) -> dict[str, float]:
        seconds, self.seconds = self.seconds, {}
        return seconds


def train(
    agent: DQN,
    simulator: Simulator,
    observe: Observe,
    replay: Replay,
    epsilon: LinearSchedule,
    *,
    updates: int,
    batch: int,
    episodes: int,
    max_moves: int,
    discount: float,
    goal_iou: float | None,
    warmup_moves: int,
    report_every: int,
    seed: np.random.SeedSequence,
) -> Iterator[Progress]:
    """Train for `updates` updates of `batch` transitions, one step of all parallel `episodes` before each.

    An episode is cut after `max_moves` moves, which the agent cannot see: its last transition
    bootstraps like any other. With `goal_iou` it terminates at that IoU, and does not. Illegal moves
    are never chosen ("dropped, then a new action", section 4.2). Learning starts when `warmup_moves`
    moves are stored. Yields a report every `report_every` updates.
    """
    start_rng, explore_rng, replay_rng = (np.random.default_rng(s) for s in seed.spawn(3))
    device = next(agent.network.parameters()).device
    watch = Stopwatch()

    def look(rooms: np.ndarray | Tensor, positions: np.ndarray | Tensor) -> Tensor:
        with watch("observe"):
            return observe(torch.as_tensor(rooms, device=device), torch.as_tensor(positions, device=device))

    def begin(count: int) -> tuple[np.ndarray, np.ndarray]:
        rooms = start_rng.integers(len(simulator.rooms), size=count)
        return rooms, simulator.starts(rooms, start_rng)

    room, position = begin(episodes)
    reached, legal = simulator.destinations(room, position)
    made = np.zeros(episodes, dtype=int)  # moves of each running episode
    returns = np.zeros(episodes)
    moves = 0
    losses, mean_qs, max_qs = [], [], []
    ended_returns: list[float] = []
    ended_ious: list[float] = []

    while agent.updates < updates:
        observation = look(room, position)
        with watch("act"):
            q = agent.values(observation)
            greedy = np.where(legal, q.cpu().numpy(), -np.inf).argmax(1)
            action = explore(greedy, legal, epsilon(agent.updates), explore_rng)
        with watch("simulate"):
            able = np.any(legal, axis=1)  # an item that cannot move at all stays, and makes no transition
            next_position = np.where(able[:, None], reached[np.arange(episodes), action], position)
            terms = simulator.reward(room, next_position)
            next_reached, next_legal = simulator.destinations(room, next_position)
        terminated = terms.iou >= (np.inf if goal_iou is None else goal_iou)
        made += 1
        moves += episodes
        returns += terms.total
        truncated = made >= max_moves
        with watch("store"):
            replay.add(
                Transitions(
                    *(
                        torch.as_tensor(column[able], device=device)
                        for column in (
                            room,
                            position,
                            action,
                            terms.total / REWARD_SCALE,
                            np.where(terminated, 0.0, discount),
                            next_position,
                            next_legal,
                        )
                    )
                )
            )
        if not replay.size:
            raise InputError(
                "steps: no item can move in any of the rooms drawn; expected shorter steps or larger rooms"
            )
        position, reached, legal = next_position, next_reached, next_legal
        ended = np.nonzero(terminated | truncated)[0]
        if len(ended):
            ended_returns.extend(returns[ended])
            ended_ious.extend(terms.iou[ended])
            with watch("simulate"):
                room[ended], position[ended] = begin(len(ended))
                reached[ended], legal[ended] = simulator.destinations(room[ended], position[ended])
            made[ended], returns[ended] = 0, 0.0
        if replay.size < min(warmup_moves, replay.capacity):
            continue

        sampled = replay.sample(batch, replay_rng)
        observations = look(sampled.room, sampled.position), look(sampled.room, sampled.next_position)
        with watch("learn"):
            stats = agent.update(sampled, *observations)
        losses.append(stats.loss)
        mean_qs.append(stats.mean_q)
        max_qs.append(stats.max_q)
        if agent.updates % report_every == 0 or agent.updates == updates:
            yield Progress(
                agent.updates,
                moves,
                epsilon(agent.updates),
                float(torch.stack(losses).mean()),
                float(torch.stack(mean_qs).mean()),
                float(torch.stack(max_qs).max()),
                float(np.mean(ended_returns)) if ended_returns else float("nan"),
                float(np.mean(ended_ious)) if ended_ious else float("nan"),
                watch.read(),
            )
            losses, mean_qs, max_qs, ended_returns, ended_ious = [], [], [], [], []
