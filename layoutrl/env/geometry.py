"""Exact areas and the positions at which an item fits, with shapely. Metres throughout."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely.affinity import scale
from shapely.geometry import Polygon

from layoutrl.rooms.room import FIT

GRID = 1e-6  # metres: positions are kept on this grid, so that a move and its opposite cancel exactly
CONTACT = 2e-6  # metres: a place that touches a border, rounded to the grid, still fits


def snap(position: np.ndarray) -> np.ndarray:
    """Positions on the grid of one micrometre."""
    return np.round(position / GRID) * GRID


def fitting_positions(area: Polygon, template: Polygon, slack: float = FIT) -> shapely.Geometry:
    """The centres at which `template`, convex and around the origin, lies inside `area`, give or take `slack` (metres).

    This is the erosion of the area by the template: what no edge of the area's border, swept by
    the template, covers. Empty where the item does not fit.
    """
    area = area.buffer(slack, join_style="mitre")
    mirrored = scale(template, -1, -1, origin=(0, 0))
    corners = np.asarray(mirrored.exterior.coords)[:-1]
    swept = [
        shapely.convex_hull(shapely.multipoints(np.concatenate([corners + start, corners + end])))
        for ring in (area.exterior, *area.interiors)
        for start, end in pairwise(np.asarray(ring.coords))
    ]
    return area.difference(shapely.union_all(swept))
