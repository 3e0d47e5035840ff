"""Designed rooms made less regular, as flats are, under the same layout.

At most two of these are done: a corner is cut off or built in, a column or a pier is added, the windows are bricked up,
or a wall gets one more door. The designer's layout has no fault in such a room either.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import Polygon, box
from shapely.geometry.polygon import orient

from layoutrl.rooms.faults import faults_from_entrance
from layoutrl.rooms.room import TOLERANCE, Opening, Ring, Room, wall_band, wall_thickness

MOST = 2  # disturbances of a room
TRIES = 8  # of each kind, in a room
CORNER = (0.3, 1.5)  # metres of each wall that a corner takes, and half of the wall at most
COLUMN = (0.2, 0.5)  # metres, of the sides of a column or a pier
DOOR = (0.7, 1.0)  # metres, of a door's width
CLEAR_OUTSIDE = 0.9  # metres outside a door that the room itself stays clear of, as the designer has it
GRID = 1e-6  # metres, to which the corners of the remaining floor are rounded
KEPT = 0.99  # share of the floor and wall along an opening that is still beside it
LITTLE = 0.01  # square metres: a piece that takes less counts as nothing
ROUNDED = 1e-6  # square metres: smaller areas come of rounding to GRID


def disturbed(rooms: Sequence[Room], rngs: Sequence[np.random.Generator]) -> list[tuple[Room, list[str]]]:
    """Return (disturbed room, names of its disturbances) for each room; its generator draws them.

    A room is returned as it is, with no names, if none was found that leaves its layout without a fault.
    """
    result = [(room, list[str]()) for room in rooms]
    wanted = [rng.integers(1, MOST + 1) for rng in rngs]
    kinds = [rng.permutation(len(DISTURBANCES)) for rng in rngs]
    for k in range(len(DISTURBANCES)):
        for _ in range(TRIES):
            tried = dict[int, tuple[Room, str]]()
            for n, (room, names) in enumerate(result):
                disturb = DISTURBANCES[kinds[n][k]]
                if len(names) < wanted[n] and disturb.__name__ not in names and (found := disturb(room, rngs[n])):
                    tried[n] = found, disturb.__name__
            wrong = faults_from_entrance([room for room, _ in tried.values()]) if tried else []
            for (n, (room, name)), faults in zip(tried.items(), wrong, strict=True):
                if not faults:
                    walls = wall_band(room.outline, room.holes, room.openings, wall_thickness(rooms[n]))
                    result[n] = replace(room, walls=walls), [*result[n][1], name]
    return result


def corner_cut(room: Room, rng: np.random.Generator) -> Room | None:
    """A triangle is taken at a corner, which leaves a slanting wall."""
    corner, along, back = _corner(room, rng)
    return without(room, Polygon([corner, corner + along, corner + back]))


def corner_built_in(room: Room, rng: np.random.Generator) -> Room | None:
    """A parallelogram is taken at a corner, which leaves an L-shaped room."""
    corner, along, back = _corner(room, rng)
    return without(room, Polygon([corner, corner + along, corner + along + back, corner + back]))


def column(room: Room, rng: np.random.Generator) -> Room | None:
    """Build a column, a rectangle parallel to the axes, anywhere."""
    x0, y0, x1, y1 = room.indoor.bounds
    x, y = rng.uniform((x0, y0), (x1, y1))
    width, depth = rng.uniform(*COLUMN, 2)
    return without(room, box(x, y, x + width, y + depth))


def pier(room: Room, rng: np.random.Generator) -> Room | None:
    """Build a pier, a rectangle with its back at a wall."""
    width, depth = rng.uniform(*COLUMN, 2)
    start, along, inwards = _along_a_wall(room, rng, width)
    return without(room, Polygon([start, start + along, start + along + depth * inwards, start + depth * inwards]))


def bricked_up(room: Room, _: np.random.Generator) -> Room | None:
    """Remove all windows; None if there are none."""
    return replace(room, openings=room.doors) if room.windows else None


def one_more_door(room: Room, rng: np.random.Generator) -> Room | None:
    """Add a door that leads out of the room; None if the chosen place is narrow, near an opening or leads back in."""
    start, along, inwards = _along_a_wall(room, rng, rng.uniform(*DOOR))
    thickness = wall_thickness(room)

    def outside(depth: float) -> Polygon:
        return Polygon([start - depth * inwards, start + along - depth * inwards, start + along, start])

    door = outside(thickness)
    too_narrow = np.hypot(*along) < DOOR[0]
    beside = any(opening.shape.distance(door) < thickness for opening in room.openings)
    if too_narrow or beside or outside(thickness + CLEAR_OUTSIDE).intersection(room.indoor).area > ROUNDED:
        return None
    return replace(room, openings=(*room.openings, Opening("door", _ring(door.exterior))))


# None of them changes the walls: `disturbed` draws these anew where the layout has no fault.
DISTURBANCES: tuple[Callable[[Room, np.random.Generator], Room | None], ...] = (
    corner_cut, corner_built_in, column, pier, bricked_up, one_more_door,
)  # fmt: skip


def without(room: Room, piece: Polygon) -> Room | None:
    """Return the room without a piece of its floor.

    None where an item or an opening is in the way, the floor would fall apart, or nothing is taken.
    """
    if shapely.dwithin([item.footprint for item in room.furniture], piece, TOLERANCE).any():
        return None
    left = shapely.set_precision(room.indoor.difference(piece), GRID)
    if not isinstance(left, Polygon) or left.area > room.indoor.area - LITTLE:
        return None
    before, after = (shapely.boundary(shape).buffer(TOLERANCE) for shape in (room.indoor, left))
    for opening in room.openings:
        if shapely.area(opening.shape.intersection(after)) < KEPT * shapely.area(opening.shape.intersection(before)):
            return None
    return replace(room, outline=_ring(left.exterior), holes=tuple(_ring(hole)[::-1] for hole in left.interiors))


def _corner(room: Room, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Choose a corner at random, and vectors along both of its walls that span what is taken there: each (2,)."""
    ring = np.array(room.outline)
    k = rng.integers(len(ring))
    corner = ring[k]
    ways = np.array([ring[(k + 1) % len(ring)], ring[k - 1]]) - corner
    lengths = np.hypot(*ways.T)
    along, back = ways * rng.uniform(*(np.minimum(metres / lengths, 0.5) for metres in CORNER))[:, None]
    return corner, along, back


def _along_a_wall(room: Room, rng: np.random.Generator, width: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Choose a stretch of wall at random, `width` metres at most: its start, the vector along it, a metre inwards."""
    ring = np.array(room.outline)
    k = rng.integers(len(ring))
    way = ring[(k + 1) % len(ring)] - ring[k]
    length = np.hypot(*way)
    along, inwards = way / length, np.array([-way[1], way[0]]) / length
    width = min(width, length)
    return ring[k] + along * rng.uniform(0, length - width), width * along, inwards


def _ring(ring: shapely.LinearRing) -> Ring:
    return tuple((x, y) for x, y in orient(Polygon(ring)).exterior.coords[:-1])
