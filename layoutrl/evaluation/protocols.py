"""Greedy rollouts: where the trained agent puts an item."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.agents.method import Method
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import snap
from layoutrl.env.scenes import Scenes, led_to
from layoutrl.env.symmetry import Symmetry

DISTINCT = 0.1  # metres: places nearer to each other are one choice
SHORTLIST = 8  # places of an episode that may be the stopping place
BLOCK = 500  # observations shown to the network at once: on a CPU, a larger block waits for memory


@dataclass(frozen=True)
class Rollout:
    """B greedy episodes: the way of each, and where it ends."""

    room: np.ndarray  # (B,) index
    path: np.ndarray  # (T + 1, B, 2), metres; an episode that ended stays where it was
    value: np.ndarray  # (T + 1, B): Q of the move that led to each position; -inf for the start, and after the end
    moves: np.ndarray  # (B,) until the stopping place is reached
    seconds: float

    @property
    def final(self) -> np.ndarray:
        """The stopping places (B, 2), in metres."""
        return self.path[self.moves, np.arange(len(self.room))]

    def choices(self, count: int) -> np.ndarray:
        """The agent's first, second, ... stopping place: (B, count, 2), metres. Real designs leave a choice open.

        After the first those of the places that it came by that it went on from only to lower Q, the highest before the
        lower, DISTINCT apart from each other. The first is repeated where there are fewer.
        """
        path, value = self.path.swapaxes(0, 1), self.value.T
        before, after = (np.pad(value, ((0, 0), pad), constant_values=-np.inf) for pad in ((1, 0), (0, 1)))
        value = np.where((value > before[:, :-1]) & (value >= after[:, 1:]), value, -np.inf)
        path = np.take_along_axis(path, np.argsort(-value, axis=1, kind="stable")[..., None], 1)  # best first
        left = -np.sort(-value, axis=1) > -np.inf
        chosen = [self.final]
        while len(chosen) < count:
            left &= np.linalg.norm(path - chosen[-1][:, None], axis=-1) >= DISTINCT
            next_best = path[np.arange(len(path)), left.argmax(1)]
            chosen.append(np.where(left.any(1, keepdims=True), next_best, self.final))
        return np.stack(chosen, 1)


@dataclass(frozen=True)
class Greedy:
    """The greedy policy of an agent, as it is tested.

    There is no move that stays, so that it would end in a loop; instead it never goes back to where it has been, and
    looks further for `max_moves` moves. Of the SHORTLIST places that it entered by the moves of highest Q, it stops at
    the one that the shortest moves into it, from all around, value highest on average: the Q of one move errs by more
    than half a centimetre is worth. The designer's place is never consulted. Q is the mean over the `symmetries`, in
    whose views a design is as good. With `on_illegal="stop"` (the paper's test rule, section 4.2) an illegal choice
    ends the episode; with `"mask"` the best legal move is taken.
    """

    agent: DQN
    max_moves: int
    on_illegal: Literal["stop", "mask"]
    symmetries: Sequence[Symmetry]

    @property
    def device(self) -> torch.device:
        """Where the agent is."""
        return next(self.agent.network.parameters()).device

    def rollout(
        self, simulator: BatchSimulator | Scenes, observe: Observe, room: np.ndarray | Tensor, starts: np.ndarray
    ) -> Rollout:
        """Follow the policy in rooms (B,) from starts (B, 2)."""
        began = time.perf_counter()
        device, batch = simulator.device, len(room)
        path = snap(torch.as_tensor(starts, device=device)).repeat(self.max_moves + 1, 1, 1)
        value = torch.full((self.max_moves + 1, batch), -torch.inf, device=device)
        active, rooms = torch.arange(batch, device=device), torch.as_tensor(room, device=device)
        for t in range(self.max_moves):
            here = path[t, active]
            length, legal = simulator.reach(rooms[active], here)
            reached = led_to(simulator, rooms[active], here, length)
            been_there = (path[: t + 1, active, None] == reached).all(-1).any(0)
            closed = been_there | ~legal if self.on_illegal == "mask" else been_there & legal
            q = self.values(observe, rooms[active], here).masked_fill(closed, -torch.inf)
            highest, action = q.max(1, keepdim=True)
            goes_on = (legal.gather(1, action) & highest.isfinite()).squeeze(1)
            active, action = active[goes_on], action[goes_on]
            if not len(active):
                break
            path[t + 1 :, active] = reached[goes_on, action.squeeze(1)]
            value[t + 1, active] = highest[goes_on].squeeze(1)
        moves = self._settled(simulator, observe, rooms, path, value)
        seconds = time.perf_counter() - began
        return Rollout(rooms.cpu().numpy(), path.cpu().numpy(), value.cpu().numpy(), moves.cpu().numpy(), seconds)

    def _settled(
        self, simulator: BatchSimulator | Scenes, observe: Observe, rooms: Tensor, path: Tensor, value: Tensor
    ) -> Tensor:
        """Which position of the path (T + 1, B, 2) each episode stops at: (B,)."""
        shortest = 4 * int(np.argmin(simulator.moves.steps))
        way = torch.arange(4, device=path.device)  # right, left, below, up
        there, back = shortest + way, shortest + (way ^ 1)
        raw, which = value.topk(min(SHORTLIST, len(value)), 0)
        place = path.gather(0, which[..., None].expand(-1, -1, 2)).flatten(0, 1)
        rooms, raw = torch.cat([rooms] * len(which)), raw.flatten()
        length, legal = (reach[:, there] for reach in simulator.reach(rooms, place))
        whose, start = (t.repeat_interleave(4, 0) for t in (rooms, place))
        around = simulator.moved(whose, start, there.repeat(len(place)), length.flatten())
        q = self.values(observe, whose, around).unflatten(0, (-1, 4))[:, way, back]
        mean = (q.where(legal, 0.0).sum(1) / legal.sum(1)).where(legal.any(1), raw)
        best = mean.where(raw.isfinite(), -torch.inf).view_as(which).argmax(0, keepdim=True)
        return which.gather(0, best).squeeze(0).where(value.isfinite().any(0), 0)

    def best_moves(
        self, simulator: BatchSimulator | Scenes, observe: Observe, room: np.ndarray, position: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The legal move of highest Q from positions (B, 2) in rooms (B,), and that Q: (B,) each.

        The Q is what the agent thinks of a position; -inf where no move is legal.
        """
        rooms, here = (torch.as_tensor(array, device=simulator.device) for array in (room, position))
        _, legal = simulator.reach(rooms, here)
        highest, action = self.values(observe, rooms, here).masked_fill(~legal, -torch.inf).max(1)
        return action.cpu().numpy(), highest.cpu().numpy()

    def best_value(
        self, simulator: BatchSimulator | Scenes, observe: Observe, room: Tensor, position: Tensor
    ) -> Tensor:
        """The Q of the best legal move from positions (B, 2): what the agent thinks of them, (B,)."""
        _, legal = simulator.reach(room, position)
        return self.values(observe, room, position).masked_fill(~legal, -torch.inf).amax(1)

    def values(self, observe: Observe, rooms: Tensor, positions: Tensor) -> Tensor:
        """Q(s, a), (B, A): the mean over views of the room, each move taken for what it is in the view."""
        blocks = zip(*(each.split(BLOCK // len(self.symmetries)) for each in (rooms, positions)), strict=True)
        return torch.cat([self._mean_over_views(observe, observe(*block)) for block in blocks])

    def _mean_over_views(self, observe: Observe, observation: Tensor) -> Tensor:
        seen = torch.cat([observe.turned(observation, s) for s in self.symmetries])
        views = zip(self.agent.values(seen).split(len(observation)), self.symmetries, strict=True)
        return torch.stack([q[:, s.action] for q, s in views]).mean(0)


def greedy(agent: DQN, method: Method) -> Greedy:
    """The agent's policy, as the method tests it."""
    device = next(agent.network.parameters()).device
    return Greedy(agent, method.evaluation_moves, method.on_illegal, method.views(device))
