from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from shapely.affinity import affine_transform, rotate
from shapely.geometry import Polygon, box

from layoutrl.rooms.brief import upright
from layoutrl.rooms.room import (
    TOLERANCE,
    WALL_THICKNESS,
    Item,
    Opening,
    Ring,
    Room,
    along_and_through,
    envelopes,
    wall_band,
    wall_thickness,
)
from tests.builders import L_OUTLINE, l_room, opening, random_room, rectangle, rectangular_room, rooms

GRID = 1e-8  # metres, of the overlays that are compared
AREA = 1e-6  # square metres: above their noise, a square millimetre
SLIVER = 1e-4  # square metres that the envelope may lose where sloping walls meet: a square centimetre
COPIES = [(quarters, mirror) for mirror in (False, True) for quarters in range(4)]

lengths = st.floats(0.1, 3.0)
angles = st.floats(-720, 720)
points = st.tuples(st.floats(-10, 10), st.floats(-10, 10))


def expected_walls(room: Room) -> shapely.Geometry:
    """What walls must cover: a mitred band around the outline without the openings, and every column."""
    outline = Polygon(room.outline)
    band = outline.buffer(WALL_THICKNESS, join_style="mitre").difference(outline)
    band = shapely.difference(band, joined([o.shape for o in room.openings]), grid_size=GRID)
    return joined([band, *(Polygon(hole) for hole in room.holes)])


def joined(shapes: Sequence[shapely.Geometry]) -> shapely.Geometry:
    return shapely.union_all(list(shapes), grid_size=GRID)


def apart(a: shapely.Geometry, b: shapely.Geometry) -> float:
    """Area that only one of two shapes covers; on a grid, as plain overlays fail on shapes equal up to rounding."""
    return shapely.symmetric_difference(a, b, grid_size=GRID).area


def elements(room: Room) -> list[Polygon]:
    return [room.indoor, *room.wall_shapes, *(o.shape for o in room.openings), *(i.footprint for i in room.furniture)]


# walls


@given(rooms())
def test_walls_are_the_mitred_band_without_openings_and_the_columns(room: Room) -> None:
    assert apart(joined(room.wall_shapes), expected_walls(room)) < 1e-4  # films thinner than 2 mm are no wall


@given(rooms())
def test_walls_are_valid_disjoint_and_counter_clockwise(room: Room) -> None:
    assert all(wall.is_valid and wall.exterior.is_ccw for wall in room.wall_shapes)
    summed = sum(wall.area for wall in room.wall_shapes)
    assert abs(summed - joined(room.wall_shapes).area) < AREA


def test_a_rectangular_room_has_four_walls_and_the_earlier_wall_keeps_the_corner() -> None:
    walls = [wall.bounds for wall in rectangular_room(4, 3).wall_shapes]
    assert walls == [
        pytest.approx((-0.2, -0.2, 4.2, 0.0)),
        pytest.approx((4.0, 0.0, 4.2, 3.2)),
        pytest.approx((-0.2, 3.0, 4.0, 3.2)),
        pytest.approx((-0.2, 0.0, 0.0, 3.0)),
    ]


def test_a_door_cuts_its_wall_in_two() -> None:
    walls = rectangular_room(4, 3, openings=(opening("door", 1, -0.2, 2, 0),)).wall_shapes
    assert len(walls) == 5
    assert sorted(wall.bounds for wall in walls if wall.bounds[3] <= 0) == [
        pytest.approx((-0.2, -0.2, 1.0, 0.0)),
        pytest.approx((2.0, -0.2, 4.2, 0.0)),
    ]


def test_a_column_is_a_solid_wall_and_not_indoors() -> None:
    hole = rectangle(1.0, 1.0, 1.5, 1.5)[::-1]
    room = rectangular_room(4, 3, holes=(hole,))
    assert room.indoor.area == pytest.approx(12 - 0.25)
    assert any(wall.equals(Polygon(hole)) for wall in room.wall_shapes)


def test_the_thickness_of_the_band_can_be_chosen() -> None:
    walls = [Polygon(wall) for wall in wall_band(L_OUTLINE, (), (), thickness=0.5)]
    # outline 16 m around, 5 corners outwards and 1 inwards: 16 * 0.5 + (5 - 1) * 0.5 * 0.5
    assert sum(wall.area for wall in walls) == pytest.approx(9.0)


