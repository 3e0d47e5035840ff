"""Who can place furniture in rooms of a user's own: a trained agent, or a rival that needs no training.

All are asked in one way: for up to so many different layouts of each brief, of whatever has no center in it.
"""

from __future__ import annotations

import math
import time
import zlib
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
import shapely

from layoutrl import InputError
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.faults import faults
from layoutrl.env.geometry import fitting_positions
from layoutrl.env.observation import observation_of
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.protocols import greedy
from layoutrl.rivals.budgets import seconds_budget
from layoutrl.rivals.rooms.annealer import Annealing, anneal
from layoutrl.rivals.rooms.cost import PREFERENCES
from layoutrl.rivals.rooms.relations import mine
from layoutrl.rivals.rooms.search import Searching, search
from layoutrl.rooms.brief import furnished, missing, ways
from layoutrl.rooms.clearances import off, period
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Item, Room
from layoutrl.rooms.sources import main_item
from layoutrl.runs.config import PlaceConfig, TrainConfig
from layoutrl.runs.folder import load_config
from layoutrl.runs.machine import device_of
from layoutrl.runs.trained import trained_agent

DESIGNED = 200  # rooms of each type, whose relations a rival keeps
APART = 0.1  # metres: layouts in which no item stands further elsewhere are one
AT_ONCE = 64  # briefs that an agent furnishes in one batch
TURNED = 1.0  # degrees
VARIETY = 0.7  # of these weights: the standard deviation of their logarithms
TRIES = 2  # for each layout that is asked for, until that many differ


class Furnished(Protocol):
    """A layout of a brief, and what who made it thinks of it: the higher, the better."""

    @property
    def layout(self) -> Room: ...

    @property
    def value(self) -> float: ...


class Furnisher(Protocol):
    """Places all that has no center."""

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> Sequence[Sequence[Furnished]]:
        """Of each brief up to so many different layouts, best first. What finds no place has no center there."""
        ...


@dataclass(frozen=True)
class Hired:
    """Who furnishes, and what can be asked of them."""

    furnisher: Furnisher
    known: Callable[[str], Collection[str]]  # the categories that they place in rooms of a type
    at_once: int  # briefs


@dataclass(frozen=True)
class Answer:
    """What the furnishers of this module answer."""

    layout: Room
    value: float


Layouts = Callable[[Sequence[Room], Sequence[int]], Iterable[Answer]]  # one of each brief, by these seeds


def hired(config: PlaceConfig) -> Hired:
    """Who the configuration names. Raises InputError where it names nobody, or two."""
    if (config.run is None) == (config.by is None):
        raise InputError(
            "run: expected either run=<folder> of a training, or by=search or by=annealer, which need none"
        )
    if config.run is None:
        rival = Rival(config.search if config.by == "search" else config.annealer, config.seconds)
        return Hired(rival, lambda room_type: rival.relations(room_type).alone, 1)
    mover = Mover(config)
    return Hired(mover, lambda room_type: mover.moves if room_type == mover.room_type else (), AT_ONCE)


class Rival:
    """Search or annealer, with so many core-seconds a layout. It keeps relations of designed rooms of each type.

    Where one layout of a room is there, preferences are weighed otherwise for the next, else it would be the same.
    """

    def __init__(self, settings: Searching | Annealing, seconds: float):
        self.settings, self.seconds = settings, seconds
        self.relations = cache(lambda room_type: mine(design_rooms(room_type, "train", 0, DESIGNED).rooms))

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Answer]]:
        """See Furnisher. The value is how few faults there are."""
        return several(lambda some, seeds: [self._layout(brief, seeds) for brief in some], briefs, choices, seed)

    def _layout(self, brief: Room, seeds: Sequence[int]) -> Answer:
        spent, rng = seconds_budget(self.seconds, time.process_time), dice(brief, seeds)
        relations, (_, attempt) = self.relations(brief.room_type), seeds
        often = {name: rng.lognormal(0, VARIETY) for name in PREFERENCES} if attempt else {}
        weights = {name: weight * often.get(name, 1.0) for name, weight in self.settings.weights.items()}
        if isinstance(self.settings, Searching):
            layout = search(brief, relations, replace(self.settings, weights=weights), spent, rng)
        else:
            layout = anneal(brief, relations, replace(self.settings, weights=weights), spent, rng)
        return Answer(layout, -len(faults(layout)))


