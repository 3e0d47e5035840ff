"""What no designer would do, though it breaks no rule and is no fault: said of layouts, and mended where it can be."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import shapely

from layoutrl.rooms.clearances import HOSTS
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
    hosts = [item.footprint for item in items if item.category in HOSTS and not item.tucked]
    every = Items.of([layout])
    backed = np.flatnonzero(every.placed & ~every.round & np.isin(every.category, list(AT_A_WALL)))
    off_wall = backed[sides_off_walls([layout], every, backed)[:, BACK] > NEAR]
    found = []
    for k, item in enumerate(layout.furniture):
        if item.center is None or (asked is not None and k not in asked):
            continue
        if k in off_wall:
            found.append((k, OFF_ITS_WALL))
        if item.tucked and hosts and not any(_sits_at(every.footprint[k], item.form, host) for host in hosts):
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


def _sits_at(chair: shapely.Geometry, form: str, host: shapely.Geometry) -> bool:
    """Whether its front is under a table or desk, both corners within NEAR, and its back is not; round, any of it."""
    if form == "circle":
        return chair.intersects(host)
    front_left, back_left, back_right, front_right = shapely.points(shapely.get_coordinates(chair)[:4])
    under = shapely.dwithin(host, [front_left, front_right], NEAR).all()
    return bool(under and not shapely.intersects(host, [back_left, back_right]).any())


def _closes(item: Item, window: shapely.Geometry) -> bool:
    """Whether it stands at a window, and takes more than CLOSED of its length."""
    reaches = max(NEAR - item.footprint.distance(window), 0)  # metres into what is NEAR the window
    return shapely.intersection(item.footprint, shapely.buffer(window, NEAR)).area > reaches * CLOSED
