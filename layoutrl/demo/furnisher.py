"""The agents and the search that furnish the page's rooms, and their values of places there."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np

from layoutrl import InputError
from layoutrl.rivals.rooms.search import Searching
from layoutrl.rooms.furnished import Furnishes
from layoutrl.rooms.room import MAIN_ITEM, Room
from layoutrl.runs import pretrained

Move = tuple[str, tuple[float, float], float]


class Thinker(Protocol):
    """An agent that can be asked for its values of places and moves."""

    def values(self, room: Room, item: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return centres (n, 2) for an item among what stands, `step` metres apart; the value (n,) of the best rotation
        at each; and that rotation (n,) in degrees."""

    def moves(self, room: Room, item: int) -> list[Move]:
        """The legal moves of an item from where it stands, best first: name, the centre it leads to, value."""


@dataclass(frozen=True)
class Staff:
    """The furnisher of the page's rooms, and the thinker of each room type, loaded when they are first asked for."""

    furnisher: Callable[[], Furnishes]
    thinker: Callable[[str], Thinker]
    known: Callable[[str], Collection[str]]  # the categories that are placed in rooms of a type
    ready: Callable[[], None] = lambda: None  # loads all of them


def staff_of(searching: Searching) -> Staff:
    """The agents in the package, helped by the search as those of `place` are."""

    @cache
    def agents() -> pretrained.Agents:
        import torch  # takes seconds: the page is served before

        return pretrained.Agents(torch.device("cpu"))

    @cache
    def furnisher() -> Furnishes:
        from layoutrl.runs.furnishers import helped

        return helped(agents(), searching)

    def ready() -> None:
        for room_type in MAIN_ITEM:
            with suppress(InputError):  # whoever asks for it is told
                agents().of(room_type)

    return Staff(furnisher, lambda room_type: agents().of(room_type), pretrained.placed, ready)
