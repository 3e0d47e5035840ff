"""The training loop: act, store, learn; its consumer logs, evaluates, saves and stops."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from torch import Tensor

from layoutrl.agents.dqn import DQN, UpdateStats
from layoutrl.agents.exploration import LinearSchedule, explore
from layoutrl.agents.gains import EveryMove
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.env.device import generator_of
from layoutrl.env.episodes import Episodes, Step
from layoutrl.env.observation import Observe, in_every_view
from layoutrl.env.reward import REWARD_SCALE
from layoutrl.env.symmetry import Symmetry, moves_in_every_view, values_in_every_view

Begin = Callable[[torch.Generator], Episodes]  # makes episodes that draw from the generator


@dataclass(frozen=True)
class Progress:
    """What happened since the last report."""

    updates: int  # since the start
    moves: int  # since the start
    epsilon: float
    loss: float
    mean_q: float
    max_q: float
    episode_return: float  # mean over the whole episodes that ended, in units of the paper's reward; NaN if none did
    episode_iou: float  # mean over the whole episodes that ended, at their last position
    seconds: dict[str, float]  # by stage


@dataclass
class Stopwatch:
    """Host seconds spent in each stage since the last reading; asynchronous work of a GPU is not waited for."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block as part of a stage."""
        start = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start

    def read(self) -> dict[str, float]:
        """Seconds of each stage since this was last asked."""
        seconds, self.seconds = self.seconds, {}
        return seconds


