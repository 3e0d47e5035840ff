"""The two observations of a state S = (walls, openings, furniture): `geometry`, that tuple itself, and `image`.

Both are made for a batch of poses, on the learner's device, from tables of what does not move.
Neither reads the designer's place of the moving item.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, Protocol

import numpy as np
import shapely
import torch
from gymnasium import spaces
from torch import Tensor

from layoutrl import InputError
from layoutrl.env import coverage
from layoutrl.env.geometry import padded
from layoutrl.env.render import MOVING, SIDE_PX, View, background
from layoutrl.env.symmetry import Symmetry, shares
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.clearances import period
from layoutrl.rooms.documents import LARGEST
from layoutrl.rooms.room import Item, Point, Room, middles, polygons

# Columns of one element in the geometry observation; one column per known furniture category follows. Extents are those
# along x and y once it is turned back by the angle of cos2 and sin2: with rotation 0 an item's depth is along x.
KINDS = ("moving", "wall", "door", "window", "item")
COLUMNS = ("x", "y", "present", *KINDS, "extent_x", "extent_y", "cos2", "sin2", "circle", "cos", "sin")
X, Y, PRESENT, WALL, WINDOW, ITEM = map(COLUMNS.index, ("x", "y", "present", "wall", "window", "item"))
EXTENT_X, EXTENT_Y, COS2, SIN2 = map(COLUMNS.index, ("extent_x", "extent_y", "cos2", "sin2"))
CIRCLE, COS, SIN = map(COLUMNS.index, ("circle", "cos", "sin"))
STANDING = slice(WALL, ITEM + 1)  # the kinds of elements that do not move
LIMIT = 2 * LARGEST  # metres: no entry of a room that can be read is larger
BLOCK = 128  # pictures painted at once: on a CPU, a larger block waits for memory


class Observe(Protocol):
    """Protocol of what an agent sees of poses: GeometryObservation, ImageObservation or ScenesObservation."""

    def __call__(self, room: Tensor, position: Tensor, /) -> Tensor:
        """Observations (B, ...) of rooms (B,) or scenes (B, columns) with the item at positions (B, 2)."""

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """How the same rooms look mirrored and turned."""


def in_every_view(observe: Observe, symmetries: Sequence[Symmetry], observation: Tensor) -> Tensor:
    """Return the observations (B, ...) with each symmetry applied to an equal share of them."""
    return torch.cat([in_view(observe, symmetry, share) for symmetry, share in shares(symmetries, observation)])


def in_view(observe: Observe, symmetry: Symmetry, observation: Tensor) -> Tensor:
    """Return the observation of the same rooms in a symmetry; the observation itself for the identity."""
    return observe.turned(observation, symmetry) if symmetry.changes else observation


def observation_of(
    kind: Literal["geometry", "image"],
    rooms: Sequence[Room],
    device: torch.device | str = "cpu",
    categories: Sequence[str] | None = None,
    elements: int | None = None,
) -> GeometryObservation | ImageObservation:
    """Return the observation of the rooms. Raises ValueError for another kind.

    The geometry observation has a column for each of the categories, by default those of what stands in the rooms.
    """
    if kind == "geometry":
        known = categories_of(rooms, waiting=False) if categories is None else categories
        return GeometryObservation(rooms, known, device, elements)
    if kind == "image":
        return ImageObservation(rooms, device)
    raise ValueError(f"observation: expected geometry or image; got {kind!r}")


class GeometryObservation:
    """The state as a set of elements: float32 (B, elements, columns); the moving item comes first.

    An element is its kind, centre and size (metres, from the centre of the envelope), the double angle of its
    rotation (a rectangle turned by half a circle covers the same), where it faces (0, 0 for what has no front: walls,
    openings, tables and the like) and its category.
    There are `elements` rows, by default as many as the rooms need, at least 2. Rooms with fewer elements are padded
    with rows of zeros, which have `present` 0. `origin` (rooms, 2) holds the centres of the envelopes.

    Raises InputError where rooms need more rows than are given.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        categories: Sequence[str],
        device: torch.device | str = "cpu",
        elements: int | None = None,
    ):
        origin = middles(rooms)
        table = np.nan_to_num(padded(*elements_of(rooms, list(categories), origin), len(rooms)))
        shape = (enough(elements, table.shape[1]), table.shape[2])
        self.space = spaces.Box(-LIMIT, LIMIT, shape, np.float32)
        self._elements = torch.zeros(len(rooms), *shape, device=device)
        self._elements[:, : table.shape[1]] = torch.as_tensor(table, dtype=torch.float32)
        self.origin = torch.tensor(origin, device=device)  # float64, as positions

    def __call__(self, room: Tensor, position: Tensor) -> Tensor:
        """Observe poses: room index (B,), position (B, 2) in metres."""
        observation = self._elements.index_select(0, room)  # on a CPU several times as fast as by an index
        observation[:, 0, X : Y + 1] = position - self.origin.index_select(0, room)
        return observation

    def single(self, room: int, position: Point) -> np.ndarray:
        """Observe one pose, in metres: float32 (elements, columns). Without tensors it is several times as fast."""
        observation = self._elements.numpy(force=True)[room].copy()  # on a CPU the table is not copied
        observation[0, X : Y + 1] = position - self.origin.numpy(force=True)[room]
        return observation

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """How the same rooms look mirrored and turned. (An element at 45 degrees can come out as one at -45.)"""
        return elements_turned(observation, symmetry)


