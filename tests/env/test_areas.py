"""Shared areas of boxes and discs. Shapely, plane geometry and the additivity of area are the oracles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import shapely
import torch
from hypothesis import assume, example, given
from hypothesis import strategies as st
from shapely.affinity import rotate, translate
from shapely.geometry import Polygon, box
from shapely.geometry.polygon import orient
from torch import Tensor

from layoutrl.env.areas import box_box, box_polygon, disc_disc, disc_polygon
from tests.builders import random_outline

seeds = st.integers(0, 2**32 - 1)
grids = st.sampled_from([None, 2, 1])  # decimals of a metre; on centimetres and decimetres much coincides


def star(rng: np.random.Generator) -> Polygon:
    count = rng.integers(3, 10)
    angle = np.sort(rng.uniform(0, 2 * np.pi, count))
    return Polygon((rng.uniform(0.2, 2, count) * (np.cos(angle), np.sin(angle))).T)


def star_with_a_hole(rng: np.random.Generator) -> Polygon:
    outside = shapely.get_coordinates(star(rng))
    return Polygon(outside, [outside * rng.uniform(0.1, 0.9)])


def turned_rectangle(rng: np.random.Generator) -> Polygon:
    return rotate(box(0, 0, *rng.uniform(0.1, 3, 2)), rng.choice([0, 45, 90, 1e-6, rng.uniform(0, 360)]))


def l_or_u(rng: np.random.Generator) -> Polygon:
    (a, b, c), (left, bottom, right) = np.cumsum(rng.uniform(0.1, 1, 3)), rng.uniform(0.1, 2, 3)
    notch = [(b, bottom + right), (b, bottom)] if rng.random() < 0.5 else []
    points = [(0, 0), (c, 0), (c, bottom + right), *notch, (a, bottom), (a, bottom + left), (0, bottom + left)]
    return rotate(Polygon(points), 90 * rng.integers(4))


def outline(rng: np.random.Generator) -> Polygon:
    return Polygon(*random_outline(rng))


def random_polygon(rng: np.random.Generator, decimals: int | None) -> Polygon:
    """A simple polygon somewhere in a room of 12 m."""
    shapes = [star, star_with_a_hole, turned_rectangle, l_or_u, outline]
    while True:
        polygon = translate(shapes[rng.integers(len(shapes))](rng), *rng.uniform(2, 10, 2))
        if decimals is not None:
            polygon = shapely.transform(polygon, lambda points: points.round(decimals))
        if polygon.is_valid and polygon.area > 0:
            return polygon


def random_box(rng: np.random.Generator, polygon: Polygon, decimals: int | None) -> np.ndarray:
    """x0, y0, x1, y1 about a polygon; half of the sides run through one of its corners."""
    corners, (x0, y0, x1, y1) = shapely.get_coordinates(polygon), polygon.bounds
    while True:
        anywhere = rng.uniform((x0 - 1, y0 - 1), (x1 + 1, y1 + 1), (2, 2))
        sides = np.where(rng.random((2, 2)) < 0.5, rng.choice(corners, 2), anywhere)
        low, high = np.sort(sides if decimals is None else sides.round(decimals), 0)
        if (low < high).all():
            return np.concatenate([low, high])


def random_center(rng: np.random.Generator, polygon: Polygon) -> np.ndarray:
    """A corner of a polygon, a place on its border, or anywhere in and around it."""
    corners, (x0, y0, x1, y1) = shapely.get_coordinates(polygon), polygon.bounds
    along = polygon.boundary.interpolate(rng.uniform(0, polygon.boundary.length))
    places = [rng.choice(corners), (along.x, along.y), rng.uniform((x0 - 1, y0 - 1), (x1 + 1, y1 + 1))]
    return np.array(places[rng.integers(len(places))])


def edges_of(polygons: list[Polygon], spare: int = 0) -> Tensor:
    """All directed edges (n, E, 4), filled up with edges of no length: `spare` of them at a corner, others at 0, 0."""
    rows = []
    for polygon in map(orient, polygons):
        rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
        edges = [np.concatenate([ring[:-1], ring[1:]], 1) for ring in rings]
        rows.append(np.concatenate([*edges, np.tile(rings[0][0], (spare, 2))]))
    table = np.zeros((len(rows), max(map(len, rows)), 4))
    for entry, row in zip(table, rows, strict=True):
        entry[: len(row)] = row
    return torch.as_tensor(table)


def boxes_and_polygons(seed: int, decimals: int | None) -> tuple[Tensor, list[Polygon]]:
    rng = np.random.default_rng(seed)
    polygons = [random_polygon(rng, decimals) for _ in range(12)]
    return torch.as_tensor(np.array([random_box(rng, polygon, decimals) for polygon in polygons])), polygons


def discs_and_polygons(seed: int, decimals: int | None) -> tuple[Tensor, Tensor, list[Polygon]]:
    rng = np.random.default_rng(seed)
    polygons = [random_polygon(rng, decimals) for _ in range(8)]
    centers = np.array([random_center(rng, polygon) for polygon in polygons])
    return torch.as_tensor(centers), torch.as_tensor(rng.uniform(0.05, 2, len(polygons))), polygons


def shared_by_boxes(boxes: Tensor, polygons: list[Polygon]) -> np.ndarray:
    return shapely.area(shapely.intersection(shapely.box(*boxes.numpy().T), polygons))


def segment(radius: float, distance: float) -> float:
    """The area of a disc beyond a line at a signed distance from its centre."""
    half_chord = math.sqrt(max((radius - distance) * (radius + distance), 0))
    return radius**2 * math.atan2(half_chord, distance) - distance * half_chord


# boxes


@given(seeds, grids)
def test_two_boxes_share_what_shapely_says(seed: int, decimals: int | None) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0, 3, (2, 40, 2, 2))
    b = np.where(rng.random(b.shape) < 0.3, a, b)
    a, b = (np.sort(x if decimals is None else x.round(decimals), 1).reshape(-1, 4) for x in (a, b))
    expected = shapely.area(shapely.intersection(shapely.box(*a.T), shapely.box(*b.T)))
    np.testing.assert_allclose(box_box(torch.as_tensor(a), torch.as_tensor(b)), expected, atol=1e-12)


@given(seeds, grids)
def test_a_box_and_a_polygon_share_what_shapely_says(seed: int, decimals: int | None) -> None:
    boxes, polygons = boxes_and_polygons(seed, decimals)
    shared = box_polygon(boxes, edges_of(polygons, spare=2))
    np.testing.assert_allclose(shared, shared_by_boxes(boxes, polygons), atol=1e-10)


@given(seeds, grids)
def test_a_polygon_that_is_a_box_shares_as_much_as_the_box(seed: int, decimals: int | None) -> None:
    boxes, polygons = boxes_and_polygons(seed, decimals)
    bounds = shapely.bounds(polygons)
    shared = box_polygon(boxes, edges_of(list(shapely.box(*bounds.T))))
    np.testing.assert_allclose(shared, box_box(boxes, torch.as_tensor(bounds)), atol=1e-12)


@given(seeds, grids)
def test_boxes_that_part_the_plane_part_the_polygon(seed: int, decimals: int | None) -> None:
    rng = np.random.default_rng(seed)
    polygon = random_polygon(rng, decimals)
    corners = shapely.get_coordinates(polygon)
    lines = [np.sort([-20, *rng.choice(corners[:, k], 2), *rng.uniform(0, 12, 2), 30]) for k in range(2)]
    low, high = (np.stack(np.meshgrid(*(line[cut] for line in lines)), -1) for cut in (np.s_[:-1], np.s_[1:]))
    parts = box_polygon(torch.as_tensor(np.concatenate([low, high], -1)), edges_of([polygon]))
    assert parts.min() > -1e-11
    assert parts.sum().item() == pytest.approx(polygon.area, abs=1e-10)


@given(seeds, grids)
def test_boxes_in_single_precision_are_good_to_square_millimetres(seed: int, decimals: int | None) -> None:
    boxes, polygons = boxes_and_polygons(seed, decimals)
    expected, edges = shared_by_boxes(boxes, polygons), edges_of(polygons)
    np.testing.assert_allclose(box_polygon(boxes.float(), edges.float()), expected, atol=2e-5)
    middle = boxes.unflatten(1, (2, 2)).mean(1).repeat(1, 2)
    around = (edges - middle[:, None]).float()
    np.testing.assert_allclose(box_polygon((boxes - middle).float(), around), expected, atol=5e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("top", [0.0, 0.4])
@pytest.mark.parametrize("tilt", [0.0, *np.logspace(-1, -12, 23), 1e-20, 1e-30])
def test_edges_that_are_nearly_level_or_upright_are_no_worse(tilt: float, top: float, dtype: torch.dtype) -> None:
    """A border that meets the left side of a box `share * tilt` below its top, and is `tilt` higher at the right."""
    share = np.linspace(0, 1, 21)
    left, right = top - tilt * (1 + share), top + tilt * (2 - share)  # at x = -3 and 3; the box is from -1 to 1
    level = edges_of([Polygon([(-3, -5), (3, -5), (3, b), (-3, a)]) for a, b in zip(left, right, strict=True)])
    upright = torch.stack([-level[..., 1], level[..., 0], -level[..., 3], level[..., 2]], -1)
    expected = 2 * 0.8 - share**2 * tilt
    for sides, edges in (((-1, top - 0.8, 1, top), level), ((-top, -1, 0.8 - top, 1), upright)):
        shared = box_polygon(torch.tensor(sides, dtype=dtype), edges.to(dtype))
        np.testing.assert_allclose(shared, expected, rtol=0, atol=5e-7 if dtype == torch.float32 else 1e-14)


# discs


@given(seeds, grids)
def test_a_disc_and_a_polygon_share_no_less_and_little_more_than_an_inscribed_one(
    seed: int, decimals: int | None
) -> None:
    centers, radii, polygons = discs_and_polygons(seed, decimals)
    shared = disc_polygon(centers, radii, edges_of(polygons, spare=2)).numpy()
    inscribed = shapely.buffer(shapely.points(centers.numpy()), radii.numpy(), quad_segs=1024)
    left_over = math.pi * radii.numpy() ** 2 - shapely.area(inscribed)
    assert left_over.max() < 1e-5
    least = shapely.area(shapely.intersection(inscribed, polygons))
    assert (shared > least - 1e-9).all()
    assert (shared < least + left_over + 1e-9).all()


@given(seeds, grids)
def test_polygons_that_part_the_plane_part_the_disc(seed: int, decimals: int | None) -> None:
    """A polygon and what is left of the plane, both cut by lines, one of them through the disc's centre."""
    rng = np.random.default_rng(seed)
    polygon = random_polygon(rng, decimals)
    center, radius = random_center(rng, polygon), rng.uniform(0.05, 2)
    pieces = np.array([polygon, box(-20, -20, 30, 30).difference(polygon)])
    for x, y in (center, random_center(rng, polygon)):
        half = rotate(box(x - 90, y, x + 90, y + 90), rng.choice([0, 90, rng.uniform(0, 360)]), origin=(x, y))
        pieces = np.concatenate([shapely.intersection(pieces, half), shapely.difference(pieces, half)])
    parts = [part for part in shapely.get_parts(pieces) if part.geom_type == "Polygon" and part.area > 0]
    shared = disc_polygon(torch.as_tensor(center), torch.tensor(radius, dtype=torch.float64), edges_of(parts))
    assert shared.min() > -1e-11
    assert shared.sum().item() == pytest.approx(math.pi * radius**2, abs=1e-10)


