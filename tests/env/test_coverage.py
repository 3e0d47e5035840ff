"""Shares of pixels that shapes cover, against shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import translate

from layoutrl.env.coverage import boxes, discs, polygons

DEVICES = ["cpu", *(["cuda"] if torch.cuda.is_available() else [])]


def shared(shape: shapely.Polygon, pixels: np.ndarray) -> np.ndarray:
    """The areas that a shape and pixels have in common: to intersect them takes long, and few need it."""
    shapely.prepare(shape)
    areas = np.where(shapely.covers(shape, pixels), shapely.area(pixels), 0.0)
    partly = shapely.intersects(shape, pixels) & (areas == 0)
    areas[partly] = shapely.area(shapely.intersection(shape, pixels[partly]))
    return areas


@pytest.mark.parametrize("device", DEVICES)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_shares_of_pixels_are_the_areas_that_shape_and_pixel_have_in_common(device, seed):
    rng = np.random.default_rng(seed)
    side, corner_count = int(rng.integers(1, 12)), int(rng.integers(3, 7))
    center = rng.uniform(-3, side + 3, (3, 2)).astype(np.float32)
    if rng.random() < 0.3:
        center = center.round()  # corners on the borders of pixels
    reach = rng.choice([1e-3, 0.3, 3.0, 20.0])
    half = (reach * rng.uniform(0.5, 1, 2)).astype(np.float32)
    # Around the centre in their order, so that no side crosses another.
    angle = -(np.arange(corner_count) + rng.uniform(0, 0.45, corner_count)) * 2 * np.pi / corner_count
    corners = reach * rng.uniform(0.3, 1, (corner_count, 1)) * np.stack([np.cos(angle), np.sin(angle)], -1)
    if rng.random() < 0.3:
        corners = half * [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    corners, radius = corners.astype(np.float32), np.float32([reach])
    disc = shapely.Point(0, 0).buffer(radius[0], quad_segs=4096)
    left, top = np.meshgrid(np.arange(side), np.arange(side))
    pixels = shapely.box(left, top, left + 1, top + 1)
    for cover, size, shape in (
        (boxes, half, shapely.box(*-half, *half)),
        (polygons, corners, shapely.Polygon(corners)),
        (discs, radius, disc),
    ):
        sizes = np.stack([size, size, np.zeros_like(size)])  # the third has no size
        shown = cover(torch.as_tensor(center, device=device), torch.as_tensor(sizes, device=device), side).cpu()
        exact = [shared(translate(shape, *c), pixels) for c in center[:2].astype(float)]
        np.testing.assert_allclose(shown, [*exact, np.zeros((side, side))], atol=1e-4)
