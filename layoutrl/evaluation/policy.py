"""Greedy rollouts: where the trained agent puts an item."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.agents.dqn import Observe
from layoutrl.agents.gains import gains
from layoutrl.agents.method import Method
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import snap
from layoutrl.env.observation import out_of_line
from layoutrl.env.scenes import Scenes, led_to
from layoutrl.env.simulator import Moves
from layoutrl.env.symmetry import Symmetry

DISTINCT = 0.1  # metres: places nearer to each other are one choice
SHORTLIST = 8  # places of an episode that may be the stopping place
FRUITLESS = 120  # moves in a row that gain nothing end an episode, where Q is of what moves gain: a room's length
BLOCK = 500  # observations shown to the network at once: on a CPU, a larger block waits for memory


@dataclass(frozen=True)
class Rollout:
    """B greedy episodes: the way of each, and where it ends."""

    room: np.ndarray  # (B,) index
    path: np.ndarray  # (T + 1, B, 2), metres; an episode that ended stays where it was
    value: np.ndarray  # (T + 1, B): Q of the move that led to each position, or what was gained; -inf after the end
    best: np.ndarray  # (B,) the position of the path that it goes back to when it has looked enough
    settling: np.ndarray  # (S, B, 2), metres: how it settles from there; stays where it ends
    seconds: float

    @property
    def final(self) -> np.ndarray:
        """The stopping places (B, 2), in metres."""
        return self.settling[-1]

    @property
    def moves(self) -> np.ndarray:
        """Of each episode until the stopping place is reached (B,)."""
        return self.best + self._settles.sum(0)

    def way(self, b: int) -> np.ndarray:
        """From the start of an episode to its stopping place: (moves + 1, 2), metres."""
        return np.concatenate([self.path[: self.best[b] + 1, b], self.settling[1:, b][self._settles[:, b]]])

    @cached_property
    def _settles(self) -> np.ndarray:
        """Whether an episode moves in a step of its settling: (S - 1, B)."""
        return (np.diff(self.settling, axis=0) != 0).any(-1)

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
class GreedyPolicy:
    """The greedy policy of an agent, as it is tested.

    There is no move that stays, so that it would end in a loop; instead it never goes back to where it has been, and
    looks further for `max_moves` moves. Of the SHORTLIST places that it entered by the moves of highest Q, it goes back
    to the one that promises most: the Q of the shortest moves into it, on average of all around, as that of one move
    errs by more than half a centimetre is worth. From there it climbs by the shortest moves, `climbs` of them at most,
    to what promises more. Last, where it is no further than `snap` from being in line with something (`out_of_line`),
    it is put there, as people's drawing tools do. The designer's place is never consulted. Q is the mean over the
    `symmetries`, in whose views a design is as good. With `on_illegal="stop"` (the paper's test rule, section 4.2) an
    illegal choice ends the episode; with `"mask"` the best legal move is taken.

    Where Q is of what moves gain (`EveryMove`), it is near zero at the best of places. Then it goes back to the place
    of its path of the highest sum of gains, and looks no further once FRUITLESS moves in a row have not raised it. A
    move gained its Q, less the discounted Q of what is left where it leads; on average of the move and the one back, as
    what both err in alike cancels.
    """

    network: nn.Module
    max_moves: int
    on_illegal: Literal["stop", "mask"]
    symmetries: Sequence[Symmetry]
    climbs: int = 0
    snap: float = 0.0  # metres
    gains_discount: float | None = None  # where Q is of what moves gain: the discount that it was learned with

    @property
    def device(self) -> torch.device:
        """Where the network is."""
        return next(self.network.parameters()).device

    def rollout(
        self, simulator: BatchSimulator | Scenes, observe: Observe, room: np.ndarray | Tensor, starts: np.ndarray
    ) -> Rollout:
        """Follow the policy in rooms (B,) from starts (B, 2)."""
        began = time.perf_counter()
        device, batch = simulator.device, len(room)
        path = snap(torch.as_tensor(starts, device=device)).repeat(self.max_moves + 1, 1, 1)
        value = torch.full((self.max_moves + 1, batch), -torch.inf, device=device)
        active, rooms = torch.arange(batch, device=device), torch.as_tensor(room, device=device)
        made = torch.zeros(batch, 1, dtype=torch.int64, device=device)
        promised = left = torch.zeros(batch, device=device)  # by the move that is made; where it starts
        looks_back = self.gains_discount is not None  # what a move gained is known once it is made: one look more
        for t in range(self.max_moves + looks_back):
            here = path[t, active]
            length, legal = simulator.reach(rooms[active], here)
            reached = led_to(simulator, rooms[active], here, length)
            been_there = (path[: t + 1, active, None] == reached).all(-1).any(0)
            closed = been_there | ~legal if self.on_illegal == "mask" else been_there & legal
            q = self.values(observe, rooms[active], here)
            if self.gains_discount is not None:
                q = gains(q, legal)
                before, left = left, self.gains_discount * q.masked_fill(~legal, -torch.inf).amax(1)
                left = left.where(legal.any(1), 0.0)
                gained, lost = promised - left, q.gather(1, made ^ 1).squeeze(1) - before
                value[t, active] = value[t - 1, active] + (gained - lost) / 2 if t else 0.0
                closed |= (t - value[: t + 1, active].argmax(0) >= FRUITLESS)[:, None]
            highest, action = q.masked_fill(closed, -torch.inf).max(1, keepdim=True)
            goes_on = (legal.gather(1, action) & highest.isfinite()).squeeze(1)
            active, action = active[goes_on], action[goes_on].squeeze(1)
            if not len(active):
                break
            path[t + 1 :, active] = reached[goes_on, action]
            made, promised, left = action[:, None], highest[goes_on].squeeze(1), left[goes_on]
            if self.gains_discount is None:
                value[t + 1, active] = promised
        best, promise = self._most_promising(simulator, observe, rooms, path, value)
        climb = self._climb(simulator, observe, rooms, path[best, torch.arange(batch, device=device)], promise)
        in_line = self._in_line(simulator, observe, rooms, climb[-1])
        found = (rooms, path, value, best, torch.cat([climb, in_line[None]]))
        room, way, values, which, settling = (each.cpu().numpy() for each in found)
        return Rollout(room, way, values, which, settling, time.perf_counter() - began)

    def _most_promising(
        self, simulator: BatchSimulator | Scenes, observe: Observe, rooms: Tensor, path: Tensor, value: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Which position of the path (T + 1, B, 2) of each episode promises most, of the SHORTLIST, and how much.

        (B,) each; of an episode without a move the start.
        """
        if self.gains_discount is not None:
            promise, best = value.max(0)
            return best, promise
        raw, which = value.topk(min(SHORTLIST, len(value)), 0)
        which = which.where(raw.isfinite(), 0)
        place = path.gather(0, which[..., None].expand(-1, -1, 2)).flatten(0, 1)
        promise = self._promise(simulator, observe, torch.cat([rooms] * len(which)), place).view_as(which)
        ranked = promise.where(promise.isfinite(), raw).where(raw.isfinite(), -torch.inf)
        best = ranked.argmax(0, keepdim=True)
        return which.gather(0, best).squeeze(0), promise.gather(0, best).squeeze(0)

    def _climb(
        self, simulator: BatchSimulator | Scenes, observe: Observe, rooms: Tensor, place: Tensor, promise: Tensor
    ) -> Tensor:
        """Where episodes climb from places (B, 2) that promise so much (B,): (climbs + 1, B, 2), metres."""
        climb = place.repeat(self.climbs + 1, 1, 1)
        active = torch.arange(len(place), device=place.device)
        for t in range(self.climbs):
            beside, legal = _beside(simulator, rooms[active], climb[t, active])
            whose = rooms[active].repeat_interleave(4, 0)
            promised = self._promise(simulator, observe, whose, beside.flatten(0, 1)).view_as(legal)
            highest, way = promised.masked_fill(~legal, -torch.inf).max(1)
            higher = (highest > promise[active]).nonzero().squeeze(1)
            if not len(higher):
                break
            active = active[higher]
            climb[t + 1 :, active], promise[active] = beside[higher, way[higher]], highest[higher]
        return climb

    def _in_line(self, simulator: BatchSimulator | Scenes, observe: Observe, rooms: Tensor, place: Tensor) -> Tensor:
        """Places (B, 2) moved into the nearest line along each axis, where that is no further than `snap`: (B, 2)."""
        if not self.snap:
            return place
        off = out_of_line(observe(rooms, place)).double()
        for way, (ahead, back) in zip(off.T, ((0, 1), (3, 2)), strict=True):  # right or left, up or below
            near = way.abs() <= self.snap
            action, length = torch.where(way > 0, ahead, back), way.abs().where(near, 0.0)
            there = simulator.moved(rooms, place, action, length)
            place = there.where((near & simulator.is_legal(rooms, there))[:, None], place)
        return place

    def _promise(self, simulator: BatchSimulator | Scenes, observe: Observe, rooms: Tensor, place: Tensor) -> Tensor:
        """What the shortest moves into places (B, 2) are worth, on average of all around: (B,), -inf where none is."""
        around, legal = _beside(simulator, rooms, place)
        if not legal.any():
            return torch.full((len(place),), -torch.inf, device=place.device)
        b, way = legal.nonzero().unbind(1)
        # What is around one place is around others, too: each is looked at once.
        seen, which = torch.column_stack([rooms[b], around[b, way]]).unique(dim=0, return_inverse=True)
        seen_room, seen_from = seen[:, :-2].to(rooms.dtype).view(len(seen), *rooms.shape[1:]), seen[:, -2:]
        q = self.values(observe, seen_room, seen_from)[which, _shortest(simulator.moves) + (way ^ 1)]  # the move back
        total = q.new_zeros(len(place)).index_add_(0, b, q)
        return (total / legal.sum(1)).where(legal.any(1), -torch.inf)

    def best_moves(
        self,
        simulator: BatchSimulator | Scenes,
        observe: Observe,
        room: np.ndarray | Tensor,
        position: np.ndarray | Tensor,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The legal move of highest Q from positions (B, 2) in rooms or scenes (B, ...), and that Q: (B,) each.

        The Q is what the agent thinks of a position; -inf where no move is legal.
        """
        rooms, here = (torch.as_tensor(array, device=simulator.device) for array in (room, position))
        _, legal = simulator.reach(rooms, here)
        highest, action = self.values(observe, rooms, here).masked_fill(~legal, -torch.inf).max(1)
        return action.cpu().numpy(), highest.cpu().numpy()

    def values(self, observe: Observe, rooms: Tensor, positions: Tensor) -> Tensor:
        """Q(s, a), (B, A): the mean over views of the room, each move taken for what it is in the view."""
        blocks = zip(*(each.split(BLOCK // len(self.symmetries)) for each in (rooms, positions)), strict=True)
        return torch.cat([self._mean_over_views(observe, observe(*block)) for block in blocks])

    @torch.no_grad()
    def _mean_over_views(self, observe: Observe, observation: Tensor) -> Tensor:
        seen = torch.cat([observe.turned(observation, s) for s in self.symmetries])
        views = zip(self.network(seen).split(len(observation)), self.symmetries, strict=True)
        return torch.stack([q[:, s.action] for q, s in views]).mean(0)


def _beside(simulator: BatchSimulator | Scenes, rooms: Tensor, place: Tensor) -> tuple[Tensor, Tensor]:
    """Where the shortest moves lead from places (B, 2), right, left, below and up (B, 4, 2), and which are legal."""
    first = _shortest(simulator.moves)
    length, legal = (reach[:, first : first + 4] for reach in simulator.reach(rooms, place))
    return led_to(simulator, rooms, place, length), legal


def _shortest(moves: Moves) -> int:
    """The first of the four shortest moves."""
    return 4 * int(np.argmin(moves.steps))


def greedy(network: nn.Module, method: Method) -> GreedyPolicy:
    """The policy of a Q-network, as the method tests it."""
    views = method.views(next(network.parameters()).device)
    discount = method.discount if method.every_move else None
    return GreedyPolicy(
        network, method.evaluation_moves, method.on_illegal, views, method.climbs, method.snap, discount
    )
