"""What furniture needs of the floor around it, as the designer has it. Metres.

Depths are the least that any of the designer's templates keeps for the category (`Piece.front`): whose figures they
are, of the HUD's, Neufert's and the NKBA's or unsourced, the templates say.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from layoutrl.rooms.room import Item

Angle = TypeVar("Angle", float, np.ndarray)

# Kept free before an item, as wide as it is; 0 where it has a front but some template keeps nothing free there. What
# is not named has no front: it faces nowhere, as tables and stools do. Nor has anything round.
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
RAISED = frozenset({"platform"}) | RUGS  # floor to walk on, and to stand on

# What a tucked item may stand under: a chair, under the desk or table where one sits.
HOSTS = frozenset({"desk", "table"})

# What may stand in the floor before a category: who sits at a desk; wardrobes round a corner, one before the other's
# end.
MAY_STAND_BEFORE = {"desk": frozenset({"chair", "stool"}), "wardrobe": frozenset({"wardrobe"})}

PASSAGE = 0.6  # to every item,
NARROW = {"bathroom": 0.5, "kitchen": 0.5}  # but in these types


def may_tuck(item: Item, items: Iterable[Item]) -> bool:
    """Whether an item that is to be placed may stand under one of these: a chair, where one sits at something."""
    return item.category == "chair" and any(other.category in HOSTS for other in items)


def front_depth(item: Item) -> float:
    """How many metres of floor are to be free before an item."""
    return 0.0 if item.form == "circle" else FRONT_DEPTH.get(item.category, 0.0)


def floor_before(item: Item) -> Item | None:
    """The floor that is to be free before an item, as an item that faces as this one does; its centre is `ahead`."""
    depth = front_depth(item)
    return Item(item.category, (depth, item.size[1])) if depth else None


def ahead(item: Item, floor: Item) -> float:
    """How many metres before the middle of an item that of the floor before it is."""
    return (item.size[0] + floor.size[0]) / 2


def may_stand_before(category: str, other: str) -> bool:
    """Whether what is of the other category takes nothing of the floor before one of the first."""
    return other in RAISED or other in MAY_STAND_BEFORE.get(category, ())


def may_share_floor(item: Item, other: Item) -> bool:
    """Whether two items do not overlap wherever they stand, as `layoutrl.rooms.faults` has it.

    One is tucked and the other a host, which is not tucked itself; or one is raised floor, on which the other stands,
    or a rug.
    """
    if {item.category, other.category} & RUGS or (item.category in RAISED) != (other.category in RAISED):
        return True
    return any(
        under.tucked and host.category in HOSTS and not host.tucked for under, host in ((item, other), (other, item))
    )


def passage(room_type: str) -> float:
    """How wide the way to every item is at least."""
    return NARROW.get(room_type, PASSAGE)


def period(item: Item) -> float:
    """Degrees after which an item looks as before: without a front half a turn is none; of a square one no quarter is,
    either, and of a round one no turn at all."""
    if item.form == "circle":
        return 90.0
    if item.category in FRONT_DEPTH:
        return 360.0
    return 180.0 if item.size[0] != item.size[1] else 90.0


def off(degrees: Angle, period: Angle) -> Angle:
    """How far angles are from the nearest multiple of a period, in degrees. Below 45 two items face alike."""
    return abs((degrees + period / 2) % period - period / 2)
