"""Doors: what floor they need, which is the entrance, how wide they are, and what their leaves sweep. Metres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, wraps
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np
import shapely
from shapely.affinity import translate

from layoutrl.rooms.clearances import RAISED, passage
from layoutrl.rooms.room import TOLERANCE, Item, Opening, Room, along_and_through

DOOR_CLEARANCE = 0.3  # metres before and behind a door that are needed to pass it
WIDEST_LEAF = 1.2  # metres: wider doors slide, or have two leaves
STEPS = 9  # straight lines for the arc that a leaf sweeps
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Leaf:
    """A way to hang a door's leaf: its hinge, and its other end when shut and when open, as points (2,)."""

    hinge: np.ndarray
    shut: np.ndarray
    open: np.ndarray

    def arc(self, steps: int) -> np.ndarray:
        """Return the points (steps + 1, 2) on the arc of its other end, from shut to open."""
        angle = np.linspace(0, np.pi / 2, steps + 1)[:, None]
        return self.hinge + np.cos(angle) * (self.shut - self.hinge) + np.sin(angle) * (self.open - self.hinge)

    @cached_property
    def swept(self) -> shapely.Polygon:
        """The floor over which it swings into the room."""
        return shapely.Polygon([self.hinge, *self.arc(STEPS)])


def without_furniture(work: Callable[Concatenate[Room, P], T]) -> Callable[Concatenate[Room, P], T]:
    """Do the work for the room without furniture, which many layouts share, and keep what it returns."""
    kept = lru_cache(maxsize=1024)(work)

    @wraps(work)
    def of(room: Room, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return kept(replace(room, furniture=(), target=None), *args, **kwargs)  # type: ignore[arg-type]

    return of


@without_furniture
def kept_free(room: Room) -> shapely.Geometry:
    """Return the area to keep free: windows, doors, and the floor before and behind each door."""
    zones = [window.shape for window in room.windows]
    border = room.indoor.boundary
    for door in room.doors:
        _, through = along_and_through(door.shape, border)
        x, y = DOOR_CLEARANCE * through / np.hypot(*through)
        zones.append(shapely.union(translate(door.shape, x, y), translate(door.shape, -x, -y)).convex_hull)
    return shapely.union_all(zones)


def entrance(room: Room) -> Opening | None:
    """Return the door by which one enters: the first as wide as the `way_width`, less 1 cm; None if there is none."""
    return next(iter(_wide_doors(room)), None)


def way_width(room: Room) -> float:
    """How wide the way to each item is, in metres: the `passage`, or less where no door is as wide."""
    return min(passage(room.room_type), max(door_widths(room), default=np.inf))


def free_doors(room: Room) -> list[Opening]:
    """Return the doors by which one could enter that have floor to stand on for somebody as wide as the `way_width`."""
    radius = (way_width(room) - TOLERANCE) / 2
    solid = shapely.union_all([item.footprint for item in in_the_way(room)])
    floor = empty_floor(room, radius) - solid.buffer(radius)
    return [door for door in _wide_doors(room) if door.shape.dwithin(floor, TOLERANCE)]


def with_a_free_door_first(room: Room) -> Room:
    """Return the room with the first of its `free_doors` before its other openings, so that one enters there."""
    if len(room.doors) < 2 or not (free := free_doors(room)) or free[0] is entrance(room):
        return room
    return replace(room, openings=(free[0], *(opening for opening in room.openings if opening is not free[0])))


def before_doors(room: Room) -> list[Item]:
    """Return what stands so near to a door by which one could enter that nobody can stand there."""
    radius = (way_width(room) - TOLERANCE) / 2
    doors = shapely.union_all([door.shape for door in _wide_doors(room)])
    return [item for item in in_the_way(room) if item.footprint.dwithin(doors, radius)]


def in_the_way(room: Room) -> list[Item]:
    """Return the items that stand and stop who walks, or a door that meets them."""
    return [i for i in room.furniture if i.center and (i.form == "circle" or i.rotation is not None) and bars(i)]


@without_furniture
def empty_floor(room: Room, radius: float) -> shapely.Geometry:
    """Return where the centre of a disc of this radius (metres) can be in the empty room. Doors are wide open."""
    walls = room.indoor.boundary - shapely.union_all([door.shape for door in room.doors]).buffer(TOLERANCE)
    return room.indoor - walls.buffer(radius)


@without_furniture
def door_widths(room: Room) -> tuple[float, ...]:
    """How wide each door is, in metres."""
    border = room.indoor.boundary
    return tuple(float(np.hypot(*along_and_through(door.shape, border)[0])) for door in room.doors)


@without_furniture
def leaves(room: Room) -> tuple[tuple[Leaf, Leaf] | None, ...]:
    """Return the leaf of each door, hung at one end and at the other; None for a door wider than WIDEST_LEAF."""
    border, hung = room.indoor.boundary, list[tuple[Leaf, Leaf] | None]()
    for door in room.doors:
        along, through = along_and_through(door.shape, border)
        width = float(np.hypot(*along))
        middle = np.array(door.shape.minimum_rotated_rectangle.centroid.coords[0])
        beyond = through * (0.5 + TOLERANCE / np.hypot(*through))
        off = shapely.distance(room.indoor, shapely.points([middle + beyond, middle - beyond]))
        inward = through / np.hypot(*through) * (1 if off[0] <= off[1] else -1)
        one, other = (middle + abs(through @ inward) / 2 * inward + side * along / 2 for side in (-1, 1))
        ahead = width * inward
        both = Leaf(one, other, one + ahead), Leaf(other, one, other + ahead)
        hung.append(both if width < WIDEST_LEAF + TOLERANCE else None)
    return tuple(hung)


def drawn_leaves(room: Room) -> list[Leaf | None]:
    """Return the leaf of each door as plans draw it; None as in `leaves`.

    It is hung at the end at which no furniture stops it; if that holds of both or none, at the one nearer to a corner.
    """
    corners = shapely.multipoints(room.outline)
    solid = shapely.union_all([item.footprint for item in in_the_way(room)]).buffer(-TOLERANCE)

    def worse(leaf: Leaf) -> tuple[bool, float]:
        return leaf.swept.intersects(solid), corners.distance(shapely.Point(leaf.hinge))

    return [both and min(both, key=worse) for both in leaves(room)]


def bars(item: Item) -> bool:
    """Whether an item stops a door that meets it: tucked items are moved aside, and RAISED ones are floor."""
    return not item.tucked and item.category not in RAISED


def _wide_doors(room: Room) -> list[Opening]:
    """Return the doors as wide as the `way_width`, less 1 cm."""
    wide = way_width(room) - TOLERANCE
    return [door for door, width in zip(room.doors, door_widths(room), strict=True) if width >= wide]
