"""Who furnishes the page's rooms.

A `Furnisher` furnishes; a `Thinker` also says what it thinks of places, which the page then shows. `furnisher_of`
is the one place that chooses.
"""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import dist, inf
from typing import Protocol, runtime_checkable

import numpy as np

from layoutrl.rivals.budgets import seconds_budget
from layoutrl.rivals.rooms.relations import Relations, mine
from layoutrl.rivals.rooms.scene import scene_of
from layoutrl.rivals.rooms.search import Finder, Searching
from layoutrl.rooms.brief import missing
from layoutrl.rooms.clearances import off, period
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Room
from layoutrl.runs.config import DemoConfig

DESIGNED = 100  # rooms of a type, whose relations the search keeps; of more the designer would start processes
APART = 0.3  # metres by which an item stands elsewhere, so that a layout is another choice
LOST = 1000.0  # of a layout's value, for an item without a place or out of reach

Move = tuple[str, tuple[float, float], float]


@dataclass(frozen=True)
class Furnished:
    """A layout, what it is worth to who made it (higher is better), and each pose that an item took on the way there.

    The path is in the order of the poses: the item's index in the room, its centre in metres, its degrees.
    """

    layout: Room
    value: float
    path: list[tuple[int, tuple[float, float], float]]


class Furnisher(Protocol):
    """Who furnishes rooms."""

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """Up to so many different layouts of each brief, best first."""


@runtime_checkable
class Thinker(Furnisher, Protocol):
    """Who furnishes rooms, and says what it thinks of places."""

    def values(self, room: Room, item: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of an item among what stands: centres (n, 2) a step in metres apart, the value (n,) of the best way to face
        there, and its degrees (n,)."""

    def moves(self, room: Room, item: int) -> list[Move]:
        """The best moves of an item from where it stands: name, the centre it leads to, value; best first."""


def furnisher_of(config: DemoConfig) -> Furnisher:
    """Who furnishes the page's rooms."""
    return SearchFurnisher(config.search, config.seconds)


class SearchFurnisher:
    """The constraint search, as `place by=search` has it; each of its restarts is a choice.

    `seconds` are spent on a brief, and one restart at least.
    """

    def __init__(self, settings: Searching, seconds: float):
        self.settings, self.seconds = settings, seconds
        self.known: dict[str, Relations] = {}
        self.mining: defaultdict[str, threading.Lock] = defaultdict(threading.Lock)

    def relations(self, room_type: str) -> Relations:
        """What designed rooms of a type have in common; worked out once, when it is first asked for."""
        with self.mining[room_type]:
            if room_type not in self.known:
                self.known[room_type] = mine(design_rooms(room_type, "train", 0, DESIGNED).rooms)
        return self.known[room_type]

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """Up to so many different layouts of each brief, best first."""
        return [self._furnish(brief, choices, np.random.default_rng([seed, k])) for k, brief in enumerate(briefs)]

    def _furnish(self, brief: Room, choices: int, rng: np.random.Generator) -> list[Furnished]:
        scene = scene_of(brief)
        if not len(scene.movable):
            return []
        finder = Finder(scene, self.relations(brief.room_type), self.settings, rng)
        spent = seconds_budget(self.seconds)
        found: list[tuple[tuple[int, float], Room]] = []
        while not found or spent(len(found)) < 1:
            finder.lowest = (len(brief.furniture) + 1, inf)  # this restart's own layout, and not the best of all
            finder.restart(lambda: spent(0) >= 1)
            found.append((finder.lowest, scene.layout(*finder.best)))
        different: list[Furnished] = []
        for (lost, cost), layout in sorted(found, key=lambda entry: entry[0]):
            if len(different) < choices and all(apart(layout, other.layout) for other in different):
                different.append(Furnished(layout, -LOST * lost - cost, one_pose_an_item(brief, layout, finder)))
        return different


def one_pose_an_item(brief: Room, layout: Room, finder: Finder) -> list[tuple[int, tuple[float, float], float]]:
    """The path of a search: it puts each item where it stays, in its order."""
    items = ((int(k), layout.furniture[k]) for k in finder.order)
    return [(k, item.center, item.degrees) for k, item in items if item.center is not None and k in missing(brief)]


def apart(one: Room, other: Room) -> bool:
    """Whether an item stands or faces elsewhere in one layout than all that are like it do in the other."""
    for item in one.furniture:
        alike = [its for its in other.furniture if (its.category, its.size) == (item.category, item.size)]
        if item.center is None:
            if all(its.center is not None for its in alike):
                return True
        elif not any(
            its.center is not None
            and dist(item.center, its.center) <= APART
            and off(item.degrees - its.degrees, period(item)) <= 45
            for its in alike
        ):
            return True
    return False
