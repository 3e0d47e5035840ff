"""A replay buffer that stores poses in rooms, from which observations are made anew."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from layoutrl.agents.method import MOST_ACTIONS
from layoutrl.env.geometry import GRID


class Transitions(NamedTuple):
    """B transitions (S, A, R, S'), with states as poses; section 4.4 of Di & Yu 2021."""

    room: Tensor  # int64 (B,), or scenes, integers (B, columns)
    position: Tensor  # float64 (B, 2), metres, before the move
    action: Tensor  # integers (B,); uint8 as they are drawn
    reward: Tensor  # float32 (B,), divided by the reward scale
    discount: Tensor  # float32 (B,): gamma, or 0 where the episode terminated; of repeated moves their product
    next_position: Tensor  # float64 (B, 2)
    next_legal: Tensor  # bool (B, A): the moves that are legal from there


class Replay:
    """The last `capacity` transitions, drawn uniformly with replacement.

    Positions are stored exactly, as whole micrometres (the simulator's grid), and legal moves as the bits
    of one integer: 33 bytes a transition, against 98,304 for two pictures. The index of a room takes four
    of them; a scene, of shape `scene` = (columns,), takes four for each column instead.

    Raises ValueError for more than MOST_ACTIONS actions.
    """

    def __init__(self, capacity: int, actions: int, device: torch.device | str = "cpu", scene: tuple[int, ...] = ()):
        if actions > MOST_ACTIONS:
            raise ValueError(f"expected at most {MOST_ACTIONS} actions, one bit each; got {actions}")
        self._columns = (
            torch.zeros(capacity, *scene, dtype=torch.int32, device=device),
            torch.zeros(capacity, 2, dtype=torch.int32, device=device),
            torch.zeros(capacity, dtype=torch.uint8, device=device),
            torch.zeros(capacity, dtype=torch.float32, device=device),
            torch.zeros(capacity, dtype=torch.float32, device=device),
            torch.zeros(capacity, 2, dtype=torch.int32, device=device),
            torch.zeros(capacity, dtype=torch.int32, device=device),
        )
        self._bit = 1 << torch.arange(actions, dtype=torch.int32, device=device)
        self._next = 0
        self.device = torch.device(device)
        self.capacity = capacity
        self.size = 0

    @property
    def bytes_per_transition(self) -> int:
        """Bytes that one transition takes."""
        return sum(column[0].numel() * column.element_size() for column in self._columns)

    def add(self, transitions: Transitions) -> None:
        """Store B transitions; the oldest give way. Raises ValueError where B exceeds the capacity."""
        count = len(transitions.room)
        if count > self.capacity:
            raise ValueError(f"expected at most {self.capacity} transitions at once; got {count}")
        slots = (self._next + torch.arange(count, device=self._bit.device)) % self.capacity
        stored = transitions._replace(
            position=(transitions.position / GRID).round(),
            next_position=(transitions.next_position / GRID).round(),
            next_legal=(transitions.next_legal * self._bit).sum(1),
        )
        for column, values in zip(self._columns, stored, strict=True):
            column[slots] = values.to(column)
        self._next = (self._next + count) % self.capacity
        self.size = min(self.size + count, self.capacity)

    def sample(self, count: int, generator: torch.Generator) -> Transitions:
        """Draw `count` transitions uniformly, with replacement."""
        index = torch.randint(self.size, (count,), generator=generator, device=self._bit.device)
        drawn = Transitions(*(column[index] for column in self._columns))
        return drawn._replace(
            room=drawn.room.long(),
            position=drawn.position.double() * GRID,
            next_position=drawn.next_position.double() * GRID,
            next_legal=(drawn.next_legal[:, None] & self._bit) != 0,
        )

    def state_dict(self) -> dict[str, Any]:
        """Return what is stored, and where the next transition goes."""
        # A copy of a part: saving a view would save the whole tensor behind it.
        columns = [c if self.size == self.capacity else c[: self.size].clone() for c in self._columns]
        return {"columns": columns, "next": self._next}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore what a buffer of the same capacity held."""
        self.size = len(state["columns"][0])
        self._next = state["next"]
        for column, stored in zip(self._columns, state["columns"], strict=True):
            column[: self.size] = stored
