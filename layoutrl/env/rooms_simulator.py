"""The simulator of whole rooms: any item of a brief can be the one that moves, among those that stand now.

It is the simulator of one item, told what else stands: `Simulator` knows of each room what never moves, for each of its
items and each way that the item can face; poses are state. One item in a finished room is the case in which
nothing else can move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Generic, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.env.geometry import fitting_positions
from layoutrl.env.reward import Array, Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.brief import missing, ways
from layoutrl.rooms.clearances import off, period
from layoutrl.rooms.room import Item, Room, envelopes

TURNS = np.array([1, -1])  # quarters, counter-clockwise, of the two actions that turn


class State(NamedTuple, Generic[Array]):
    """B rooms as they are furnished now. N is the most items that a room has to place.

    An item that does not stand has the pose at which it will once it is taken.
    """

    room: Array  # int64 (B,)
    center: Array  # float64 (B, N, 2), metres
    quarter: Array  # int64 (B, N): quarters counter-clockwise from the first way that the item can face
    stands: Array  # bool (B, N)
    moving: Array  # int64 (B,): the item that was taken last, which moves if it stands


class RoomsSimulator:
    """Legality, moves and rewards in B states at once, by shapely.

    `briefs` are rooms with items to place; `designs`, where they are known, the same rooms as the designer has them:
    the first term of the reward is 0 where they are not. An item may take the place of any of the designer's that is
    the same (category, size, form); the highest IoU counts.

    Of the items (rooms, N): `count` (rooms,) is how many each room has to place, `ways` how many ways an item can face
    that look different, `degrees` (rooms, N, 4) its rotation in each, and `entry` (rooms, N, 4) the room of `simulator`
    in which it moves so turned, -1 where it does not fit. Raises InputError where an item fits in no way, and where no
    room has anything to place.
    """

    def __init__(self, briefs: Sequence[Room], designs: Sequence[Room | None] | None, moves: Moves, reward: Reward):
        self.rooms = list(briefs)
        self.moves = moves
        self.weights = reward
        self.items = [[room.furniture[k] for k in missing(room)] for room in briefs]
        self.count = np.array([len(items) for items in self.items])
        if not self.count.any():
            raise InputError("rooms: expected furniture to place; there is none")
        shape = len(briefs), int(self.count.max())
        self.ways = np.ones(shape, dtype=int)
        self.degrees = np.zeros((*shape, 4))
        self.entry = np.full((*shape, 4), -1)
        self.simulator = Simulator(self._entries(), moves, reward)
        self.targets: list[list[list[Item]]] = [[[] for _ in range(shape[1])] for _ in briefs]
        for targets, design, items in zip(self.targets, designs or [None] * len(briefs), self.items, strict=True):
            for n, item in enumerate(items):
                targets[n] = [there for there in (design.furniture if design else ()) if _same(there, item)]

    @property
    def actions(self) -> int:
        """How many actions there are: those of Moves; a quarter turn to the left, and one to the right; to take each of
        N items."""
        return self.moves.count + len(TURNS) + self.entry.shape[1]

    def _entries(self) -> list[Room]:
        """A room for each item and way to face, with what never moves; where poses have one footprint, one room."""
        entries: list[Room] = []
        index: dict[tuple[object, ...], int] = {}
        users: list[tuple[int, int, int, int]] = []  # room, item, quarter, entry
        for r, (room, items) in enumerate(zip(self.rooms, self.items, strict=True)):
            shell = replace(room, furniture=tuple(item for item in room.furniture if item.center), target=None)
            inside = envelopes([room])[0].representative_point().coords[0]
            for n, item in enumerate(items):
                first, *others = ways(room, item)
                self.ways[r, n] = 1 + len(others)
                self.degrees[r, n] = first + 90 * np.arange(4)
                for q in range(self.ways[r, n]):
                    lies = item.size if (first // 90 + q) % 2 == 0 else item.size[::-1]
                    key = r, item.form, lies, first % 90
                    if key not in index:
                        index[key] = len(entries)
                        turned = replace(item, center=inside, rotation=float(self.degrees[r, n, q]))
                        entries.append(_with(shell, turned, room.envelope))
                    users.append((r, n, q, index[key]))
        regions = fitting_positions(envelopes(entries), np.array([entry.moving.template for entry in entries]))
        fits = ~shapely.is_empty(regions)
        number = np.where(fits, np.cumsum(fits) - 1, -1)
        for r, n, q, k in users:
            self.entry[r, n, q] = number[k]
        for r, items in enumerate(self.items):
            for n, item in enumerate(items):
                if (self.entry[r, n] < 0).all():
                    raise InputError(f"room {self.rooms[r].id}: the {item.category} does not fit into it")
        return [entry for entry, fit in zip(entries, fits, strict=True) if fit]

    def designed(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the designer has each item: centers (rooms, N, 2) and quarters (rooms, N).

        Of items that are the same the first has the place of the designer's first. Raises ValueError without designs.
        """
        center, quarter = np.zeros((*self.ways.shape, 2)), np.zeros(self.ways.shape, dtype=int)
        for r, items in enumerate(self.items):
            for n, item in enumerate(items):
                if not (there := self.targets[r][n]):
                    raise ValueError(f"room {self.rooms[r].id}: the designer's places are not known")
                target = there[items[:n].count(item)]
                alike = [faces_alike(target, self.degrees[r, n, q]) for q in range(self.ways[r, n])]
                center[r, n], quarter[r, n] = target.center, np.argmax(alike)
        return center, quarter

    def sequence(self) -> np.ndarray:
        """When each item is placed, (rooms, N): how many are before it, the largest footprint first.

        Items that are the same have one rank, as have rows that are none, the last.
        """
        rank = np.full(self.ways.shape, self.ways.shape[1])
        for r, items in enumerate(self.items):
            first = sorted(items, key=lambda item: -item.area)  # of the same size, as the brief has them
            rank[r, : len(items)] = [first.index(item) for item in items]
        return rank

    def empty(self, room: np.ndarray) -> State[np.ndarray]:
        """Rooms (B,) in which nothing stands but what never moves."""
        shape = len(room), self.ways.shape[1]
        nowhere = np.zeros((*shape, 2)), np.zeros(shape, dtype=int), np.zeros(shape, dtype=bool)
        return State(np.array(room), *nowhere, np.zeros(len(room), dtype=int))

    def begin(self, room: np.ndarray, rng: np.random.Generator) -> State[np.ndarray]:
        """Rooms (B,) in which nothing stands but what never moves, and poses drawn for when an item is taken.

        Of the ways that an item can face each is as likely in which it fits, and so is each place at which it does.
        """
        entry = self.entry[room]
        quarter = np.argmax(rng.random(entry.shape) * (entry >= 0), 2)
        entry = np.take_along_axis(entry, quarter[..., None], 2)[..., 0]
        center = np.zeros((*entry.shape, 2))
        center[entry >= 0] = self.simulator.starts(entry[entry >= 0], rng)
        return State(np.array(room), center, quarter, np.zeros(entry.shape, dtype=bool), np.zeros(len(room), dtype=int))

    def put(
        self, state: State[np.ndarray], item: np.ndarray, center: np.ndarray, quarter: np.ndarray
    ) -> State[np.ndarray]:
        """The states in which an item (B,) stands at centers (B, 2), turned by quarters (B,), and is what moves."""
        every = np.arange(len(item))
        new = State(*(values.copy() for values in state))
        new.center[every, item], new.quarter[every, item], new.stands[every, item] = center, quarter, True
        return new._replace(moving=np.array(item))

    def destinations(self, state: State[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Which item every action moves (B, A), where it leads, (B, A, 2) and quarters (B, A), and whether it is legal
        (B, A). Until an item is taken there is nothing to move."""
        entry, center, quarter = self._moving(state)
        reached, legal = self.simulator.destinations(entry, center, self._others(state))
        ways = self.ways[state.room, state.moving][:, None]
        turned = (quarter[:, None] + TURNS) % ways
        as_turned = self.entry[state.room[:, None], state.moving[:, None], turned]
        there = np.repeat(center[:, None], len(TURNS), 1)
        fits = (ways > 1) & (as_turned >= 0) & self.simulator.is_legal(as_turned, there)
        stands = np.take_along_axis(state.stands, state.moving[:, None], 1)
        items = np.arange(state.stands.shape[1])
        taken = (items == state.moving[:, None]) & stands
        moves = legal.shape[1]
        return (
            np.concatenate([np.repeat(state.moving[:, None], self.actions - len(items), 1), items + 0 * taken], 1),
            np.concatenate([reached, there, state.center], 1),
            np.concatenate([np.repeat(quarter[:, None], moves, 1), turned, state.quarter], 1),
            np.concatenate([legal & stands, fits & stands, (items < self.count[state.room][:, None]) & ~taken], 1),
        )

    def reward(self, state: State[np.ndarray]) -> RewardTerms[np.ndarray]:
        """The reward of the moving item where it stands, among what stands now: terms (B,), 0 until one is taken."""
        entry, center, quarter = self._moving(state)
        iou = np.zeros(len(entry))
        for b, (room, item) in enumerate(zip(state.room, state.moving, strict=True)):
            degrees = self.degrees[room, item, quarter[b]]
            for target in self.targets[room][item]:
                found = self.simulator.ious(entry[[b]], center[[b]], np.array([[target.footprint]])).item()
                iou[b] = max(iou[b], found * (1 if faces_alike(target, degrees) else self.weights.faces_away))
        terms = self.simulator.reward(entry, center, self._others(state), iou)
        return RewardTerms(*(term * state.stands[np.arange(len(iou)), state.moving] for term in terms))

    def _moving(self, state: State[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of what moves its room of `simulator` (B,), center (B, 2) and quarter (B,)."""
        every = np.arange(len(state.room))
        quarter = state.quarter[every, state.moving]
        return self.entry[state.room, state.moving, quarter], state.center[every, state.moving], quarter

    def _others(self, state: State[np.ndarray]) -> np.ndarray:
        """The footprints (B, N) of what stands and does not move; None for what does not stand."""
        footprints = np.full(state.stands.shape, None)
        for b, n in zip(*np.nonzero(state.stands), strict=True):
            if n != state.moving[b]:
                footprints[b, n] = self.item(state, b, n).footprint
        return footprints

    def item(self, state: State[np.ndarray], b: int | np.integer, n: int | np.integer) -> Item:
        """An item where it stands."""
        (x, y), room = state.center[b, n], state.room[b]
        return replace(
            self.items[room][n],
            center=(float(x), float(y)),
            rotation=float(self.degrees[room, n, state.quarter[b, n]]),
        )

    def layout(self, state: State[np.ndarray], b: int | np.integer) -> Room:
        """One of the rooms with what stands in it; items that do not stand have no center."""
        room = self.rooms[state.room[b]]
        furniture = list(room.furniture)
        for n, k in enumerate(missing(room)):
            if state.stands[b, n]:
                furniture[k] = self.item(state, b, n)
        return replace(room, furniture=tuple(furniture))


def faces_alike(item: Item, degrees: float) -> bool:
    """Whether an item of this kind, turned to `degrees`, looks as `item` does."""
    return off(item.degrees - degrees, period(item)) <= 45


def _same(item: Item, other: Item) -> bool:
    """Whether the one stands where the other could."""
    return item.center is not None and replace(item, center=None, rotation=other.rotation) == other


def _with(shell: Room, item: Item, envelope: Polygon) -> Room:
    """The room with one more item, its target."""
    room = replace(shell, furniture=(*shell.furniture, item), target=len(shell.furniture))
    vars(room)["envelope"] = envelope  # worked out once a room
    return room
