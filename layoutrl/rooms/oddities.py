"""What no designer would do, though it breaks no rule and is no fault: said of layouts, and mended where it can be."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import shapely

from layoutrl.rooms.clearances import HOSTS
from layoutrl.rooms.faults import Fault
from layoutrl.rooms.room import Item, Room

OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW = "off its wall", "away from its table", "before a window"
ODDITIES = (OFF_ITS_WALL, ASTRAY, BEFORE_WINDOW)
NEAR = 0.05  # metres: no farther from its wall or window is at it
CLOSED = 0.2  # metres of a window

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
    found = []
    for k, item in enumerate(layout.furniture):
        if item.center is None or (asked is not None and k not in asked):
            continue
        if _off_its_wall(layout, item):
            found.append((k, OFF_ITS_WALL))
        if item.tucked and hosts and not any(item.footprint.intersects(host) for host in hosts):
            found.append((k, ASTRAY))
        if item.category in TALL and any(_closes(item, w.shape) for w in layout.windows):
            found.append((k, BEFORE_WINDOW))
    return found


def _off_its_wall(layout: Room, item: Item) -> bool:
    if item.category not in AT_A_WALL or item.form == "circle":
        return False
    half = np.array([[-1, -1], [-1, 1]]) * item.size / 2  # the ends of its back, as it faces right
    angle = np.radians(item.degrees)
    turned = half @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    off = shapely.distance(layout.indoor.boundary, shapely.points(turned + item.center))
    return bool((off > NEAR).any())


def _closes(item: Item, window: shapely.Geometry) -> bool:
    """Whether it stands at a window, and takes more than CLOSED of its length."""
    return shapely.intersection(item.footprint, shapely.buffer(window, NEAR)).area > NEAR * CLOSED