# envelope


@given(rooms())
def test_the_envelope_is_the_outer_border_with_columns_filled_in(room: Room) -> None:
    expected = Polygon(room.outline).buffer(WALL_THICKNESS, join_style="mitre")
    assert apart(room.envelope, expected) < SLIVER
    assert not room.envelope.interiors


OFF = st.integers(-60, 60).map(lambda centimetres: centimetres / 100)
LEANING = st.tuples(*[st.tuples(OFF, OFF)] * 4).map(
    lambda offs: tuple((x + dx, y + dy) for (x, y), (dx, dy) in zip(rectangle(0, 0, 4, 3), offs, strict=True))
)


@given(LEANING)
@example(((0, 0), (3.73, -0.47), (3.98, 3.06), (0.7, 3.75), (0, 2.45)))
def test_walls_that_lean_have_an_envelope_however_the_room_is_turned(outline: Ring) -> None:
    room = replace(rectangular_room(), outline=outline, walls=wall_band(outline, (), ()), furniture=(), target=None)
    assert upright(room)[0].envelope.area > Polygon(outline).area


def test_a_hairline_between_two_walls_is_no_way_out_of_the_envelope() -> None:
    gap = 0.005  # metres
    walls = [*rectangular_room(4, 3).walls[1:], rectangle(-0.2, -0.2, 2.0, 0.0), rectangle(2.0 + gap, -0.2, 4.2, 0.0)]
    envelope = rectangular_room(4, 3, walls=tuple(walls)).envelope
    assert apart(envelope, box(-0.2, -0.2, 4.2, 3.2)) < AREA


def test_a_gap_wider_than_drawing_noise_stays_open_in_the_envelope() -> None:
    walls = [*rectangular_room(4, 3).walls[1:], rectangle(-0.2, -0.2, 2.0, 0.0), rectangle(2.1, -0.2, 4.2, 0.0)]
    envelope = rectangular_room(4, 3, walls=tuple(walls)).envelope
    assert box(-0.2, -0.2, 4.2, 3.2).difference(envelope).area == pytest.approx(0.1 * 0.2, abs=AREA)


def test_a_bay_window_that_stands_out_belongs_to_the_envelope() -> None:
    bay = opening("window", 1.0, 3.0, 2.0, 3.6)
    envelope = rectangular_room(4, 3, openings=(bay,)).envelope
    assert envelope.area == pytest.approx(4.4 * 3.4 + 1.0 * 0.4, abs=AREA)
    assert envelope.buffer(1e-9).covers(bay.shape)


def test_a_shaft_between_walls_is_no_hole_in_the_envelope() -> None:
    shaft = (rectangle(-1.2, 0.0, -0.2, 0.2), rectangle(-1.2, 0.8, -0.2, 1.0), rectangle(-1.2, 0.2, -1.0, 0.8))
    envelope = rectangular_room(4, 3, walls=rectangular_room(4, 3).walls + shaft).envelope
    assert envelope.area == pytest.approx(4.4 * 3.4 + 1.0, abs=AREA)


# footprints


@given(lengths, lengths, angles, points)
def test_a_rectangle_has_its_corners_where_rotation_puts_them(
    width: float, depth: float, rotation: float, center: tuple[float, float]
) -> None:
    item = Item("desk", (width, depth), center, rotation)
    turn = np.exp(1j * math.radians(rotation))
    corners = [
        complex(*center) + turn * complex(x, y) for x in (-width / 2, width / 2) for y in (-depth / 2, depth / 2)
    ]
    got = [complex(x, y) for x, y in item.footprint.exterior.coords[:-1]]
    assert len(got) == 4
    assert all(min(abs(g - c) for g in got) < 1e-9 for c in corners)
    assert item.footprint.area == pytest.approx(width * depth)


@pytest.mark.parametrize("rotation", [-90, 0, 90, 180, 270, 360, 450])
def test_quarter_turns_give_exact_upright_rectangles(rotation: float) -> None:
    bounds = Item("desk", (0.7, 0.3), (0.0, 0.0), rotation).footprint.bounds
    assert bounds == ((-0.35, -0.15, 0.35, 0.15) if rotation % 180 == 0 else (-0.15, -0.35, 0.15, 0.35))


