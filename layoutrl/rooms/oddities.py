"""Oddities of layouts: what no designer would do, though it breaks no rule and is no fault; mended where possible."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from layoutrl.rooms.clearances import RAISED, RUGS
from layoutrl.rooms.doors import leaves
from layoutrl.rooms.faults import (
    Fault,
    Items,
    by_layout,
    facing,
    faults_of_all,
    floor_ahead,
    floor_taken,
    pairs,
    rectangles,
    unions,
)
from layoutrl.rooms.room import TOLERANCE, Room

OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW = "off its wall", "not at its table", "before a window"
IN_SWING, ON_PLATFORM = "in a door's swing", "on a platform"
CROWDED, WITHOUT_SEAT, OFF_ITS_BED = "crowded", "not before a seat", "not at its bed"
UNSEEN, TURNED_AWAY = "faced by no seat", "turned away"
WITHOUT_WORKTOP = "without a worktop"
ODDITIES = (
    OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW, IN_SWING, ON_PLATFORM, CROWDED, WITHOUT_SEAT, OFF_ITS_BED, UNSEEN, TURNED_AWAY,
    WITHOUT_WORKTOP,
)  # fmt: skip
NEAR = 0.05  # metres: an item no farther from its wall, table, window or the edge of a platform is at it
CLOSED = 0.2  # metres of a window's length that a tall item may cover
BACK = 1  # index of the back among the sides of an item, in the order of its corners
LEFT, BEHIND_IT, RIGHT = 1, 2, 3  # quarter turns from the front of an item to another side

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
BEDSIDE = 0.3  # metres; in designs a nightstand touches the head half of its bed
AT_HAND = 0.6  # metres before a seat; in designs a coffee table is 0.4 m from its sofa, all of it before the seat
FOR_FEET = 0.3  # metres before a seat, of which no design closes half
TO_RISE = 0.2  # metres behind a chair at its table; in designs they are free
FOR_ELBOWS = 0.35  # metres from the axis of a toilet; in designs 0.4 are free on both sides
WORKTOP = 0.3  # metres of a side of a sink or cooktop; in designs a counter, or the other of them, adjoins as much
BENCH_AT_TABLE = 0.3  # metres; in designs a bench is at most 0.05 m from a table
WATCHED = 45  # degrees to both sides of where a TV unit and who watches it face; in designs it is straight ahead
IN_VIEW = 60  # degrees to both sides of where a seat faces
ROUNDED = 1e-9  # of a cosine: the page turns furniture by 15 degrees, and no turn of a room is to make a difference
BEHIND = 1.5  # metres: in no design a seat looks at the back of another so near
KITCHEN_LINE = frozenset({
    "counter", "sink", "cooktop", "corner_counter", "dishwasher", "washing_machine",  # the last three are people's
})  # fmt: skip
BESIDE_PLATFORMS = frozenset({"chair", "desk", "stool"})  # in all of the authors' tatami rooms; wardrobes stand on them


def oddities(layout: Room) -> list[Fault]:
    """Return (index of the item, name of the oddity) of all items, item by item."""
    return oddities_of_all([layout])[0]


def oddities_of_all(layouts: Sequence[Room]) -> list[list[Fault]]:
    """The `oddities` of each layout, in less than a tenth of the time that they take one by one."""
    items = Items.of(layouts)
    return by_layout(item_oddities(layouts, items), items, len(layouts))


def faults_and_oddities(layouts: Sequence[Room]) -> list[list[Fault]]:
    """All that is wrong with each layout: its `faults`, and then its `oddities`."""
    return [[*wrong, *odd] for wrong, odd in zip(faults_of_all(layouts), oddities_of_all(layouts), strict=True)]


def item_oddities(layouts: Sequence[Room], items: Items) -> dict[str, np.ndarray]:
    """Return which items have each oddity: arrays (N,) by its name. Items that are not placed have none."""
    strays = astray(layouts, items)
    return {
        OFF_ITS_WALL: off_their_walls(layouts, items),
        ASTRAY: strays,
        BEFORE_WINDOW: before_windows(layouts, items),
        IN_SWING: in_swings(layouts, items),
        ON_PLATFORM: on_platforms(items),
        CROWDED: crowded(layouts, items, strays),
        WITHOUT_SEAT: without_seats(items),
        OFF_ITS_BED: off_their_beds(items),
        UNSEEN: unseen(items),
        TURNED_AWAY: turned_away(items),
        WITHOUT_WORKTOP: without_worktops(layouts, items),
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

    It is at one if the middle half of its front is within NEAR of it, and neither its back nor three quarters of it are
    under it; an item without a front, if any part touches it. A bench of a room with tables is astray, too, unless it
    is BENCH_AT_TABLE.
    """
    hosts = unions(items.footprint[items.hosts], items.room[items.hosts], len(layouts))[items.room]
    result = items.tucked & items.placed & ~shapely.is_empty(hosts)
    those = np.flatnonzero(result)
    result[those] = ~shapely.intersects(items.footprint[those], hosts[those])
    those = those[items.period[those] == 360]  # what has a front
    corners = shapely.get_coordinates(items.footprint[those]).reshape(-1, 5, 2)
    quarter = (corners[:, 3] - corners[:, 0]) / 4
    front = shapely.points(np.stack([corners[:, 0] + quarter, corners[:, 3] - quarter], 1))
    three_quarters = corners[:, [0, 3]].mean(1) / 4 + corners[:, 1:3].mean(1) * 3 / 4  # of its depth, at half its width
    at, under = hosts[those, None], shapely.points(np.concatenate([corners[:, 1:3], three_quarters[:, None]], 1))
    result[those] = ~shapely.dwithin(at, front, NEAR).all(1) | shapely.intersects(at, under).any(1)
    bench, table = together(items, placed_of(items, "bench"), placed_of(items, "table"))
    return result | alone(items, bench, shapely.dwithin(items.footprint[bench], items.footprint[table], BENCH_AT_TABLE))


