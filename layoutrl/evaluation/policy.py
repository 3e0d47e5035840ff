"""Greedy rollouts: where the trained agent puts an item."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.agents.method import Method
from layoutrl.env.observation import Observe, out_of_line
from layoutrl.env.scenes import ItemSimulator, destinations, led_to
from layoutrl.env.simulator import Moves
from layoutrl.evaluation.gains_policy import GainsPolicy
from layoutrl.evaluation.rollout import MeanQ, Remembered, Rollout, first_poses, visited

SHORTLIST = 8  # places of an episode that may be the stopping place


@dataclass(frozen=True)
class GreedyPolicy:
    """The greedy policy of an agent, as it is tested.

    No move stays in place, so a plain greedy policy would end in a loop. This one never goes back to where it has been,
    and searches for `max_moves` moves. Then it returns to one of the SHORTLIST positions that it entered by the moves
    of highest Q: the one of the highest promise, which is the mean Q of the shortest moves into it from all sides. (The
    Q of one move errs by more than half a centimetre is worth.) From there it climbs by the shortest moves, at most
    `climbs` of them, to higher promises. Last, if it is no further than `snap` from being in line with something
    (`out_of_line`), it is put there, as people's drawing tools do. The designer's place is never consulted. With
    `on_illegal="stop"` (the paper's test rule, section 4.2) an illegal choice ends the episode; with `"mask"` the best
    legal move is taken.

    The value of a position is the Q of the move that led to it.
    """

    q: MeanQ
    max_moves: int
    on_illegal: Literal["stop", "mask"]
    climbs: int = 0
    snap: float = 0.0  # metres

    def rollout(
        self, simulator: ItemSimulator, observe: Observe, room: np.ndarray | Tensor, starts: np.ndarray
    ) -> Rollout:
        """Follow the policy in rooms or scenes (B, ...) from starts (B, 2), in metres."""
        began = time.perf_counter()
        rooms, path, value = first_poses(simulator, room, starts, self.max_moves)
        active = every = torch.arange(len(rooms), device=rooms.device)
        q_of = Remembered(self.q, observe)
        for t in range(self.max_moves):
            here = path[t, active]
            reached, legal = destinations(simulator, rooms[active], here)
            visited_before = visited(path[: t + 1, active], reached)
            closed = visited_before | ~legal if self.on_illegal == "mask" else visited_before & legal
            q = q_of(rooms[active], here)
            highest, action = q.masked_fill(closed, -torch.inf).max(1)
            goes_on = legal.gather(1, action[:, None]).squeeze(1) & highest.isfinite()
            active, action = active[goes_on], action[goes_on]
            if not len(active):
                break
            path[t + 1 :, active] = reached[goes_on, action]
            value[t + 1, active] = highest[goes_on]
        best, promise = self._most_promising(simulator, q_of, rooms, path, value)
        climb, promise = self._climb(simulator, q_of, rooms, path[best, every], promise)
        promise = promise.where(promise.isfinite(), value[best, every])  # where no shortest move leads
        in_line = self._in_line(simulator, observe, rooms, climb[-1])
        return Rollout.of(began, path, value, best, torch.cat([climb, in_line[None]]), promise)

    def _most_promising(
        self, simulator: ItemSimulator, q_of: Remembered, rooms: Tensor, path: Tensor, value: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the index in the path (T + 1, B, 2) of the SHORTLIST position that promises most, and its promise.

        (B,) each; for an episode without a move, those of the start.
        """
        raw, which = value.topk(min(SHORTLIST, len(value)), 0)
        which = which.where(raw.isfinite(), 0)
        place = path.gather(0, which[..., None].expand(-1, -1, 2)).flatten(0, 1)
        promise = self._promise(simulator, q_of, torch.cat([rooms] * len(which)), place).view_as(which)
        ranked = promise.where(promise.isfinite(), raw).where(raw.isfinite(), -torch.inf)
        best = ranked.argmax(0, keepdim=True)
        return which.gather(0, best).squeeze(0), promise.gather(0, best).squeeze(0)

    def _climb(
        self, simulator: ItemSimulator, q_of: Remembered, rooms: Tensor, place: Tensor, promise: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Climb from places (B, 2) with their `promise` (B,); return the places passed, (climbs + 1, B, 2), in metres,
        and the promise of the last (B,)."""
        climb, promise = place.repeat(self.climbs + 1, 1, 1), promise.clone()
        active = torch.arange(len(place), device=place.device)
        for t in range(self.climbs):
            beside, legal = _beside(simulator, rooms[active], climb[t, active])
            whose = rooms[active].repeat_interleave(4, 0)
            promised = self._promise(simulator, q_of, whose, beside.flatten(0, 1)).view_as(legal)
            highest, way = promised.masked_fill(~legal, -torch.inf).max(1)
            higher = (highest > promise[active]).nonzero().squeeze(1)
            if not len(higher):
                break
            active = active[higher]
            climb[t + 1 :, active], promise[active] = beside[higher, way[higher]], highest[higher]
        return climb, promise

    def _in_line(self, simulator: ItemSimulator, observe: Observe, rooms: Tensor, place: Tensor) -> Tensor:
        """Move places (B, 2) into the nearest line along each axis, where no further than `snap` and legal: (B, 2)."""
        if not self.snap:
            return place
        off = out_of_line(observe(rooms, place)).double()
        for way, (ahead, back) in zip(off.T, ((0, 1), (3, 2)), strict=True):  # right or left, up or below
            near = way.abs() <= self.snap
            action, length = torch.where(way > 0, ahead, back), way.abs().where(near, 0.0)
            there = simulator.moved(rooms, place, action, length)
            place = there.where((near & simulator.is_legal(rooms, there))[:, None], place)
        return place

    def _promise(self, simulator: ItemSimulator, q_of: Remembered, rooms: Tensor, place: Tensor) -> Tensor:
        """Return the mean Q of the shortest moves into places (B, 2) from all sides: (B,), -inf where there is none."""
        around, legal = _beside(simulator, rooms, place)
        b, way = legal.nonzero().unbind(1)
        back = _shortest(simulator.moves) + (way ^ 1)
        q = q_of(rooms[b], around[b, way]).gather(1, back[:, None]).squeeze(1)
        total = q.new_zeros(len(place)).index_add_(0, b, q)
        return (total / legal.sum(1)).where(legal.any(1), -torch.inf)


def _beside(simulator: ItemSimulator, rooms: Tensor, place: Tensor) -> tuple[Tensor, Tensor]:
    """Where the shortest moves lead from places (B, 2), right, left, below and up (B, 4, 2), and which are legal."""
    first = _shortest(simulator.moves)
    length, legal = (reach[:, first : first + 4] for reach in simulator.reach(rooms, place))
    return led_to(simulator, rooms, place, length), legal


def _shortest(moves: Moves) -> int:
    """Return the action index of the first of the four shortest moves."""
    return 4 * int(np.argmin(moves.steps))


Policy = GreedyPolicy | GainsPolicy


def greedy(network: nn.Module, method: Method) -> Policy:
    """The policy of a Q-network, as the method tests it."""
    q = MeanQ(network, method.views(next(network.parameters()).device))
    if method.every_move:
        return GainsPolicy(q, method.evaluation_moves, method.discount)
    return GreedyPolicy(q, method.evaluation_moves, method.on_illegal, method.climbs, method.snap)
