"""What greedy rollouts have in common: the Q that they follow, and the paths and stopping places that result."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.env.geometry import snap
from layoutrl.env.observation import Observe, in_view
from layoutrl.env.scenes import ItemSimulator
from layoutrl.env.symmetry import Symmetry

DISTINCT = 0.1  # metres: places nearer to each other are one choice
BLOCK = 500  # observations shown to the network at once: on a CPU, a larger block waits for memory


@dataclass(frozen=True)
class Rollout:
    """B greedy episodes: the way of each, and where it ends."""

    path: np.ndarray  # (T + 1, B, 2), metres; an episode that ended stays where it was
    value: np.ndarray  # (T + 1, B) of each position, by which the stopping place is found; -inf where no move led
    best: np.ndarray  # (B,) index in the path of the position to which it returns after the search
    settling: np.ndarray  # (S, B, 2), metres: the path from there to the stopping place, where it then stays
    promise: np.ndarray  # (B,) what the agent thinks of the stopping place, before it is put in line
    seconds: float

    @classmethod
    def of(cls, began: float, *found: Tensor) -> Self:
        """Make one from tensors of all other fields, and the `time.perf_counter` at which the rollout began."""
        path, value, best, settling, promise = (each.cpu().numpy() for each in found)
        return cls(path, value, best, settling, promise, time.perf_counter() - began)

    @property
    def final(self) -> np.ndarray:
        """The stopping places (B, 2), in metres."""
        return self.settling[-1]

    @property
    def moves(self) -> np.ndarray:
        """How many moves lead each episode from its start to its stopping place: (B,)."""
        return self.best + self._settles.sum(0)

    def way(self, b: int) -> np.ndarray:
        """Return the path of an episode from its start to its stopping place: (moves + 1, 2), metres."""
        return np.concatenate([self.path[: self.best[b] + 1, b], self.settling[1:, b][self._settles[:, b]]])

    @cached_property
    def _settles(self) -> np.ndarray:
        """Whether an episode moves in a step of its settling: (S - 1, B)."""
        return (np.diff(self.settling, axis=0) != 0).any(-1)

    def choices(self, count: int) -> np.ndarray:
        """The agent's first, second, ... stopping place: (B, count, 2), metres. Real designs leave a choice open.

        After the first come positions of the path whose value is a local maximum, the highest first, at least DISTINCT
        apart from all chosen before. The first is repeated where there are fewer.
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
class MeanQ:
    """Q of a network, on average over the views of a room (`symmetries`), in all of which a design is as good."""

    network: nn.Module
    symmetries: Sequence[Symmetry]

    @property
    def device(self) -> torch.device:
        """Where the network is."""
        return next(self.network.parameters()).device

    def best_moves(
        self,
        simulator: ItemSimulator,
        observe: Observe,
        room: np.ndarray | Tensor,
        position: np.ndarray | Tensor,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The legal move of highest Q from positions (B, 2) in rooms or scenes (B, ...), and that Q: (B,) each.

        The Q is what the agent thinks of a position; -inf where no move is legal.
        """
        rooms, here = (torch.as_tensor(array, device=simulator.device) for array in (room, position))
        _, legal = simulator.reach(rooms, here)
        highest, action = self(observe, rooms, here).masked_fill(~legal, -torch.inf).max(1)
        return action.cpu().numpy(), highest.cpu().numpy()

    def __call__(self, observe: Observe, rooms: Tensor, positions: Tensor) -> Tensor:
        """Return Q(s, a), (B, A): the mean over views of the Q of what each move becomes there."""
        blocks = zip(*(each.split(BLOCK // len(self.symmetries)) for each in (rooms, positions)), strict=True)
        return torch.cat([self._over_views(observe, observe(*block)) for block in blocks])

    @torch.no_grad()
    def _over_views(self, observe: Observe, observation: Tensor) -> Tensor:
        seen = torch.cat([in_view(observe, s, observation) for s in self.symmetries])
        views = zip(self.network(seen).tensor_split(len(self.symmetries)), self.symmetries, strict=True)
        return torch.stack([q[:, s.action] for q, s in views]).mean(0)


class Remembered:
    """A cache of Q, by which the network sees each pose once: episodes come to where they or others have been."""

    def __init__(self, q: MeanQ, observe: Observe):
        self._q, self._observe = q, observe
        self._row = dict[bytes, int]()  # in `_known`, of each room and position
        self._known: Tensor | None = None  # Q (poses, A)

    def __call__(self, rooms: Tensor, positions: Tensor) -> Tensor:
        """Q(s, a), (B, A), of positions (B, 2) in rooms or scenes (B, ...)."""
        poses = [pose.tobytes() for pose in torch.column_stack([rooms, positions]).cpu().numpy()]
        fresh = {pose: b for b, pose in enumerate(poses) if pose not in self._row}
        if fresh or self._known is None:
            b = list(fresh.values())
            q = self._q(self._observe, rooms[b], positions[b])
            self._known = q if self._known is None else torch.cat([self._known, q])
            self._row |= zip(fresh, range(len(self._row), len(self._known)), strict=True)
        return self._known[[self._row[pose] for pose in poses]]


def first_poses(
    simulator: ItemSimulator, room: np.ndarray | Tensor, starts: np.ndarray, moves: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the arrays of episodes before their first move, with space for `moves` moves.

    They are rooms (B, ...), paths (moves + 1, B, 2) that stay at the start, and values (moves + 1, B) of -inf.
    """
    path = snap(torch.as_tensor(starts, device=simulator.device)).repeat(moves + 1, 1, 1)
    value = torch.full(path.shape[:2], -torch.inf, device=simulator.device)
    return torch.as_tensor(room, device=simulator.device), path, value


def visited(path: Tensor, reached: Tensor) -> Tensor:
    """Whether places (B, A, 2) are on the way (T, B, 2) so far: (B, A)."""
    return (path[:, :, None] == reached).all(-1).any(0)
