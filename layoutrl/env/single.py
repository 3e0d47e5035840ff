"""The simulator for one pose at a time, in plain floats: what `LayoutEnv` steps.

The reference `Simulator` defines rooms, moves, rewards and envelopes. Areas and crossings are computed here in closed
form, as in `areas` and `packed`. For one pose a tensor operation or a call of shapely is mostly overhead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from layoutrl.env.areas import TINY
from layoutrl.env.geometry import GRID
from layoutrl.env.packed import UPRIGHT, crossings
from layoutrl.env.reward import RewardTerms
from layoutrl.env.simulator import DIRECTIONS, TOUCHING, Simulator
from layoutrl.rooms.fitting import edges
from layoutrl.rooms.room import Point

AXES = [(int(y != 0), int(x + y)) for x, y in DIRECTIONS]  # of each direction its axis, and +1 or -1 along it
Row = Sequence[float]
Box = tuple[float, float, float, float]  # x0, y0, x1, y1
Shape = tuple[Box, float, float, list[Row]]  # bounds; area; radius, 0 for no disc; sides, if areas need them


class SingleSimulator:
    """Moves and rewards of one pose in one room of a `Simulator`: x, y in metres, on the grid.

    Discs are true circles, where shapely has polygons of 256 corners.
    """

    def __init__(self, simulator: Simulator, room: int):
        self._reward = simulator.reward_function
        self._steps: list[float] = simulator.steps[room].tolist()
        self._slides = simulator.moves.slide
        borders, _ = edges(simulator.legal[[room]])
        contacts = simulator.contacts[room]
        contacts = contacts[~np.isnan(contacts[:, 0])]
        self._borders = [crossings(borders, axis, 0.0).tolist() for axis in (0, 1)]
        self._contacts = [crossings(contacts, axis, TOUCHING).tolist() for axis in (0, 1)]

        # Areas are computed in the item's frame: turned back by its rotation, so that its own sides are upright.
        item = simulator.rooms[room].moving
        disc = item.form == "circle"
        turn = math.radians(0.0 if disc or item.degrees % 90 == 0 else item.degrees)
        self._cosine, self._sine = math.cos(turn), math.sin(turn)
        along_x, along_y = item.size if disc or item.degrees % 180 != 90 else item.size[::-1]
        self._half = along_x / 2, along_y / 2
        self._radius = along_x / 2 if disc else 0.0
        self._area = item.area
        first, last = np.searchsorted(simulator.room_of_shape, (room, room + 1))
        is_disc = simulator.is_circle[first:last] | (disc & (np.arange(last - first) == 1))  # the designer's footprint
        self._shapes = self._seen(simulator.shapes[first:last], is_disc)  # indoor area, designer's footprint, elements

    def destinations(self, x: float, y: float) -> tuple[list[Point], list[bool]]:
        """Where each of A actions leads, and whether it is legal."""
        at = x, y
        borders = _crossed(self._borders[0], y), _crossed(self._borders[1], x)
        ends, legal = [], []
        for step in self._steps:
            for axis, sign in AXES:
                end = round((at[axis] + sign * step) / GRID) * GRID
                inside = False
                for border in borders[axis]:
                    if border < end:
                        inside = not inside
                ends.append((end, y) if axis == 0 else (x, end))
                legal.append(inside)
        if self._slides:
            contacts = _crossed(self._contacts[0], y), _crossed(self._contacts[1], x)
            slides = *_ahead(contacts[0], x, TOUCHING), *_ahead(contacts[1], y, TOUCHING)[::-1]
            limits = *_ahead(borders[0], x, 0.0), *_ahead(borders[1], y, 0.0)[::-1]
            for (axis, sign), slide, limit in zip(AXES, slides, limits, strict=True):
                # The next contact may lie beyond the outer walls: in a room with recesses, or behind an item.
                touches = slide < limit
                end = round((at[axis] + sign * slide) / GRID) * GRID if touches else at[axis]
                ends.append((end, y) if axis == 0 else (x, end))
                legal.append(touches)
        return ends, legal

    def reward(self, x: float, y: float) -> RewardTerms[float]:
        """The reward of standing there."""
        x, y = self._cosine * x + self._sine * y, self._cosine * y - self._sine * x
        half_x, half_y = self._half
        left, below, right, up = box = x - half_x, y - half_y, x + half_x, y + half_y
        shared, ious = [], []
        for shape in self._shapes:
            (x0, y0, x1, y1), area, _, _ = shape
            touches = x0 < right and x1 > left and y0 < up and y1 > below
            shared.append(max(self._shared(x, y, box, shape), 0.0) if touches else 0.0)  # rounding can give less than 0
            ious.append(shared[-1] / (self._area + area - shared[-1]))
        return self._reward(ious[1], sum(ious[2:], 0.0), shared[0] / self._area, ious[0], 0.0)

    def _seen(self, shapes: np.ndarray, is_disc: np.ndarray) -> list[Shape]:
        """Return shapes (n,), some of which are discs, in the item's frame."""
        radius = np.where(is_disc, np.ptp(shapely.bounds(shapes)[:, [0, 2]], 1) / 2, 0.0)  # turned it is less wide
        if self._sine:
            matrix = np.array([[self._cosine, -self._sine], [self._sine, self._cosine]])
            shapes = shapely.transform(shapes, lambda corners: corners @ matrix)
        bounds, area = shapely.bounds(shapes), shapely.area(shapes)
        is_box = np.prod(bounds[:, 2:] - bounds[:, :2], 1) - area < UPRIGHT
        with_sides = ~is_disc & (~is_box | bool(self._radius))  # to a disc a box is a polygon like any other
        center = bounds.reshape(-1, 2, 2).mean(1)
        around = np.hstack([center - radius[:, None], center + radius[:, None]])
        bounds = np.where(is_disc[:, None], around, bounds)
        area = np.where(is_disc, math.pi * radius**2, area)
        sides, of = edges(shapely.orient_polygons(shapes))
        return [
            ((x0, y0, x1, y1), area, radius, sides[of == k].tolist() if with_sides[k] else [])
            for k, (x0, y0, x1, y1, area, radius) in enumerate(np.column_stack([bounds, area, radius]).tolist())
        ]

    def _shared(self, x: float, y: float, box: Box, shape: Shape) -> float:
        """Return the area that the item shares with a shape: x, y and its box are in its frame."""
        (x0, y0, x1, y1), _, radius, sides = shape
        left, below, right, up = box
        if radius and self._radius:
            off_x, off_y = x - (x0 + x1) / 2, y - (y0 + y1) / 2
            return _of_discs(off_x * off_x + off_y * off_y, self._radius, radius)
        if radius:
            xs, ys = (left, right, right, left), (below, below, up, up)
            around = list(zip(xs, ys, xs[1:] + xs[:1], ys[1:] + ys[:1], strict=True))
            return _in_disc(around, (x0 + x1) / 2, (y0 + y1) / 2, radius)
        if self._radius:
            return _in_disc(sides, x, y, self._radius)
        if sides:
            return _in_box(sides, left, below, right, up)
        return (min(right, x1) - max(left, x0)) * (min(up, y1) - max(below, y0))