class ImageObservation:
    """The paper's picture of each pose: uint8 (B, 128, 128, 3), the moving item with exact pixel coverage.

    The background of the room is copied; the item is painted into a window that holds the largest item of the rooms.
    """

    def __init__(self, rooms: Sequence[Room], device: torch.device | str = "cpu"):
        self.space = spaces.Box(0, 255, (SIDE_PX, SIDE_PX, 3), np.uint8)
        views = [View(room) for room in rooms]
        self._backgrounds = torch.as_tensor(np.stack([background(room) for room in rooms]), device=device)
        self._scale = torch.tensor([[view.scale, -view.scale] for view in views], dtype=torch.float64, device=device)
        self._offset = torch.tensor(np.array([view.offset for view in views]), device=device)

        # Sizes in pixels. An item has its size in the table of its form, and zeros in the others.
        half, corners, radius = np.zeros((len(rooms), 2)), np.zeros((len(rooms), 4, 2)), np.zeros((len(rooms), 1))
        for k, (room, view) in enumerate(zip(rooms, views, strict=True)):
            item = room.moving
            if item.form == "circle":  # a disc as large as the polygon that the reference paints
                radius[k] = view.scale * math.sqrt(item.template.area / math.pi)
            elif item.degrees % 90 == 0:
                half[k] = view.scale * np.array(item.template.bounds[2:])
            else:
                corners[k] = np.array(item.template.exterior.coords[:-1]) * (view.scale, -view.scale)
        forms = ((coverage.boxes, half), (coverage.polygons, corners), (coverage.discs, radius))
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

    def single(self, room: int, position: Point) -> np.ndarray:
        """Observe one pose, in metres: uint8 (128, 128, 3)."""
        device = self._offset.device
        at = torch.tensor([position], dtype=torch.float64, device=device)
        return self(torch.tensor([room], device=device), at)[0].numpy(force=True)

    def turned(self, observation: Tensor, symmetry: Symmetry) -> Tensor:
        """How the same rooms look mirrored and turned."""
        mirrored = observation.flip(2) if symmetry.mirror else observation
        return mirrored.rot90(symmetry.quarters, (1, 2))

    def _paint(self, image: Tensor, room: Tensor, position: Tensor) -> None:
        """Blend the moving item into backgrounds (B, 128, 128, 3), in place."""
        center = self._offset.index_select(0, room) + position * self._scale.index_select(0, room)
        first = (center - self._reach).floor().clamp(0, SIDE_PX - self._side)  # column and row of the window
        column, row = first.long().unbind(1)
        # Columns and colours share an axis: an inner axis of length three would be several times slower.
        windows = image.flatten(2).unfold(1, self._side, 1).unfold(2, 3 * self._side, 3)
        at = (torch.arange(len(room), device=room.device), row, column)
        painted = windows[at].float()
        for cover, size in self._forms:
            share = cover((center - first).float(), size[room], self._side)
            painted.lerp_(self._moving, torch.stack((share, share, share), -1).flatten(2))
        windows[at] = painted.round_().to(torch.uint8)


def enough(elements: int | None, needed: int) -> int:
    """Return the number of rows: `elements`, or as many as needed, at least 2. Raises InputError if it is too few."""
    needed = max(2, needed)  # so that there are others to take extremes over
    if elements is not None and elements < needed:
        raise InputError(f"elements: expected {needed} or more: so many rows do these rooms fill; got {elements}")
    return elements or needed