@given(lengths, points)
def test_a_circle_is_round_and_has_nearly_the_area_of_a_circle(diameter: float, center: tuple[float, float]) -> None:
    footprint = Item("stool", (diameter, diameter), center, form="circle").footprint
    radii = np.hypot(*(np.asarray(footprint.exterior.coords) - center).T)
    assert np.allclose(radii, diameter / 2)
    assert footprint.area == pytest.approx(math.pi * diameter**2 / 4, rel=2e-4)


def test_an_item_without_centre_has_no_footprint() -> None:
    with pytest.raises(ValueError, match="still to be placed"):
        _ = Item("bed", (2.0, 1.5)).footprint


def test_others_are_the_placed_items_except_the_one_that_moves() -> None:
    chair, unplaced = Item("chair", (0.5, 0.5), (3.0, 2.0)), Item("lamp", (0.2, 0.2))
    room = rectangular_room(4, 3, others=(chair, unplaced))
    assert room.moving.category == "bed"
    assert room.others == (chair,)
    with pytest.raises(ValueError, match="no target"):
        _ = rectangular_room(4, 3, target=None).moving


# turned copies


@pytest.mark.parametrize(("quarters", "mirror"), COPIES)
@given(room=rooms())
def test_a_turned_copy_is_the_room_under_one_rigid_map(room: Room, quarters: int, mirror: bool) -> None:
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters]
    sign = -1 if mirror else 1
    matrix = [sign * cosine, -sine, sign * sine, cosine, 0, 0]
    copy = room.turned(quarters, mirror)
    for before, after in zip(elements(room), elements(copy), strict=True):
        assert affine_transform(before, matrix).boundary.hausdorff_distance(after.boundary) < 1e-9
        assert after.area == pytest.approx(before.area)
    assert apart(copy.envelope, affine_transform(room.envelope, matrix)) < SLIVER
    assert (copy.target, copy.group, copy.room_type) == (room.target, room.group, room.room_type)


@pytest.mark.parametrize(("quarters", "mirror"), COPIES)
@given(room=rooms())
def test_a_turned_copy_keeps_all_distances_and_counter_clockwise_rings(room: Room, quarters: int, mirror: bool) -> None:
    copy = room.turned(quarters, mirror)
    for (a, b), (c, d) in zip(combinations(elements(room), 2), combinations(elements(copy), 2), strict=True):
        assert c.distance(d) == pytest.approx(a.distance(b), abs=1e-9)
    assert all(shapely.is_ccw(Polygon(ring).exterior) for ring in (copy.outline, *copy.walls))
    assert all(opening.shape.exterior.is_ccw for opening in copy.openings)
    assert [Polygon(hole).exterior.is_ccw for hole in copy.holes] == [False] * len(room.holes)


@pytest.mark.parametrize(("quarters", "mirror"), COPIES)
@given(room=rooms())
def test_items_of_a_turned_copy_face_where_the_map_takes_their_front(room: Room, quarters: int, mirror: bool) -> None:
    """The front is the item's own +x axis: the map of a point before it is the point before its copy."""

    def front(item: Item) -> complex:
        reach = item.size[0] / 2 + 0.1
        return complex(*item.center) + reach * np.exp(1j * math.radians(item.rotation))

    for before, after in zip(room.furniture, room.turned(quarters, mirror).furniture, strict=True):
        point = front(before)
        expected = (-point.conjugate() if mirror else point) * 1j**quarters
        assert abs(front(after) - expected) < 1e-9
        assert 0 <= after.rotation < 360


@given(rooms(), st.booleans())
def test_four_quarter_turns_are_the_same_room(room: Room, mirror: bool) -> None:
    copy = room
    for _ in range(4):
        copy = copy.turned(1)
    _assert_same_place(copy, room)
    _assert_same_place(room.turned(3, mirror).turned(1), room.turned(0, mirror))
    _assert_same_place(room.turned(5, mirror), room.turned(1, mirror))


@given(rooms())
def test_mirroring_twice_gives_the_same_room(room: Room) -> None:
    _assert_same_place(room.turned(0, mirror=True).turned(0, mirror=True), room)


