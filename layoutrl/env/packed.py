"""Rooms as padded tensors: the borders that a move crosses, the areas that an item shares, places to start from.

A table has one row per room, so that what a batch needs of it lies together. Positions are relative to the room's
origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
import torch
from shapely.geometry import Polygon
from torch import Tensor

from layoutrl.env.areas import box_box, box_polygon, disc_disc, disc_polygon
from layoutrl.env.geometry import GRID, padded, shrunk
from layoutrl.rooms.fitting import edges
from layoutrl.rooms.room import Item

UPRIGHT = 1e-9  # square metres by which an upright rectangle may be smaller than its bounding box


class Footprints(NamedTuple):
    """K footprints beside each of B moving items: rectangles and discs, far away or of area 0 where there is none."""

    center: Tensor  # float64 (B, K, 2), metres
    half: Tensor  # (B, K, 2): half sides, of a disc its radius
    bounds: Tensor  # (B, K, 2): half sides of the upright box around it
    is_disc: Tensor | None  # bool (B, K); None where all are rectangles
    turn: Tensor | None  # (B, K): radians that a rectangle's sides are turned by; None where all stand upright

    def lines(self, origin: Tensor, around: Tensor, across: Tensor, margin: float) -> Tensor:
        """Return where the line along each axis at `across` (B, axis) crosses the bounding boxes: (axis, 2 K, B).

        Infinity where it does not. The boxes are grown by `around` (B, 2), the half sides of the moving item's bounding
        box, and crossed up to `margin` metres beyond their corners. Places are relative to `origin` (B, 2).
        """
        center = (self.center - origin[:, None]).to(across.dtype)
        reach = self.bounds + around[:, None]
        meets = (center - across.flip(1)[:, None]).abs() < (reach + margin).where(self.half > 0, 0.0)
        sides = torch.cat([center - reach, center + reach], 1)
        return sides.where(meets.flip(2).repeat(1, 2, 1), torch.inf).permute(2, 1, 0).contiguous()


def crossings(segments: np.ndarray, axis: int, margin: float) -> np.ndarray:
    """Return segments x0, y0, x1, y1 (n, 4) as a move along an axis crosses them: (m, 7), without those parallel to it.

    Columns: the lowest and highest place across the axis, extended by `margin` metres at both ends; the start of the
    segment along and across the axis, and its slope, along by across; the lowest and highest place along the axis.
    """
    u0, v0, u1, v1 = segments[segments[:, 1 - axis] != segments[:, 3 - axis]][:, [axis, 1 - axis, axis + 2, 3 - axis]].T
    span = np.minimum(v0, v1) - margin, np.maximum(v0, v1) + margin
    return np.stack([*span, u0, v0, (u1 - u0) / (v1 - v0), np.minimum(u0, u1), np.maximum(u0, u1)], 1)


class Lines:
    """Segments that a move along an axis can cross, in each room."""

    def __init__(self, segments: np.ndarray, room: np.ndarray, rooms: int, margin: float, like: Tensor):
        """From segments x0, y0, x1, y1 (n, 4) and their rooms (n,); crossed up to `margin` metres beyond their ends."""
        columns, rows = [], []
        for axis in (0, 1):
            columns.append(crossings(segments, axis, margin))
            rows.append(2 * room[segments[:, 1 - axis] != segments[:, 3 - axis]] + axis)  # of those that are crossed
        row = np.concatenate(rows)
        order = np.argsort(row, kind="stable")
        table = padded(np.concatenate(columns)[order], row[order], 2 * rooms)
        if not table.shape[1]:  # no room has any: add one that is nowhere, since a minimum over none is an error
            table = np.full((2 * rooms, 1, 7), np.nan)
        table = np.moveaxis(table.reshape(rooms, 2, -1, 7), 3, 1)  # (rooms, columns, axis, lines)
        # The lowest and highest place across the axis (NaN: nowhere), and the place along it.
        self._line = _tensor(table[:, :3], like)
        self._slant = _tensor(table[:, 3:], like) if np.nan_to_num(table[:, 4]).any() else None

    def crossed(self, room: Tensor, across: Tensor) -> Tensor:
        """Return where the line along each axis at `across` (B, axis) is crossed: (axis, lines, B), else infinity."""
        across = across[..., None]
        low, high, place = self._line.index_select(0, room).unbind(1)
        if self._slant is not None:
            at, slope, least, most = self._slant.index_select(0, room).unbind(1)
            place = torch.clamp(place + slope * (across - at), least, most)
        return place.where((low <= across) & (across < high), torch.inf).permute(1, 2, 0).contiguous()


class Starts:
    """Regions (rooms,) cut into triangles, to draw places from."""

    def __init__(self, regions: np.ndarray, device: torch.device):
        parts = shapely.constrained_delaunay_triangles(shrunk(regions))
        triangles, room = shapely.get_parts(parts, return_index=True)
        share = padded(shapely.area(triangles), room, len(regions))
        before = np.cumsum(share, 1) - share
        corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
        self._before = torch.tensor(before / np.nansum(share, 1, keepdims=True), device=device)  # NaN: never
        self._corners = torch.tensor(padded(corners, room, len(regions)), device=device)

    def at(self, room: Tensor, uniform: Tensor) -> Tensor:
        """Map random numbers (3, B), from 0 to 1, to places (B, 2) in the regions of rooms (B,), all as likely."""
        which, v, w = uniform
        triangle = (self._before.index_select(0, room) <= which[:, None]).sum(1) - 1
        a, b, c = self._corners[room, triangle].unbind(1)
        beyond = v + w > 1  # in the other half of the parallelogram
        v, w = (torch.where(beyond, 1 - x, x)[:, None] for x in (v, w))
        return a + v * (b - a) + w * (c - a)


class Shapes:
    """The areas that the moving item shares with its room's indoor area, its elements and its designer's footprint.

    They are computed in the item's frame: turned back by its rotation, so that its own sides are upright. `shapes`
    ascend by room; the first of each room is its indoor area, the second the designer's footprint, all others are
    elements.
    """

    def __init__(
        self, shapes: np.ndarray, room: np.ndarray, is_circle: np.ndarray, items: Sequence[Item], like: Tensor
    ):
        disc = np.array([item.form == "circle" for item in items])
        degrees = np.array([item.degrees for item in items])
        turn = np.deg2rad(np.where(disc | (degrees % 90 == 0), 0, -degrees))
        turns = np.stack([np.cos(turn), -np.sin(turn), np.sin(turn), np.cos(turn)], 1).reshape(-1, 2, 2)
        on_its_side = ~disc & (degrees % 180 == 90)
        sizes = np.array([item.size for item in items])
        half = np.where(on_its_side[:, None], sizes[:, ::-1], sizes) / 2
        self._half = _tensor(half, like)  # half sides, of a disc its radius: (rooms, axis)
        self._item_area = _tensor(np.where(disc, np.pi, 4) * half.prod(1), like)
        self._is_disc = torch.tensor(disc, device=like.device)
        self._any_disc, self._any_box = bool(disc.any()), not disc.all()
        self._turns = torch.tensor(turns, device=like.device) if turn.any() else None

        corners, shape = shapely.get_coordinates(shapes, return_index=True)
        turned = np.einsum("nij,nj->ni", turns[room[shape]], corners)
        diameter = np.ptp(shapely.bounds(shapes)[:, [0, 2]], 1)  # of a disc: its polygon is less wide when turned
        shapes = shapely.set_coordinates(shapes.copy(), turned)
        area, bounds = shapely.area(shapes), shapely.bounds(shapes)
        upright = ~disc[room] & (np.prod(bounds[:, 2:] - bounds[:, :2], 1) - area < UPRIGHT)

        rooms = len(items)
        first = np.searchsorted(room, np.arange(rooms))
        element = np.ones(len(shapes), dtype=bool)
        element[first] = element[first + 1] = False

        def table(entries: np.ndarray, of: np.ndarray) -> Tensor:
            """(rooms, ..., longest) from entries (n, ...), ascending by the room (n,) of each."""
            return _tensor(np.nan_to_num(np.moveaxis(padded(entries, of, rooms), 1, -1)), like)

        pieces = [np.empty((0, 4)) if d else _boxes_of(shapes[k]) for k, d in zip(first, disc, strict=True)]
        whole = np.array([not len(p) for p in pieces])
        self._indoor_boxes = table(np.concatenate(pieces), np.repeat(np.arange(rooms), list(map(len, pieces))))
        self._indoor_edges = _edges_table(shapes[first[whole]], np.flatnonzero(whole), rooms, like)
        self._indoor_area = _tensor(area[first], like)

        boxes, polygons = element & upright & ~is_circle, element & ~upright & ~is_circle
        self._boxes, self._box_area = table(bounds[boxes], room[boxes]), table(area[boxes], room[boxes])
        self._edges = _edges_table(shapes[polygons], room[polygons], rooms, like)
        self._polygon_area = table(area[polygons], room[polygons])
        center = bounds.reshape(-1, 2, 2).mean(1)
        self._discs = table(np.column_stack([center, diameter / 2])[is_circle], room[is_circle])

    def ious(self, room: Tensor, position: Tensor, others: Footprints | None) -> tuple[Tensor, Tensor, Tensor]:
        """Return summed IoU with elements and others, share indoors, and IoU with the indoor area: (B,) each."""
        item, at, half, box = self._item_at(room, position)

        indoor = box_box(box[:, None], _taken(self._indoor_boxes, room)).sum(1)
        shared = box_box(box[:, None], _taken(self._boxes, room))
        elements = _iou(shared, self._box_area.index_select(0, room), item[:, None]).sum(1)
        if self._indoor_edges.numel():
            indoor += self._in_polygons(_taken(self._indoor_edges, room), room, box, at, half)[:, 0]
        if self._edges.numel():
            shared = self._in_polygons(_taken(self._edges, room), room, box, at, half)
            elements += _iou(shared, self._polygon_area.index_select(0, room), item[:, None]).sum(1)
        if self._discs.numel():
            shared, area = self._in_discs(_taken(self._discs, room), room, box, at, half)
            elements += _iou(shared, area, item[:, None]).sum(1)
        if others is not None:
            elements += self.ious_with(room, position, others).sum(1)
        indoor_area = self._indoor_area.index_select(0, room)
        return elements, indoor / item, _iou(indoor, indoor_area, item)

    def iou_with_itself(self, room: Tensor, off: Tensor) -> Tensor:
        """Return the IoU of the item with itself when moved by `off` (B, 2) metres: (B,)."""
        item, half = self._item_area.index_select(0, room), self._half.index_select(0, room)
        off = self._seen(room, off)
        in_box = (2 * half - off.abs()).clamp_(min=0).prod(1) if self._any_box else None
        in_disc = disc_disc(off.square().sum(1), half[:, 0], half[:, 0]) if self._any_disc else None
        return _iou(self._of_its_kind(room, in_box, in_disc), item, item)

    def ious_with(self, room: Tensor, position: Tensor, footprints: Footprints) -> Tensor:
        """IoU with each of K footprints, whose centres count from the same origin as position: (B, K)."""
        item, at, half, box = self._item_at(room, position)
        count = footprints.half.shape[1]
        center = self._seen(room.repeat_interleave(count), footprints.center.flatten(0, 1)).unflatten(0, (-1, count))
        area = 4 * footprints.half.prod(2)
        if self._any_disc or self._turns is not None or footprints.turn is not None:
            shared = self._in_polygons(self._sides(room, center, footprints), room, box, at, half)
        else:
            shared = box_box(box[:, None], torch.cat([center - footprints.half, center + footprints.half], 2))
        if footprints.is_disc is not None:
            in_discs, disc_area = self._in_discs(torch.cat([center, footprints.half[..., :1]], 2), room, box, at, half)
            shared = torch.where(footprints.is_disc, in_discs, shared)
            area = torch.where(footprints.is_disc, disc_area, area)
        return _iou(shared, area, item[:, None])

    def _item_at(self, room: Tensor, position: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the item's area (B,) and, in its frame, its centre (B, 2), half sides (B, 2) and box (B, 4)."""
        half, at = self._half.index_select(0, room), self._seen(room, position)
        return self._item_area.index_select(0, room), at, half, torch.cat([at - half, at + half], 1)

    def _sides(self, room: Tensor, center: Tensor, footprints: Footprints) -> Tensor:
        """Return the sides (B, K, 4, 4) of rectangles around centres (B, K, 2), in the item's frame."""
        signs = center.new_tensor([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        corners = signs * footprints.half[:, :, None]  # (B, K, corners, 2)
        if footprints.turn is not None:
            cosine, sine = footprints.turn.cos()[..., None], footprints.turn.sin()[..., None]
            x, y = corners.unbind(-1)
            corners = torch.stack([cosine * x - sine * y, sine * x + cosine * y], -1)
        if self._turns is not None:
            seen = self._turns.index_select(0, room).to(corners.dtype)
            corners = torch.einsum("bij,bkcj->bkci", seen, corners)
        corners = corners + center[:, :, None]
        return torch.cat([corners[:, :, :-1], corners[:, :, 1:]], -1)

    def _seen(self, room: Tensor, vector: Tensor) -> Tensor:
        """Return vectors (B, 2) in the item's frame."""
        if self._turns is not None:
            vector = torch.einsum("bij,bj->bi", self._turns.index_select(0, room), vector)
        return vector.to(self._half.dtype)

    def _in_polygons(self, edges: Tensor, room: Tensor, box: Tensor, at: Tensor, half: Tensor) -> Tensor:
        """Areas shared with polygons, edges (B, polygons, n, 4): (B, polygons)."""
        in_box = box_polygon(box[:, None], edges) if self._any_box else None
        in_disc = disc_polygon(at[:, None], half[:, :1], edges) if self._any_disc else None
        return self._of_its_kind(room[:, None], in_box, in_disc)

    def _in_discs(self, discs: Tensor, room: Tensor, box: Tensor, at: Tensor, half: Tensor) -> tuple[Tensor, Tensor]:
        """Return areas shared with discs, centre and radius (B, discs, 3), and the discs' areas: (B, discs) each."""
        center, radius = discs[..., :2], discs[..., 2]
        x0, y0, x1, y1 = box.T
        corners = torch.stack([x0, y0, x1, y0, x1, y1, x0, y1, x0, y0], 1)
        sides = corners.unfold(1, 4, 2)[:, None]  # (B, 1, sides, 4)
        in_box = disc_polygon(center, radius, sides) if self._any_box else None
        distance_squared = (center - at[:, None]).square().sum(2)
        in_disc = disc_disc(distance_squared, radius, half[:, :1]) if self._any_disc else None
        return self._of_its_kind(room[:, None], in_box, in_disc), torch.pi * radius.square()

    def _of_its_kind(self, room: Tensor, in_box: Tensor | None, in_disc: Tensor | None) -> Tensor:
        """Return, for each room's item, the values for a rectangle or those for a disc."""
        if in_box is None or in_disc is None:
            shared = in_disc if in_box is None else in_box
            assert shared is not None
            return shared
        return torch.where(self._is_disc[room], in_disc, in_box)


def _taken(table: Tensor, room: Tensor) -> Tensor:
    """Rows of a table (rooms, columns, ...), columns last: (B, ..., columns)."""
    return table.index_select(0, room).movedim(1, -1)


def _iou(shared: Tensor, area: Tensor, item: Tensor) -> Tensor:
    return shared / (item + area - shared)


def _boxes_of(polygon: Polygon) -> np.ndarray:
    """A polygon of upright and level sides, cut into boxes x0, y0, x1, y1: (n, 4); none of any other."""
    x0, y0, x1, y1 = edges(np.array([polygon]))[0].T
    if np.minimum(np.abs(x1 - x0), np.abs(y1 - y0)).max() > GRID / 1000:
        return np.empty((0, 4))
    boxes = []
    for left, right in pairwise(np.unique(x0)):
        spans = (np.minimum(x0, x1) <= left) & (right <= np.maximum(x0, x1))
        heights = np.sort(y0[spans])
        boxes += [(left, low, right, high) for low, high in zip(heights[::2], heights[1::2], strict=True)]
    return np.array(boxes)


def _edges_table(polygons: np.ndarray, room: np.ndarray, rooms: int, like: Tensor) -> Tensor:
    """The edges of polygons, ascending by room, counter-clockwise around them: (rooms, 4, polygons, edges)."""
    table = np.nan_to_num(padded(*edges(shapely.orient_polygons(polygons)), len(polygons)))  # (polygons, edges, 4)
    return _tensor(np.nan_to_num(np.moveaxis(padded(table, room, rooms), 3, 1)), like)


def _tensor(values: np.ndarray, like: Tensor) -> Tensor:
    return torch.tensor(np.ascontiguousarray(values)).to(like)
