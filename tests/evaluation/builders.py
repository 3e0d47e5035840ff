"""Networks whose values are known, and what they are shown."""

from __future__ import annotations

import torch

from layoutrl.env.simulator import Moves
from layoutrl.env.symmetry import Symmetry, symmetries
from layoutrl.rooms.room import Item, Room
from tests.builders import rectangular_room

STEPS = Moves((0.5,), slide=False)
RIGHT, LEFT, BELOW, UP = range(4)


class Scripted:
    """A network whose values hang on the position alone, by a function of (x, y)."""

    def __init__(self, values):
        self._values = values

    def __call__(self, positions: torch.Tensor) -> torch.Tensor:
        return torch.tensor([self._values(x, y) for x, y in positions.tolist()])


class Place:
    """An observation that is the position itself."""

    def __call__(self, room: torch.Tensor, position: torch.Tensor) -> torch.Tensor:
        return position

    def turned(self, observation: torch.Tensor, symmetry: Symmetry) -> torch.Tensor:
        return observation @ symmetry.matrix.double().T


class Flat:
    """A network to which everything is worth the same."""

    def __call__(self, seen: torch.Tensor) -> torch.Tensor:
        return torch.zeros(len(seen), STEPS.count)


def wide_room(designer: tuple[float, float] = (2.5, 1.5)) -> Room:
    """The item's centre may go from 0.3 to 3.7 and from 0.3 to 2.7."""
    return rectangular_room(4, 3, Item("bed", (1.0, 1.0), designer))


def unturned(moves: Moves) -> list[Symmetry]:
    return symmetries(moves)[:1]


def nearing(home: tuple[float, float], overrated: dict[tuple[float, float, int], float] | None = None) -> Scripted:
    """Values a move by how near it leads to a place, but for moves that it overrates, from (x, y) in a direction."""

    def values(x: float, y: float) -> list[float]:
        reached = [(x + 0.5, y), (x - 0.5, y), (x, y - 0.5), (x, y + 0.5)]
        promised = [-abs(u - home[0]) - abs(v - home[1]) for u, v in reached]
        return [q + (overrated or {}).get((round(x, 3), round(y, 3), a), 0.0) for a, q in enumerate(promised)]

    return Scripted(values)