def test_the_eight_copies_of_an_uneven_room_all_differ_and_have_names_of_their_own() -> None:
    room = l_room(Item("bed", (1.0, 0.5), (0.75, 2.5)), others=(Item("desk", (0.4, 0.8), (3.0, 0.5)),))
    copies = [room.turned(*copy) for copy in COPIES]
    assert len({copy.id for copy in copies}) == 8
    shapes = [joined([i.footprint for i in copy.furniture]) for copy in copies]
    assert all(apart(a, b) > 0.01 for a, b in combinations(shapes, 2))


def _assert_same_place(copy: Room, room: Room) -> None:
    """Equal outline, walls, openings and items, number for number; only the name may differ."""
    assert copy.outline == room.outline
    assert copy.holes == room.holes
    assert copy.walls == room.walls
    assert copy.openings == room.openings
    for a, b in zip(copy.furniture, room.furniture, strict=True):
        assert (a.category, a.size, a.center, a.form) == (b.category, b.size, b.center, b.form)
        assert math.cos(math.radians(a.rotation - b.rotation)) == pytest.approx(1)


def door_in(outline: Ring, edge: int) -> Opening:
    """A door across the 0.2 m band outside an edge of a counter-clockwise outline, from 1 to 2 m along it."""
    start, end = np.array(outline[edge]), np.array(outline[(edge + 1) % len(outline)])
    along = (end - start) / np.hypot(*(end - start))
    out = 0.2 * np.array((along[1], -along[0]))
    corners = (start + along, start + along + out, start + 2 * along + out, start + 2 * along)
    return Opening("door", tuple((float(x), float(y)) for x, y in corners))


@pytest.mark.parametrize("degrees", range(1, 90, 4))
def test_walls_and_envelope_are_whole_in_a_room_at_any_angle(degrees: int) -> None:
    turned = rotate(box(0, 0, 4.1, 3.3), degrees, origin=(0, 0)).normalize().exterior.coords[:-1]
    outline = tuple((float(x), float(y)) for x, y in turned[::-1])
    doors = tuple(door_in(outline, edge) for edge in range(3))
    walls = wall_band(outline, (), doors)
    for door in doors:
        assert shapely.union_all([Polygon(wall) for wall in walls]).intersection(door.shape).area < 1e-6
    assert Room("r", "bedroom", outline, walls, doors).envelope.area == pytest.approx(4.5 * 3.7, abs=1e-5)


def test_walls_meet_at_an_acute_corner() -> None:
    outline = ((0.0, 0.0), (4.0, 0.0), (0.0, 4.0))
    room = Polygon(outline)
    band = room.buffer(0.2, join_style="mitre").difference(room)
    assert sum(Polygon(wall).area for wall in wall_band(outline, (), ())) == pytest.approx(band.area)


def test_an_opening_a_hair_thinner_than_the_wall_still_parts_it() -> None:
    outline = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0))
    door = Opening("door", ((1.0, -0.1999), (2.0, -0.1999), (2.0, -0.0001), (1.0, -0.0001)))
    for wall in wall_band(outline, (), (door,)):
        assert box(*Polygon(wall).bounds).intersection(door.shape).area < 1e-9


@given(st.floats(-TOLERANCE, TOLERANCE), st.floats(0, 90), st.integers(0, 5))
def test_a_door_drawn_off_the_outline_has_no_wall_across_it(off: float, degrees: float, edge: int) -> None:
    outline = tuple(rotate(Polygon(L_OUTLINE), degrees, origin=(0, 0)).exterior.coords[:-1])
    door = door_in(outline, edge)
    (ax, ay), (bx, by), *_others = door.polygon  # from the outline outwards, 0.2 m
    x, y = (bx - ax) * off / 0.2, (by - ay) * off / 0.2
    drawn = replace(door, polygon=tuple((px + x, py + y) for px, py in door.polygon))
    across = joined([Polygon(wall) for wall in wall_band(outline, (), (drawn,))]).intersection(door.shape)
    assert across.area < AREA


# envelopes of many rooms at once