class Mover:
    """A trained agent that moves one item. Of several it moves the largest first, each among what stands by then."""

    def __init__(self, config: PlaceConfig):
        folder = Path(config.run or "").expanduser()
        self.trained, self.device = load_config(folder, TrainConfig), device_of(config.device)
        self.agent, self.categories, _ = trained_agent(folder, self.trained, self.device, config.checkpoint)
        self.room_type = self.trained.room.type
        moved = item_of(self.trained, config.item, self.categories)
        self.moves = self.categories if moved == "all" else [moved]

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Answer]]:
        """See Furnisher. The value is the mean of what the agent thinks of each item's place."""
        return several(self._layouts, briefs, choices, seed)

    def _layouts(self, briefs: Sequence[Room], seeds: Sequence[int]) -> list[Answer]:
        layouts, values = list(briefs), [np.zeros(0) for _ in briefs]
        rngs = [dice(brief, seeds) for brief in briefs]
        orders = [by_size(brief) for brief in briefs]
        for turn in range(max(map(len, orders))):
            asked = [(k, order[turn]) for k, order in enumerate(orders) if turn < len(order)]
            turned = [(k, facing) for k, item in asked for facing in facing_all_ways(layouts[k], item)]
            turned = [entry for entry, fits in zip(turned, fitting([room for _, room in turned]), strict=True) if fits]
            rooms = [room for _, room in turned]
            place, value = self._moved(rooms, [rngs[k] for k, _ in turned])
            for k, item in asked:
                ends = [n for n, (of, _) in enumerate(turned) if of == k]
                best = max(ends, key=lambda n: value[n])
                center = (round(float(place[best][0]), 4), round(float(place[best][1]), 4))
                layouts[k] = furnished(layouts[k], {item: (center, rooms[best].moving.degrees)})
                values[k] = np.append(values[k], value[best])
        return [Answer(layout, float(value.mean())) for layout, value in zip(layouts, values, strict=True)]

    def _moved(self, rooms: Sequence[Room], rngs: Sequence[np.random.Generator]) -> tuple[np.ndarray, np.ndarray]:
        """Where the agent moves the targets to (B, 2), and what it thinks of these places (B,)."""
        method, index = self.trained.method, np.arange(len(rooms))
        simulator = Simulator(rooms, method.moves, self.trained.reward.weights)
        starts = [simulator.starts(index[k : k + 1], rng) for k, rng in enumerate(rngs)]
        episodes = greedy(self.agent, method).rollout(
            BatchSimulator(simulator, self.device),
            observation_of(method.observation, rooms, self.device, self.categories),
            index,
            np.concatenate(starts),
        )
        return episodes.final, episodes.value[episodes.moves, index]


def several(
    layouts: Callable[[Sequence[Room], Sequence[int]], Iterable[Answer]],
    briefs: Sequence[Room],
    choices: int,
    seed: int,
) -> list[list[Answer]]:
    """Of each brief up to so many layouts that differ, best first: `layouts` makes one of each with other seeds."""
    found: list[list[Answer]] = [[] for _ in briefs]
    for attempt in range(TRIES * choices if choices > 1 else 1):
        if short := [k for k, answers in enumerate(found) if len(answers) < choices]:
            for k, answer in zip(short, layouts([briefs[k] for k in short], [seed, attempt]), strict=True):
                if not any(same(answer.layout, other.layout) for other in found[k]):
                    found[k].append(answer)
    return [sorted(answers, key=lambda answer: -answer.value) for answers in found]


def same(one: Room, other: Room) -> bool:
    """Whether each item of one layout has one like it in the other that stands there and faces alike."""
    return all(any(_alike(item, its) for its in other.furniture) for item in one.furniture)


def _alike(one: Item, other: Item) -> bool:
    if (one.category, one.size, one.form) != (other.category, other.size, other.form):
        return False
    if one.center is None or other.center is None:
        return one.center == other.center
    turned = off((one.rotation or 0) - (other.rotation or 0), period(one))
    return math.dist(one.center, other.center) < APART and (one.form == "circle" or turned < TURNED)


def dice(brief: Room, seeds: Sequence[int]) -> np.random.Generator:
    """Of a room: the same in whichever file, shard or block it is."""
    return np.random.default_rng([*seeds, zlib.crc32(brief.id.encode())])


def by_size(brief: Room) -> list[int]:
    """What is to be placed, the largest first; what is tucked under others after them."""
    items = brief.furniture
    return sorted(missing(brief), key=lambda k: (items[k].tucked, -math.prod(items[k].size)))


def facing_all_ways(room: Room, item: int) -> list[Room]:
    """The room once for each way in which an item, its target, may face.

    The simulator is for rooms whose answer is known. Here it is none: any place will do, and nothing looks at it.
    """
    return [
        replace(furnished(room, {item: (room.outline[0], degrees)}), target=item)
        for degrees in ways(room, room.furniture[item])
    ]


def fitting(rooms: Sequence[Room]) -> np.ndarray:
    """Which rooms their targets fit into, indoors, as they face: (B,)."""
    indoor, templates = (np.array(each) for each in zip(*[(r.indoor, r.moving.template) for r in rooms], strict=True))
    return ~shapely.is_empty(fitting_positions(indoor, templates))


def item_of(trained: TrainConfig, asked: str | None, categories: Sequence[str]) -> str:
    """The category to place: what the agent was trained to move. Raises InputError for another, where that is known."""
    source, item = str(trained.data.source), trained.room.item
    moved = main_item(source, trained.room.type) if item == "main" else item
    known = moved != "all" and (item != "main" or source != "json")  # rooms of one's own may name other targets
    if asked and known and asked != moved:
        raise InputError(f"item: the agent was trained to move a {moved}; expected it, got {asked}")
    if asked and asked not in categories:
        raise InputError(f"item: expected what the agent knows, one of {', '.join(categories)}; got {asked}")
    return asked or moved
