"""Exact shares of pixels that shapes cover: what `render.coverage` computes, for a batch and on any device.

Every function takes the centre (B, 2) and the size of one shape per window, and returns the share of each pixel
of the window: float32 (B, side, side), rows first. All is float32, in pixels, x to the right and y down; centres are
relative to the window's upper left corner. Shapes may reach out of the window; one of size 0 covers nothing.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor


def boxes(center: Tensor, half: Tensor, side: int) -> Tensor:
    """Upright rectangles of half sides (B, 2)."""
    pixel = torch.arange(side, device=center.device)
    low, high = (center - half)[..., None], (center + half)[..., None]
    # The share of a pixel is the share of its column times the share of its row.
    columns, rows = (torch.minimum(high, pixel + 1) - torch.maximum(low, pixel)).clamp(min=0).unbind(1)
    return rows[:, :, None] * columns[:, None, :]


def polygons(center: Tensor, corners: Tensor, side: int) -> Tensor:
    """Simple polygons whose corners (B, n, 2), counted from the centre, run counter-clockwise on the screen.

    The polygon's area in a column of pixels above a level is a sum over edges: the area above both the edge and the
    level, positive for edges that run to the right. Levels are the borders of rows; their differences are pixels.
    """
    border = torch.arange(side + 1, device=center.device)
    start = (center[:, None] + corners)[..., None]
    (x0, y0), (x1, y1) = start.unbind(2), start.roll(-1, 1).unbind(2)  # (B, n, 1) each
    # Where an edge enters and leaves each column: both at the same end where it does not cross the column.
    x = border.clamp(torch.minimum(x0, x1), torch.maximum(x0, x1))
    y = y0 + (y1 - y0) * (x - x0) / torch.where(x0 == x1, 1, x1 - x0)
    width, drop = x.diff() * (x1 - x0).sign(), y.diff().abs()
    top = torch.minimum(y[..., 1:], y[..., :-1])
    bend = width / (2 * drop).clamp(min=1e-6)
    area = center.new_zeros(len(center), side + 1, side)
    for k in range(corners.shape[1]):
        # Below its top, the edge takes a triangle that grows with the square of the depth.
        depth = torch.minimum(border[:, None] - top[:, k, None], drop[:, k, None])
        area.addcmul_(width[:, k, None], depth)
        area.addcmul_(bend[:, k, None], depth.clamp_(min=0).square_(), value=-1)
    return area.diff(dim=1)


def discs(center: Tensor, radius: Tensor, side: int) -> Tensor:
    """Discs of radius (B, 1).

    A pixel is a difference of areas that the disc shares with the upright rectangles between its centre and the pixel's
    corners: all of the rectangle if the corner lies in the disc, else the disc's part up to the corner's x, plus that
    up to its y, less a quarter of the disc.
    """
    radius = radius[..., None]
    corner = torch.arange(side + 1, device=center.device) - center[..., None]
    corner = torch.minimum(torch.maximum(corner, -radius), radius)
    chord = (radius**2 - corner**2).sqrt()
    part = (corner * chord + radius**2 * torch.atan2(corner, chord)) / 2 - corner.sign() * math.pi / 8 * radius**2
    x, y = corner[:, 0, None, :], corner[:, 1, :, None]
    part_x, part_y = part[:, 0, None, :], part[:, 1, :, None]
    held = torch.where(x**2 + y**2 <= radius**2, x * y, y.sign() * part_x + x.sign() * part_y)
    return held.diff(dim=1).diff(dim=2)
