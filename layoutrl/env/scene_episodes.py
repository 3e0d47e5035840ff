"""Many rooms that are furnished at once, item after item; where all has been placed, another room begins."""

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

SETTLING = 0.3  # share of an item's moves, the last, in which nothing is drawn: where it ends is the agent's own choice
ANY_ORDER = 1.0  # of the logarithm of a footprint: the largest waiting item is seldom not among the next
REACH = 0.4  # metres, a standard deviation: how near to the designer's place is near
LEFT = 0.25  # share of rooms that are left after an item: the first items, of which least is known, come most often
LEFT_FURNISHED = 0.5  # and of those in which all stands, after each item that was placed again


class SceneEpisodes(Episodes):
    """B rooms that are furnished in parallel; `room` (B, columns), the scenes, `position` and `legal` are their state.

    An item moves for `max_moves` moves, from a place and a facing that are drawn; a `near` share of them are turned as
    the designer turned them, and begin near the designer's place where what is drawn there is legal. Then the next is
    taken: one of those that wait, the larger the sooner, or, where all stand, any of them once more; or another room
    begins. Rooms are furnished as the designer has them, where every item goes to the designer's place before the next
    is taken; or by the agent itself, whose mistakes stay: an `own` share of them, as far as it does not explore. Rooms
    have designs.
    """

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
        self._scenes = scenes
        self._near_share, self._own_share = near, own
        self._keeps = 0.0
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
        super().__init__(scenes, ages, max_moves, generator)

    def explore_by(self, epsilon: float) -> Tensor:
        """Explore so much from now on: the probability of a drawn action in each room, none in the last moves of an
        item. The less it is, the more of the rooms that begin keep the agent's mistakes."""
        self._keeps = 1 - epsilon
        settles = self._age >= (1 - SETTLING) * self._max_moves
        return torch.as_tensor(np.where(settles, 0.0, epsilon), dtype=torch.float32).to(self._scenes.device)

    def state_dict(self) -> dict[str, Any]:
        """Where every room is, and what is drawn next."""
        return super().state_dict() | {"own": self._own, "keeps": self._keeps}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from where others were."""
        super().load_state_dict(state)
        self._own, self._keeps = state["own"].to(self._scenes.device), state["keeps"]

    def _following(self, ended: Tensor) -> tuple[Tensor, Tensor]:
        """Take the next items of rooms, or begin others."""
        state = self._scenes.state(self.room[ended], self.position[ended])
        own = self._own[ended]
        state = state._replace(
            center=state.center.where(own[:, None, None], self._designed_center[state.room]),
            quarter=state.quarter.where(own[:, None], self._designed_quarter[state.room]),
        )
        complete = state.stands.sum(1) == (self._size[state.room] > -torch.inf).sum(1)
        begins = self._uniform(len(ended)) < torch.where(complete, LEFT_FURNISHED, LEFT)
        fresh = self._empty(len(ended))
        state = either(begins, fresh, state)
        own = torch.where(begins, self._uniform(len(ended)) < self._own_share * self._keeps, own)
        self._own = self._own.index_copy(0, ended, own)  # a new tensor: a state that was kept has the old one
        return self._taken(state)

    def _drawn(self, count: int) -> tuple[Tensor, Tensor]:
        return self._taken(self._empty(count))

    def _empty(self, count: int) -> State[Tensor]:
        """Rooms in which nothing stands."""
        drawn = torch.randint(len(self._rooms), (count,), generator=self._generator, device=self._scenes.device)
        room = self._rooms[drawn]
        nowhere = torch.zeros_like(self._designed_center[room])
        quarter = torch.zeros_like(self._designed_quarter[room])
        return State(room, nowhere, quarter, quarter > 0, torch.zeros_like(room))

    def _taken(self, state: State[Tensor]) -> tuple[Tensor, Tensor]:
        """The scenes and positions in which the next item of states moves."""
        scenes = self._scenes
        size = self._size[state.room]
        waits = (size > -torch.inf) & ~state.stands
        complete = ~waits.any(1, keepdim=True)
        free = torch.where(complete, size > -torch.inf, waits)
        chance = -(-self._uniform(*size.shape).clamp(min=1e-9).log()).log()  # Gumbel
        drawn = chance * ANY_ORDER + size.where(~complete, 0.0)
        moving = drawn.masked_fill(~free, -torch.inf).argmax(1)
        fits = scenes.simulator.entry[state.room, moving] >= 0
        quarter = self._uniform(*fits.shape).masked_fill(~fits, -1.0).argmax(1)
        designed = self._designed_quarter[state.room, moving]
        # What the designer turned by less than a quarter may fit in no way that is near to it.
        near = (self._uniform(len(moving)) < self._near_share) & fits.gather(1, designed[:, None])[:, 0]
        quarter = torch.where(near, designed, quarter)
        quarters = state.quarter.scatter(1, moving[:, None], quarter[:, None])
        scene = scenes.of(state._replace(moving=moving, quarter=quarters))
        anywhere = scenes.starts(scene, self._generator)
        off = REACH * torch.randn(anywhere.shape, generator=self._generator, device=anywhere.device).double()
        beside = snap(self._designed_center[state.room, moving] + off)
        return scene, torch.where((near & scenes.is_legal(scene, beside))[:, None], beside, anywhere)

    def _uniform(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self._generator, device=self._scenes.device)
