from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import translate
from shapely.geometry import MultiPolygon, Point, Polygon, box

from layoutrl.rooms.fitting import edges, fitting_positions
from layoutrl.rooms.room import FIT, Item, Room
from tests.builders import L_OUTLINE, random_item, random_room

seeds = st.integers(0, 2**32 - 1)


def room_and_item(seed: int) -> tuple[Room, Item, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return random_room(rng), random_item(rng, "bed"), rng


def positions(area: Polygon, template: Polygon) -> shapely.Geometry:
    return fitting_positions(np.array([area]), np.array([template]))[0]


def fits(area: Polygon, template: Polygon, points: np.ndarray) -> np.ndarray:
    """The direct answer: whether the area covers the item at each of the points."""
    return np.array([area.covers(translate(template, *point)) for point in points], dtype=bool)


@given(seeds)
def test_an_item_fits_exactly_where_the_area_covers_it(seed: int) -> None:
    room, item, rng = room_and_item(seed)
    for area in (room.indoor, room.envelope):
        region = positions(area, item.template)
        x0, y0, x1, y1 = area.bounds
        points = rng.uniform((x0, y0), (x1, y1), (60, 2))
        expected = fits(area.buffer(FIT), item.template, points)
        sure = shapely.distance(region.boundary, shapely.points(points)) > 1e-5
        found = shapely.intersects_xy(region, points[:, 0], points[:, 1])
        assert np.array_equal(found[sure | region.is_empty], expected[sure | region.is_empty])


@given(seeds)
def test_at_the_border_of_the_region_an_item_is_off_by_micrometres_at_most(seed: int) -> None:
    """Positions up to 0.1 mm around the border: nothing that oversteps is let in, nothing that fits is kept out."""
    room, item, rng = room_and_item(seed)
    region = positions(room.indoor, item.template)
    if region.is_empty:
        return
    along = rng.uniform(0, region.boundary.length, 40)
    points = shapely.get_coordinates(shapely.line_interpolate_point(region.boundary, along))
    points += rng.uniform(-1e-4, 1e-4, points.shape)
    found = shapely.intersects_xy(region, points[:, 0], points[:, 1])
    assert fits(room.indoor.buffer(1e-5, join_style="mitre"), item.template, points[found]).all()
    assert found[fits(room.indoor, item.template, points)].all()


@given(st.floats(0.3, 3.0), st.floats(0.3, 3.0), st.sampled_from([0.0, 90.0, 180.0, 270.0]))
def test_an_item_that_fits_exactly_is_found_and_one_a_millimetre_wider_is_not(
    width: float, depth: float, rotation: float
) -> None:
    template = Item("bed", (width, depth), rotation=rotation).template
    turned_width = depth if rotation % 180 else width
    turned_depth = width if rotation % 180 else depth
    center = Point(turned_width / 2, turned_depth / 2)
    assert positions(box(0, 0, turned_width, turned_depth), template).intersects(center)
    alley = positions(box(0, 0, turned_width, turned_depth + 1), template)
    assert alley.length / 2 == pytest.approx(1, abs=1e-4)  # a slit as long as the item can move
    assert alley.intersects(Point(turned_width / 2, turned_depth / 2 + 1))
    assert positions(box(0, 0, turned_width - 1e-3, turned_depth), template).is_empty
    assert positions(box(0, 0, turned_width, turned_depth - 1e-3), template).is_empty


def test_in_an_l_the_region_is_an_l_and_a_column_leaves_a_hole() -> None:
    template = Item("bed", (1.0, 1.0), rotation=0).template
    # centres 0.5 from every wall: 3 x 1 and 1 x 3 that share 1 x 1
    assert positions(Polygon(L_OUTLINE), template).area == pytest.approx(5.0, abs=1e-4)
    around_a_column = Polygon(box(0, 0, 5, 5).exterior, [box(2, 2, 3, 3).exterior])
    # centres 4 x 4 less the 2 x 2 at which the item meets the column
    assert positions(around_a_column, template).area == pytest.approx(12.0, abs=1e-4)


def test_a_circle_reaches_the_walls_and_goes_round_an_inner_corner() -> None:
    template = Item("stool", (1.0, 1.0), form="circle").template
    # as for the square, but the inner corner is rounded: the region gains 0.5 x 0.5 less a quarter circle there
    expected = 5.0 + 0.25 - math.pi * 0.25 / 4
    assert positions(Polygon(L_OUTLINE), template).area == pytest.approx(expected, abs=1e-3)


def test_a_shape_that_is_not_its_own_mirror_image_reaches_as_far_as_its_corners() -> None:
    triangle = Polygon([(-1.0, -0.5), (0.5, -0.5), (0.5, 2.0)])
    assert positions(box(0, 0, 5, 5), triangle).bounds == pytest.approx((1.0, 0.5, 4.5, 3.0), abs=1e-5)


def test_two_rooms_joined_by_a_door_too_narrow_give_two_regions() -> None:
    dumbbell = shapely.union_all([box(0, 0, 2, 2), box(2, 0.7, 3, 1.3), box(3, 0, 5, 2)])
    region = positions(dumbbell, Item("bed", (1.0, 1.0), rotation=0).template)
    assert sorted(part.bounds for part in shapely.get_parts(region)) == [
        pytest.approx((0.5, 0.5, 1.5, 1.5), abs=1e-5),
        pytest.approx((3.5, 0.5, 4.5, 1.5), abs=1e-5),
    ]


@given(seeds)
def test_areas_taken_at_once_keep_the_positions_that_each_has_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pairs = [(random_room(rng).indoor, random_item(rng, "bed").template) for _ in range(5)]
    pairs.insert(2, (box(0, 0, 1, 1), box(-1, -1, 1, 1)))  # which does not fit
    areas, templates = (np.array(those) for those in zip(*pairs, strict=True))
    together = fitting_positions(areas, templates)
    assert together[2].is_empty
    assert shapely.equals_exact(together, [positions(*pair) for pair in pairs]).all()


@given(seeds)
def test_the_edges_are_the_borders_of_all_parts_holes_included(seed: int) -> None:
    rng = np.random.default_rng(seed)
    areas = [random_room(rng).indoor for _ in range(3)]
    shapes = np.array([areas[0], Polygon(), MultiPolygon([areas[1], translate(areas[2], 10)]), areas[1]])
    segments, owner = edges(shapes)
    assert (np.diff(owner) >= 0).all()
    assert 1 not in owner
    for k in (0, 2, 3):
        lines = shapely.multilinestrings(shapely.linestrings(segments[owner == k].reshape(-1, 2, 2)))
        assert lines.equals(shapes[k].boundary)
        assert lines.length == pytest.approx(shapes[k].length)  # each of them once