def _crossed(table: list[Row], across: float) -> list[float]:
    """Return where the line along an axis, at `across` on the other, is crossed by segments, rows of `crossings`."""
    return [
        min(max(place + slope * (across - at), least), most) if slope else place
        for low, high, place, at, slope, least, most in table
        if low <= across < high
    ]


def _ahead(crossed: list[float], along: float, nearest: float) -> tuple[float, float]:
    """How far it is to the first place further than `nearest`, onwards and backwards; infinity for none."""
    onwards = backwards = math.inf
    for place in crossed:
        way = place - along
        if nearest < way < onwards:
            onwards = way
        elif nearest < -way < backwards:
            backwards = -way
    return onwards, backwards


def _in_box(sides: Sequence[Row], left: float, below: float, right: float, up: float) -> float:
    """The area that an upright rectangle shares with a polygon: `areas.box_polygon`."""
    twice, height = 0.0, up - below
    for x0, y0, x1, y1 in sides:
        start = left if x0 < left else right if x0 > right else x0
        end = left if x1 < left else right if x1 > right else x1
        width = end - start
        if not width:
            continue
        slope = (y1 - y0) / (x1 - x0)
        first = y0 - below + slope * (start - x0)
        last = first + slope * width
        low = 0.0 if first < 0 else height if first > height else first
        high = 0.0 if last < 0 else height if last > height else last
        twice -= width * (low + high)
        if low != high:
            twice -= (high - low) / slope * (first + last - low - high)
    return twice / 2


def _in_disc(sides: Sequence[Row], x: float, y: float, radius: float) -> float:
    """The area that a disc shares with a polygon: `areas.disc_polygon`."""
    twice, squared = 0.0, radius * radius
    for x0, y0, x1, y1 in sides:
        dx, dy = x1 - x0, y1 - y0
        length = math.hypot(dx, dy)
        if not length:
            continue
        dx, dy = dx / length, dy / length
        distance = (x0 - x) * dy - (y0 - y) * dx
        start = (x0 - x) * dx + (y0 - y) * dy
        end = start + length
        reach = math.sqrt(max(squared - distance * distance, 0.0))
        first, last = min(max(start, -reach), reach), min(max(end, -reach), reach)
        edge_cos, edge_sin = distance * distance + start * end, distance * length
        chord_cos, chord_sin = distance * distance + first * last, distance * (last - first)
        angle = math.atan2(edge_sin * chord_cos - edge_cos * chord_sin, edge_cos * chord_cos + edge_sin * chord_sin)
        twice += chord_sin + squared * angle
    return twice / 2


def _of_discs(distance_squared: float, a: float, b: float) -> float:
    """The area that discs of radii a and b share: `areas.disc_disc`."""
    total, gap = a + b, a - b
    triangle = math.sqrt(max((total * total - distance_squared) * (distance_squared - gap * gap), TINY**2))
    angle_a = math.atan2(triangle, distance_squared + gap * total)
    angle_b = math.atan2(triangle, distance_squared - gap * total)
    return a * a * angle_a + b * b * angle_b - triangle / 2
