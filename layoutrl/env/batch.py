"""The simulator as tensors: thousands of episodes step at once, exactly, on CPU or GPU.

The reference `Simulator` defines rooms, moves, rewards and envelopes. Areas and crossings are computed here in closed
form, from tables of its shapes.
"""

from __future__ import annotations

import numpy as np
import shapely
import torch
from torch import Tensor

from layoutrl.env.geometry import snap
from layoutrl.env.packed import Footprints, Lines, Shapes, Starts
from layoutrl.env.reward import RewardTerms
from layoutrl.env.simulator import DIRECTIONS, TOUCHING, Simulator
from layoutrl.rooms.fitting import edges


class BatchSimulator:
    """Moves and rewards of B poses at once in the rooms of a `Simulator`: room int64 (B,), position float64 (B, 2).

    Positions are metres on the grid, as in `Simulator`; areas and lengths are computed in `dtype`.
    `others`, where they are given, are footprints of what else stands in each room now and could stand elsewhere.
    Discs are true circles, where shapely has polygons of 256 corners.
    """

    def __init__(self, simulator: Simulator, device: torch.device | str = "cpu", dtype: torch.dtype = torch.float32):
        self.rooms = simulator.rooms
        self.moves = simulator.moves
        self.device = torch.device(device)
        self._reward = simulator.reward_function
        like = torch.empty(0, device=device, dtype=dtype)
        origin = shapely.bounds(simulator.legal).reshape(-1, 2, 2).mean(1)
        self._origin = torch.tensor(origin, device=device)
        self._designer_position = torch.tensor(simulator.designer_position, device=device)
        self._directions = torch.tensor(DIRECTIONS, device=device).double()
        self._signs = torch.tensor(DIRECTIONS.sum(1).reshape(2, 2, 1, 1)).to(like)  # (axis, direction, 1, 1)
        self._steps = torch.tensor(simulator.steps).to(like)
        self._around = torch.tensor(simulator.item_bounds[:, 2:]).to(like)  # half sides of the box around the item

        legal = _shifted(simulator.legal, -origin)
        shapes = _shifted(simulator.shapes, -origin[simulator.room_of_shape])
        self._starts = Starts(legal, self.device)
        borders, room = edges(legal)
        borders = borders.round(12)  # to picometres, so that what is level up to rounding is exactly level
        self._borders = Lines(borders, room, len(origin), 0.0, like)
        contacts = simulator.contacts - np.tile(origin, 2)[:, None]
        room, k = np.nonzero(~np.isnan(contacts[..., 0]))
        self._contacts = Lines(contacts[room, k], room, len(origin), TOUCHING, like)
        moving = [room.moving for room in self.rooms]
        self._shapes = Shapes(shapes, simulator.room_of_shape, simulator.is_circle, moving, like)

    def starts(self, room: Tensor, generator: torch.Generator) -> Tensor:
        """Positions (B, 2) drawn uniformly from all those at which the item lies in the envelope."""
        uniform = torch.rand(3, len(room), generator=generator, device=room.device, dtype=torch.float64)
        return self.starts_at(room, uniform)

    def starts_at(self, room: Tensor, uniform: Tensor) -> Tensor:
        """Map random numbers from 0 to 1, float64 (3, B), to starts (B, 2): each is the same in any batch."""
        return snap(self._origin.index_select(0, room) + self._starts.at(room, uniform))

    def is_legal(self, room: Tensor, position: Tensor) -> Tensor:
        """Whether the item lies within the envelope, walls included: bool (B,)."""
        along = self._from_origin(room, position)
        return _inside(self._borders.crossed(room, along.flip(1)), along.T[:, None])[0, 0]

    def reach(self, room: Tensor, position: Tensor, others: Footprints | None = None) -> tuple[Tensor, Tensor]:
        """How far every action leads, in metres, and whether it is legal: (B, A) each."""
        along = self._from_origin(room, position)
        across = along.flip(1)
        borders = self._borders.crossed(room, across)
        contacts = self._contacts.crossed(room, across) if self.moves.slide else None
        if contacts is not None and others is not None:
            origin, around = self._origin.index_select(0, room), self._around.index_select(0, room)
            contacts = torch.cat([contacts, others.lines(origin, around, across, TOUCHING)], 1)
        # From here on the batch is the last axis, which makes long rows.
        along, steps = along.T.contiguous(), self._steps.index_select(0, room).T
        reached = along[:, None, None] + self._signs * steps  # (axis, direction, steps, B)
        legal = _inside(borders, reached.flatten(1, 2)).unflatten(1, reached.shape[1:3])
        length, legal = steps.repeat_interleave(4, 0), legal.permute(2, 0, 1, 3).flatten(0, 2)
        if contacts is not None:
            slide, end = _ahead(contacts, along, TOUCHING), _ahead(borders, along, 0.0)
            # The next contact may lie beyond the outer walls: in a room with recesses, or behind an item.
            touches = slide < end
            length = torch.cat([length, slide.where(touches, 0.0)])
            legal = torch.cat([legal, touches])
        return length.T, legal.T

    def moved(self, room: Tensor, position: Tensor, action: Tensor, length: Tensor) -> Tensor:  # noqa: ARG002
        """Return positions (B, 2) moved by `length` (B,) metres in the direction of each action (B,).

        `room` is unused, since directions are the same in all rooms; those of `Scenes` depend on it.
        """
        return snap(position + self._directions[action % 4] * length[:, None])

    def reward(
        self,
        room: Tensor,
        position: Tensor,
        others: Footprints | None = None,
        target_iou: Tensor | None = None,
        floor_taken: Tensor | None = None,
    ) -> RewardTerms[Tensor]:
        """The reward of standing at `position`: terms of shape (B,).

        `target_iou` (B,), where given, replaces the IoU with the designer's place in the room. `floor_taken` (B,) is
        how much of the floor before items is taken, by default 0.
        """
        if target_iou is None:
            off_target = position - self._designer_position.index_select(0, room)
            target_iou = self._shapes.iou_with_itself(room, off_target)
        at, around = self._from(room, position, others)
        taken = torch.zeros_like(target_iou) if floor_taken is None else floor_taken
        return self._reward(target_iou, *self._shapes.ious(room, at, around), taken)

    def ious(self, room: Tensor, position: Tensor, footprints: Footprints) -> Tensor:
        """The item's IoU with each of K footprints: (B, K)."""
        at, around = self._from(room, position, footprints)
        assert around is not None
        return self._shapes.ious_with(room, at, around)

    def _from(self, room: Tensor, position: Tensor, footprints: Footprints | None) -> tuple[Tensor, Footprints | None]:
        """Return positions and footprints relative to the origins of their rooms."""
        origin = self._origin.index_select(0, room)
        if footprints is not None:
            footprints = footprints._replace(center=footprints.center - origin[:, None])
        return position - origin, footprints

    def _from_origin(self, room: Tensor, position: Tensor) -> Tensor:
        return (position - self._origin.index_select(0, room)).to(self._steps.dtype)


def _shifted(shapes: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Each shape moved by a vector of its own (n, 2)."""
    corners, shape = shapely.get_coordinates(shapes, return_index=True)
    return shapely.set_coordinates(shapes.copy(), corners + by[shape])


def _inside(borders: Tensor, places: Tensor) -> Tensor:
    """Return whether places (axis, n, B) on a line lie inside borders that cross it at (axis, lines, B).

    Inside, the number of borders before a place is odd.
    """
    return (borders[:, None] < places[:, :, None]).sum(2, dtype=torch.uint8).bitwise_and_(1).bool()


def _ahead(crossed: Tensor, along: Tensor, nearest: float) -> Tensor:
    """How far it is to the first line further than `nearest`, right, left, below and up: (4, B), infinity for none."""
    distance = crossed - along[:, None]  # (axis, lines, B)
    forward = distance.where(distance > nearest, torch.inf).amin(1)
    backward = distance.where(distance < -nearest, -torch.inf).amax(1).neg_()
    return torch.stack([forward[0], backward[0], backward[1], forward[1]])
