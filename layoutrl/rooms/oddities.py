"""Oddities of layouts: what no designer would do, though it breaks no rule and is no fault; mended where possible."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import shapely

from layoutrl.rooms.clearances import RAISED, RUGS
from layoutrl.rooms.doors import leaves
from layoutrl.rooms.faults import Fault, Items, floor_ahead, free_fronts, pairs, unions
from layoutrl.rooms.room import TOLERANCE, Room

OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW = "off its wall", "not at its table", "before a window"
IN_SWING, ON_PLATFORM = "in a door's swing", "on a platform"
CROWDED, WITHOUT_SEAT, OFF_ITS_BED = "crowded", "not before a seat", "not at its bed"
ODDITIES = (OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW, IN_SWING, ON_PLATFORM, CROWDED, WITHOUT_SEAT, OFF_ITS_BED)
NEAR = 0.05  # metres: an item no farther from its wall, table, window or the edge of a platform is at it
CLOSED = 0.2  # metres of a window's length that a tall item may cover
BACK = 1  # index of the back among the sides of an item, in the order of its corners

# Categories that the designer always puts with their backs at a wall, in 300 rooms of every type; without those that
# people also put in the middle of rooms: sofas, armchairs, lounge chairs.
AT_A_WALL = frozenset({
    "bathtub", "bed", "bench", "bookcase", "cooktop", "counter", "dresser", "fridge", "laundry_cabinet", "nightstand",
    "plant_rack", "shower", "sideboard", "sink", "sofa_bed", "toilet", "tv_unit", "vanity", "wardrobe", "washer",
    "washing_machine",
})  # fmt: skip
TALL = frozenset({"bookcase", "fridge", "wardrobe"})
NEED_ROOM = frozenset({"dresser", "tv_unit"})  # though some template keeps nothing free before them, no design takes of
ROOM_BEFORE = 0.6  # metres of floor there
LOUNGING = frozenset({"armchair", "loveseat", "lounge_chair", "sofa", "sofa_bed"})  # before which a coffee table stands
BEDSIDE = 0.3  # metres; in designs a nightstand touches its bed
AT_HAND = 0.6  # metres before a seat; in designs a coffee table is 0.4 m from its sofa
BESIDE_PLATFORMS = frozenset({"chair", "desk", "stool"})  # in all of the authors' tatami rooms; wardrobes stand on them


def oddities(layout: Room, asked: Collection[int] | None = None) -> list[Fault]:
    """Return (index of the item, name of the oddity) of the items `asked` about, or of all, item by item."""
    found = item_oddities([layout], Items.of([layout]))
    those = range(len(layout.furniture)) if asked is None else sorted(asked)
    return [(k, name) for k in those for name, odd in found.items() if odd[k]]


def item_oddities(layouts: Sequence[Room], items: Items) -> dict[str, np.ndarray]:
    """Return which items have each oddity: arrays (N,) by its name. Items that are not placed have none."""
    return {
        OFF_ITS_WALL: off_their_walls(layouts, items),
        ASTRAY: astray(layouts, items),
        BEFORE_WINDOW: before_windows(layouts, items),
        IN_SWING: in_swings(layouts, items),
        ON_PLATFORM: on_platforms(items),
        CROWDED: crowded(layouts, items),
        WITHOUT_SEAT: without_seats(items),
        OFF_ITS_BED: off_their_beds(items),
    }


def off_their_walls(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether an item belongs AT_A_WALL, and its back is at none: (N,)."""
    result = items.placed & ~items.round & np.isin(items.category, list(AT_A_WALL))
    those = np.flatnonzero(result)
    result[those] = sides_off_walls(layouts, items, those)[:, BACK] > NEAR
    return result


def sides_off_walls(layouts: Sequence[Room], items: Items, those: np.ndarray) -> np.ndarray:
    """Return how far the four sides of `those` items (n,), placed rectangles, are from the walls, in metres: (n, 4).

    A side is as far as the farthest of its ends and of the points a tenth of it from these: across a corner the ends
    alone touch, and before a niche all may. BACK is the index of the back.
    """
    corners = shapely.get_coordinates(items.footprint[those]).reshape(-1, 5, 2)
    walls = shapely.boundary([layout.indoor for layout in layouts])[items.room[those]]
    first, last = corners[:, :-1], corners[:, 1:]
    points = [first + share * (last - first) for share in (0, 0.1, 0.9, 1)]
    return shapely.distance(walls[:, None], shapely.points(points)).max(0)


