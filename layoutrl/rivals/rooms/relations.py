"""Relations that training rooms have in common, by category; annealer and search try to keep them in new rooms.

They are distances, how often items face and lie which way, which categories never stand before a window, and how much
floor doors keep free (Merrell et al. 2011 and Yu et al. 2011 took theirs from guidelines and examples). An offset is
steady where its STEADY_RANGE is no wider than STEADY.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from layoutrl.rivals.rooms.scene import FACINGS, Array, Gate, Scene, ahead, boxes_at, daylight, depth, gap, scene_of
from layoutrl.rooms.room import TOLERANCE, Room

# What counts as a relation; unsourced, all of them.
STEADY = 0.3  # metres
STEADY_RANGE = (0.1, 0.9)  # quantiles
RELATED = 1.0  # metres: categories whose distance varies by more are no pair
RANGE = (0.25, 0.75)  # quantiles
CLEAR = 0.05  # quantile: this share of all doors has less floor free before it
FEWEST = 3  # observations of a category or pair: fewer are chance

# How costs grow; unsourced, both.
FAR = 1.0  # metres: beyond, an offset is as bad as any
NEAREST = 0.05  # metres: shorter distances count as this, so that no ratio of them runs away

Range = tuple[float, float]  # quartiles: half of all values lie between
Shares = Array  # (3,) ahead, beside, behind; or the same way, across, opposite


@dataclass(frozen=True)
class Alone:
    """How items of one category stand in a room. Offsets are medians in metres, None where they are not steady."""

    back: float | None  # from its back to the wall
    side: float | None  # from the nearer of its sides to the wall
    door: Range  # distance from the nearest, as a share of the farthest corner's distance from it
    window: Range
    to_door: Shares  # how often it looks away from the widest door, as one who enters, across, or towards it
    to_window: Shares


@dataclass(frozen=True)
class Pair:
    """How the nearest item of a second category stands, as seen from an item of a first."""

    distance: Range  # metres between their middles
    gap: float | None  # metres between their sides; None where it is not steady
    turn: Shares  # how often it faces the same way, across, opposite
    bearing: Shares  # how often it lies ahead, beside, behind
    along: float | None  # metres off the first's axis; None where they are not steady


@dataclass(frozen=True)
class Relations:
    """Relations in rooms of one type. `tall` categories never stand before a window; doors keep `clear` metres free."""

    alone: dict[str, Alone]
    pairs: dict[tuple[str, str], Pair]
    tall: frozenset[str]
    clear: float


def mine(rooms: Sequence[Room]) -> Relations:
    """The relations in rooms whose furniture stands where its designer put it."""
    single: dict[str, list[Array]] = defaultdict(list)
    double: dict[tuple[str, str], list[Array]] = defaultdict(list)
    before_window: set[str] = set()
    clear = []
    for room in rooms:
        scene = scene_of(room)
        box, quarter = boxes_at(scene.center, scene.half[np.arange(len(scene.center)), scene.quarter]), scene.quarter
        features = alone_features(scene, box, quarter)
        between = pair_features(box[:, None], quarter[:, None], box[None], quarter[None])
        dark = depth(box[:, None], daylight(scene)).max(1, initial=0.0)
        for i, item in enumerate(room.furniture):
            single[item.category].append(features[i])
            if dark[i] > TOLERANCE:
                before_window.add(item.category)
            nearest: dict[str, int] = {}
            for j in np.argsort(between[i, :, DISTANCE]).tolist():
                if i != j:
                    nearest.setdefault(room.furniture[j].category, j)
            for other, j in nearest.items():
                double[item.category, other].append(between[i, j])
        clear += [_clear_before(scene, box, k) for k in range(len(scene.doors))]
    return Relations(
        {category: _alone(np.array(seen)) for category, seen in single.items() if len(seen) >= FEWEST},
        {key: pair for key, seen in double.items() if len(seen) >= FEWEST and (pair := _pair(np.array(seen)))},
        frozenset(single) - before_window,
        float(np.quantile(clear, CLEAR)) if clear else 0.0,
    )


# --- features; annealer and search have the same ---

CLASSES = 4  # the same way, across, opposite, or nothing there to look at
BACK, SIDE, DOOR, WINDOW, LOOKS_DOOR, LOOKS_WINDOW = range(6)
DISTANCE, GAP, TURN, BEARING, ALONG = range(5)


def alone_features(scene: Scene, box: Array, quarter: Array) -> Array:
    """Return (..., 6): metres from back and nearer side to the wall, shares of the way to door and window, two looks.

    Looks, at doors and at windows, are 0 away from the widest, as one who enters by it, 1 across, 2 towards it, 3 where
    there is none.
    """
    room = ahead(box, scene.solids)  # (..., 4) by direction
    at = np.arange(4)
    facing = quarter[..., None]
    back = np.where(at == (facing + 2) % 4, room, 0).sum(-1)
    side = np.where((at - facing) % 2 == 1, room, np.inf).min(-1)
    features = [back, side]
    looks = []
    for gates in (scene.doors, scene.windows):
        features.append(_share_of_the_way(scene, box, gates))
        inward = max(gates, key=lambda gate: gate.width).inward if gates else 0
        looks.append(_turn(quarter - inward) if gates else np.full(quarter.shape, 3.0))
    return np.stack([*features, *looks], -1)


def pair_features(box: Array, quarter: Array, other: Array, facing: Array) -> Array:
    """(..., 5) of two items: metres between middles and sides; turn; bearing; metres off the first's axis."""
    offset = (other[..., :2] + other[..., 2:] - box[..., :2] - box[..., 2:]) / 2
    forward = (offset * FACINGS[quarter]).sum(-1)
    across = np.abs((offset * FACINGS[(quarter + 1) % 4]).sum(-1))
    distance = np.hypot(forward, across)
    bearing = np.where(across >= np.abs(forward), 1.0, np.where(forward > 0, 0.0, 2.0))
    turn = np.broadcast_to(_turn(facing - quarter), distance.shape)
    return np.stack([distance, gap(box, other), turn, bearing, across], -1)


