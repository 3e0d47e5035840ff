"""Pictures: exact coverage of every pixel, the paper's colours, y up."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate

from layoutrl.env import render
from layoutrl.env.render import View, background, coverage, picture, story
from layoutrl.rooms.room import Item, Opening
from tests.builders import l_room, random_room, rectangle, rectangular_room

SEEDS = st.integers(0, 2**32 - 1)
SIDE = 24


def pixel_boxes(view: View) -> np.ndarray:
    """The square of every pixel in metres, (side, side): row 0 on top."""
    columns, rows = np.meshgrid(np.arange(view.side), np.arange(view.side))
    left, top = (columns - view.offset[0]) / view.scale, (view.offset[1] - rows) / view.scale
    return shapely.box(left, top - 1 / view.scale, left + 1 / view.scale, top)


def random_shape(rng: np.random.Generator, bounds: tuple[float, ...]) -> shapely.Geometry:
    """A turned rectangle, a circle, a star with a hole or two of these, anywhere around the bounds."""
    x0, y0, x1, y1 = bounds
    x, y = rng.uniform((x0 - 1, y0 - 1), (x1 + 1, y1 + 1))
    kind = rng.integers(4)
    if kind == 0:
        w, d = rng.uniform(0.02, 3, 2)
        angle = rng.choice([0.0, 90.0, 45.0, rng.uniform(0, 360)])
        return rotate(shapely.box(x - w / 2, y - d / 2, x + w / 2, y + d / 2), angle)
    if kind == 1:
        return shapely.Point(x, y).buffer(rng.uniform(0.05, 2), quad_segs=16)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    radius = rng.uniform(0.6, 2, 9)
    star = shapely.Polygon(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], -1))
    star = shapely.make_valid(star).difference(shapely.Point(x, y).buffer(0.3))
    return star if kind == 2 else star.difference(shapely.box(x - 5, y - 0.1, x + 5, y + 0.1))


@given(SEEDS)
@settings(max_examples=60)
def test_coverage_is_the_shared_area_of_shape_and_pixel(seed):
    rng = np.random.default_rng(seed)
    view = View(rectangular_room(*rng.uniform(2, 5, 2)), SIDE)
    corners = pixel_boxes(view)[[0, -1], [0, -1]]
    shape = random_shape(rng, shapely.total_bounds(corners))
    exact = shapely.area(shapely.intersection(shape, pixel_boxes(view))) * view.scale**2
    np.testing.assert_allclose(coverage(shape, view), exact, atol=1e-6)


@given(SEEDS)
@settings(max_examples=10)
def test_coverage_of_rooms_and_their_items_is_exact(seed):
    room = random_room(np.random.default_rng(seed))
    view = View(room, SIDE)
    for shape in (room.indoor, room.envelope, *room.wall_shapes, *(item.footprint for item in room.furniture)):
        exact = shapely.area(shapely.intersection(shape, pixel_boxes(view))) * view.scale**2
        np.testing.assert_allclose(coverage(shape, view), exact, atol=1e-6)


def test_coverage_counts_a_hole_as_uncovered_and_the_direction_of_rings_does_not_matter():
    view = View(rectangular_room(), SIDE)
    outer, inner = rectangle(0.5, 0.5, 3.5, 2.5), rectangle(1, 1, 2.3, 2)
    ways = [coverage(shapely.Polygon(a, [b]), view) for a in (outer, outer[::-1]) for b in (inner, inner[::-1])]
    for way in ways:
        np.testing.assert_allclose(way, ways[0], atol=1e-12)
        assert way.sum() == pytest.approx((3 * 2 - 1.3) * view.scale**2)


def test_a_shape_outside_the_picture_covers_nothing():
    view = View(rectangular_room(), SIDE)
    assert not coverage(shapely.box(50, 0, 51, 1), view).any()
    assert not coverage(shapely.box(0, 50, 1, 51), view).any()
    assert not coverage(shapely.box(-51, -51, -50, -50), view).any()


@given(SEEDS)
@settings(max_examples=20)
def test_the_longest_side_of_the_envelope_fills_120_of_128_pixels_and_is_centred(seed):
    room = random_room(np.random.default_rng(seed))
    x0, y0, x1, y1 = room.envelope.bounds
    (left, bottom), (right, top) = View(room).pixels([(x0, y0), (x1, y1)])
    assert max(right - left, bottom - top) == pytest.approx(120)
    assert (left + right) / 2 == pytest.approx(64)
    assert (top + bottom) / 2 == pytest.approx(64)
    assert (right - left) / (bottom - top) == pytest.approx((x1 - x0) / (y1 - y0))
    drawn = np.argwhere((background(room) != 255).any(-1))
    assert np.ptp(drawn, axis=0).max() + 1 == 120


def painted_room():
    """From (0, 0) to (4, 3), in an envelope from (-0.2, -0.2) to (4.2, 3.2): 120 / 4.4 pixels a metre."""
    return rectangular_room(
        item=Item("bed", (1.0, 0.8), (3.0, 1.0)),
        others=(Item("chair", (0.8, 0.6), (1.0, 2.3)),),
        openings=(Opening("door", rectangle(1, -0.2, 2, 0)), Opening("window", rectangle(4, 1, 4.2, 2))),
    )


def color_at(image: np.ndarray, x: float, y: float) -> tuple[int, ...]:
    """The colour at (x, y) metres of the room above, by hand."""
    scale = image.shape[0] * 120 / 128 / 4.4
    column, row = image.shape[1] / 2 + (x - 2) * scale, image.shape[0] / 2 - (y - 1.5) * scale
    return tuple(image[int(row), int(column)].tolist())


def test_walls_are_black_doors_green_windows_blue_and_the_moving_item_red():
    image = picture(painted_room(), (2.6, 1.4))
    assert image.shape == (128, 128, 3)
    assert image.dtype == np.uint8
    for wall in ((-0.1, 1.5), (0.5, -0.1), (3, -0.1), (2, 3.1), (4.1, 0.5), (4.1, 2.5)):
        assert color_at(image, *wall) == (0, 0, 0)
    red, green, blue = color_at(image, 1.5, -0.1)
    assert green > 2 * max(red, blue)
    red, green, blue = color_at(image, 4.1, 1.5)
    assert blue > 2 * max(red, green)
    for x, y in ((2.6, 1.4), (2.2, 1.1), (3.0, 1.7)):
        red, green, blue = color_at(image, x, y)
        assert red > 4 * max(green, blue)
    for x, y in ((0.3, 0.3), (3.8, 0.3), (3.4, 1.0), (2.6, 2.6)):  # the third is the designer's place
        assert color_at(image, x, y) == (255, 255, 255)
    assert color_at(image, 1.0, 2.3) in render.OTHERS
    assert (image[0] == 255).all()
    assert (image[:, 0] == 255).all()


def test_colours_of_other_items_are_none_of_the_paper_s_own():
    named = [render.WHITE, render.BLACK, render.DOOR, render.WINDOW, render.MOVING]
    for one in (*named, *render.OTHERS):
        for other in (*named, *render.OTHERS):
            assert one == other or np.abs(np.subtract(one, other)).max() >= 40


def test_up_in_the_room_is_up_in_the_picture():
    room = painted_room()
    rows = [np.nonzero((picture(room, (2.5, y)) == render.MOVING).all(-1))[0].mean() for y in (0.6, 1.4, 2.2)]
    assert rows[0] > rows[1] > rows[2]
    columns = [np.nonzero((picture(room, (x, 1)) == render.MOVING).all(-1))[1].mean() for x in (1.2, 2.0, 3.0)]
    assert columns[0] < columns[1] < columns[2]


def test_the_red_area_of_a_picture_is_the_area_of_the_item():
    room = l_room(Item("bed", (0.9, 0.5), (1, 1), rotation=25), walls=())
    share = (255 - picture(room, (0.9, 0.9))[..., 1].astype(float)) / (255 - render.MOVING[1])
    assert share.sum() == pytest.approx(0.45 * (120 / 4) ** 2, rel=2e-3)


def test_a_background_is_drawn_once_and_nobody_paints_over_it():
    room = painted_room()
    first = background(room).copy()
    picture(room, (0.9, 0.9))
    assert (background(room) == first).all()
    assert background(painted_room()) is background(room)
    assert not background(room).flags.writeable


def test_no_white_seam_shows_between_touching_walls_and_openings():
    image = background(painted_room())
    ring = [(-0.1, y) for y in np.arange(-0.15, 3.1, 0.01)] + [(x, -0.1) for x in np.arange(-0.15, 4.15, 0.01)]
    assert all(min(color_at(image, x, y)) < 60 for x, y in ring)


def test_a_story_shows_start_path_end_and_the_designers_outline():
    room = painted_room()  # the designer's place reaches from (2.5, 0.6) to (3.5, 1.4)
    path = np.array([(0.8, 0.8), (2.0, 0.8), (2.0, 2.2)])
    image = story(room, path)
    assert image.shape == (384, 384, 3)
    assert image.dtype == np.uint8
    for x, y in ((1.0, 0.8), (1.6, 0.8), (2.0, 1.2), (2.0, 2.0)):
        assert color_at(image, x, y) == render.PATH
    red, green, blue = color_at(image, 2.3, 2.4)  # inside the end
    assert red > 200 > 100 > max(green, blue)
    red, green, blue = color_at(image, 0.5, 0.6)  # inside the start: pale
    assert red > 230
    assert 150 < green < 230
    assert 150 < blue < 230
    for x, y in ((2.5, 1.0), (3.5, 0.9), (3.0, 0.6), (3.0, 1.4)):
        assert color_at(image, x, y) == render.DESIGNER
    assert color_at(image, 3.0, 1.0) == render.WHITE


def test_a_story_of_one_position_has_no_path_and_no_start():
    image = story(painted_room(), np.array([(1.0, 0.8)]))
    assert not (image == render.PATH).all(-1).any()
    red, green, blue = color_at(image, 1.2, 0.9)
    assert red > 200 > 100 > max(green, blue)


def test_a_story_of_a_room_without_a_designed_place_has_no_outline_of_it():
    room = rectangular_room(item=Item("bed", (1.0, 0.8), rotation=0))
    image = story(room, np.array([(1.0, 0.8), (2.0, 0.8), (2.0, 0.8)]))
    assert not (image == render.DESIGNER).all(-1).any()
    assert (image == render.PATH).all(-1).any()
