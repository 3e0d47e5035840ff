"""Doors and windows less wide than their wall is thick, which others are not; and what leaves of doors sweep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import box

from layoutrl.rivals.rooms.scene import scene_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.doors import (
    WIDEST_LEAF,
    before_doors,
    door_widths,
    drawn_leaves,
    entrance,
    free_doors,
    kept_free,
    leaves,
    with_a_free_door_first,
)
from layoutrl.rooms.faults import BLOCKS, OUT_OF_REACH, faults, faults_from_entrance, faults_of_all
from layoutrl.rooms.room import MAIN_ITEM, TOLERANCE, Item, along_and_through, wall_band
from tests.builders import L_OUTLINE, opening, rectangular_room

THICK = 1.0  # metres, of a wall that is thicker than its door is wide


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_what_is_wider_than_its_wall_is_thick_runs_along_its_longer_side(room_type: str) -> None:
    """To the bit: what was measured of such rooms stays as it is."""
    for upright in design_rooms(room_type, "train", 0, 12).rooms:
        for room in (upright, upright.turned(1, True), upright.rotated(33.3)):
            for each in room.openings:
                for beside, longer in zip(
                    along_and_through(each.shape, room.indoor.boundary), along_and_through(each.shape), strict=True
                ):
                    assert beside.tolist() == longer.tolist()


@pytest.mark.parametrize("width", [0.3, 0.8, 0.99, 1.2])
@pytest.mark.parametrize("degrees", [0, 90, 33.3])
def test_a_door_in_a_thick_wall_is_as_wide_as_its_side_along_the_wall(width: float, degrees: float) -> None:
    door = opening("door", 2.0, -THICK, 2.0 + width, 0.0)
    bare = rectangular_room(4.0, 3.0, openings=(door,))
    room = replace(bare, walls=wall_band(bare.outline, (), (door,), THICK)).rotated(degrees)
    along, through = along_and_through(room.doors[0].shape, room.indoor.boundary)
    assert (np.hypot(*along), np.hypot(*through)) == pytest.approx((width, THICK))
    assert door_widths(room) == pytest.approx([width])
    expected = replace(bare, openings=(opening("door", 2.0, -THICK - 0.3, 2.0 + width, 0.3),)).rotated(degrees)
    assert shapely.symmetric_difference(kept_free(room), expected.doors[0].shape).area < 1e-6
    (gate,) = scene_of(room).doors
    assert gate.width == pytest.approx(width)


@pytest.mark.parametrize("degrees", range(0, 90, 10))
@pytest.mark.parametrize("widths", [(0.8, 0.8), (0.55, 0.55), (0.55, 0.545)])
def test_one_enters_by_the_door_that_is_free_however_narrow_and_turned(
    degrees: int, widths: tuple[float, float]
) -> None:
    left, right = (opening("door", x, 1.0, x + 0.2, 1.0 + width) for x, width in zip((-0.2, 4.0), widths, strict=True))
    piano, bed = Item("piano", (1.5, 0.6), (0.3, 1.5), 90.0), Item("bed", (1.0, 1.0), (2.0, 2.4), 0.0)
    for openings in ((left, right), (right, left)):
        room = rectangular_room(4.0, 3.0, bed, others=(piano,), openings=openings).rotated(degrees)
        free = with_a_free_door_first(room)
        assert [entrance(free)] == free_doors(room) == [room.openings[openings.index(right)]]
        assert {*free.openings} == {*room.openings}
        assert before_doors(room) == [room.furniture[1]]
        assert OUT_OF_REACH not in {fault for _, fault in faults(room)}


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_one_enters_the_designers_rooms_by_the_first_wide_door(room_type: str) -> None:
    """So that measures, which leave it at that, and faults agree."""
    rooms = design_rooms(room_type, "test", 2, 10).rooms
    assert all(with_a_free_door_first(room) is room for room in rooms)
    assert faults_of_all(rooms) == faults_from_entrance(rooms)


def test_what_stands_right_before_a_door_in_a_thick_wall_blocks_it() -> None:
    door = opening("door", 2.5, -THICK, 3.3, 0.0)
    chest = Item("dresser", (0.4, 0.8), (2.9, 0.2), 90.0)
    beside = replace(chest, center=(1.9, 0.2))
    for item, blocks in ((chest, True), (beside, False)):
        bare = rectangular_room(4.0, 3.0, item, openings=(door,))
        room = replace(bare, walls=wall_band(bare.outline, (), (door,), THICK))
        assert ((0, BLOCKS) in faults(room)) == blocks
    (gate,) = scene_of(room).doors
    assert gate.middle == pytest.approx((2.9, 0.0))
    assert (gate.inward, gate.width) == (1, pytest.approx(0.8))


def test_an_opening_by_an_inner_corner_or_off_the_outline_runs_along_the_side_that_it_lies_at() -> None:
    border = shapely.LinearRing(L_OUTLINE)
    for shape in (
        box(2.0, 2.0, 2.9, 2.2),  # at the inner corner it touches the other side, too
        box(3.0, -0.15, 3.9, 0.05),  # partly in the room
        box(3.0, -0.2 - TOLERANCE, 3.9, -TOLERANCE),
    ):
        along, through = along_and_through(shape, border)
        assert (np.abs(along), np.abs(through)) == (pytest.approx((0.9, 0)), pytest.approx((0, 0.2)))
    along, _ = along_and_through(box(1, -0.2 - 5, 1.4, -5), border)
    assert np.hypot(*along) == pytest.approx(0.4)  # no border is near: its longer side


@pytest.mark.parametrize("width", [0.7, 0.9, WIDEST_LEAF])
@pytest.mark.parametrize("depth", [0.1, THICK])
@pytest.mark.parametrize("degrees", [0, 90, 180, 33.3])
def test_a_leaf_sweeps_a_quarter_of_a_disc_into_the_room(width: float, depth: float, degrees: float) -> None:
    door = opening("door", 2.0, -depth, 2.0 + width, 0.0)
    bare = rectangular_room(4.0, 3.0, openings=(door,))
    room = replace(bare, walls=wall_band(bare.outline, (), (door,), max(depth, 0.2))).rotated(degrees)
    ((one, other),) = leaves(room)
    hinges = [shapely.Point(*leaf.hinge) for leaf in (one, other)]
    assert hinges[0].distance(hinges[1]) == pytest.approx(width)
    for leaf, hinge in zip((one, other), hinges, strict=True):
        assert hinge.distance(room.doors[0].shape.boundary) < 1e-6
        assert hinge.distance(room.indoor.boundary) < 1e-6
        assert room.indoor.buffer(1e-6).covers(leaf.swept)
        assert hinge.hausdorff_distance(leaf.swept) < width + 1e-6
        assert leaf.swept.area == pytest.approx(np.pi / 4 * width**2, rel=0.01)


def test_a_wide_door_has_no_leaf() -> None:
    doors = opening("door", 0.5, -0.2, 0.5 + WIDEST_LEAF + 0.1, 0.0), opening("door", 2.5, -0.2, 3.3, 0.0)
    slides, swings = leaves(rectangular_room(4.0, 3.0, openings=doors))
    assert slides is None
    assert swings is not None


def test_a_leaf_is_drawn_where_it_opens() -> None:
    door = opening("door", 0.2, -0.2, 1.1, 0.0)
    bare = replace(rectangular_room(4.0, 3.0, openings=(door,)), furniture=(), target=None)
    (leaf,) = drawn_leaves(bare)
    assert leaf
    assert leaf.hinge == pytest.approx([0.2, 0.0])  # by the corner
    table = Item("side_table", (0.2, 0.2), (0.15, 0.7), 0.0)  # where that leaf would stand open
    (other,) = drawn_leaves(replace(bare, furniture=(table,)))
    assert other
    assert other.hinge == pytest.approx([1.1, 0.0])
    assert not other.swept.intersects(table.footprint)
    chair = replace(table, category="chair", tucked=True)
    for item in (replace(table, category="rug"), chair, replace(table, center=None)):
        (leaf,) = drawn_leaves(replace(bare, furniture=(item,)))
        assert leaf
        assert leaf.hinge == pytest.approx([0.2, 0.0])
