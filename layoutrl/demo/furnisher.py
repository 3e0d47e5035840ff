"""Who furnishes the page's rooms.

Whoever is a `Thinker` also says what it thinks of places, which the page then shows. `staff_of` is the one place that
chooses.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache
from typing import Protocol, runtime_checkable

import numpy as np

from layoutrl.rivals.budgets import seconds_budget
from layoutrl.rivals.rooms.rival import Rival
from layoutrl.rooms.furnished import Furnishes
from layoutrl.rooms.room import Room
from layoutrl.runs import box
from layoutrl.runs.config import DemoConfig

Move = tuple[str, tuple[float, float], float]


@runtime_checkable
class Thinker(Furnishes, Protocol):
    """Who furnishes rooms, and says what it thinks of places."""

    def values(self, room: Room, item: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of an item among what stands: centres (n, 2) a step in metres apart, the value (n,) of the best way to face
        there, and its degrees (n,)."""

    def moves(self, room: Room, item: int) -> list[Move]:
        """The best moves of an item from where it stands: name, the centre it leads to, value; best first."""


@dataclass(frozen=True)
class Staff:
    """Who furnishes rooms, by their type."""

    of: Callable[[str], Furnishes]  # loaded when it is first asked for
    known: Callable[[str], Collection[str]]  # the categories that are placed
    thinking: Collection[str]  # room types, in which a Thinker furnishes


def staff_of(config: DemoConfig) -> Staff:
    """The agents in the package, and the constraint search in rooms of a type that has none."""
    agents, search = box.cards(), Rival(config.search, lambda: seconds_budget(config.seconds, time.process_time))

    @cache
    def agent(room_type: str) -> Furnishes:
        import torch  # which takes seconds: the page is there before

        from layoutrl.runs.machine import use_one_thread

        use_one_thread()
        return box.boxed(room_type, torch.device("cpu"))

    return Staff(
        of=lambda room_type: agent(room_type) if room_type in agents else search,
        known=lambda room_type: box.known(room_type) or search.relations(room_type).alone,
        thinking=agents.keys(),
    )
