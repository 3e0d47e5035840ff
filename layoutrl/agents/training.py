"""The training loop: act, store, learn; a generator whose consumer logs, evaluates and stops."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.agents.exploration import LinearSchedule, explore
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes, Step
from layoutrl.env.symmetry import Symmetry, shares

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
    """Seconds that the host spent in each stage since the last reading; a GPU works on meanwhile."""

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
    simulator: BatchSimulator,
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
    symmetries: Sequence[Symmetry],
    seed: np.random.SeedSequence,
) -> Iterator[Progress]:
    """Train for `updates` updates of `batch` transitions, one step of all parallel `episodes` before each.

    An episode is cut after `max_moves` moves, which the agent cannot see: its last transition
    bootstraps like any other. With `goal_iou` it terminates at that IoU, and does not. Illegal moves
    are never chosen ("dropped, then a new action", section 4.2); an item that can make no move stays.
    Learning starts when `warmup_moves` moves are stored; each update sees an equal share of its batch
    in every one of the `symmetries`. Yields a report every `report_every` updates; only there, and
    where `goal_iou` ends episodes, does it wait for the device.
    """
    device = simulator.device
    episode_rng, explore_rng, replay_rng = (
        torch.Generator(device).manual_seed(int(s.generate_state(1)[0])) for s in seed.spawn(3)
    )
    watch = Stopwatch()
    # Of different ages, so that not all end in the same step.
    running = Episodes(simulator, np.arange(episodes) * max_moves // episodes, max_moves, episode_rng, goal_iou)
    moves = 0
    returns = torch.zeros(episodes, device=device)
    losses, mean_qs, max_qs = [], [], []
    ended_returns, ended_ious = [], []

    while agent.updates < updates:
        with watch("act"):
            observation = observe(running.room, running.position)
            greedy = agent.values(observation).masked_fill(~running.legal, -torch.inf).argmax(1)
            action = explore(greedy, running.legal, epsilon(agent.updates), explore_rng)
        with watch("simulate"):
            step = running.step(action)
        moves += episodes
        with watch("store"):
            replay.add(transitions(step, discount))
        returns += step.terms.total
        if len(step.ended):
            ended_returns.append(returns[step.ended])
            ended_ious.append(step.terms.iou[step.ended])
            returns[step.ended] = 0
        if replay.size < min(warmup_moves, replay.capacity):
            continue

        with watch("sample"):
            sampled = replay.sample(batch, replay_rng)
            observation = observe(sampled.room, sampled.position)
            next_observation = observe(sampled.room, sampled.next_position)
            turned = _turned(observe, symmetries, sampled, observation, next_observation)
        with watch("learn"):
            stats = agent.update(*turned)
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
                float(torch.cat(ended_returns).mean()) if ended_returns else float("nan"),
                float(torch.cat(ended_ious).mean()) if ended_ious else float("nan"),
                watch.read(),
            )
            losses, mean_qs, max_qs, ended_returns, ended_ious = [], [], [], [], []


def transitions(step: Step, discount: float) -> Transitions:
    """What is stored of a step."""
    reward, discounts = step.terms.total / REWARD_SCALE, discount * ~step.terminated
    return Transitions(step.room, step.position, step.action, reward, discounts, step.next_position, step.next_legal)


def _turned(
    observe: Observe, symmetries: Sequence[Symmetry], batch: Transitions, observation: Tensor, next_observation: Tensor
) -> tuple[Transitions, Tensor, Tensor]:
    """The same transitions, an equal share of them in each symmetry: a move becomes the move that it is there.

    Poses stay what they are: nothing but what is observed of them is read from here on.
    """
    turned = batch._replace(
        action=torch.cat([symmetry.action[share.long()] for symmetry, share in shares(symmetries, batch.action)]),
        next_legal=torch.cat([share[:, symmetry.inverse] for symmetry, share in shares(symmetries, batch.next_legal)]),
    )
    observation, next_observation = (in_every_view(observe, symmetries, o) for o in (observation, next_observation))
    return turned, observation, next_observation


def in_every_view(observe: Observe, symmetries: Sequence[Symmetry], observation: Tensor) -> Tensor:
    """The same observations (B, ...), an equal share of them in each symmetry."""
    return torch.cat([observe.turned(share, symmetry) for symmetry, share in shares(symmetries, observation)])