@given(st.floats(0, 360), st.floats(-1.5, 1.5), st.floats(0.01, 2))
@example(0.0, 0.0, 1.0)
@example(0.0, 1.0, 1.0)
@example(0.0, -1.0, 1.0)
def test_what_a_disc_holds_beyond_a_line_is_a_segment(angle: float, share: float, radius: float) -> None:
    beyond = rotate(box(share * radius, -9, 9, 9), angle, origin=(0, 0))
    center, size = torch.zeros(2, dtype=torch.float64), torch.tensor(radius, dtype=torch.float64)
    shared = disc_polygon(center, size, edges_of([beyond]))
    assert shared.item() == pytest.approx(segment(radius, share * radius), abs=1e-12)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_disc_at_a_corner_or_on_a_side_by_hand(dtype: torch.dtype) -> None:
    points = torch.tensor([(0, 0), (4, 0), (2, 0), (0, 1.5), (1, 1), (5, 1), (1, 1), (-1, 1.0)], dtype=dtype)
    radii = torch.tensor([1, 1, 1, 1, 1, 1, 0, 1], dtype=dtype)
    shared = disc_polygon(points, radii, edges_of([box(0, 0, 4, 3)]).to(dtype))
    expected = math.pi * torch.tensor([1 / 4, 1 / 4, 1 / 2, 1 / 2, 1, 0, 0, 0])
    torch.testing.assert_close(shared, expected.to(dtype), rtol=0, atol=1e-6)


