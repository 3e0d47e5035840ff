"""The paper's picture of a room (Figure 4): walls black, doors green, windows blue, furniture in colours.

Every pixel takes the exact share that a shape covers of it, so that a move of a tenth of a pixel shows.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString

from layoutrl.rooms.room import Room

SIDE_PX = 128
LARGE_PX = 384  # for people
LINE_PX = 1.5  # width of a black outline in a picture for people
SPAN_SHARE = 120 / 128  # share of the picture's side that the longest side of the envelope fills

WHITE = (255, 255, 255)
BLACK = (0, 0, 0)
DOOR = (0, 160, 60)
WINDOW = (40, 90, 230)
OPENINGS = {"door": DOOR, "window": WINDOW}
MOVING = (225, 30, 30)
YELLOW, PINK, VIOLET, CYAN, ORANGE, GREY = OTHERS = (
    (245, 205, 40), (245, 150, 190), (150, 105, 215), (80, 200, 205), (240, 140, 50), (165, 165, 165),
)  # fmt: skip
# Categories that stand in one room together differ; the colour of any other follows from its name.
COLOR_OF = {
    "bathtub": CYAN, "shower": PINK, "toilet": YELLOW, "vanity": VIOLET,
    "washing_machine": GREY, "washer": GREY, "bed": PINK, "wardrobe": YELLOW, "nightstand": VIOLET, "tv_unit": CYAN,
    "bench": ORANGE, "desk": CYAN, "chair": ORANGE, "bookcase": VIOLET, "platform": PINK, "stool": ORANGE,
    "sofa": PINK, "armchair": YELLOW, "coffee_table": VIOLET, "side_table": GREY, "table": YELLOW,
    "sideboard": VIOLET, "cooktop": YELLOW, "sink": PINK, "fridge": VIOLET,
    "counter": ORANGE, "laundry_cabinet": YELLOW, "lounge_chair": CYAN, "plant_rack": VIOLET,
}  # fmt: skip
DESIGNER = (0, 170, 170)
PATH = (120, 20, 20)


def color_of(category: str) -> tuple[int, int, int]:
    """The colour of furniture that stands still."""
    return COLOR_OF.get(category) or OTHERS[zlib.crc32(category.encode()) % len(OTHERS)]


class View:
    """How metres of one room become pixels of a square picture: centred, y up, row 0 on top."""

    def __init__(self, room: Room, side: int = SIDE_PX):
        x0, y0, x1, y1 = room.envelope.bounds
        self.side = side
        self.scale = side * SPAN_SHARE / max(x1 - x0, y1 - y0)  # pixels a metre
        self.offset = np.array([side / 2 - self.scale * (x0 + x1) / 2, side / 2 + self.scale * (y0 + y1) / 2])

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 2) in metres as (column, row) in pixels."""
        return self.offset + np.asarray(points) * (self.scale, -self.scale)


@lru_cache(maxsize=256)  # 12 MB
def background(room: Room) -> np.ndarray:
    """All that does not move, as an RGB picture: uint8 (SIDE_PX, SIDE_PX, 3), to be read only."""
    image = np.rint(_painted_background(room, View(room), outlined=False)).astype(np.uint8)
    image.flags.writeable = False
    return image


def picture(room: Room, position: Sequence[float]) -> np.ndarray:
    """What the agent sees with its item at `position`: uint8 (SIDE_PX, SIDE_PX, 3)."""
    image = background(room).astype(float)
    paint(image, View(room), room.moving.footprint_at((position[0], position[1])), MOVING)
    return np.rint(image).astype(np.uint8)


def story(room: Room, path: np.ndarray) -> np.ndarray:
    """A picture for people: start (pale), path (n, 2), end (red) and the designer's place (outline).

    Returns uint8 (LARGE_PX, LARGE_PX, 3). If the item never moved, no start and no path are drawn.
    """
    view = View(room, LARGE_PX)
    line = LINE_PX / view.scale  # metres
    image = _painted_background(room, view, outlined=True)
    moved = path[np.r_[True, np.any(np.diff(path, axis=0) != 0, axis=1)]]
    start, end = (room.moving.footprint_at(tuple(moved[k])) for k in (0, -1))
    if len(moved) > 1:
        paint(image, view, start, MOVING, 0.25)
    paint(image, view, end, MOVING, 0.8)
    _outline(image, view, end)
    if len(moved) > 1:
        paint(image, view, LineString(moved).buffer(line), PATH)
    if room.moving.center is not None:
        paint(image, view, room.moving.footprint.boundary.buffer(line), DESIGNER)
    return np.rint(image).astype(np.uint8)