def elements_of(rooms: Sequence[Room], categories: list[str], origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the elements of all rooms (n, columns), columns as above, and the room (n,) of each, ascending.

    In each room the target, if there is one, comes first, then walls and openings, then the other items. Positions are
    relative to `origin` (rooms, 2), the middles of the envelopes; the target has none yet and is put at 0, 0.
    """
    moving = [(k, "moving", room.moving) for k, room in enumerate(rooms) if room.target is not None]
    walls = [(k, "wall", wall) for k, room in enumerate(rooms) for wall in room.walls]
    openings = [(k, opening.kind, opening.polygon) for k, room in enumerate(rooms) for opening in room.openings]
    others = [(k, "item", item) for k, room in enumerate(rooms) for item in room.others]

    corners = _rectangles(polygons([ring for _, _, ring in walls + openings]))
    items = [item for _, _, item in moving + others]
    sides = np.diff(corners[:, :3], axis=1)
    size = np.hypot(*np.moveaxis(sides, 2, 0))
    degrees = np.rad2deg(np.arctan2(sides[:, 0, 1], sides[:, 0, 0]))
    shape = np.concatenate([described(size, degrees), items_described(items, [item.degrees for item in items])])
    shape[: len(corners), -2:] = 0.0  # walls and openings face nowhere

    room = np.array([k for k, _, _ in walls + openings + moving + others], dtype=int)  # int, even if empty
    kind = np.array([name for _, name, _ in walls + openings + moving + others])
    category = np.array([""] * len(corners) + [item.category for item in items])
    placed = np.array([item.center for _, _, item in others]).reshape(-1, 2)
    nowhere = origin[[k for k, _, _ in moving]]
    center = np.concatenate([corners.mean(1), nowhere, placed]) - origin[room]
    table = np.column_stack(
        [
            center,
            np.ones(len(room)),
            kind[:, None] == np.array(KINDS),
            shape,
            category[:, None] == np.array(categories),
        ]
    )
    order = np.lexsort([kind == "item", kind != "moving", room])
    return table[order], room[order]


def items_described(items: Sequence[Item], degrees: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the columns `extent_x` to `sin` (n, 7) of items with rotations in degrees (n,)."""
    size = np.array([item.size for item in items]).reshape(-1, 2)
    shown = described(size, np.array(degrees))
    circle = np.array([item.form == "circle" for item in items], dtype=bool)
    shown[circle, 2:] = (0, 0, 1, 0, 0)
    shown[np.array([period(item) < 360 for item in items], dtype=bool), -2:] = 0.0
    return shown


def described(size: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """The columns `extent_x` to `sin` (n, 7) of rectangles of a size (n, 2), turned by degrees (n,)."""
    # Of the equal descriptions of a rectangle, take the one whose rotation lies above -45 and up to 45 degrees.
    quarters = np.ceil((degrees - 45) / 90 - 1e-9).astype(int)
    size = np.where(quarters[:, None] % 2 == 0, size, size[:, ::-1])
    double, facing = np.deg2rad(2 * (degrees - 90 * quarters)), np.deg2rad(degrees)
    return np.column_stack([size, np.cos(double), np.sin(double), np.zeros(len(size)), np.cos(facing), np.sin(facing)])


def elements_turned(elements: Tensor, symmetry: Symmetry) -> Tensor:
    """Elements (..., columns) that stand somewhere, mirrored and turned."""
    turned = elements.clone()
    for first, last in ((X, Y), (COS, SIN)):
        turned[..., first : last + 1] = elements[..., first : last + 1] @ symmetry.matrix.T
    if symmetry.quarters % 2:
        turned[..., EXTENT_X], turned[..., EXTENT_Y] = elements[..., EXTENT_Y], elements[..., EXTENT_X]
    if symmetry.mirror:
        turned[..., SIN2].neg_()
    return turned


def upright_box(element: Tensor) -> tuple[Tensor, Tensor]:
    """Centre and half sides, (2, ...) each, of the upright box around each element (columns, ...)."""
    cosine = ((1 + element[COS2]) / 2).clamp_(0, 1).sqrt_().where(element[CIRCLE] == 0, 1.0)
    sine = (1 - cosine.square()).clamp_(min=0).sqrt_()
    size = element[EXTENT_X : EXTENT_Y + 1]
    return element[: Y + 1], (size * cosine + size.flip(0) * sine) / 2


def out_of_line(elements: Tensor) -> Tensor:
    """Return the signed distance in metres from the moving item to its nearest alignment along each axis: (B, 2).

    The moving item is the first of elements (B, N, columns). It is aligned where its bounding box shares a side or the
    middle with that of a wall, an opening or an item, or where it is midway between two items of one category. Infinite
    where there is nothing to align with.
    """
    (center, half), (its_center, its_half) = (
        upright_box(part.movedim(-1, 0)) for part in elements.tensor_split([1], 1)
    )
    others = elements[:, 1:]
    sides = [its_center + its * its_half + own * half for its in (-1, 1) for own in (-1, 1)]
    lines = torch.cat([its_center, *sides], -1)  # (2, B, 5 N)
    stands = others[..., STANDING].any(-1).repeat(1, 5)
    midway = (its_center[..., :, None] + its_center[..., None, :]) / 2  # (2, B, N, N)
    item, category = others[..., ITEM] > 0, others[..., len(COLUMNS) :]
    pair = item[:, :, None] & item[:, None] & (category[:, :, None] == category[:, None]).all(-1)
    way = torch.cat([lines, midway.flatten(2)], -1) - center
    way = way.masked_fill(~torch.cat([stands, pair.flatten(1)], -1), torch.inf)
    return way.gather(2, way.abs().argmin(2, keepdim=True)).squeeze(2).T


def _rectangles(shapes: np.ndarray) -> np.ndarray:
    """The corners (n, 4, 2) of the smallest rectangle around each shape; of the upright one if it is as small."""
    upright = shapely.box(*shapely.bounds(shapes).T)
    turned = shapely.minimum_rotated_rectangle(shapes)
    smallest = np.where(shapely.area(turned) >= 0.999 * shapely.area(upright), upright, turned)
    return shapely.get_coordinates(smallest).reshape(-1, 5, 2)[:, :4]