@given(seeds, grids)
def test_discs_in_single_precision_are_good_to_square_millimetres(seed: int, decimals: int | None) -> None:
    centers, radii, polygons = discs_and_polygons(seed, decimals)
    edges = edges_of(polygons)
    expected = disc_polygon(centers, radii, edges)
    np.testing.assert_allclose(disc_polygon(centers.float(), radii.float(), edges.float()), expected, atol=2e-5)
    around = (edges - centers.repeat(1, 2)[:, None]).float()
    np.testing.assert_allclose(disc_polygon(torch.zeros(2), radii.float(), around), expected, atol=5e-6)


radii_in_metres = st.floats(0.01, 2)


@given(radii_in_metres, radii_in_metres, st.floats(0, 1))
@example(1.0, 1.0, 1e-9)
@example(1.0, 0.5, 1e-9)
@example(1.0, 0.5, 1 - 1e-9)
def test_two_discs_that_cross_share_a_segment_of_each(a: float, b: float, share: float) -> None:
    distance = abs(a - b) + share * (a + b - abs(a - b))
    assume(distance > 1e-6)
    crossing = (distance**2 + a**2 - b**2) / (2 * distance)  # where the common chord is, seen from the first centre
    expected = segment(a, crossing) + segment(b, distance - crossing)
    for dtype, error in ((torch.float64, 1e-9), (torch.float32, 5e-6)):
        squared, first, second = torch.tensor([distance**2, a, b], dtype=torch.float64).to(dtype)
        assert disc_disc(squared, first, second).item() == pytest.approx(expected, abs=error)


