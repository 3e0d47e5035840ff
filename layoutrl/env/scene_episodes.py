"""Many rooms that are furnished at once, item after item; where all has been placed, another room begins."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.episodes import Step
from layoutrl.env.geometry import snap
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.scenes import Scenes

SETTLING = 0.3  # share of an item's moves, the last, in which nothing is drawn: where it ends is the agent's own choice
ANY_ORDER = 1.0  # of the logarithm of a footprint: the largest waiting item is seldom not among the next
REACH = 0.4  # metres, a standard deviation: how near to the designer's place is near
LEFT = 0.25  # share of rooms that are left after an item: the first items, of which least is known, come most often
LEFT_FURNISHED = 0.5  # and of those in which all stands, after each item that was placed again


class SceneEpisodes:
    """B rooms that are furnished in parallel; `room` (B, columns), the scenes, `position` and `legal` are their state.

    An item moves for `max_moves` moves, from a place and a facing that are drawn; a `near` share of them begin near the
    designer's place, as the designer turned them. Then the next is taken: one of those that wait, the larger the
    sooner, or, where all stand, any of them once more; or another room begins. Rooms are furnished as the designer has
    them, where every item goes to the designer's place before the next is taken; or by the agent itself, whose mistakes
    stay: an `own` share of them, as far as it does not explore. Rooms have designs.
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
        self._max_moves = max_moves
        self._generator = generator
        self._age = ages.copy()  # kept on the host, as in Episodes
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
        every = torch.arange(len(ages), device=device)
        self._own = torch.zeros(len(ages), dtype=torch.bool, device=device)
        self.room = torch.zeros(len(ages), scenes.columns, dtype=torch.int32, device=device)
        self.position = torch.zeros(len(ages), 2, dtype=torch.float64, device=device)
        self._take(every, self._empty(len(ages)))
        self._length, self.legal = scenes.reach(self.room, self.position)

    def exploring(self, epsilon: float) -> Tensor:
        """The probability of a drawn action in each room: none in the last moves of an item."""
        self._keeps = 1 - epsilon
        settles = self._age >= (1 - SETTLING) * self._max_moves
        return torch.as_tensor(np.where(settles, 0.0, epsilon), dtype=torch.float32).to(self._scenes.device)

    def step(self, action: Tensor) -> Step:
        """Make one move (B,) each."""
        scenes, index = self._scenes, action[:, None]
        legal = self.legal.gather(1, index).squeeze(1)
        moved = scenes.moved(self.room, self.position, action, self._length.gather(1, index).squeeze(1))
        next_position = torch.where(legal[:, None], moved, self.position)
        terms = scenes.reward(self.room, next_position)
        self._age += 1
        ended = np.flatnonzero(self._age >= self._max_moves)
        length, next_legal = scenes.reach(self.room, next_position)
        step = Step(
            self.room, self.position, action, legal, next_position, next_legal, terms, torch.zeros_like(legal),
            torch.as_tensor(ended).to(scenes.device, non_blocking=True),
        )  # fmt: skip
        self.position, self._length, self.legal = next_position, length, next_legal
        if len(ended):
            self._go_on(step.ended)
            self._age[ended] = 0
        return step

    def state_dict(self) -> dict[str, Any]:
        """Where every room is, and what is drawn next."""
        return {
            "room": self.room,
            "position": self.position,
            "own": self._own,
            "keeps": self._keeps,
            "age": self._age.tolist(),
            "generator": self._generator.get_state(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from where others were."""
        device = self._scenes.device
        self.room, self.position, self._own = (state[name].to(device) for name in ("room", "position", "own"))
        self._keeps = state["keeps"]
        self._age = np.array(state["age"])
        self._generator.set_state(state["generator"].cpu())
        self._length, self.legal = self._scenes.reach(self.room, self.position)

    def _go_on(self, ended: Tensor) -> None:
        """Take the next items of rooms, or begin others."""
        state = self._scenes.state(self.room[ended], self.position[ended])
        own = self._own[ended]
        stands, count = state.stands, (self._size[state.room] > -torch.inf).sum(1)
        state = State(
            state.room,
            state.center.where(own[:, None, None], self._designed_center[state.room]),
            state.quarter.where(own[:, None], self._designed_quarter[state.room]),
            stands,
            state.moving,
        )
        complete = stands.sum(1) == count
        begins = self._uniform(len(ended)) < torch.where(complete, LEFT_FURNISHED, LEFT)
        fresh = self._empty(len(ended))
        state = State(
            *(
                torch.where(begins.view(-1, *[1] * (new.dim() - 1)), new, old)
                for new, old in zip(fresh, state, strict=True)
            )
        )
        self._own[ended] = torch.where(begins, self._uniform(len(ended)) < self._own_share * self._keeps, own)
        self._take(ended, state)
        length, legal = self._scenes.reach(self.room[ended], self.position[ended])
        self._length = self._length.index_copy(0, ended, length)
        self.legal = self.legal.index_copy(0, ended, legal)

    def _empty(self, count: int) -> State[Tensor]:
        """Rooms in which nothing stands."""
        drawn = torch.randint(len(self._rooms), (count,), generator=self._generator, device=self._scenes.device)
        room = self._rooms[drawn]
        nowhere = torch.zeros_like(self._designed_center[room])
        quarter = torch.zeros_like(self._designed_quarter[room])
        return State(room, nowhere, quarter, quarter > 0, torch.zeros_like(room))

    def _take(self, which: Tensor, state: State[Tensor]) -> None:
        """Let the next item of states move: the scenes and positions of `which` (n,) episodes."""
        scenes = self._scenes
        size = self._size[state.room]
        waits = (size > -torch.inf) & ~state.stands
        complete = ~waits.any(1, keepdim=True)
        free = torch.where(complete, size > -torch.inf, waits)
        chance = -(-self._uniform(*size.shape).clamp(1e-9, 1 - 1e-9).log()).log()  # Gumbel
        drawn = chance * ANY_ORDER + size.where(~complete, 0.0)
        moving = drawn.masked_fill(~free, -torch.inf).argmax(1)
        fits = scenes.simulator.entry[state.room, moving] >= 0
        quarter = self._uniform(*fits.shape).masked_fill(~fits, -1.0).argmax(1)
        near = self._uniform(len(which)) < self._near_share
        quarter = torch.where(near, self._designed_quarter[state.room, moving], quarter)
        quarters = state.quarter.scatter(1, moving[:, None], quarter[:, None])
        scene = scenes.of(state._replace(moving=moving, quarter=quarters))
        anywhere = scenes.starts(scene, self._generator)
        off = REACH * torch.randn(anywhere.shape, generator=self._generator, device=anywhere.device).double()
        beside = snap(self._designed_center[state.room, moving] + off)
        position = torch.where((near & scenes.is_legal(scene, beside))[:, None], beside, anywhere)
        # New tensors: the step that was made keeps the old ones.
        self.room = self.room.index_copy(0, which, scene)
        self.position = self.position.index_copy(0, which, position)

    def _uniform(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self._generator, device=self._scenes.device)
