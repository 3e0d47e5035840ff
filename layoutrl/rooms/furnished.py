"""What who furnishes rooms answers: an agent, a rival, or whoever comes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from layoutrl.rooms.room import Point, Room

Placement = tuple[int, Point, float]  # index of an item in the room's furniture, its centre in metres, degrees


@dataclass(frozen=True)
class Furnished:
    """A layout of a brief. What found no place in it has no center."""

    layout: Room
    value: float  # what who made it thinks of it: the higher, the better
    path: list[Placement] = field(default_factory=list)  # all of the items on their way, in order
    by: str = ""  # who made it, where that is not who was asked


class Furnishes(Protocol):
    """Who places all that has no center in rooms."""

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """Of each brief one layout or up to so many different ones, best first; what is drawn hangs on the seed."""
