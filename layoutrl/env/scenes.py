"""Whole rooms for the simulator of one item: a scene is a room in which one item moves among what stands now.

A row of integers replaces the index of a room, so that the code that learns to move one item also learns whole rooms.
Observations and moves of a scene are turned by quarters until the item faces right, or nearly so where walls lean. So
the agent learns one thing where it would learn four.
"""

from __future__ import annotations

import torch
from torch import Tensor

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import GRID
from layoutrl.env.observation import COS, EXTENT_X, EXTENT_Y, ITEM, SIN, X, Y
from layoutrl.env.reward import RewardTerms
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import STANDS, RoomsObservation, lying, moving_first_
from layoutrl.env.rooms_simulator import QUARTERS, State
from layoutrl.env.symmetry import Symmetry


class Scenes:
    """Moves and rewards of B poses at once, with the interface of `BatchSimulator`, in scenes int32 (B, columns).

    Columns: the room; the moving item; x and y of the N items' middles, in micrometres; the N items' quarters, -1 where
    one does not stand. The moving item's middle is not in the scene but given as position.
    Actions are those of `Moves`, turned with the item: "right" is ahead of it.
    """

    def __init__(self, simulator: BatchRoomsSimulator):
        self.simulator = simulator
        self.rooms = simulator.rooms
        self.moves = simulator.moves
        self.device = simulator.device
        self._items = simulator.ways.shape[1]  # N
        self.columns = 2 + 3 * self._items
        turned = [Symmetry(quarters, False, self.moves, self.device).action for quarters in range(QUARTERS)]
        self._turned = torch.stack(turned)  # (quarters, A): the action that each is in the room

    def of(self, state: State[Tensor]) -> Tensor:
        """Return the scenes (B, columns) of states; the moving item counts as standing."""
        moving = state.moving[:, None]
        quarter = state.quarter.masked_fill(~state.stands.scatter(1, moving, True), -1)
        middle = (state.center / GRID).round().scatter(1, moving[..., None].expand(-1, -1, 2), 0.0)
        return torch.cat([state.room[:, None], moving, middle.flatten(1), quarter], 1).int()

    def state(self, scene: Tensor, position: Tensor) -> State[Tensor]:
        """Return the states of scenes with the moving item at positions (B, 2)."""
        room, moving, *_ = scene.long().T
        middle, quarter = scene[:, 2:].split(2 * self._items, 1)
        center = (middle.double() * GRID).unflatten(1, (-1, 2))
        center = center.scatter(1, moving[:, None, None].expand(-1, 1, 2), position[:, None])
        return State(room, center, quarter.clamp(min=0).long(), quarter >= 0, moving)

    def turns(self, scene: Tensor) -> Tensor:
        """By how many quarters, rounded, the moving item is turned from facing right: int64 (B,)."""
        return self.simulator.turns[scene[:, 0].long(), scene[:, 1].long(), self.quarter(scene)]

    def quarter(self, scene: Tensor) -> Tensor:
        """Return the quarter of the moving item, as in State: int64 (B,)."""
        first = 2 + 2 * self._items
        return scene.gather(1, first + scene[:, 1:2].long())[:, 0].long()

    def starts(self, scene: Tensor, generator: torch.Generator) -> Tensor:
        """Positions (B, 2) drawn uniformly from all those at which the item lies in the envelope, as it is turned."""
        return self.simulator.one_item.starts(self._room_index(scene), generator)

    def starts_at(self, scene: Tensor, uniform: Tensor) -> Tensor:
        """Map random numbers from 0 to 1, float64 (3, B), to starts (B, 2): each is the same in any batch."""
        return self.simulator.one_item.starts_at(self._room_index(scene), uniform)

    def is_legal(self, scene: Tensor, position: Tensor) -> Tensor:
        """Whether the item lies within the envelope, walls included: bool (B,)."""
        return self.simulator.one_item.is_legal(self._room_index(scene), position)

    def reach(self, scene: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
        """How far every action leads, in metres, and whether it is legal: (B, A) each."""
        length, legal = self.simulator.steps(self.state(scene, position))
        action = self._turned[self.turns(scene)]
        return length.gather(1, action), legal.gather(1, action)

    def moved(self, scene: Tensor, position: Tensor, action: Tensor, length: Tensor) -> Tensor:
        """Return positions (B, 2) moved by `length` (B,) metres in the direction of each action (B,)."""
        action = self._turned[self.turns(scene), action]
        return self.simulator.one_item.moved(scene, position, action, length)

    def reward(self, scene: Tensor, position: Tensor) -> RewardTerms[Tensor]:
        """The reward of standing at `position`: terms of shape (B,)."""
        return self.simulator.reward(self.state(scene, position))

    def _room_index(self, scene: Tensor) -> Tensor:
        return self.simulator.room_index[scene[:, 0].long(), scene[:, 1].long(), self.quarter(scene)]


ItemSimulator = BatchSimulator | Scenes  # what moves one item of each of B rooms


def destinations(simulator: ItemSimulator, room: Tensor, here: Tensor) -> tuple[Tensor, Tensor]:
    """Where each action leads from positions (B, 2): (B, A, 2), and whether it is legal: (B, A)."""
    length, legal = simulator.reach(room, here)
    return led_to(simulator, room, here, length), legal


def led_to(simulator: ItemSimulator, room: Tensor, here: Tensor, length: Tensor) -> Tensor:
    """Where each action leads, by lengths (B, A) in metres, from positions (B, 2): (B, A, 2)."""
    actions = torch.arange(length.shape[1], device=length.device).repeat(len(here))
    whose, start = (t.repeat_interleave(length.shape[1], 0) for t in (room, here))
    return simulator.moved(whose, start, actions, length.flatten()).unflatten(0, length.shape)


class ScenesObservation:
    """The observation of scenes: float32 (B, elements, columns), the moving item first.

    The elements are those of `RoomsObservation`, turned with the item. Items that still wait stand nowhere: they are
    shown where the moving item is, with `item` 0, since it cannot meet them.
    """

    def __init__(self, scenes: Scenes, observe: RoomsObservation):
        self._scenes, self._observe = scenes, observe
        turns = [Symmetry(-k % QUARTERS, False, scenes.moves, scenes.device).matrix for k in range(QUARTERS)]
        self._back = torch.stack(turns)

    def __call__(self, scene: Tensor, position: Tensor) -> Tensor:
        """Observe poses: scene (B, columns), position (B, 2) in metres."""
        state = self._scenes.state(scene, position)
        elements = moving_first_(self._observe(state), state.moving)
        waits = elements[..., STANDS] == 0
        elements[..., X : Y + 1] = elements[..., X : Y + 1].where(~waits[..., None], elements[:, :1, X : Y + 1])
        elements[..., ITEM] *= ~waits

        turns = self._scenes.turns(scene)
        back = self._back[turns]
        for a, b in ((X, Y), (COS, SIN)):
            elements[..., a : b + 1] = torch.einsum("bij,bnj->bni", back, elements[..., a : b + 1])
        swapped = lying(elements) & (turns % 2 == 1)[:, None]
        sides = elements[..., EXTENT_X : EXTENT_Y + 1]
        elements[..., EXTENT_X : EXTENT_Y + 1] = torch.where(swapped[..., None], sides.flip(-1), sides)
        return elements

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """How the same scenes look mirrored and turned."""
        return self._observe.turned(observation, symmetry)
