"""Parallel episodes that furnish whole rooms, one item after the other."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.episodes import Episodes
from layoutrl.env.geometry import snap
from layoutrl.env.rooms_batch import either
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.scenes import Scenes

SETTLING = 0.3  # share of an item's moves, the last ones, without exploration: where it ends is the agent's own choice
NEAR_DEVIATION = 0.4  # metres: standard deviation of starts near the designer's place
LEAVE_SHARE = 0.25  # share of rooms left after each item: the first items, about which least is known, come most often
LEAVE_SHARE_FURNISHED = 0.5  # the same once all items stand


class SceneEpisodes(Episodes):
    """B rooms that are furnished in parallel. Their state is `room` (B, columns), the scenes, `position` and `legal`.

    An item moves for `max_moves` moves, from a random place and facing. A share `near` of items begin turned as the
    designer turned them, and near the designer's place where the start drawn there is legal. Then either another room
    begins, or the next item is taken: one of those that wait, larger ones sooner, or any of them again once all stand.

    A share `own`, times 1 - epsilon, of the rooms that begin is furnished by the agent: items stay where it left them,
    mistakes included. In all other rooms every item is put at the designer's place before the next is taken.

    Raises ValueError where a room has no design.
    """

    _simulator: Scenes

    def __init__(
        self,
        scenes: Scenes,
        rooms: RoomsSimulator,
        ages: np.ndarray,
        max_moves: int,
        generator: torch.Generator,
        *,
        near: float,
        own: float,
    ):
        self._near_share, self._own_share = near, own
        device = scenes.device
        center, quarter = rooms.designed()
        self._designed_center = torch.tensor(center, device=device)
        self._designed_quarter = torch.tensor(quarter, device=device)
        size = np.full(rooms.ways.shape, -np.inf)
        for r, items in enumerate(rooms.items):
            size[r, : len(items)] = [np.log(item.area) for item in items]
        self._size = torch.tensor(size, device=device)
        self._rooms = torch.tensor(np.flatnonzero(rooms.count), device=device)
        self._own = torch.zeros(len(ages), dtype=torch.bool, device=device)
        self._keeps = 0.0  # until `explore_at` sets it: of the rooms that begin, how many may keep the agent's mistakes
        super().__init__(scenes, ages, max_moves, generator)

    def explore_at(self, epsilon: float) -> Tensor:
        """Set the rate of exploration, before each step; return the probability of a random action, float32 (B,).

        It is `epsilon`, but 0 in the last moves of an item. The lower `epsilon` is, the more of the rooms that begin
        keep the agent's mistakes.
        """
        self._keeps = 1 - epsilon
        settles = self._age >= (1 - SETTLING) * self._max_moves
        return torch.as_tensor(np.where(settles, 0.0, epsilon), dtype=torch.float32).to(self._simulator.device)

    def state_dict(self) -> dict[str, Any]:
        """Return the state of all rooms and of their random generator."""
        return super().state_dict() | {"own": self._own}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a state that `state_dict` returned."""
        super().load_state_dict(state)
        self._own = state["own"].to(self._simulator.device)

    def _following(self, ended: Tensor) -> tuple[Tensor, Tensor]:
        """Take the next item of each room, or begin another room; return the scenes and starts."""
        state = self._simulator.state(self.room[ended], self.position[ended])
        own = self._own[ended]
        state = state._replace(
            center=state.center.where(own[:, None, None], self._designed_center[state.room]),
            quarter=state.quarter.where(own[:, None], self._designed_quarter[state.room]),
        )
        complete = state.stands.sum(1) == (self._size[state.room] > -torch.inf).sum(1)
        begins = self._uniform(len(ended)) < torch.where(complete, LEAVE_SHARE_FURNISHED, LEAVE_SHARE)
        fresh = self._empty(len(ended))
        state = either(begins, fresh, state)
        own = torch.where(begins, self._uniform(len(ended)) < self._own_share * self._keeps, own)
        self._own = self._own.index_copy(0, ended, own)  # a new tensor, since a saved state holds the old one
        return self._taken(state)

    def _drawn(self, count: int) -> tuple[Tensor, Tensor]:
        return self._taken(self._empty(count))

    def _empty(self, count: int) -> State[Tensor]:
        """Draw rooms with none of the items to place."""
        drawn = torch.randint(len(self._rooms), (count,), generator=self._generator, device=self._simulator.device)
        room = self._rooms[drawn]
        nowhere = torch.zeros_like(self._designed_center[room])
        quarter = torch.zeros_like(self._designed_quarter[room])
        return State(room, nowhere, quarter, torch.zeros_like(quarter, dtype=torch.bool), torch.zeros_like(room))

    def _taken(self, state: State[Tensor]) -> tuple[Tensor, Tensor]:
        """Take the next item of each state; return the scenes in which it moves and its starts (B, 2)."""
        scenes = self._simulator
        size = self._size[state.room]
        waits = (size > -torch.inf) & ~state.stands
        complete = ~waits.any(1, keepdim=True)
        free = torch.where(complete, size > -torch.inf, waits)
        chance = -(-self._uniform(*size.shape).clamp(min=1e-9).log()).log()  # Gumbel: larger items are likely the next
        drawn = chance + size.where(~complete, 0.0)
        moving = drawn.masked_fill(~free, -torch.inf).argmax(1)
        fits = scenes.simulator.room_index[state.room, moving] >= 0
        quarter = self._uniform(*fits.shape).masked_fill(~fits, -1.0).argmax(1)
        designed = self._designed_quarter[state.room, moving]
        # An item that the designer turned by less than a quarter may not fit in the quarter next to that.
        near = (self._uniform(len(moving)) < self._near_share) & fits.gather(1, designed[:, None])[:, 0]
        quarter = torch.where(near, designed, quarter)
        quarters = state.quarter.scatter(1, moving[:, None], quarter[:, None])
        scene = scenes.of(state._replace(moving=moving, quarter=quarters))
        anywhere = scenes.starts(scene, self._generator)
        off = NEAR_DEVIATION * torch.randn(anywhere.shape, generator=self._generator, device=anywhere.device).double()
        beside = snap(self._designed_center[state.room, moving] + off)
        return scene, torch.where((near & scenes.is_legal(scene, beside))[:, None], beside, anywhere)

    def _uniform(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self._generator, device=self._simulator.device)
