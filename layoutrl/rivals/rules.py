"""Baselines that learn nothing: each places one item in B rooms and returns its centres (B, 2) in metres.

Only `best_wall_place` reads the designer's place in the room that it furnishes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from layoutrl.env.geometry import CONTACT
from layoutrl.env.simulator import Simulator
from layoutrl.rooms.fitting import center_range, edges, fitting_positions, relative_place
from layoutrl.rooms.room import SYMMETRIES, TOLERANCE, Room, symmetry

MILLIMETRE = 3  # decimals of a metre


def wall_places(room: Room) -> np.ndarray:
    """Return the places (n, 2) at which the item's bounding box stands in a corner or at the middle of a wall.

    They are the corners, and the middles of the edges, of the region of centres at which that box lies indoors. Where
    it fits nowhere, the outline's bounding box is taken instead of the outline.
    """
    around = shapely.box(*room.moving.template.bounds)
    fits = fitting_positions(np.array([room.indoor]), np.array([around]), CONTACT)[0]
    if fits.is_empty:
        fits = shapely.box(*np.concatenate(center_range(room, room.moving)))
    border, _ = edges(np.array([fits.simplify(TOLERANCE)]))
    middles = shapely.points((border[:, :2] + border[:, 2:]) / 2)
    middles = shapely.get_coordinates(shapely.shortest_line(fits, middles))[::2]  # else some lie past a corner
    places = np.concatenate([border[:, :2], middles])
    return np.unique(places.round(MILLIMETRE), axis=0)  # where it just fits between two walls, both have the same


def random_wall_place(
    simulator: Simulator, room: np.ndarray, starts: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """For each of B rooms one of its legal wall places, drawn at random; the start where none is legal."""
    chosen, places_of = starts.copy(), {}
    for k in np.unique(room):
        places = wall_places(simulator.rooms[k])
        places_of[k] = places[simulator.is_legal(np.repeat(k, len(places)), places)]
    for b, k in enumerate(room):
        if len(places := places_of[k]):
            chosen[b] = places[rng.integers(len(places))]
    return chosen


def best_wall_place(simulator: Simulator, room: np.ndarray) -> np.ndarray:
    """For each of B rooms the wall place that has the highest IoU with the designer's place.

    Chosen with knowledge of the answer: what a method can reach that knows the right wall or corner and nothing else.
    """
    best = []
    for k in room:
        places = wall_places(simulator.rooms[k])
        best.append(places[simulator.reward(np.repeat(k, len(places)), places).iou.argmax()])
    return np.array(best)


def far_end_place(simulator: Simulator, room: np.ndarray) -> np.ndarray:
    """For each of B rooms the place by a hand rule for bathtubs: across the end far from the door.

    The rule works in the outline's bounding box. Along the axis on which the item, as it is turned, has the most play,
    it stands flush with the end that is farther from the centre of the nearest door, measured along that axis. Along
    the other axis, which it more or less fills, it stands in the middle. Without a door the windows count; without
    windows it stands at the upper end.
    """
    places = []
    for k in room:
        low, high = center_range(simulator.rooms[k], simulator.rooms[k].moving)
        axis = int(np.argmax(high - low))
        x0, y0, x1, y1 = simulator.rooms[k].indoor.bounds
        ends = np.array([(x0, x1), (y0, y1)])[axis]
        doors = simulator.rooms[k].doors or simulator.rooms[k].openings
        at = [door.shape.centroid.coords[0][axis] for door in doors] or ends[:1]
        distance = np.abs(np.subtract.outer(ends, at)).min(1)
        place = (low + high) / 2
        place[axis] = low[axis] if distance[0] > distance[1] else high[axis]
        places.append(place)
    return np.array(places)


def nearest_wall_place(simulator: Simulator, room: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """For each of B starts the item moved straight to the nearest side of the outline's bounding box."""
    nearest = []
    for k, start in zip(room, starts, strict=True):
        low, high = center_range(simulator.rooms[k], simulator.rooms[k].moving)
        ways = np.array([(low[0], start[1]), (high[0], start[1]), (start[0], low[1]), (start[0], high[1])])
        nearest.append(ways[np.argmin(np.abs(ways - start).sum(1))])
    return np.array(nearest)


def nearest_room_place(simulator: Simulator, room: np.ndarray, training: Sequence[Room]) -> np.ndarray:
    """For each of B rooms the designer's relative place in the training room that is most like it.

    Rooms are compared, in all eight symmetries, by the size of the outline, the size of the item and the centre of the
    first door. Rooms of the same group hold the answer and are left out, unless there are no others. Of the rest,
    rooms in which the same category moves come first. The place is relative to the outline's bounding box, and stays
    inside it.
    """
    pairs = np.array([_features(r) for r in training])  # (training, 3, 2)
    relative = np.array([relative_place(r, r.moving) for r in training])
    category, group = np.array([r.moving.category for r in training]), np.array([r.group for r in training])
    # Sizes have no sign that a symmetry could change.
    views = [symmetry(*which) for which in SYMMETRIES]
    features = np.stack([np.concatenate([pairs[:, :2] @ np.abs(m).T, pairs[:, 2:] @ m.T], 1) for m in views])
    places = []
    for r in simulator.rooms:
        unlike = ((features - _features(r)) ** 2).sum((2, 3)) + 1e6 * (category != r.moving.category)
        if not (own := group == r.group).all():
            unlike[:, own] = np.inf
        view, k = np.unravel_index(np.argmin(unlike), unlike.shape)
        low, high = center_range(r, r.moving)
        there = np.clip(0.5 + views[view] @ (relative[k] - 0.5), 0, 1)
        places.append(low + there * np.maximum(high - low, 0))
    return np.array(places)[room]


def _features(room: Room) -> np.ndarray:
    x0, y0, x1, y1 = room.indoor.bounds
    a, b, c, d = room.moving.template.bounds
    doors = room.doors or room.openings
    at = doors[0].shape.centroid if doors else room.indoor.centroid
    return np.array([[x1 - x0, y1 - y0], [c - a, d - b], [at.x - (x0 + x1) / 2, at.y - (y0 + y1) / 2]])
