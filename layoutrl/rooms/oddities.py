"""What no designer would do, though it breaks no rule and is no fault: said of layouts, and mended where it can be."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import shapely

from layoutrl.rooms.clearances import FRONT_DEPTH, HOSTS
from layoutrl.rooms.faults import Fault, Items
from layoutrl.rooms.room import Item, Room

OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW = "off its wall", "not at its table", "before a window"
NEAR = 0.05  # metres: no farther from its wall or window is at it
CLOSED = 0.2  # metres of a window
BACK = 1  # of the sides of an item, in the order of their corners

# What the designer always puts with its back at a wall, in 300 rooms of every type; not what rooms of people have in
# their middle, too: sofas, armchairs, lounge chairs.
AT_A_WALL = frozenset({
    "bathtub", "bed", "bench", "bookcase", "cooktop", "counter", "dresser", "fridge", "laundry_cabinet", "nightstand",
    "plant_rack", "shower", "sideboard", "sink", "sofa_bed", "toilet", "tv_unit", "vanity", "wardrobe", "washer",
    "washing_machine",
})  # fmt: skip
TALL = frozenset({"bookcase", "fridge", "wardrobe"})


def oddities(layout: Room, asked: Collection[int] | None = None) -> list[Fault]:
    """(index of the item, what is odd about it) of those `asked` about, or of all; item by item."""
    items = [item for item in layout.furniture if item.center is not None]
    hosts = shapely.union_all([item.footprint for item in items if item.category in HOSTS and not item.tucked])
    every = Items.of([layout])
    backed = np.flatnonzero(every.placed & ~every.round & np.isin(every.category, list(AT_A_WALL)))
    off_wall = backed[sides_off_walls([layout], every, backed)[:, BACK] > NEAR]
    found = []
    for k, item in enumerate(layout.furniture):
        if item.center is None or (asked is not None and k not in asked):
            continue
        if k in off_wall:
            found.append((k, OFF_ITS_WALL))
        if item.tucked and not hosts.is_empty and not _sits_at(item, every.footprint[k], hosts):
            found.append((k, ASTRAY))
        if item.category in TALL and any(_closes(item, w.shape) for w in layout.windows):
            found.append((k, BEFORE_WINDOW))
    return found


def sides_off_walls(layouts: Sequence[Room], items: Items, those: np.ndarray) -> np.ndarray:
    """How far the four sides of some items (n,), rectangles that stand, are from the walls, in metres: (n, 4).

    Of a side it is the farther of its ends; the BACK is one of them.
    """
    corners = shapely.get_coordinates(items.footprint[those]).reshape(-1, 5, 2)
    walls = shapely.boundary([layout.indoor for layout in layouts])[items.room[those]]
    off = shapely.distance(walls[:, None], shapely.points(corners))
    return np.maximum(off[:, :-1], off[:, 1:])


def _sits_at(item: Item, footprint: shapely.Geometry, hosts: shapely.Geometry) -> bool:
    """Whether a tucked item is at one of these tables and desks: the middle half of its front within NEAR of it, its
    back not under it. Of what has no front any part may touch it."""
    if item.form == "circle" or item.category not in FRONT_DEPTH:
        return footprint.intersects(hosts)
    corners = shapely.get_coordinates(footprint)
    (front_left, back_left, back_right, front_right), quarter = corners[:4], (corners[3] - corners[0]) / 4
    front, back = shapely.points([front_left + quarter, front_right - quarter]), shapely.points([back_left, back_right])
    return bool(shapely.dwithin(hosts, front, NEAR).all() and not shapely.intersects(hosts, back).any())


def _closes(item: Item, window: shapely.Geometry) -> bool:
    """Whether it stands at a window, and takes more than CLOSED of its length."""
    reaches = max(NEAR - item.footprint.distance(window), 0)  # metres into what is NEAR the window
    return shapely.intersection(item.footprint, shapely.buffer(window, NEAR)).area > reaches * CLOSED
