"""The simulator of whole rooms: any item of a brief can be the one that moves, among those that stand now.

It is the simulator of one item, told what else stands: `Simulator` gets one room for each item and each way that it can
face, with what never moves; the poses of the other items are state. One item in a finished room is the case in which
nothing else can move.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import compress
from typing import Generic, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.env.geometry import Array
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.brief import distinct_rotations, missing
from layoutrl.rooms.clearances import ahead, angle_off, floor_before, may_stand_before, period
from layoutrl.rooms.fitting import fitting_positions
from layoutrl.rooms.room import TOLERANCE, Item, Room, envelopes

QUARTERS = 4  # most ways that an item can face: quarters counter-clockwise from the first
TURNS = np.array([1, -1])  # quarters, counter-clockwise, of the two actions that turn


class State(NamedTuple, Generic[Array]):
    """B rooms as they are furnished now, with the N items of `RoomsSimulator`.

    An item that does not stand has the pose at which it will stand once it is taken.
    """

    room: Array  # int64 (B,)
    center: Array  # float64 (B, N, 2), metres
    quarter: Array  # int64 (B, N): quarters counter-clockwise from the first way that the item can face
    stands: Array  # bool (B, N)
    moving: Array  # int64 (B,): the item that was taken last, which moves if it stands


def _in_place_of(designed: Item, other: Item) -> bool:
    """Whether another item is the same as one of the designer's, and stands where that one does."""
    assert designed.center
    there = other.center is not None and math.dist(designed.center, other.center) < TOLERANCE
    return there and designed.kind == other.kind


def _free_places(brief: Room, design: Room | None) -> list[Item]:
    """Return the designer's items in whose place nothing stands in the brief; none without a design."""
    designed = [item for item in (design.furniture if design else ()) if item.center]
    return [item for item in designed if not any(_in_place_of(item, other) for other in brief.furniture)]