def _share_of_the_way(scene: Scene, box: Array, gates: Sequence[Gate]) -> Array:
    """Return box distances from a gate as shares of the farthest corner's: the least of all gates, 1 without any."""
    if not gates:
        return np.ones(box.shape[:-1])
    middles = np.array([gate.middle for gate in gates])
    x, y = scene.bounds[::2], scene.bounds[1::2]
    farthest = np.hypot(np.abs(x - middles[:, :1]).max(1), np.abs(y - middles[:, 1:]).max(1))
    apart = (box[..., None, :2] + box[..., None, 2:]) / 2 - middles
    return (np.hypot(apart[..., 0], apart[..., 1]) / farthest).min(-1)


def _turn(quarters: Array) -> Array:
    """0 the same way, 1 across, 2 opposite."""
    return np.array([0.0, 1.0, 2.0, 1.0])[quarters % 4]


def _clear_before(scene: Scene, box: Array, k: int) -> float:
    """Return how many metres of floor before a door are free, at most its width."""
    door = scene.doors[k]
    return min(door.width, float(ahead(door.box, box)[door.inward]) if len(box) else door.width)


def _alone(seen: Array) -> Alone:
    return Alone(
        _steady(seen[:, BACK]),
        _steady(seen[:, SIDE]),
        _range(seen[:, DOOR]),
        _range(seen[:, WINDOW]),
        _shares(seen[:, LOOKS_DOOR]),
        _shares(seen[:, LOOKS_WINDOW]),
    )


def _pair(seen: Array) -> Pair | None:
    low, high = _range(seen[:, DISTANCE])
    if high - low > RELATED:
        return None
    turn, bearing = _shares(seen[:, TURN]), _shares(seen[:, BEARING])
    return Pair((low, high), _steady(seen[:, GAP]), turn, bearing, _steady(seen[:, ALONG]))


def _range(values: Array) -> Range:
    low, high = np.quantile(values, RANGE).tolist()
    return max(low, NEAREST), max(high, NEAREST)


def _steady(values: Array) -> float | None:
    low, high = np.quantile(values, STEADY_RANGE)
    return float(np.median(values)) if high - low <= STEADY else None


