"""The positions at which an item fits, with shapely. Metres throughout."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import Polygon

from layoutrl.rooms.room import FIT, Item, Room


def edges(polygons: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges (n, 4) of all rings of polygons (B,), as x0, y0, x1, y1, and the polygon (n,) of each, ascending."""
    parts, polygon = shapely.get_parts(polygons, return_index=True)
    rings, part = shapely.get_rings(parts, return_index=True)
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    start = np.flatnonzero(ring[:-1] == ring[1:])
    return np.hstack([corners[start], corners[start + 1]]), polygon[part[ring[start]]]


def fitting_positions(areas: np.ndarray, templates: np.ndarray, slack: float = FIT) -> np.ndarray:
    """The centres at which each template lies inside its area, give or take `slack` (metres): geometries (B,).

    Areas and templates are polygons (B,), templates convex and around the origin. This is the erosion
    of the area by the template: what no edge of the area's border, swept by the template, covers. Empty
    where the item does not fit.
    """
    regions = shapely.buffer(areas, slack, join_style="mitre")
    ends, area = edges(regions)
    count = np.bincount(area, minlength=len(regions))
    first = np.cumsum(count) - count
    # All areas lose their k-th edge at once: faster than area by area, or than uniting the swept edges first.
    for k in range(count.max(initial=0)):
        left = np.flatnonzero(count > k)
        corners, of = shapely.get_coordinates(templates[left], return_index=True)
        both_ends = ends[first[left] + k].reshape(-1, 2, 2)[of] - corners[:, None]  # the template is mirrored
        swept = shapely.convex_hull(shapely.linestrings(both_ends.reshape(-1, 2), indices=np.repeat(of, 2)))
        regions[left] = shapely.difference(regions[left], swept)
    return regions


def fits(area: Polygon, item: Item, degrees: Iterable[float]) -> bool:
    """Whether an item fits somewhere into the area, at one of these rotations in degrees."""
    templates = np.array([replace(item, rotation=way).template for way in degrees])
    return not shapely.is_empty(fitting_positions(np.array([area] * len(templates)), templates)).all()


def center_range(room: Room, item: Item) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and highest centre at which the item, as it is turned, lies within the outline's bounding box."""
    bounds, around = np.array(room.indoor.bounds), np.array(item.template.bounds)
    return bounds[:2] - around[:2], bounds[2:] - around[2:]


def relative_place(room: Room, item: Item) -> np.ndarray:
    """Where the item's centre lies between the ends of `center_range`: (2,), 0 to 1 along each axis if inside."""
    low, high = center_range(room, item)
    return (np.array(item.center) - low) / np.maximum(high - low, 1e-9)