def furnished_picture(room: Room) -> np.ndarray:
    """A picture for people of what stands in a room, its target in red: uint8 (LARGE_PX, LARGE_PX, 3)."""
    view = View(room, LARGE_PX)
    image = _painted_background(room, view, outlined=True)
    if room.target is not None:
        paint(image, view, room.moving.footprint, MOVING, 0.8)
        _outline(image, view, room.moving.footprint)
    return np.rint(image).astype(np.uint8)


def paint(
    image: np.ndarray, view: View, shape: shapely.Geometry, color: tuple[int, int, int], opacity: float = 1.0
) -> None:
    """Blend `color` into a float picture (side, side, 3), in place, where `shape` (metres) covers it."""
    if shape.is_empty:
        return
    low, high = _window(view.pixels(np.reshape(shape.bounds, (2, 2))), view.side)
    around = np.s_[low[1] : high[1], low[0] : high[0]]  # no other pixel is covered
    share = opacity * coverage(shape, view)[around][..., None]
    image[around] += share * (np.array(color) - image[around])


def coverage(shape: shapely.Geometry, view: View) -> np.ndarray:
    """Exact share of every pixel that a shape covers: (side, side), 0 to 1.

    Closed form: the signed area below each edge, clamped to the pixel's row and column, summed over edges.
    """
    total = np.zeros((view.side, view.side))
    for part in shapely.get_parts(shape):
        if part.geom_type != "Polygon":
            continue
        for ring, sign in [(part.exterior, 1)] + [(hole, -1) for hole in part.interiors]:
            corners = view.pixels(np.asarray(ring.coords))
            low, high = _window(corners, view.side)
            if (low >= high).any():  # it lies beside the picture
                continue
            columns, rows = np.arange(low[0], high[0]), np.arange(low[1], high[1])
            total[low[1] : high[1], low[0] : high[0]] += sign * np.abs(_edge_areas(corners, columns, rows))
    return np.clip(total, 0, 1)


def _window(corners: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first column and row (2,) that points (n, 2) in pixels reach, and those after the last."""
    low, high = np.floor(corners.min(0)), np.ceil(corners.max(0))
    return np.clip(low, 0, side).astype(int), np.clip(high, 0, side).astype(int)


def _edge_areas(corners: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Signed area of a closed ring within every unit pixel: (rows, columns)."""
    area = np.zeros((len(rows), len(columns)))
    for (x0, y0), (x1, y1) in pairwise(corners):
        first, stop = (int(max(x - columns[0], 0)) for x in (np.floor(min(x0, x1)), np.ceil(max(x0, x1))))
        below = columns[first:stop]  # the edge bounds nothing in other columns
        if x0 == x1 or not len(below):
            continue
        a = np.clip(min(x0, x1), below, below + 1)
        b = np.clip(max(x0, x1), below, below + 1)
        slope = (y1 - y0) / (x1 - x0)
        h0 = y0 + slope * (a - x0) - rows[:, None]  # height above the pixel's upper side where the edge enters it
        h1 = y0 + slope * (b - x0) - rows[:, None]
        area[:, first:stop] += np.sign(x1 - x0) * (b - a) * _mean_clamped(h0, h1)
    return area


def _mean_clamped(h0: np.ndarray, h1: np.ndarray) -> np.ndarray:
    """Mean of a height clamped to [0, 1] while it runs linearly from h0 to h1."""

    def integral(h: np.ndarray) -> np.ndarray:
        return np.where(h < 1, np.maximum(h, 0) ** 2 / 2, h - 0.5)

    run = h1 - h0
    level = np.abs(run) < 1e-9
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(level, np.clip(h0, 0, 1), (integral(h1) - integral(h0)) / run)


def _painted_background(room: Room, view: View, outlined: bool) -> np.ndarray:
    image = np.full((view.side, view.side, 3), WHITE, dtype=float)
    # Walls and openings in one piece first, so that no white seam shows where two of them meet.
    paint(image, view, shapely.union_all([*room.wall_shapes, *(o.shape for o in room.openings)]), BLACK)
    for opening in room.openings:
        paint(image, view, opening.shape, OPENINGS[opening.kind])
    for item in room.others:
        paint(image, view, item.footprint, color_of(item.category))
        if outlined:
            _outline(image, view, item.footprint)
    return image


def _outline(image: np.ndarray, view: View, shape: shapely.Geometry) -> None:
    paint(image, view, shape.boundary.buffer(LINE_PX / 2 / view.scale), BLACK)