@given(radii_in_metres, radii_in_metres, st.floats(0, 1), st.sampled_from([torch.float64, torch.float32]))
@example(1.0, 1.0, 0.0, torch.float32)
@example(1.0, 0.5, 1.0, torch.float32)
def test_of_a_disc_within_another_all_is_shared_and_apart_from_it_none(
    a: float, b: float, share: float, dtype: torch.dtype
) -> None:
    first, second = torch.tensor([a, b], dtype=dtype)
    within, apart = share * abs(a - b), (a + b) / max(share, 1e-3)
    error = 1e-9 if dtype == torch.float64 else 1e-5
    shared = disc_disc(torch.tensor([within**2, apart**2], dtype=dtype), first, second)
    assert shared.tolist() == pytest.approx([math.pi * min(a, b) ** 2, 0], abs=error)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_discs_without_size_share_nothing(dtype: torch.dtype) -> None:
    squared, radii = torch.tensor([0, 0.25, 1, 4], dtype=dtype), torch.tensor([0, 1], dtype=dtype)
    shared = disc_disc(squared[:, None], torch.zeros(1, dtype=dtype), radii)
    torch.testing.assert_close(shared, torch.zeros_like(shared), rtol=0, atol=1e-11)


# batches


AREAS: dict[Callable[..., Tensor], tuple[tuple[int, ...], ...]] = {  # and the last dimensions of its arguments
    box_box: ((4,), (4,)),
    box_polygon: ((4,), (6, 4)),
    disc_polygon: ((2,), (), (6, 4)),
    disc_disc: ((), (), ()),
}
each = pytest.mark.parametrize("area", AREAS, ids=lambda area: area.__name__)
leading = st.sampled_from([(), (1,), (5,), (3, 1), (3, 5), (2, 1, 5), (1, 1, 1)])


