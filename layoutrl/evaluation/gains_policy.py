"""Greedy rollouts of agents whose Q is that of gains (`EveryMove`)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from layoutrl.agents.gains import gains
from layoutrl.env.observation import Observe
from layoutrl.env.scenes import ItemSimulator, destinations
from layoutrl.evaluation.rollout import MeanQ, Rollout, first_poses, visited

FRUITLESS = 120  # moves in a row that gain nothing end an episode: a room's length


@dataclass(frozen=True)
class GainsPolicy:
    """The greedy policy of an agent that learned what moves gain.

    It takes the best legal move that does not lead back to where it has been. Q is near zero at the best place, so it
    stops at the position of its path with the highest sum of gains, and searches no further once FRUITLESS moves in a
    row have not raised that sum. The gain of a move is its Q less the discounted Q of the best move from where it
    leads, averaged with minus the gain of the move back, since errors that both share cancel. The designer's place is
    never consulted.

    The value of a position is the sum of gains on the path to it. Values of different episodes are not comparable.
    """

    q: MeanQ  # on the scale on which it is learned
    max_moves: int
    discount: float  # the last one of its training

    def rollout(
        self, simulator: ItemSimulator, observe: Observe, room: np.ndarray | Tensor, starts: np.ndarray
    ) -> Rollout:
        """Follow the policy in rooms (B,) from starts (B, 2), in metres."""
        began = time.perf_counter()
        rooms, path, value = first_poses(simulator, room, starts, self.max_moves)
        active = every = torch.arange(len(rooms), device=rooms.device)
        value[0] = 0.0
        left = torch.zeros_like(value)  # Q of the best legal move from each position
        made, promised = active.new_zeros(len(rooms), 1), left[0]
        for t in range(self.max_moves + 1):  # one look more than moves: a gain is known only once the move is made
            here = path[t, active]
            reached, legal = destinations(simulator, rooms[active], here)
            q = gains(self.q(observe, rooms[active], here), legal)
            left[t, active] = q.masked_fill(~legal, -torch.inf).amax(1).where(legal.any(1), 0.0)
            if t:
                gained = promised - self.discount * left[t, active]
                lost = q.gather(1, made ^ 1).squeeze(1) - self.discount * left[t - 1, active]
                value[t, active] = value[t - 1, active] + (gained - lost) / 2
            fruitless = t - value[: t + 1, active].argmax(0) >= FRUITLESS
            closed = visited(path[: t + 1, active], reached) | ~legal | fruitless[:, None]
            highest, action = q.masked_fill(closed, -torch.inf).max(1, keepdim=True)
            goes_on = highest.isfinite().squeeze(1)
            active, made, promised = active[goes_on], action[goes_on], highest[goes_on].squeeze(1)
            if not len(active):
                break
            path[t + 1 :, active] = reached[goes_on, made.squeeze(1)]
        best = value.argmax(0)
        return Rollout.of(began, path, value, best, path[best, every][None], value[best, every])
