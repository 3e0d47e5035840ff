"""Exact areas that a box (an upright rectangle) or a disc shares with other shapes, for batches on any device.

Lengths are metres, in float32 or float64; all arguments broadcast over their leading dimensions. A box (..., 4) is
its x0, y0, x1, y1. The edges (..., E, 4) of a simple polygon are the x0, y0, x1, y1 from corner to corner of all its
rings, counter-clockwise outside and clockwise around holes; edges of no length, which fill up a batch, add nothing.

Areas of shapes that only touch are 0 up to rounding, on either side. In float32 that is up to 1e-5 m² in a room of
12 m, and a third of it with coordinates from the centre of the box or disc. On a CPU all functions are fastest where
the batch is the innermost dimension in memory: a tensor (4, E, B) viewed as (B, E, 4).
"""

from __future__ import annotations

import torch
from torch import Tensor

TINY = 1e-18  # metres: replaces a length of 0 in quotients and under roots; the root of exactly 0 is slow on some CPUs


def box_box(a: Tensor, b: Tensor) -> Tensor:
    """The area (...) that two boxes (..., 4) share."""
    sides = torch.minimum(a[..., 2:], b[..., 2:]).sub_(torch.maximum(a[..., :2], b[..., :2])).clamp_(min=0)
    return sides[..., 0] * sides[..., 1]


def box_polygon(box: Tensor, edges: Tensor) -> Tensor:
    """The area (...) that a box (..., 4) shares with a polygon (..., E, 4).

    Each edge adds the integral of its height, clamped to the box's heights, over its part in the box's x-range.
    """
    left, bottom, right, top = box[..., None, :].unbind(-1)
    x0, y0, x1, y1 = edges.unbind(-1)
    slope = (y1 - y0).div_(x1 - x0).nan_to_num_(0, 0, 0)  # an upright edge has no x-range, so any slope will do
    start = x0.clamp(left, right)
    width = x1.clamp(left, right).sub_(start)
    start_height = torch.addcmul(y0, slope, start.sub_(x0))
    end_height = torch.addcmul(start_height, slope, width)
    start_clamped, end_clamped = start_height.clamp(bottom, top), end_height.clamp(bottom, top)
    # The mean clamped height is the mean of both clamped ends, plus the mean of what was cut off them times the share
    # of the width on which the edge is neither above nor below the box. The usual quotient, a difference of integrals
    # divided by the rise, would lose its digits where an edge is nearly level.
    free = (end_clamped - start_clamped).div_(slope).nan_to_num_()
    clamped = start_clamped.add_(end_clamped)
    cut = start_height.add_(end_height).sub_(clamped)
    twice = width.mul_(clamped).addcmul_(free, cut)
    return twice.sum(-1).mul_(-0.5)


def disc_polygon(center: Tensor, radius: Tensor, edges: Tensor) -> Tensor:
    """The area (...) that a disc of centre (..., 2) and radius (...) shares with a polygon (..., E, 4).

    Each edge adds the signed area that the disc shares with the triangle of the centre and the edge: the triangle of
    the edge's chord in the disc, and a sector for the rest of the angle under which the centre sees the edge.
    """
    x0, y0, x1, y1 = edges.unbind(-1)
    x, y = x0 - center[..., None, 0], y0 - center[..., None, 1]
    dx, dy = x1 - x0, y1 - y0
    length = dx.square().addcmul_(dy, dy).clamp_(min=TINY**2).sqrt_()
    dx.div_(length)
    dy.div_(length)
    # The edge's line passes the centre at a signed distance; start and end are measured along it from the point that
    # is nearest to the centre.
    distance = (x * dy).addcmul_(y, dx, value=-1)
    start = x.mul_(dx).addcmul_(y, dy)
    end = start + length
    distance_squared, radius_squared = distance.square(), radius.square()[..., None]
    reach = (radius_squared - distance_squared).clamp_(min=TINY**2).sqrt_()
    chord_start, chord_end = start.clamp(-reach, reach), end.clamp(-reach, reach)
    # Cosine and sine of the angles of edge and chord, each pair times some length squared, and of their difference.
    edge_cos, edge_sin = torch.addcmul(distance_squared, start, end), distance * length
    chord_cos = torch.addcmul(distance_squared, chord_start, chord_end)
    chord_sin = chord_end.sub_(chord_start).mul_(distance)  # also twice the area of the triangle
    cos = (edge_cos * chord_cos).addcmul_(edge_sin, chord_sin)
    sin = chord_cos.mul_(edge_sin).addcmul_(edge_cos, chord_sin, value=-1)
    twice = chord_sin.addcmul_(sin.atan2_(cos), radius_squared)
    return twice.sum(-1).mul_(0.5)


def disc_disc(distance_squared: Tensor, a: Tensor, b: Tensor) -> Tensor:
    """The area (...) that two discs of radii a and b (...) share, from the squared distance (...) of their centres."""
    total, gap = a + b, a - b
    # Four times the area of the triangle of both centres and a crossing of the circles; next to 0 where none cross,
    # and not 0 itself, so that equal discs at one place get the two right angles that nearly equal ones have.
    triangle = (total.square() - distance_squared).mul_(distance_squared - gap.square()).clamp_(min=TINY**2).sqrt_()
    gap.mul_(total)  # a² - b²
    area = torch.atan2(triangle, distance_squared + gap).mul_(a.square())
    area.addcmul_(torch.atan2(triangle, distance_squared - gap), b.square())
    return area.sub_(triangle, alpha=0.5)