def before_windows(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether an item is TALL, stands at a window, and takes more than CLOSED of its length: (N,)."""
    result = np.zeros(len(items.room), dtype=bool)
    tall = placed_of(items, *TALL)
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


def crowded(layouts: Sequence[Room], items: Items, strays: np.ndarray) -> np.ndarray:
    """Whether a wall or another item takes some of the floor that an item needs: (N,); `strays` are astray (N,).

    That is the ROOM_BEFORE one of NEED_ROOM; what is FOR_ELBOWS on both sides of a toilet; and TO_RISE behind a chair
    at its table. A LOUNGING seat is crowded where other items, but no footstools, take more than half of what it has
    FOR_FEET.
    """
    result = np.zeros(len(items.room), dtype=bool)
    seats = with_fronts(items, *LOUNGING)
    floor = floor_ahead(items, seats, np.full(len(seats), FOR_FEET))
    stands = np.flatnonzero(items.placed & ~np.isin(items.category, [*RAISED, "stool"]))
    a, b = pairs(items.room[seats], items.room[stands])
    meets = shapely.intersects(floor[a], items.footprint[stands[b]])
    taken = unions(items.footprint[stands[b[meets]]], a[meets], len(seats))
    result[seats] = shapely.area(shapely.intersection(floor, taken)) > shapely.area(floor) / 2

    need, toilets, chairs = (with_fronts(items, *names) for names in (NEED_ROOM, ("toilet",), ("chair",)))
    elbows = FOR_ELBOWS - items.size[toilets, 1] / 2
    toilets, elbows = toilets[elbows > 2 * TOLERANCE], elbows[elbows > 2 * TOLERANCE]  # others are wide enough
    with_tables = np.isin(items.room[chairs], items.room[items.hosts & items.placed])
    chairs = chairs[items.tucked[chairs] & with_tables & ~strays[chairs]]
    floors = (
        floor_ahead(items, need, np.full(len(need), ROOM_BEFORE)),
        floor_ahead(items, toilets, elbows, LEFT),
        floor_ahead(items, toilets, elbows, RIGHT),
        floor_ahead(items, chairs, np.full(len(chairs), TO_RISE), BEHIND_IT),
    )
    those = np.concatenate([need, toilets, toilets, chairs])
    result[those[floor_taken(layouts, items, those, np.concatenate(floors))]] = True
    return result


def placed_of(items: Items, *categories: str) -> np.ndarray:
    """Return the indices (n,) of the items of these categories that are placed."""
    return np.flatnonzero(items.placed & np.isin(items.category, categories))


def with_fronts(items: Items, *categories: str) -> np.ndarray:
    """Return the indices (n,) of those of `placed_of` that are not round."""
    those = placed_of(items, *categories)
    return those[~items.round[those]]


def together(items: Items, those: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of one of `those` and another of the `others` in its room, as indices (n,) of items."""
    a, b = pairs(items.room[those], items.room[others])
    a, b = those[a], others[b]
    return a[a != b], b[a != b]


def without_seats(items: Items) -> np.ndarray:
    """Whether an item is a coffee table in a room with LOUNGING seats, and not before one: (N,).

    It is before a seat if a quarter of it is straight ahead, and it is AT_HAND.
    """
    tables, seats = together(items, placed_of(items, "coffee_table"), with_fronts(items, *LOUNGING))
    well = shapely.intersects(floor_ahead(items, seats, np.full(len(seats), AT_HAND)), items.footprint[tables])
    table, seat = tables[well], seats[well]
    top, beyond = items.footprint[table], AT_HAND + np.hypot(*items.size[table].T)
    ahead = shapely.intersection(floor_ahead(items, seat, beyond), top)
    well[well] = shapely.area(ahead) > shapely.area(top) / 4
    return alone(items, tables, well)


def off_their_beds(items: Items) -> np.ndarray:
    """Whether an item is a nightstand in a room with beds, and farther than BEDSIDE from their head halves: (N,)."""
    stand, bed = together(items, placed_of(items, "nightstand"), placed_of(items, "bed"))
    half = items.size[bed] * (0.5, 1)
    head = rectangles(items.center[bed] - facing(items, bed) * half[:, :1] / 2, half, items.degrees[bed])
    head = np.where(items.round[bed], items.footprint[bed], head)  # a round bed has no head
    return alone(items, stand, shapely.dwithin(items.footprint[stand], head, BEDSIDE))


def in_view(items: Items, a: np.ndarray, b: np.ndarray, degrees: float) -> np.ndarray:
    """Whether the centres of items b (n,) are within so many degrees of where items a (n,) face: (n,)."""
    way = items.center[b] - items.center[a]
    return (way * facing(items, a)).sum(1) >= (np.cos(np.radians(degrees)) - ROUNDED) * np.hypot(*way.T)


def unseen(items: Items) -> np.ndarray:
    """Whether an item is a TV unit in a room with LOUNGING seats or beds, and none is before it and faces it: (N,).

    Another seat, or a TALL item, must not stand between.
    """
    unit, seat = together(items, with_fronts(items, "tv_unit"), with_fronts(items, *LOUNGING, "bed"))
    well = in_view(items, unit, seat, WATCHED) & in_view(items, seat, unit, WATCHED)
    those, hides = np.flatnonzero(well), placed_of(items, *LOUNGING, *TALL)
    sight = shapely.linestrings(np.stack([items.center[unit[those]], items.center[seat[those]]], 1))
    a, b = pairs(items.room[unit[those]], items.room[hides])
    between = (hides[b] != seat[those[a]]) & shapely.intersects(sight[a], items.footprint[hides[b]])
    well[those[a[between]]] = False
    return alone(items, unit, well)


def turned_away(items: Items) -> np.ndarray:
    """Whether an item is a LOUNGING seat that faces none of the coffee tables, TV units and other seats of its room, if
    there are any, that looks at the back of another seat, or that faces no TV unit and has its back to one that faces
    it: (N,)."""
    seats = with_fronts(items, *LOUNGING)
    a, b = together(items, seats, placed_of(items, *LOUNGING, "coffee_table", "tv_unit"))
    result = alone(items, a, in_view(items, a, b, IN_VIEW))
    a, b = together(items, seats, seats)
    reach = items.size[a, :1] / 2 + BEHIND
    sight = shapely.linestrings(np.stack([items.center[a], items.center[a] + facing(items, a) * reach], 1))
    alike = (facing(items, a) * facing(items, b)).sum(1) > np.sqrt(0.5) + ROUNDED  # within 45 degrees
    result[a[alike & shapely.intersects(sight, items.footprint[b])]] = True
    a, b = together(items, seats, with_fronts(items, "tv_unit"))
    blind = alone(items, a, in_view(items, a, b, IN_VIEW))  # no TV unit is before the seat
    result[a[in_view(items, b, a, WATCHED) & ~in_view(items, a, b, 180 - WATCHED) & blind[a]]] = True
    return result


def without_worktops(layouts: Sequence[Room], items: Items) -> np.ndarray:
    """Whether an item is a sink or cooktop in a room with counters, and nothing of a kitchen's line adjoins it: (N,).

    None is odd where something of the line waits for its place: that may be beside it.
    """
    those = placed_of(items, "sink", "cooktop")
    those = those[np.isin(items.room[those], items.room[placed_of(items, "counter")])]
    waits = [any(i.center is None and i.category in KITCHEN_LINE for i in layout.furniture) for layout in layouts]
    those = those[~np.array(waits, dtype=bool)[items.room[those]]]
    a, b = together(items, those, placed_of(items, *KITCHEN_LINE))
    item, other = items.footprint[a], items.footprint[b]
    reaches = NEAR - shapely.distance(item, other)  # metres into the zone NEAR the item
    adjoins = shapely.area(shapely.intersection(shapely.buffer(item, NEAR), other)) > reaches * WORKTOP
    return alone(items, a, (reaches > 0) & adjoins)


def alone(items: Items, those: np.ndarray, well: np.ndarray) -> np.ndarray:
    """Whether an item is one of `those` (n,), and none of its entries there is `well` (n,): (N,)."""
    result = np.zeros(len(items.room), dtype=bool)
    result[those] = True
    result[those[well]] = False
    return result
