"""The eight symmetries of the square: a design is as good in a turned room, with its moves turned too.

So it is in a mirrored one, but where the type of the room is handed (`mirrors_alike` in conf/room/): whole rooms of
such a type are not learned from in the mirror. One item is, in every type: few of its places hang on that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.simulator import DIRECTIONS, Moves
from layoutrl.rooms.room import SYMMETRIES, symmetry


class Symmetry:
    """Mirrored in the y axis if asked, then turned by quarters of a circle, as `Room.turned` does it.

    `action` (A,) is the move that every move becomes, `inverse` (A,) the move that becomes it.
    """

    def __init__(self, quarters: int, mirror: bool, moves: Moves, device: torch.device | str = "cpu"):
        self.quarters = quarters
        self.mirror = mirror
        self.changes = bool(quarters) or mirror  # anything
        matrix = symmetry(quarters, mirror)
        turned = np.array([np.flatnonzero((matrix @ way == DIRECTIONS).all(1)).item() for way in DIRECTIONS])
        action = np.arange(moves.count)
        self.action = torch.tensor(action // 4 * 4 + turned[action % 4], device=device)
        self.inverse = self.action.argsort()
        self.matrix = torch.tensor(matrix, device=device, dtype=torch.float32)


def symmetries(moves: Moves, device: torch.device | str = "cpu", mirrors: bool = True) -> list[Symmetry]:
    """All eight, first the one that changes nothing; or, without mirrors, the four that turn."""
    return [Symmetry(quarters, mirror, moves, device) for quarters, mirror in SYMMETRIES if mirrors or not mirror]


def mirrored(moves: Moves, device: torch.device | str = "cpu") -> list[Symmetry]:
    """The two of a scene, which looks right as the item is turned: as it is, and with left and right of it swapped."""
    return [Symmetry(0, False, moves, device), Symmetry(2, True, moves, device)]


def shares(symmetries: Sequence[Symmetry], column: Tensor) -> Iterator[tuple[Symmetry, Tensor]]:
    """A batch (B, ...) cut into shares, one for each symmetry: equal ones, or the first of them larger by one."""
    return zip(symmetries, column.tensor_split(len(symmetries)), strict=True)