def _shares(classes: Array) -> Shares:
    count = np.bincount(classes.astype(int), minlength=CLASSES)[:3]
    return count / max(count.sum(), 1)


# --- how well relations are kept ---

ALONE_TERMS = ("back", "side", "door", "window", "looks")  # costs of an item
PAIR_TERMS = ("near", "gap", "turn", "bearing", "along")  # costs of a pair


class RelationCosts:
    """Costs of how well the items of a scene keep relations: at best 0 for offsets, -1 for distances and shares.

    The tables by item (n, ...) and by pair (n, n, ...) hold what was mined. What was not mined costs nothing. `i` and
    `j` index the rows of the items that are judged.
    """

    def __init__(self, scene: Scene, relations: Relations):
        names = [item.category for item in scene.brief.furniture]
        n = len(names)
        self.scene = scene
        self.offset = np.full((n, 2), np.nan)  # of back and side
        self.distance = np.full((n, 2, 2), np.nan)  # to door and window: from, to
        self.looks = np.zeros((n, 2, CLASSES))  # at door and window
        self.pair_distance = np.full((n, n, 2), np.nan)
        self.pair_offset = np.full((n, n, 2), np.nan)  # gap, along
        self.pair_shares = np.zeros((n, n, 2, CLASSES))  # turn, bearing
        for i, a in enumerate(names):
            if alone := relations.alone.get(a):
                self.offset[i] = _or_nan(alone.back), _or_nan(alone.side)
                self.distance[i] = alone.door, alone.window
                self.looks[i, :, :3] = alone.to_door, alone.to_window
            for j, b in enumerate(names):
                if i != j and (pair := relations.pairs.get((a, b))):
                    self.pair_distance[i, j] = pair.distance
                    self.pair_offset[i, j] = _or_nan(pair.gap), _or_nan(pair.along)
                    self.pair_shares[i, j, :, :3] = pair.turn, pair.bearing
        for k, gates in enumerate((scene.doors, scene.windows)):
            if not gates:
                self.distance[:, k] = np.nan

    def alone(self, box: Array, quarter: Array, i: Array | int | slice = slice(None)) -> Array:
        """The costs (..., 5) of items `i` at boxes (..., 4): ALONE_TERMS."""
        seen = alone_features(self.scene, box, quarter)
        off = _off(seen[..., :2], self.offset[i])
        near = _within(seen[..., 2:4], self.distance[i])
        looks = _share(seen[..., 4:], self.looks[i]).sum(-1, keepdims=True)
        return np.concatenate([off, near, looks], -1)

    def pairs(
        self, box: Array, quarter: Array, other: Array, facing: Array, i: Array | int | slice, j: Array | int | slice
    ) -> Array:
        """The costs (..., 5) of items `j`, at `other`, as seen from items `i`, at `box`: PAIR_TERMS."""
        seen = pair_features(box, quarter, other, facing)
        near = _within(seen[..., DISTANCE, None], self.pair_distance[i, j][..., None, :])
        off = _off(seen[..., [GAP, ALONG]], self.pair_offset[i, j])
        share = _share(seen[..., [TURN, BEARING]], self.pair_shares[i, j])
        return np.concatenate([near, off[..., :1], share, off[..., 1:]], -1)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _off(seen: Array, usual: Array) -> Array:
    """Return how far offsets are from the usual ones, in units of FAR and at most 1; 0 where none is usual."""
    return np.nan_to_num(np.minimum(np.abs(seen - usual) / FAR, 1.0))


def _within(seen: Array, usual: Array) -> Array:
    """Merrell's -t(d, m, M) of distances: (d/m)^2 below m, 1 up to M, (M/d)^2 above; 0 where nothing is usual."""
    seen = np.maximum(seen, NEAREST)
    return -np.nan_to_num(np.minimum(np.minimum(seen / usual[..., 0], usual[..., 1] / seen), 1.0) ** 2)


def _share(seen: Array, shares: Array) -> Array:
    """Return minus the mined share of the class that is seen. seen (...), shares (..., CLASSES)."""
    rows = np.arange(shares[..., 0].size).reshape(shares.shape[:-1]) * CLASSES
    return -shares.reshape(-1)[rows + seen.astype(int)]
