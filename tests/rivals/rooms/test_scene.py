"""A room as boxes: they cover what is not floor, and who can get where agrees with polygons."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import rotate

from layoutrl.rivals.rooms.scene import (
    FACINGS,
    SLACK,
    STRIP,
    ahead,
    boxes_at,
    depth,
    gap,
    scene_of,
    solid_boxes,
    unreached,
)
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.clearances import may_share_floor
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import TOLERANCE, Item, Room
from tests.builders import l_room, opening, random_room, rectangular_room
from tests.rivals.rooms.builders import random_poses

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
def test_the_boxes_cover_all_that_is_not_floor_and_of_the_floor_a_strip_at_slanting_walls(seed):
    indoor = random_room(np.random.default_rng(seed)).indoor
    boxes = solid_boxes(indoor)
    solid = shapely.union_all(shapely.box(*boxes.T))
    around = shapely.box(*indoor.bounds)
    assert around.difference(indoor).difference(solid).area < 1e-6
    corners = np.array(indoor.exterior.coords)
    slanting = [shapely.LineString(edge).length for edge in pairwise(corners) if np.diff(edge, axis=0).all()]
    assert solid.intersection(indoor).area <= STRIP * sum(slanting) + 1e-6
    if not slanting:
        assert solid.intersection(indoor).area < 1e-6


def test_an_l_is_one_box_and_the_four_around_it():
    boxes = scene_of(l_room()).solids
    assert len(boxes) == 5
    assert boxes[4].tolist() == [2, 2, 4, 4]
    assert scene_of(l_room()).bounds.tolist() == [0, 0, 4, 4]


def test_boxes_by_hand():
    a, b = np.array([0.0, 0, 2, 1]), np.array([1.5, 0.2, 3, 3])
    assert depth(a, b) == 0.5
    assert gap(a, b) == 0
    assert gap(a, np.array([5, 5, 6, 6])) == 5
    assert depth(a, np.array([2.0, 0, 3, 1])) == 0
    blocks = np.array([[3.0, -1, 4, 0.5], [-1.0, 5, 3, 6], [-3.0, 2, -2, 3]])
    assert ahead(a, blocks)[:2].tolist() == [1, 4]
    assert (ahead(a, blocks)[2:] > 5).all()  # the last block lies left of it, but not at its height


@given(seeds)
def test_who_can_get_where_is_what_polygons_say(seed):
    rng = np.random.default_rng(seed)
    scene = scene_of(brief_of(random_room(rng)))
    center, quarter = random_poses(scene, rng, 4)
    boxes = boxes_at(center, scene.half[np.arange(center.shape[1]), quarter])
    slow = [_unreached(scene, box) for box in boxes]
    assert unreached(scene, boxes).tolist() == slow


def _unreached(scene, boxes) -> int:
    """By polygons: the floor less what stands, grown to the sides by half a passage."""
    if not scene.doors:
        return 0
    radius = scene.radius - SLACK
    ways = [box for box, aside in zip(boxes, scene.stands_aside, strict=True) if not aside]
    grown = np.array([*scene.solids, *ways]) + radius * np.array([-1, -1, 1, 1])
    left = shapely.box(*scene.bounds).difference(shapely.union_all(shapely.box(*grown.T)))
    door = scene.doors[0]
    entry = shapely.Point(door.middle + FACINGS[door.inward] * scene.radius)
    parts = [part for part in shapely.get_parts(left) if part.distance(entry) < 1e-5]
    entered = shapely.union_all(parts)
    within = scene.radius + TOLERANCE
    before = [
        (shapely.box(a - within, b, c + within, d), shapely.box(a, b - within, c, d + within)) for a, b, c, d in boxes
    ]
    return sum(not parts or not any(entered.intersects(strip) for strip in strips) for strips in before)


def test_a_bed_across_the_room_bars_the_way():
    door = opening("door", -0.2, 1, 0, 1.9)
    wardrobe, bed = Item("wardrobe", (0.6, 1.0), (3.6, 1.5), 180), Item("bed", (1.0, 3.0), (2.0, 1.5))
    narrow = Item("bed", (1.0, 2.4), (2.0, 1.2))
    for item, lost in ((bed, 1), (narrow, 0)):
        scene = scene_of(rectangular_room(4, 3, wardrobe, others=(item,), openings=(door,)))
        boxes = boxes_at(scene.center, scene.half[np.arange(2), scene.quarter])[None]
        assert unreached(scene, boxes).tolist() == [lost]


def test_a_room_that_leans_is_turned_upright_and_its_layout_turned_back():
    ring = rotate(shapely.box(0, 0, 4, 3), 30, origin=(0, 0)).normalize().exterior.coords[:-1]
    room = Room("leaning", "bedroom", tuple(ring[::-1]), (), furniture=(Item("bed", (2.0, 1.5), None, None),))
    scene = scene_of(room)
    assert len(scene.solids) == 4
    center = scene.bounds[:2] + scene.half[0, 1]
    item = scene.layout(center[None], np.array([1])).furniture[0]
    assert room.indoor.buffer(1e-5).covers(item.footprint)
    assert item.degrees % 90 == pytest.approx(30)


def test_what_stands_stays_and_a_given_rotation_is_kept():
    standing, given_facing = Item("bed", (1.0, 2.0), (1.0, 1.0), 45.0), Item("desk", (0.6, 1.2), None, 90.0)
    room = rectangular_room(4, 3, standing, others=(given_facing,))
    scene = scene_of(room)
    assert scene.movable.tolist() == [1]
    assert not scene.turnable[1]
    layout = scene.layout(np.array([(0, 0), (3.0, 2.0)]), np.array([0, 1]))
    assert layout.furniture[0] == standing
    assert (layout.furniture[1].center, layout.furniture[1].rotation) == ((3.0, 2.0), 90.0)
    assert scene.half[1, 1].tolist() == [0.6, 0.3]


@pytest.mark.parametrize("tucked", [False, True])
@pytest.mark.parametrize("hosted", [False, True])
def test_who_may_share_floor_is_who_does_not_overlap_anywhere(tucked, hosted):
    """By the faults of two items, one in the middle of the other."""
    names = ("desk", "chair", "table", "bed")
    for first, second in product(names, names):
        pair = Item(first, (0.6, 1.2), (2.0, 1.5), tucked=tucked), Item(second, (0.5, 0.5), (2.0, 1.5), tucked=hosted)
        room = rectangular_room(4, 3, pair[0], others=pair[1:], target=None)
        overlap = "overlaps" in {name for _, name in faults(room)}
        assert may_share_floor(*pair) == may_share_floor(*pair[::-1]) == (not overlap)
        assert scene_of(room).may_overlap[0, 1] == may_share_floor(*pair)


def test_what_stands_on_a_platform_shares_its_floor():
    platform, chest, chair = (
        Item("platform", (2.0, 2.0)),
        Item("dresser", (0.5, 1.0)),
        Item("chair", (0.5, 0.5), tucked=True),
    )
    assert may_share_floor(platform, chest)
    assert may_share_floor(chair, platform)
    assert not may_share_floor(platform, platform)
    brief = rectangular_room(4, 3, platform, others=(chest,), target=None)
    assert scene_of(brief).may_overlap.all()
