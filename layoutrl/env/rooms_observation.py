"""What is seen of a whole room: its shell, what stands, what moves, and what is still to come.

Nothing of it is read from the designer's layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor

from layoutrl.env.geometry import padded
from layoutrl.env.observation import (
    COLUMNS,
    COS,
    COS2,
    EXTENT_X,
    EXTENT_Y,
    ITEM,
    LIMIT,
    PRESENT,
    SIN,
    SIN2,
    X,
    Y,
    elements_of,
    elements_turned,
    enough,
    items_described,
)
from layoutrl.env.rooms_simulator import QUARTERS, RoomsSimulator, State
from layoutrl.env.symmetry import Symmetry
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import middles

MOVING = COLUMNS.index("moving")
ROOM_COLUMNS = (*COLUMNS, "stands", "tucked")  # one column per known furniture category follows
STANDS, TUCKED = len(COLUMNS), len(COLUMNS) + 1


class RoomsObservation:
    """The state as a set of elements, float32 (B, elements, columns): the N items to place, then what never moves.

    Columns are those of GeometryObservation with `stands` and `tucked` before the categories. An item that does not
    stand yet has x and y 0. If its rotation is given, it is shown turned so; if not, its extents are those that it has
    with rotation 0, its depth along x and its width along y, and the columns of its rotation and facing are 0. There
    are `elements` rows, as in GeometryObservation.

    Raises InputError where rooms need more rows than are given.
    """

    def __init__(
        self,
        simulator: RoomsSimulator,
        categories: Sequence[str] | None = None,
        device: torch.device | str = "cpu",
        elements: int | None = None,
    ):
        rooms = simulator.rooms
        names = list(categories_of(rooms) if categories is None else categories)
        origin = middles(rooms)
        shells = [replace(room, target=None) for room in rooms]
        shell, of = elements_of(shells, names, origin)
        shell = np.insert(np.nan_to_num(padded(shell, of, len(rooms))), [STANDS, STANDS], 0.0, axis=2)
        shell[..., STANDS] = shell[..., PRESENT]

        rows, most = simulator.room_index.shape[:2]
        total = enough(elements, most + shell.shape[1])
        shell = np.pad(shell, ((0, 0), (0, total - most - shell.shape[1]), (0, 0)))
        items = np.zeros((rows, most, QUARTERS, len(ROOM_COLUMNS) + len(names)))
        waiting = np.zeros((rows, most, 2))
        given = np.zeros((rows, most), dtype=bool)
        for r, those in enumerate(simulator.items):
            if those:
                for q in range(QUARTERS):
                    shown = items_described(those, simulator.degrees[r, : len(those), q])
                    items[r, : len(those), q, EXTENT_X : SIN + 1] = shown
                items[r, : len(those), :, PRESENT] = 1.0
                items[r, : len(those), :, TUCKED] = np.array([item.tucked for item in those])[:, None]
                waiting[r, : len(those)] = [item.size for item in those]
                given[r, : len(those)] = [item.rotation is not None for item in those]
                category = np.array([item.category for item in those])
                items[r, : len(those), :, len(ROOM_COLUMNS) :] = (category[:, None] == np.array(names))[:, None]
        self.space = spaces.Box(-LIMIT, LIMIT, (total, shell.shape[2]), np.float32)
        self._shell, self._items, self._waiting = (
            torch.tensor(table, dtype=torch.float32, device=device) for table in (shell, items, waiting)
        )
        self._given = torch.tensor(given, device=device)
        self.origin = torch.tensor(origin, device=device)  # float64, as positions

    def __call__(self, state: State[Tensor]) -> Tensor:
        """Observe states."""
        stands = state.stands[..., None]
        lies = stands | self._given.index_select(0, state.room)[..., None]
        index = state.quarter[..., None, None].expand(-1, -1, 1, self._items.shape[-1])
        items = self._items.index_select(0, state.room).gather(2, index).squeeze(2)
        place = state.center - self.origin.index_select(0, state.room)[:, None]
        items[..., X : Y + 1] = place.float() * stands
        items[..., EXTENT_X : EXTENT_Y + 1] = torch.where(
            lies, items[..., EXTENT_X : EXTENT_Y + 1], self._waiting.index_select(0, state.room)
        )
        items[..., COS2 : SIN2 + 1] *= lies  # `circle` stays
        items[..., COS : SIN + 1] *= lies
        moves = torch.zeros_like(state.stands).scatter(1, state.moving[:, None], True) & state.stands
        items[..., MOVING] = moves.float()
        items[..., ITEM] = items[..., PRESENT] - items[..., MOVING]
        items[..., STANDS] = state.stands.float()
        return torch.cat([items, self._shell.index_select(0, state.room)], 1)

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """Return the observation of the same rooms, mirrored and turned; what is not `lying` keeps its size."""
        turned, sizes = elements_turned(observation, symmetry), slice(EXTENT_X, EXTENT_Y + 1)
        turned[..., sizes] = torch.where(lying(observation)[..., None], turned[..., sizes], observation[..., sizes])
        return turned


def moving_first_(values: Tensor, moving: Tensor) -> Tensor:
    """Swap in place the values (B, elements, ...) of the moving item (B,) with those of the first; return them all."""
    every = torch.arange(len(moving), device=values.device)
    values[every, moving], values[:, 0] = values[:, 0].clone(), values[every, moving]
    return values


def lying(elements: Tensor) -> Tensor:
    """Return whether the extents of elements (..., columns) are along the room's x and y, not the item's: bool (...).

    So they are for all that stands, and for what waits with a given rotation. (For round items both are the same.)
    """
    return (elements[..., [STANDS, COS2, SIN2]] != 0).any(-1)
