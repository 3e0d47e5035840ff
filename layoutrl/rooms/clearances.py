"""The floor that furniture needs around it, as the designer has it. Metres.

Depths are the least that any of the designer's templates keeps for the category (`Piece.front`). The templates give
the source of each figure: the HUD, Neufert, the NKBA, or none.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from layoutrl.rooms.room import Item

Angle = TypeVar("Angle", float, np.ndarray)

# Depth kept free before an item, over its whole width; 0 if it has a front but some template keeps nothing free there.
# Categories that are not listed have no front, such as tables and stools. Nor has any round item.
FRONT_DEPTH = {
    "armchair": 0.0,  # 0.5 in studies
    "bathtub": 0.0,
    "bed": 0.6,
    "bench": 0.0,
    "bookcase": 0.6,
    "chair": 0.0,
    "cooktop": 0.9,
    "counter": 0.0,
    "desk": 0.6,
    "dresser": 0.0,
    "fridge": 0.9,
    "laundry_cabinet": 0.6,
    "lounge_chair": 0.4,
    "loveseat": 0.0,
    "nightstand": 0.0,
    "plant_rack": 0.45,
    "shower": 0.6,
    "sideboard": 0.9,
    "sink": 0.5,  # 0.9 in kitchens
    "sofa": 0.4,
    "sofa_bed": 0.6,
    "toilet": 0.6,
    "tv_unit": 0.0,  # 0.75 in living rooms
    "vanity": 0.6,
    "wardrobe": 0.6,  # at a platform's end it keeps none, since it opens over the platform, where one stands
    "washer": 0.6,
    "washing_machine": 0.6,
}

RUGS = frozenset({"carpet", "mat", "rug"})
RAISED = frozenset({"platform"}) | RUGS  # floor: people walk on it, and furniture stands on it

# What a tucked item may stand under: a chair, under the desk or table where one sits.
HOSTS = frozenset({"desk", "table"})

# What may stand on the floor before a category: seats before a desk; wardrobes round a corner, one before the end of
# the other; a coffee table before seats that keep floor free, since it is moved aside.
MAY_STAND_BEFORE = {
    "desk": frozenset({"chair", "stool"}),
    "lounge_chair": frozenset({"coffee_table"}),
    "sofa_bed": frozenset({"coffee_table"}),
    "wardrobe": frozenset({"wardrobe"}),
}

PASSAGE = 0.6  # width of the way to every item,
NARROW = {"bathroom": 0.5, "kitchen": 0.5}  # except in these room types


def may_tuck(item: Item, items: Iterable[Item]) -> bool:
    """Whether an item may stand under one of these: it is a chair, and there is a desk or table."""
    return item.category == "chair" and any(other.category in HOSTS for other in items)


def front_depth(item: Item) -> float:
    """How many metres of floor are to be free before an item."""
    return 0.0 if item.form == "circle" else FRONT_DEPTH.get(item.category, 0.0)


def floor_before(item: Item) -> Item | None:
    """Return the floor to keep free before an item, or None: an Item to be turned as it is, and put `ahead` of it."""
    depth = front_depth(item)
    return Item(item.category, (depth, item.size[1])) if depth else None


def ahead(item: Item, floor: Item) -> float:
    """Return the distance from the centre of an item to that of the floor before it, in metres."""
    return (item.size[0] + floor.size[0]) / 2


def may_stand_before(category: str, other: str) -> bool:
    """Whether items of the category `other` may stand on the floor before those of `category`."""
    return other in RAISED or other in MAY_STAND_BEFORE.get(category, ())


def may_share_floor(item: Item, other: Item) -> bool:
    """Whether two items may overlap without a fault, as in `layoutrl.rooms.faults`.

    One is tucked and the other is one of the HOSTS that is not tucked itself; or one of them is RAISED and the other
    is not; or one is a rug.
    """
    if {item.category, other.category} & RUGS or (item.category in RAISED) != (other.category in RAISED):
        return True
    return any(
        under.tucked and host.category in HOSTS and not host.tucked for under, host in ((item, other), (other, item))
    )


def passage(room_type: str) -> float:
    """Return the least width of the way to every item, in metres."""
    return NARROW.get(room_type, PASSAGE)


def period(item: Item) -> float:
    """Return the degrees of turn after which an item looks as before: 360 with a front, else 180, or 90 if square.

    A round item looks the same after any turn; its period is 90, too.
    """
    if item.form == "circle":
        return 90.0
    if item.category in FRONT_DEPTH:
        return 360.0
    return 180.0 if item.size[0] != item.size[1] else 90.0


def angle_off(degrees: Angle, period: Angle) -> Angle:
    """How far angles are from the nearest multiple of a period, in degrees. Below 45 two items face alike."""
    return abs((degrees + period / 2) % period - period / 2)
