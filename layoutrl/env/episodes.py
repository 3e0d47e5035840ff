"""Many episodes at once, each of which begins anew in another room as soon as it ends."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.geometry import snap
from layoutrl.env.reward import RewardTerms
from layoutrl.env.scenes import ItemSimulator

NEAR_DEVIATIONS = (0.1, 0.3, 1.0)  # metres: standard deviations, equally likely, of starts near the designer's place


class Step(NamedTuple):
    """One move of each of B episodes, before any of them began anew."""

    room: Tensor  # int64 (B,), or scenes, int32 (B, columns)
    position: Tensor  # float64 (B, 2), before the move
    action: Tensor  # int64 (B,)
    legal: Tensor  # bool (B,): whether the move was legal; an illegal one is dropped and changes nothing
    next_position: Tensor  # float64 (B, 2)
    next_legal: Tensor  # bool (B, A): the moves that are legal from there
    terms: RewardTerms[Tensor]  # the reward at `next_position`, (B,)
    terminated: Tensor  # bool (B,): whether the goal is reached
    ended: Tensor  # int64 (n,): the episodes that terminated or were truncated
    whole: Tensor  # int64 (m,): those of `ended` that began at age 0, so that none of their moves is missing


class Episodes:
    """B parallel episodes in rooms drawn at random. Their state is `room`, `position` and `legal`, as in Step.

    An episode is truncated after `max_moves` moves and, with `goal_iou`, terminates at that IoU with the
    designer's footprint. `near` is the share of episodes that begin near the designer's places, and these places
    (rooms, 2), in metres; where the start drawn there is illegal, one is drawn from anywhere.
    `ages` (B,) are numbers of moves that count as made already: if staggered, episodes do not all end at once.
    """

    def __init__(
        self,
        simulator: ItemSimulator,
        ages: np.ndarray,
        max_moves: int,
        generator: torch.Generator,
        goal_iou: float | None = None,
        near: tuple[float, Tensor] | None = None,
    ):
        self._simulator = simulator
        self._max_moves = max_moves
        self._goal_iou = goal_iou
        self._near = near
        self._generator = generator
        self._age = ages.copy()  # on the host, so that truncation is known without waiting for the device
        self._whole = ages == 0
        self.room, self.position = self._drawn(len(ages))
        self._length, self.legal = simulator.reach(self.room, self.position)

    def explore_at(self, epsilon: float) -> float | Tensor:
        """Return the probability of a random action in the next step at this rate of exploration: here the rate."""
        return epsilon

    def step(self, action: Tensor) -> Step:
        """Make one move in each episode, int64 (B,). Episodes that end begin anew."""
        simulator, index = self._simulator, action[:, None]
        legal = self.legal.gather(1, index).squeeze(1)
        moved = simulator.moved(self.room, self.position, action, self._length.gather(1, index).squeeze(1))
        next_position = torch.where(legal[:, None], moved, self.position)
        terms = simulator.reward(self.room, next_position)
        length, next_legal = simulator.reach(self.room, next_position)
        self._age += 1
        truncated = self._age >= self._max_moves
        if self._goal_iou is None:
            terminated = torch.zeros_like(legal)
            ended = np.flatnonzero(truncated)
        else:
            terminated = terms.iou >= self._goal_iou
            ended = np.flatnonzero(truncated | terminated.cpu().numpy())
        whole = ended[self._whole[ended]]
        told = (torch.as_tensor(which).to(simulator.device, non_blocking=True) for which in (ended, whole))
        step = Step(self.room, self.position, action, legal, next_position, next_legal, terms, terminated, *told)
        self.position, self._length, self.legal = next_position, length, next_legal
        if len(ended):
            self._begin_anew(step.ended)
            self._age[ended], self._whole[ended] = 0, True
        return step

    def state_dict(self) -> dict[str, Any]:
        """Return the state of all episodes and of their random generator."""
        return {
            "room": self.room,
            "position": self.position,
            "age": self._age.tolist(),
            "whole": self._whole.tolist(),
            "generator": self._generator.get_state(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a state that `state_dict` returned."""
        self.stand_at(state["room"], state["position"])
        self._age = np.array(state["age"])
        self._whole = np.array(state["whole"])
        self._generator.set_state(state["generator"].cpu())

    def stand_at(self, room: Tensor, position: Tensor) -> None:
        """Put the items of all episodes elsewhere, into rooms (B,) at positions (B, 2)."""
        self.room, self.position = (where.to(self._simulator.device) for where in (room, position))
        self._length, self.legal = self._simulator.reach(self.room, self.position)

    def _begin_anew(self, ended: Tensor) -> None:
        room, position = self._following(ended)
        length, legal = self._simulator.reach(room, position)
        # New tensors: the step that was made keeps the old ones.
        self.room = self.room.index_copy(0, ended, room)
        self.position = self.position.index_copy(0, ended, position)
        self._length = self._length.index_copy(0, ended, length)
        self.legal = self.legal.index_copy(0, ended, legal)

    def _following(self, ended: Tensor) -> tuple[Tensor, Tensor]:
        """Return the rooms and positions in which the next episodes begin, one for each that ended."""
        return self._drawn(len(ended))

    def _drawn(self, count: int) -> tuple[Tensor, Tensor]:
        rooms, device = len(self._simulator.rooms), self._simulator.device
        room = torch.randint(rooms, (count,), generator=self._generator, device=device)
        anywhere = self._simulator.starts(room, self._generator)
        if self._near is None:
            return room, anywhere
        share, designed = self._near
        chance = torch.rand(2, count, generator=self._generator, device=device)
        deviation = torch.tensor(NEAR_DEVIATIONS, device=device)[(chance[0] * len(NEAR_DEVIATIONS)).long(), None]
        off = deviation * torch.randn(count, 2, generator=self._generator, device=device)
        beside = snap(designed[room] + off.double())
        begins_near = (chance[1] < share) & self._simulator.is_legal(room, beside)
        return room, torch.where(begins_near[:, None], beside, anywhere)