def upright_room(rng: np.random.Generator) -> Room:
    """An L with walls and windows anywhere, whose sides are on lines 0.1 m apart, give or take half a micrometre."""

    def beside(ring: Ring) -> Ring:
        lines = np.unique(ring)
        moved = dict(zip(lines, lines + rng.uniform(-4e-7, 4e-7, len(lines)), strict=True))
        return tuple((moved[x], moved[y]) for x, y in ring)

    def part() -> Ring:
        x0, y0 = rng.integers(-10, 50, 2)
        width, depth = rng.integers(1, 20, 2)
        return beside(rectangle(x0 / 10, y0 / 10, (x0 + width) / 10, (y0 + depth) / 10))

    walls = tuple(part() for _ in range(rng.integers(1, 10)))
    openings = tuple(Opening("window", part()) for _ in range(rng.integers(3)))
    return Room("upright", "study", beside(L_OUTLINE), walls, openings)


def united(room: Room) -> Polygon:
    """The envelope of one room, the direct way: all parts united on a grid."""
    parts = [Polygon(room.outline), *room.wall_shapes, *(o.shape for o in room.openings)]
    with np.errstate(all="ignore"):
        grown = shapely.union_all(parts, grid_size=1e-6).buffer(TOLERANCE, join_style="mitre")
        shrunk = grown.buffer(-TOLERANCE, join_style="mitre")
    return Polygon(max(shapely.get_parts(shrunk), key=lambda part: part.area).exterior)


@given(st.integers(0, 2**32 - 1))
def test_envelopes_worked_out_at_once_are_those_worked_out_the_direct_way_and_are_kept(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rooms = [upright_room(rng), random_room(rng), upright_room(rng), upright_room(rng), random_room(rng)]
    known = rooms[2].envelope
    found = envelopes(rooms)
    # Unions in another order may round a crossing of slanting sides to another point of the grid of a micrometre.
    assert shapely.hausdorff_distance(found, [united(room) for room in rooms]).max() < 2e-6
    assert found[2] is known
    assert all(room.envelope is envelope for room, envelope in zip(rooms, found, strict=True))


@pytest.mark.parametrize("seed", [535, 1634, 2104])
def test_an_envelope_at_an_angle_loses_no_part(seed: int) -> None:
    """Rooms of which a plain union loses one, since sides in line are rounded apart when they are turned."""
    rng = np.random.default_rng(seed)
    room, degrees = upright_room(rng), rng.uniform(1, 89)

    def turned(ring: Ring) -> Ring:
        return tuple(rotate(Polygon(ring), degrees, origin=(0, 0)).exterior.coords[:-1])

    openings = tuple(Opening(o.kind, turned(o.polygon)) for o in room.openings)
    slanting = Room("slanting", "study", turned(room.outline), tuple(map(turned, room.walls)), openings)
    assert slanting.envelope.area == pytest.approx(room.envelope.area, abs=1e-4)


@given(st.floats(0.5, 3), st.floats(0.05, 0.4), st.floats(0, 360))
def test_an_opening_is_longer_along_its_wall_than_through_it(width: float, depth: float, degrees: float) -> None:
    along, through = along_and_through(rotate(box(0, 0, width, depth), degrees))
    assert np.hypot(*along) == pytest.approx(width)
    assert np.hypot(*through) == pytest.approx(depth)
    assert along @ through == pytest.approx(0, abs=1e-9)
    turned = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    assert abs(along @ turned) == pytest.approx(width)


@pytest.mark.parametrize("thickness", [0.1, 0.2, 0.36])
def test_walls_are_as_thick_as_their_band(thickness: float) -> None:
    room = rectangular_room()
    assert wall_thickness(replace(room, walls=wall_band(room.outline, (), (), thickness))) == pytest.approx(thickness)
    assert wall_thickness(replace(room, walls=())) == WALL_THICKNESS


def test_an_opening_with_a_spike_keeps_no_room_from_being_united() -> None:
    """As homes have them where a door meets a corner that points inwards: by rounding the ring folds back on itself."""
    outline = (
        (0.0, 2.31),
        (0.0, 0.0),
        (5.76, 0.0),
        (5.76, 2.14),
        (5.38, 2.14),
        (5.38, 2.73),
        (1.16, 2.73),
        (1.16, 2.31),
    )
    spiked = (0.9600000000000001, 2.31), (0.9600000000000001, 2.63), (0.96, 2.51), (0.06, 2.51), (0.06, 2.31)
    room = Room("spiked", "bedroom", outline, wall_band(outline, (), ()), (Opening("door", spiked),))
    assert room.envelope.is_valid
    assert room.envelope.covers(room.indoor)
    assert room.envelope.buffer(1e-6).covers(Polygon(spiked).buffer(0))
