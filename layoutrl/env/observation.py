"""The two observations of a state S = (walls, openings, furniture): `geometry`, that tuple itself, and `image`.

Both are made for a batch of poses, on the learner's device, from tables of what does not move.
Neither reads the designer's place of the moving item.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
import torch
from shapely.geometry import Polygon
from torch import Tensor

from layoutrl.env.coverage import boxes, discs, polygons
from layoutrl.env.render import MOVING, SIDE_PX, View, background
from layoutrl.env.symmetry import Symmetry
from layoutrl.rooms.room import Item, Room

# Columns of one element in the geometry observation; one column a known furniture category follows.
KINDS = ("moving", "wall", "door", "window", "item")
COLUMNS = ("present", *KINDS, "x", "y", "width", "depth", "cos2", "sin2", "circle")
X, Y, WIDTH, DEPTH, SIN2 = (COLUMNS.index(name) for name in ("x", "y", "width", "depth", "sin2"))
BLOCK = 128  # pictures painted at once: on a CPU, a larger block waits for memory


class GeometryObservation:
    """The state as a set of elements: float32 (B, elements, columns); the moving item comes first.

    An element is its kind, centre and size (metres, from the centre of the envelope), the double
    angle of its rotation (a rectangle turned by half a circle looks the same) and its category.
    Rows of rooms with fewer elements are zero; `present` tells them apart.
    """

    def __init__(self, rooms: Sequence[Room], categories: Sequence[str], device: torch.device | str = "cpu"):
        tables = [_elements(room, list(categories)) for room in rooms]
        self.shape = (max(2, *map(len, tables)), len(COLUMNS) + len(categories))
        self._elements = torch.zeros(len(rooms), *self.shape, device=device)
        for k, table in enumerate(tables):
            self._elements[k, : len(table)] = torch.as_tensor(table, dtype=torch.float32)
        sides = [np.subtract(room.envelope.bounds[2:], room.envelope.bounds[:2]).max() for room in rooms]
        self.limit = float(max(1.0, *sides, *(np.abs(table).max() for table in tables)))  # no entry is larger
        self._origin = torch.tensor(np.array([_origin(room) for room in rooms]), device=device)  # float64, as positions

    def __call__(self, room: Tensor, position: Tensor) -> Tensor:
        """Observe poses: room index (B,), position (B, 2) in metres."""
        observation = self._elements[room]
        observation[:, 0, [X, Y]] = (position - self._origin[room]).float()
        return observation

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """How the same rooms look mirrored and turned."""
        turned = observation.clone()
        turned[..., X : Y + 1] = observation[..., X : Y + 1] @ symmetry.matrix.T
        if symmetry.quarters % 2:
            turned[..., WIDTH], turned[..., DEPTH] = observation[..., DEPTH], observation[..., WIDTH]
        if symmetry.mirror:
            turned[..., SIN2].neg_()
        return turned


class ImageObservation:
    """The paper's picture of each pose: uint8 (B, 128, 128, 3), the moving item with exact pixel coverage.

    What does not move is copied; the item is painted into a window of it that holds the largest item of the rooms.
    """

    shape = (SIDE_PX, SIDE_PX, 3)

    def __init__(self, rooms: Sequence[Room], device: torch.device | str = "cpu"):
        views = [View(room) for room in rooms]
        self._backgrounds = torch.as_tensor(np.stack([background(room) for room in rooms]), device=device)
        self._scale = torch.tensor([[view.scale, -view.scale] for view in views], dtype=torch.float64, device=device)
        self._offset = torch.tensor(np.array([view.offset for view in views]), device=device)

        # Pixels. An item has its size in the table of its form, and none in the others.
        half, corners, radius = np.zeros((len(rooms), 2)), np.zeros((len(rooms), 4, 2)), np.zeros((len(rooms), 1))
        for k, (room, view) in enumerate(zip(rooms, views, strict=True)):
            item = room.moving
            if item.form == "circle":  # a disc as large as the polygon that the reference paints
                radius[k] = view.scale * math.sqrt(item.template.area / math.pi)
            elif item.rotation % 90 == 0:
                half[k] = view.scale * np.array(item.template.bounds[2:])
            else:
                corners[k] = np.array(item.template.exterior.coords[:-1]) * (view.scale, -view.scale)
        forms = ((boxes, half), (polygons, corners), (discs, radius))
        self._forms = [
            (cover, torch.tensor(size, dtype=torch.float32, device=device)) for cover, size in forms if size.any()
        ]
        self._reach = max(float(np.abs(size).max()) for _, size in forms)
        self._side = min(SIDE_PX, math.ceil(2 * self._reach) + 1)
        self._moving = torch.tensor(MOVING, dtype=torch.float32, device=device).repeat(self._side)

    def __call__(self, room: Tensor, position: Tensor) -> Tensor:
        """Observe poses: room index (B,), position (B, 2) in metres."""
        image = self._backgrounds.index_select(0, room)
        for block in zip(image.split(BLOCK), room.split(BLOCK), position.split(BLOCK), strict=True):
            self._paint(*block)
        return image

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """How the same rooms look mirrored and turned."""
        mirrored = observation.flip(2) if symmetry.mirror else observation
        return mirrored.rot90(symmetry.quarters, (1, 2))

    def _paint(self, image: Tensor, room: Tensor, position: Tensor) -> None:
        """Blend the moving item into backgrounds (B, 128, 128, 3), in place."""
        center = self._offset[room] + position * self._scale[room]
        first = (center - self._reach).floor().clamp(0, SIDE_PX - self._side)  # column and row of the window
        column, row = first.long().unbind(1)
        # The colours of a row of pixels in one axis: an inner axis of length three would be several times slower.
        windows = image.flatten(2).unfold(1, self._side, 1).unfold(2, 3 * self._side, 3)
        at = (torch.arange(len(room), device=room.device), row, column)
        painted = windows[at].float()
        for cover, size in self._forms:
            share = cover((center - first).float(), size[room], self._side)
            painted.lerp_(self._moving, torch.stack((share, share, share), -1).flatten(2))
        windows[at] = painted.round_().to(torch.uint8)


def categories_of(rooms: Sequence[Room]) -> list[str]:
    """The furniture categories of the rooms, sorted."""
    return sorted({item.category for room in rooms for item in room.furniture})


def _elements(room: Room, categories: list[str]) -> np.ndarray:
    """Every element of a room in the columns above, the moving item first and at no place."""
    rows = [_element("moving", room.moving.template, room.moving, categories)]
    rows += [_element("wall", wall, None, categories) for wall in room.wall_shapes]
    rows += [_element(opening.kind, opening.shape, None, categories) for opening in room.openings]
    rows += [_element("item", item.footprint, item, categories) for item in room.others]
    table = np.array(rows)
    table[1:, [X, Y]] -= _origin(room)
    return table


def _element(kind: str, shape: Polygon, item: Item | None, categories: list[str]) -> list[float]:
    circle = item is not None and item.form == "circle"
    rectangle = _rectangle_around(shape)
    size, degrees = _canonical(rectangle) if item is None else _canonical_size(item.size, item.rotation)
    angle = np.deg2rad(2 * degrees)
    return [
        1.0,
        *(float(kind == name) for name in KINDS),
        rectangle.centroid.x,
        rectangle.centroid.y,
        *size,
        np.cos(angle) * (not circle),
        np.sin(angle) * (not circle),
        float(circle),
        *(float(item is not None and item.category == name) for name in categories),
    ]


def _rectangle_around(shape: Polygon) -> Polygon:
    """The smallest rectangle around a wall, an opening or an item; the upright one if it is as small."""
    upright = shapely.box(*shape.bounds)
    turned = shapely.minimum_rotated_rectangle(shape)
    return upright if turned.area >= 0.999 * upright.area else turned


def _canonical(rectangle: Polygon) -> tuple[tuple[float, float], float]:
    a, b, c = np.asarray(rectangle.exterior.coords)[:3]
    size = float(np.hypot(*(b - a))), float(np.hypot(*(c - b)))
    return _canonical_size(size, float(np.rad2deg(np.arctan2(*(b - a)[::-1]))))


def _canonical_size(size: tuple[float, float], degrees: float) -> tuple[tuple[float, float], float]:
    """The one description of a rectangle whose rotation lies above -45 and up to 45 degrees."""
    quarters = int(np.ceil((degrees - 45) / 90 - 1e-9))
    return size if quarters % 2 == 0 else size[::-1], degrees - 90 * quarters


def _origin(room: Room) -> np.ndarray:
    x0, y0, x1, y1 = room.envelope.bounds
    return np.array([(x0 + x1) / 2, (y0 + y1) / 2])