def astray(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether an item is tucked but at none of the tables and desks of its room, if there are any: (N,).

    It is at one if the middle half of its front is within NEAR of it and its back is not under it; an item without a
    front, if any part touches it.
    """
    hosts = unions(items.footprint[items.hosts], items.room[items.hosts], len(layouts))[items.room]
    result = items.tucked & items.placed & ~shapely.is_empty(hosts)
    those = np.flatnonzero(result)
    result[those] = ~shapely.intersects(items.footprint[those], hosts[those])
    those = those[items.period[those] == 360]  # what has a front
    corners = shapely.get_coordinates(items.footprint[those]).reshape(-1, 5, 2)
    quarter = (corners[:, 3] - corners[:, 0]) / 4
    front = shapely.points(np.stack([corners[:, 0] + quarter, corners[:, 3] - quarter], 1))
    at, under = hosts[those, None], shapely.points(corners[:, 1:3])
    result[those] = ~shapely.dwithin(at, front, NEAR).all(1) | shapely.intersects(at, under).any(1)
    return result


def before_windows(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether an item is TALL, stands at a window, and takes more than CLOSED of its length: (N,)."""
    result = np.zeros(len(items.room), dtype=bool)
    tall = np.flatnonzero(items.placed & np.isin(items.category, list(TALL)))
    windows = np.array([window.shape for layout in layouts for window in layout.windows], dtype=object)
    of = np.repeat(np.arange(len(layouts)), [len(layout.windows) for layout in layouts])
    a, b = pairs(items.room[tall], of)
    item, window = items.footprint[tall[a]], windows[b]
    reaches = np.maximum(NEAR - shapely.distance(item, window), 0)  # metres into the zone NEAR the window
    closes = shapely.area(shapely.intersection(item, shapely.buffer(window, NEAR))) > reaches * CLOSED
    result[tall[a[closes]]] = True
    return result


def in_swings(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether an item stops a door's leaf, and something stops that leaf at whichever end it is hung: (N,).

    Tucked items are moved aside, and RAISED ones are floor. A centimetre does not count.
    """
    hung = [(room, both) for room, layout in enumerate(layouts) for both in leaves(layout) if both]
    of = np.array([room for room, _ in hung], dtype=int)
    swept = np.array([[leaf.swept for leaf in both] for _, both in hung], dtype=object).reshape(-1, 2)
    stands = np.flatnonzero(items.placed & items.bars)
    a, door = pairs(items.room[stands], of)
    cut = shapely.intersects(items.grown(-TOLERANCE)[stands[a], None], swept[door])
    shut = np.zeros((len(hung), 2), dtype=bool)
    np.logical_or.at(shut, door, cut)
    result = np.zeros(len(items.room), dtype=bool)
    result[stands[a[np.any(cut, 1) & np.all(shut, 1)[door]]]] = True
    return result


def on_platforms(items: Items) -> np.ndarray:
    """Whether an item is half on a platform, or at all on one though it belongs BESIDE_PLATFORMS: (N,).

    What is no more than NEAR does not count.
    """
    platforms = items.placed & np.isin(items.category, list(RAISED - RUGS))
    floor = unions(items.footprint[platforms], items.room[platforms], int(items.room.max(initial=-1)) + 1)[items.room]
    stands = items.placed & ~np.isin(items.category, list(RAISED))
    core = items.grown(-NEAR)
    whole = shapely.covers(floor, core) & ~np.isin(items.category, list(BESIDE_PLATFORMS))
    return stands & shapely.intersects(floor, core) & ~whole


def crowded(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether a wall, or another item, takes some of the ROOM_BEFORE one of NEED_ROOM: (N,)."""
    depth = np.where(np.isin(items.category, list(NEED_ROOM)), ROOM_BEFORE, 0.0)
    return items.placed & ~items.round & ~free_fronts(layouts, items, depth)


def without_seats(items: Items) -> np.ndarray:
    """Whether an item is a coffee table in a room with LOUNGING seats, and none of it is AT_HAND before one: (N,)."""
    seats = np.flatnonzero(items.placed & ~items.round & np.isin(items.category, list(LOUNGING)))
    floor = floor_ahead(items, seats, np.full(len(seats), AT_HAND))
    return off_all(items, "coffee_table", seats, floor, 0.0)


def off_their_beds(items: Items) -> np.ndarray:
    """Whether an item is a nightstand in a room with beds, and farther than BEDSIDE from these: (N,)."""
    beds = np.flatnonzero(items.placed & (items.category == "bed"))
    return off_all(items, "nightstand", beds, items.footprint[beds], BEDSIDE)


def off_all(items: Items, category: str, others: np.ndarray, shapes: np.ndarray, near: float) -> np.ndarray:
    """Whether an item is of a category, and farther than `near` from the shapes (n,) of all `others` of its room: (N,).

    False where there are none; `others` (n,) are indices.
    """
    those = np.flatnonzero(items.placed & (items.category == category))
    a, b = pairs(items.room[those], items.room[others])
    result = np.zeros(len(items.room), dtype=bool)
    result[those[a]] = True
    result[those[a[shapely.dwithin(items.footprint[those[a]], shapes[b], near)]]] = False
    return result