def arguments(area: Callable[..., Tensor], shapes: list[tuple[int, ...]], seed: int) -> list[Tensor]:
    """Boxes, edges of closed rings, centres, radii or squared distances for `area`, of these leading dimensions."""
    generator = torch.Generator().manual_seed(seed)
    made = []
    for shape, trailing in zip(shapes, AREAS[area], strict=True):
        drawn = torch.rand((*shape, *trailing), generator=generator, dtype=torch.float64)
        if trailing == (4,):
            drawn[..., 2:] += drawn[..., :2]
        elif trailing == (6, 4):
            drawn[..., 2:] = drawn[..., :2].roll(-1, -2)
        made.append(drawn)
    return made


@each
@given(st.data(), seeds)
def test_leading_dimensions_broadcast_and_a_batch_is_its_entries(
    area: Callable[..., Tensor], data: st.DataObject, seed: int
) -> None:
    given_to = arguments(area, [data.draw(leading) for _ in AREAS[area]], seed)
    kept = [argument.clone() for argument in given_to]
    shared = area(*given_to)
    counts = [len(trailing) for trailing in AREAS[area]]
    lead = [a.shape[: a.ndim - n] for a, n in zip(given_to, counts, strict=True)]
    assert shared.shape == torch.broadcast_shapes(*lead)
    assert all(torch.equal(argument, copy) for argument, copy in zip(given_to, kept, strict=True))
    full = [a.expand((*shared.shape, *a.shape[a.ndim - n :])) for a, n in zip(given_to, counts, strict=True)]
    for index in np.ndindex(shared.shape):
        entry = area(*(a[index] for a in full))
        torch.testing.assert_close(shared[index], entry, rtol=0, atol=1e-12)


@each
def test_the_layout_in_memory_changes_nothing(area: Callable[..., Tensor]) -> None:
    given_to = arguments(area, [(7,)] * len(AREAS[area]), seed=0)
    batch_innermost = [a.movedim(0, -1).contiguous().movedim(-1, 0) for a in given_to]
    torch.testing.assert_close(area(*batch_innermost), area(*given_to), rtol=0, atol=1e-12)


@each
def test_no_area_reads_a_value_back_or_leaves_the_device(area: Callable[..., Tensor]) -> None:
    """A meta tensor has no values; whoever asks for one, or mixes in a tensor of another device, fails."""
    without_values = [a.to("meta") for a in arguments(area, [(7,)] * len(AREAS[area]), seed=0)]
    assert area(*without_values).shape == (7,)


@each
def test_a_place_that_is_not_a_number_shows_in_the_area(area: Callable[..., Tensor]) -> None:
    given_to = arguments(area, [(7,)] * len(AREAS[area]), seed=0)
    given_to[0][3] = math.nan
    assert area(*given_to).isnan().tolist() == [k == 3 for k in range(7)]