class Training:
    """The training loop: `total_updates` updates of `batch` transitions, one step of all parallel episodes before each.

    `begin` makes the episodes; `Episodes` and `SceneEpisodes` say when they end. The agent cannot see when an episode
    is truncated, so the last transition bootstraps like any other.
    Iterating trains, and yields a report every `report_every` updates. It waits for the device then, where a goal ends
    episodes, with `every_move`, and where the network leaves out rows of padding. It stops after the last update, or
    after the one in which `stopping` is set.
    `state_dict` holds all that is needed to resume from any update as if training had never stopped.

    Illegal moves are never chosen ("dropped, then a new action", section 4.2). An item that can make no move stays, and
    the target of what is stored of it is its reward alone. Learning starts when `warmup_moves` moves are stored; each
    update sees an equal share of its batch in every one of the `symmetries`. With `every_move` an update learns the
    values of all legal moves of the poses that it samples, otherwise only that of the move that was made.
    """

    def __init__(
        self,
        dqn: DQN,
        begin: Begin,
        observe: Observe,
        replay: Replay,
        epsilon: LinearSchedule,
        *,
        total_updates: int,
        batch: int,
        discount: float,
        warmup_moves: int,
        report_every: int,
        symmetries: Sequence[Symmetry],
        seed: np.random.SeedSequence,
        every_move: EveryMove | None = None,
    ):
        self.dqn, self.replay, self.stopping = dqn, replay, False
        self._observe, self._epsilon, self._symmetries = observe, epsilon, symmetries
        self._every_move, self._batch, self._discount = every_move, batch, discount
        self._total_updates, self._report_every = total_updates, report_every
        self._warm = min(warmup_moves, replay.capacity)
        device = replay.device
        episode_rng, self._explore_rng, self._replay_rng = (generator_of(each, device) for each in seed.spawn(3))
        self._running = begin(episode_rng)
        self._moves = 0
        self._returns = torch.zeros(len(self._running.room), device=device)  # of the episodes that run
        self._recent = Recent()
        self._watch = Stopwatch()

    def __iter__(self) -> Iterator[Progress]:
        while self.updates < self._total_updates and not self.stopping:
            self._act()
            if self.replay.size < self._warm:
                continue
            self._learn()
            if self.updates % self._report_every == 0 or self.updates == self._total_updates:
                yield self._report()

    @property
    def updates(self) -> int:
        """How many updates were made so far."""
        return self.dqn.updates

    def _act(self) -> None:
        """One move of every episode, stored."""
        running, recent = self._running, self._recent
        with self._watch("act"):
            observation = self._observe(running.room, running.position)
            greedy = self.dqn.values(observation).masked_fill(~running.legal, -torch.inf).argmax(1)
            epsilon = running.explore_at(self._epsilon(self.updates))
            action = explore(greedy, running.legal, epsilon, self._explore_rng)
        with self._watch("simulate"):
            step = running.step(action)
        with self._watch("store"):
            self.replay.add(transitions(step, self._discount))
        self._moves += len(action)
        self._returns += step.terms.total
        if len(step.ended):
            recent.returns.append(self._returns[step.whole])
            recent.ious.append(step.terms.iou[step.whole])
            self._returns[step.ended] = 0

    def _learn(self) -> None:
        """One update."""
        with self._watch("sample"):
            sampled = self.replay.sample(self._batch, self._replay_rng)
            observation = self._observe(sampled.room, sampled.position)
        if self._every_move is None:
            stats = self._learn_made(sampled, observation)
        else:
            stats = self._learn_every(self._every_move, sampled, observation)
        for column, value in zip((self._recent.losses, self._recent.mean_qs, self._recent.max_qs), stats, strict=True):
            column.append(value[None])

    def _learn_made(self, sampled: Transitions, observation: Tensor) -> UpdateStats:
        """An update from the moves that were made."""
        with self._watch("sample"):
            next_observation = self._observe(sampled.room, sampled.next_position)
            turned = sampled._replace(  # all but the poses: only their observations are read from here on
                action=moves_in_every_view(self._symmetries, sampled.action),
                next_legal=values_in_every_view(self._symmetries, sampled.next_legal),
            )
            views = [in_every_view(self._observe, self._symmetries, o) for o in (observation, next_observation)]
        with self._watch("learn"):
            return self.dqn.update(turned, *views)

    def _learn_every(self, every_move: EveryMove, sampled: Transitions, observation: Tensor) -> UpdateStats:
        """An update from every move that could have been made instead."""
        with self._watch("sample"):
            legal, moves = every_move.transitions(sampled.room, sampled.position, self.updates, self._replay_rng)
            next_observation = self._observe(moves.room, moves.next_position)
        with self._watch("learn"):
            target = every_move.target(self.dqn.target, legal, moves, observation, next_observation)
            legal, target = (values_in_every_view(self._symmetries, values) for values in (legal, target))
            action, updates = moves_in_every_view(self._symmetries, sampled.action), self.updates
            reward = every_move.reward(sampled.room, sampled.position)
            views = in_every_view(self._observe, self._symmetries, observation)
            loss, learned = self.dqn.update_every_move(legal, target, views)
            return UpdateStats.of(loss, every_move.q_made(learned, legal, action, reward, updates))

    def _report(self) -> Progress:
        recent, self._recent = self._recent, Recent()
        return Progress(
            self.updates,
            self._moves,
            self._epsilon(self.updates),
            float(torch.cat(recent.losses).mean()),
            float(torch.cat(recent.mean_qs).mean()),
            float(torch.cat(recent.max_qs).max()),
            float(torch.cat(recent.returns).mean()) if recent.returns else float("nan"),
            float(torch.cat(recent.ious).mean()) if recent.ious else float("nan"),
            self._watch.read(),
        )

    def state_dict(self) -> dict[str, Any]:
        """Return all that is needed to resume exactly: tensors, which the next update changes, and plain values."""
        return {
            "agent": self.dqn.state_dict(),
            "replay": self.replay.state_dict(),
            "episodes": self._running.state_dict(),
            "generators": [generator.get_state() for generator in (self._explore_rng, self._replay_rng)],
            "moves": self._moves,
            "returns": self._returns,
            "recent": {name: torch.cat(values) if values else None for name, values in vars(self._recent).items()},
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore the state of a training with the same settings."""
        self.dqn.load_state_dict(state["agent"])
        self.replay.load_state_dict(state["replay"])
        self._running.load_state_dict(state["episodes"])
        for generator, its_state in zip((self._explore_rng, self._replay_rng), state["generators"], strict=True):
            generator.set_state(its_state.cpu())
        self._moves = state["moves"]
        self._returns = state["returns"].clone()
        self._recent = Recent(**{name: [] if values is None else [values] for name, values in state["recent"].items()})


@dataclass
class Recent:
    """What happened since the last report, as tensors to be concatenated."""

    losses: list[Tensor] = field(default_factory=list)
    mean_qs: list[Tensor] = field(default_factory=list)
    max_qs: list[Tensor] = field(default_factory=list)
    returns: list[Tensor] = field(default_factory=list)  # of the whole episodes that ended
    ious: list[Tensor] = field(default_factory=list)  # where they ended


def transitions(step: Step, discount: float) -> Transitions:
    """Return the transitions of a step as they are stored: discounts are 0 where episodes terminated."""
    reward, discounts = step.terms.total / REWARD_SCALE, discount * ~step.terminated
    return Transitions(step.room, step.position, step.action, reward, discounts, step.next_position, step.next_legal)
