"""The eight symmetries of the square: a design is as good in a turned room, with its moves turned too.

It is as good in a mirrored room, except in room types that tell left from right (`mirrors_alike` in conf/room/):
agents of whole rooms do not learn such a type from mirrored rooms. Agents of one item do in every type, since few of
the item's places depend on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.simulator import DIRECTIONS, Moves
from layoutrl.rooms.room import SYMMETRIES, symmetry


class Symmetry:
    """Mirrors in the y axis if asked, then turns by quarters of a circle, as `Room.turned` does.

    `action` (A,) is what every move becomes, `inverse` (A,) the move that becomes it.
    """

    def __init__(self, quarters: int, mirror: bool, moves: Moves, device: torch.device | str = "cpu"):
        self.quarters = quarters
        self.mirror = mirror
        self.changes = bool(quarters) or mirror  # whether it is not the identity
        matrix = symmetry(quarters, mirror)
        turned = np.array([np.flatnonzero((matrix @ way == DIRECTIONS).all(1)).item() for way in DIRECTIONS])
        action = np.arange(moves.count)
        self.action = torch.tensor(action // 4 * 4 + turned[action % 4], device=device)
        self.inverse = self.action.argsort()
        self.matrix = torch.tensor(matrix, device=device, dtype=torch.float32)


def symmetries(moves: Moves, device: torch.device | str = "cpu", mirrors: bool = True) -> list[Symmetry]:
    """Return all eight symmetries, the identity first; without `mirrors` only the four that turn."""
    return [Symmetry(quarters, mirror, moves, device) for quarters, mirror in SYMMETRIES if mirrors or not mirror]


def mirrored(moves: Moves, device: torch.device | str = "cpu") -> list[Symmetry]:
    """Return the symmetries of a scene, in which the item faces right: the identity, and its left and right swapped."""
    return [Symmetry(0, False, moves, device), Symmetry(2, True, moves, device)]


def shares(symmetries: Sequence[Symmetry], column: Tensor) -> Iterator[tuple[Symmetry, Tensor]]:
    """A batch (B, ...) cut into shares, one for each symmetry: equal ones, or the first of them larger by one."""
    return zip(symmetries, column.tensor_split(len(symmetries)), strict=True)


def moves_in_every_view(symmetries: Sequence[Symmetry], action: Tensor) -> Tensor:
    """Map moves (B,) to what they become in the symmetries, an equal share of them in each."""
    return torch.cat([symmetry.action[share.long()] for symmetry, share in shares(symmetries, action)])


def values_in_every_view(symmetries: Sequence[Symmetry], by_move: Tensor) -> Tensor:
    """Reorder values per move (B, A) to what the moves become in the symmetries, an equal share of rows in each."""
    return torch.cat([share[:, symmetry.inverse] for symmetry, share in shares(symmetries, by_move)])


def vectors_in_every_view(symmetries: Sequence[Symmetry], vectors: Tensor) -> Tensor:
    """Mirror and turn vectors (B, ..., 2), an equal share of them in each symmetry."""
    return torch.cat([share @ symmetry.matrix.T for symmetry, share in shares(symmetries, vectors)])