class RoomsSimulator:
    """Legality, moves and rewards in B states at once, by shapely.

    `briefs` are rooms with items to place. `designs` are the same rooms as the designer furnished them, None where that
    is unknown: r1 is 0 there. An item may take the place of any of the designer's items that is the same (category,
    size, form) and does not stand in the brief; the highest IoU counts.

    N is `most`, by default the number of items to place in the room with most. Tables of the items:
    - `count` (rooms,): how many each room has to place
    - `ways` (rooms, N): in how many ways that look different an item can face
    - `degrees` (rooms, N, 4): its rotation in each of them
    - `room_index` (rooms, N, 4): the room of `one_item` in which it moves when turned so, -1 where it does not fit

    If the reward has a fourth term, the floor that is to be free before an item moves with it, in room `floor_index`
    (rooms, N, 4) of `floor_simulator`. Its middle is the item's plus `ahead` (rooms, N, 4, 2), in metres.
    `welcome` (rooms, N, N) tells which other items may stand there.

    Raises InputError where a room has more items than `most`, where an item fits in no way, and where no room has
    anything to place.
    """

    def __init__(
        self,
        briefs: Sequence[Room],
        designs: Sequence[Room | None] | None,
        moves: Moves,
        reward: Reward,
        most: int | None = None,
    ):
        self.rooms = list(briefs)
        self.moves = moves
        self.reward_function = reward
        self.items = [[room.furniture[k] for k in missing(room)] for room in briefs]
        self.count = np.array([len(items) for items in self.items])
        if not self.count.any():
            raise InputError("rooms: expected furniture to place; there is none")
        largest = int(self.count.argmax())
        if most is not None and most < self.count[largest]:
            raise InputError(
                f"items: expected {self.count[largest]} or more, as room {briefs[largest].id} has to place; got {most}"
            )
        shape = len(briefs), int(most or self.count[largest])
        self.ways = np.ones(shape, dtype=int)
        self.degrees = np.zeros((*shape, QUARTERS))
        for r, (room, items) in enumerate(zip(briefs, self.items, strict=True)):
            for n, item in enumerate(items):
                first, *others = distinct_rotations(room, item)
                self.ways[r, n] = 1 + len(others)
                self.degrees[r, n] = first + 90 * np.arange(QUARTERS)
        rooms_by_facing, self.room_index = self._rooms_by_facing(self.items, lambda *_: True)
        for r, items in enumerate(self.items):
            for n, item in enumerate(items):
                if (self.room_index[r, n] < 0).all():
                    raise InputError(f"room {briefs[r].id}: the {item.category} does not fit into it")
        self.one_item = Simulator(rooms_by_facing, moves, reward)
        self.floor = [[floor_before(item) if reward.theta4 else None for item in items] for items in self.items]
        rooms_by_facing, self.floor_index = self._rooms_by_facing(self.floor, _takes_floor)
        self.floor_simulator = Simulator(rooms_by_facing, moves, Reward(0.0, 1.0, 1.0)) if rooms_by_facing else None
        self.ahead, self.welcome = np.zeros((*shape, QUARTERS, 2)), np.zeros((*shape, shape[1]), dtype=bool)
        for r, n, floor in self._all_floors():
            item, turn = self.items[r][n], np.radians(self.degrees[r, n])
            self.ahead[r, n] = ahead(item, floor) * np.stack([np.cos(turn), np.sin(turn)], -1)
            self.welcome[r, n, : self.count[r]] = [not _takes_floor(floor, other) for other in self.items[r]]
        self.targets: list[list[list[Item]]] = []
        for items, brief, design in zip(self.items, briefs, designs or [None] * len(briefs), strict=True):
            free = _free_places(brief, design)
            alike = [[place for place in free if place.kind == item.kind] for item in items]
            self.targets.append(alike + [[]] * (shape[1] - len(items)))

    @property
    def actions(self) -> int:
        """The number of actions: those of Moves, a quarter turn to the left and to the right, and to take each item."""
        return self.moves.count + len(TURNS) + self.room_index.shape[1]

    def _rooms_by_facing(
        self, things: Sequence[Sequence[Item | None]], meets: Callable[[Item, Item], bool]
    ) -> tuple[list[Room], np.ndarray]:
        """Return a room for each thing (rooms, N) and facing, with those never-moving items that it `meets`.

        Those with the same footprint that meet the same items share a room. Also return the index of each room,
        (rooms, N, 4): -1 where there is no such thing or facing, and where it does not fit.
        """
        rooms_by_facing: list[Room] = []
        index: dict[tuple[object, ...], int] = {}
        room_index = np.full(self.degrees.shape, -1)
        for r, (room, row) in enumerate(zip(self.rooms, things, strict=True)):
            if not any(row):
                continue
            stands = [item for item in room.furniture if item.center]
            inside = envelopes([room])[0].representative_point().coords[0]
            for n, thing in enumerate(row):
                if thing is None:
                    continue
                first, met = self.degrees[r, n, 0], tuple(meets(thing, other) for other in stands)
                shell = replace(room, furniture=tuple(compress(stands, met)), target=None)
                for q in range(self.ways[r, n]):
                    lies = thing.size if (first // 90 + q) % 2 == 0 else thing.size[::-1]
                    key = r, thing.form, lies, first % 90, met
                    if key not in index:
                        index[key] = len(rooms_by_facing)
                        turned = replace(thing, center=inside, rotation=float(self.degrees[r, n, q]))
                        rooms_by_facing.append(_with(shell, turned, room.envelope))
                    room_index[r, n, q] = index[key]
        regions = fitting_positions(
            envelopes(rooms_by_facing), np.array([room.moving.template for room in rooms_by_facing])
        )
        fits = ~shapely.is_empty(regions)
        number = np.append(np.where(fits, np.cumsum(fits) - 1, -1), -1)
        return [room for room, fit in zip(rooms_by_facing, fits, strict=True) if fit], number[room_index]

    def _all_floors(self) -> Iterator[tuple[int, int, Item]]:
        """Yield the indices of room and item, and the floor before the item, for all items that have one."""
        for r, floors in enumerate(self.floor):
            for n, floor in enumerate(floors):
                if floor is not None:
                    yield r, n, floor

    def designed(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the designer has each item: centers (rooms, N, 2) and quarters (rooms, N).

        Items that are the same get the designer's places in the order of the design. Raises ValueError without designs.
        """
        center, quarter = np.zeros((*self.ways.shape, 2)), np.zeros(self.ways.shape, dtype=int)
        for r, items in enumerate(self.items):
            for n, item in enumerate(items):
                if not (there := self.targets[r][n]):
                    raise ValueError(f"room {self.rooms[r].id}: the designer's places are not known")
                target = there[[other.kind for other in items[:n]].count(item.kind)]
                alike = [faces_alike(target, self.degrees[r, n, q]) for q in range(self.ways[r, n])]
                center[r, n], quarter[r, n] = target.center, np.argmax(alike)
        return center, quarter

    def size_rank(self) -> np.ndarray:
        """Return each item's rank (rooms, N) in the order of placing, from 0: the largest footprint first.

        Items that are the same share a rank; columns without an item have the last, N.
        """
        rank = np.full(self.ways.shape, self.ways.shape[1])
        for r, items in enumerate(self.items):
            first = [item.kind for item in sorted(items, key=lambda item: -item.area)]  # ties as in the brief
            rank[r, : len(items)] = [first.index(item.kind) for item in items]
        return rank

    def empty(self, room: np.ndarray) -> State[np.ndarray]:
        """Return rooms (B,) with none of the items to place."""
        shape = len(room), self.ways.shape[1]
        nowhere = np.zeros((*shape, 2)), np.zeros(shape, dtype=int), np.zeros(shape, dtype=bool)
        return State(np.array(room), *nowhere, np.zeros(len(room), dtype=int))

    def begin(self, room: np.ndarray, rng: np.random.Generator) -> State[np.ndarray]:
        """Return rooms (B,) with none of the items to place, and draw the pose that each will have when it is taken.

        Both the way that an item faces and its place are uniform over those with which it fits.
        """
        room_index = self.room_index[room]
        quarter = np.argmax(rng.random(room_index.shape) * (room_index >= 0), 2)
        room_index = np.take_along_axis(room_index, quarter[..., None], 2)[..., 0]
        center = np.zeros((*room_index.shape, 2))
        center[room_index >= 0] = self.one_item.starts(room_index[room_index >= 0], rng)
        return self.empty(room)._replace(center=center, quarter=quarter)

    def put(
        self, state: State[np.ndarray], item: np.ndarray, center: np.ndarray, quarter: np.ndarray
    ) -> State[np.ndarray]:
        """The states in which an item (B,) stands at centers (B, 2), turned by quarters (B,), and is what moves."""
        every = np.arange(len(item))
        new = State(*(values.copy() for values in state))
        new.center[every, item], new.quarter[every, item], new.stands[every, item] = center, quarter, True
        return new._replace(moving=np.array(item))

    def destinations(self, state: State[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return which item every action moves (B, A), to which center (B, A, 2) and quarter (B, A), and whether it is
        legal (B, A). Until an item is taken, only taking one is legal."""
        room_index, center, quarter = self._moving(state)
        reached, legal = self.one_item.destinations(room_index, center, self._others(state))
        ways = self.ways[state.room, state.moving][:, None]
        turned = (quarter[:, None] + TURNS) % ways
        as_turned = self.room_index[state.room[:, None], state.moving[:, None], turned]
        there = np.repeat(center[:, None], len(TURNS), 1)
        fits = (ways > 1) & (as_turned >= 0) & self.one_item.is_legal(as_turned, there)
        stands = np.take_along_axis(state.stands, state.moving[:, None], 1)
        items = np.arange(state.stands.shape[1])
        taken = (items == state.moving[:, None]) & stands
        moves = legal.shape[1]
        return (
            np.concatenate(
                [np.repeat(state.moving[:, None], self.actions - len(items), 1), np.broadcast_to(items, taken.shape)], 1
            ),
            np.concatenate([reached, there, state.center], 1),
            np.concatenate([np.repeat(quarter[:, None], moves, 1), turned, state.quarter], 1),
            np.concatenate([legal & stands, fits & stands, (items < self.count[state.room][:, None]) & ~taken], 1),
        )

    def reward(self, state: State[np.ndarray]) -> RewardTerms[np.ndarray]:
        """The reward of the moving item where it stands, among what stands now: terms (B,), 0 until one is taken."""
        room_index, center, quarter = self._moving(state)
        iou = np.zeros(len(room_index))
        for b, (room, item) in enumerate(zip(state.room, state.moving, strict=True)):
            degrees = self.degrees[room, item, quarter[b]]
            for target in self.targets[room][item]:
                found = self.one_item.ious(room_index[[b]], center[[b]], np.array([[target.footprint]])).item()
                iou[b] = max(iou[b], found * (1 if faces_alike(target, degrees) else self.reward_function.faces_away))
        terms = self.one_item.reward(room_index, center, self._others(state), iou, self.floor_taken(state))
        return RewardTerms(*(term * state.stands[np.arange(len(iou)), state.moving] for term in terms))

    def floor_taken(self, state: State[np.ndarray]) -> np.ndarray:
        """Return how much of the floor before items is taken: before the moving item, and by it before others, (B,).

        Before the moving item this is what r2 and r3 measure, with that floor as the item: its summed IoU with what
        stands, walls and openings, plus the share of it that is not indoors. Before the other placed items it is the
        summed IoU of their floor with the moving item. Items that are `welcome` do not count. 0 if theta4 is 0.
        """
        every, moving = np.arange(len(state.room)), state.moving
        room_index, center, quarter = self._moving(state)
        taken = np.zeros(len(every))
        if not self.reward_function.theta4:
            return taken
        floor, middle = self.floor_index[state.room, moving, quarter], self.ahead[state.room, moving, quarter] + center
        b = np.flatnonzero(floor >= 0)  # a floor that fits nowhere is left out
        others = self._others(state)
        others[self.welcome[state.room, moving]] = None
        if self.floor_simulator and len(b):
            terms = self.floor_simulator.reward(floor[b], middle[b], others[b], np.zeros(len(b)))
            taken[b] = terms.r2 + terms.r3
        before_others = self._others(state, floors=True)
        before_others[self.welcome[state.room[:, None], np.arange(before_others.shape[1]), moving[:, None]]] = None
        return taken + self.one_item.ious(room_index, center, before_others).sum(1)

    def _moving(self, state: State[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the room of `one_item` (B,), the center (B, 2) and the quarter (B,) of the moving items."""
        every = np.arange(len(state.room))
        quarter = state.quarter[every, state.moving]
        return self.room_index[state.room, state.moving, quarter], state.center[every, state.moving], quarter

    def _others(self, state: State[np.ndarray], floors: bool = False) -> np.ndarray:
        """The footprints (B, N) of what stands and does not move, or the floor before it; None for none."""
        footprints = np.full(state.stands.shape, None)
        for b, n in zip(*np.nonzero(state.stands), strict=True):
            if n == state.moving[b]:
                continue
            item, floor = self.item(state, b, n), self.floor[state.room[b]][n]
            if not floors:
                footprints[b, n] = item.footprint
            elif floor is not None:
                x, y = state.center[b, n] + self.ahead[state.room[b], n, state.quarter[b, n]]
                footprints[b, n] = replace(floor, center=(float(x), float(y)), rotation=item.rotation).footprint
        return footprints

    def item(self, state: State[np.ndarray], b: int | np.integer, n: int | np.integer) -> Item:
        """Return item n of room b where it stands."""
        (x, y), room = state.center[b, n], state.room[b]
        return replace(
            self.items[room][n],
            center=(float(x), float(y)),
            rotation=float(self.degrees[room, n, state.quarter[b, n]]),
        )

    def layout(self, state: State[np.ndarray], b: int | np.integer) -> Room:
        """Return room b as it is furnished; items that do not stand have no center."""
        room = self.rooms[state.room[b]]
        furniture = list(room.furniture)
        for n, k in enumerate(missing(room)):
            if state.stands[b, n]:
                furniture[k] = self.item(state, b, n)
        return replace(room, furniture=tuple(furniture))


def rows(state: State[np.ndarray], b: np.ndarray) -> State[np.ndarray]:
    """Return the part of a state that is of rooms b (n,), as a state of n rooms."""
    return State(*(values[b] for values in state))


def faces_alike(item: Item, degrees: float) -> bool:
    """Return whether an item of the same kind, turned to `degrees`, faces as `item` does, to within 45 degrees."""
    return angle_off(item.degrees - degrees, period(item)) <= 45


def _takes_floor(floor: Item, other: Item) -> bool:
    """Return whether another item takes floor that is to be free before an item, if it stands there."""
    return not may_stand_before(floor.category, other.category)


def _with(shell: Room, item: Item, envelope: Polygon) -> Room:
    """The room with one more item, its target."""
    room = replace(shell, furniture=(*shell.furniture, item), target=len(shell.furniture))
    vars(room)["envelope"] = envelope  # worked out once a room
    return room
