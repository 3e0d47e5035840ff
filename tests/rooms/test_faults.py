"""Faults that can be seen by hand, and oracles: rules for one item, and a flooded grid."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import label

from layoutrl.env.measures import measured
from layoutrl.evaluation.metrics import blocks_openings
from layoutrl.rivals.rooms.scene import scene_of
from layoutrl.rooms.clearances import RAISED, RUGS, passage
from layoutrl.rooms.designer.generator import design_room
from layoutrl.rooms.faults import (
    MISSING,
    Items,
    along_walls,
    faults,
    faults_of_all,
    free_fronts,
    new_faults,
    within_reach,
)
from layoutrl.rooms.room import Item, Room
from tests.builders import DOOR, named, of, opening, random_room, rectangular_room, room_with, shaken

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize(("depth", "deep"), [(0.25, True), (0.011, True), (0.009, False), (0.0, False), (-0.1, False)])
def test_two_items_overlap_by_more_than_a_centimetre(depth: float, deep: bool) -> None:
    room = room_with(Item("a", (1, 1), (2, 0.5)), Item("b", (1, 0.5), (3 - depth, 0.5)), Item("c", (1, 1), (3, 2.4)))
    assert named(room, "overlaps") == ([0, 1] if deep else [])
    assert of(room).overlap == pytest.approx(2 / 3 if deep else 0)
    depth = max(depth, 0)
    assert of(room).overlap_area == pytest.approx((0.5 * depth + depth + 0) / 3)  # half of a's side, all of b's


@pytest.mark.parametrize(
    ("host", "tucked", "overlapping"),
    [("desk", True, []), ("table", True, []), ("desk", False, [0, 1]), ("bed", True, [0, 1]), ("chair", True, [0, 1])],
)
def test_a_tucked_item_may_stand_under_its_host_alone(host: str, tucked: bool, overlapping: list[int]) -> None:
    room = room_with(Item(host, (1, 1), (2, 0.5)), Item("chair", (0.5, 0.5), (2, 1), tucked=tucked))
    assert named(room, "overlaps") == overlapping
    assert of(room).overlap_area == pytest.approx((0.125 + 0.5) / 2 if overlapping else 0)


@pytest.mark.parametrize(("depth", "deep"), [(0.1, True), (0.011, True), (0.009, False), (0.0, False)])
def test_an_item_is_outside_by_more_than_a_centimetre(depth: float, deep: bool) -> None:
    room = room_with(Item("a", (1, 1), (3.5 + depth, 0.5)), Item("b", (1, 1), (3.5, 2.5)))
    assert named(room, "outside") == ([0] if deep else [])
    assert of(room).outside == (0.5 if deep else 0)
    assert of(room).outside_area == pytest.approx(depth / 2)


def test_a_column_is_outside() -> None:
    column = ((2.0, 1.0), (2.0, 1.2), (2.2, 1.2), (2.2, 1.0))
    room = room_with(Item("a", (1, 1), (2.1, 1.1)), holes=(column,))
    assert named(room, "outside") == [0]
    assert of(room).outside_area == pytest.approx(0.04)


@given(seeds)
def test_what_blocks_an_opening_is_as_for_one_item(seed: int) -> None:
    room = random_room(np.random.default_rng(seed))
    one = [replace(room, target=k) for k in range(len(room.furniture))]
    position = np.array([item.center for item in room.furniture])
    blocks = blocks_openings(SimpleNamespace(rooms=one), np.arange(len(one)), position)  # type: ignore[arg-type]
    assert named(room, "blocks an opening") == list(np.flatnonzero(blocks))
    assert of(room).blocked == pytest.approx(blocks.mean())


def test_what_stands_on_a_platform_does_not_overlap_it_and_a_platform_before_a_door_is_floor() -> None:
    platform = Item("platform", (2.0, 3.0), (1.0, 1.5), 0.0)
    room = room_with(platform, Item("wardrobe", (0.6, 0.8), (0.4, 2.5), 0.0))
    assert named(room, "overlaps") == named(room, "blocks an opening") == []
    assert named(replace(room, furniture=(replace(platform, category="desk"), room.furniture[1])), "overlaps") == [0, 1]


@pytest.mark.parametrize(
    ("room_type", "gap", "closed"),
    [
        ("bedroom", 0.6, False),
        ("bedroom", 0.592, False),
        ("bedroom", 0.58, True),
        ("kitchen", 0.58, False),
        ("kitchen", 0.48, True),
    ],
)
def test_a_passage_leads_to_every_item(room_type: str, gap: float, closed: bool) -> None:
    block = Item("shelf", (0.5, 3 - gap), (2.0, (3 - gap) / 2))
    far = Item("bench", (0.5, 0.5), (3.7, 0.3))
    room = room_with(block, far, room_type=room_type)
    assert named(room, "out of reach") == ([1] if closed else [])
    assert of(room).reached == (0.5 if closed else 1)
    for category, tucked in (("chair", True), ("platform", False)):  # moved aside, walked on
        there = replace(room, furniture=(*room.furniture, Item(category, (0.4, 0.4), (2, 2.7), tucked=tucked)))
        assert named(there, "out of reach") == ([1] if closed else [])


@pytest.mark.parametrize("middle", [1.4, 2.6])
def test_the_first_door_is_the_entrance_and_without_one_the_largest_part_of_the_floor_counts(middle: float) -> None:
    divider = Item("shelf", (0.5, 3), (middle, 1.5))
    platforms = [Item("platform", (0.4, 0.4), (x, 1.5)) for x in (0.3, 3.7)]
    room = room_with(divider, *platforms, openings=())
    assert named(room, "out of reach") == [1 if middle < 2 else 2]
    small, large = 1.15 - 0.3, 2.35 - 0.3  # wide, where the middle of the robot can be; the height is the same
    assert of(room).walkable == pytest.approx(large / (small + large))
    assert of(room).reach == pytest.approx(2 / 3)  # of either part: the divider, and the platform that stands in it
    with_both = replace(room, furniture=(divider, platforms[0], platforms[0]))
    share = large / (small + large)
    assert of(with_both).reach == pytest.approx(1 - share + share / 3 if middle < 2 else share + (1 - share) / 3)
    entered = replace(room, openings=(DOOR,))  # on the left
    assert of(entered).walkable == pytest.approx(1 - share if middle < 2 else share, abs=0.03)
    assert named(entered, "out of reach") == [2]
    right = opening("door", 4.0, 1.0, 4.2, 2.0)
    assert named(replace(room, openings=(DOOR, right)), "out of reach") == [2]  # of two doors the first is the entrance
    assert named(replace(room, openings=(right, DOOR)), "out of reach") == [1]
    hatch = opening("door", *right.shape.bounds[:3], right.shape.bounds[1] + 0.4)  # nobody fits through: not by it
    assert named(replace(room, openings=(hatch, DOOR)), "out of reach") == [2]


WARDROBE = Item("wardrobe", (0.6, 2.0), (0.3, 1.5), 0.0)  # its front, of 0.6 m, ends at x = 1.2
DESK = Item("desk", (0.6, 1.0), (0.3, 1.5), 0.0)
SOFA_BED = Item("sofa_bed", (0.9, 2.0), (0.45, 1.5), 0.0)


@pytest.mark.parametrize(
    ("item", "other", "free"),
    [
        (WARDROBE, Item("shelf", (1, 1), (1.705, 1.5)), True),
        (WARDROBE, Item("shelf", (1, 1), (1.695, 1.5)), True),  # by half a centimetre
        (WARDROBE, Item("shelf", (1, 1), (1.68, 1.5)), False),
        (WARDROBE, Item("shelf", (1, 1), (1.5, 0.005)), True),  # beside it
        (WARDROBE, Item("shelf", (1, 1), (1.5, 0.03)), False),
        (replace(WARDROBE, rotation=180.0), None, False),  # its face to the wall
        (WARDROBE, Item("platform", (1, 1), (1.5, 1.5)), True),
        (WARDROBE, Item("wardrobe", (0.6, 1), (1.0, 0.5), 90.0), True),  # round the corner
        (WARDROBE, Item("chair", (0.5, 0.5), (1.0, 1.5), tucked=True), False),
        (DESK, Item("chair", (0.5, 0.5), (0.7, 1.5), tucked=True), True),
        (DESK, Item("stool", (0.5, 0.5), (0.9, 1.5)), True),
        (DESK, Item("bed", (0.5, 0.5), (0.9, 1.5)), False),
        (SOFA_BED, Item("coffee_table", (0.6, 1), (1.4, 1.5)), True),  # one moves it aside
        (replace(SOFA_BED, category="lounge_chair"), Item("coffee_table", (0.6, 1), (1.4, 1.5)), True),
        (SOFA_BED, Item("side_table", (0.6, 1), (1.4, 1.5)), False),
        (Item("bench", (0.5, 1), (0.3, 1.5)), Item("bed", (1, 1), (1, 1.5)), None),  # it keeps nothing free
        (Item("shower", (1, 1), (0.5, 1.5), form="circle"), Item("bed", (1, 1), (1.5, 1.5)), None),
        (Item("table", (1, 1), (0.5, 1.5)), Item("stool", (1, 1), (1.5, 1.5)), None),
    ],
)
def test_the_floor_before_an_item_is_free(item: Item, other: Item | None, free: bool | None) -> None:
    room = room_with(item, *([other] if other else []))
    items = Items.of([room])
    assert free_fronts([room], items, items.front)[0] == (free is not False)
    assert (0 in named(room, "front not free")) == (free is False)
    counted = items.front > 0  # a bed or a wardrobe beside it has a front of its own
    assert counted[0] == (free is not None)
    if counted.sum() == 1 and counted[0]:
        assert of(room).fronts == free
    if not counted.any():
        assert np.isnan(of(room).fronts)


@pytest.mark.parametrize(
    ("depth", "off", "free"), [(0.1, 0.0, True), (0.15, 0.0, True), (0.17, 0.0, False), (0.1, 0.1, False)]
)
def test_what_lies_along_a_wall_takes_no_floor_before_an_item(depth: float, off: float, free: bool) -> None:
    radiator = Item("radiator", (depth, 1.0), (1.25 - off - depth / 2, 1.5), 180.0)
    room = rectangular_room(1.25, 3.0, WARDROBE, others=(radiator,), target=None)
    assert named(room, "front not free") == ([] if free else [0])
    brief = replace(room, furniture=(replace(WARDROBE, center=None, rotation=None), radiator))
    before = scene_of(brief).may_stand_before
    assert before[0, 1] == free  # for the search and the annealer, too
    assert not before[1, 0]


def test_what_lies_along_a_wall_is_told_by_its_own_room_and_columns_are_walls() -> None:
    shelf = Item("shelf", (0.1, 0.5), (1.9, 1.5), 180.0)
    column = ((1.95, 1.0), (1.95, 2.0), (2.3, 2.0), (2.3, 1.0))
    rooms = [
        rectangular_room(width, 3.0, shelf, holes=holes) for width, holes in ((4.0, ()), (1.95, ()), (4.0, (column,)))
    ]
    assert along_walls(rooms, Items.of(rooms)).tolist() == [False, True, True]


@pytest.mark.parametrize("category", sorted(RUGS))
def test_nothing_is_wrong_with_what_stands_on_a_rug_or_with_the_rug(category) -> None:
    bed, platform = Item("bed", (2.0, 1.5), (1.0, 0.75)), Item("platform", (2.0, 2.0), (1.0, 1.0))
    for below in (bed, platform):
        small, large = Item(category, (0.3, 0.3), (0.4, 0.4)), Item("carpet", (3.0, 2.0), (1.5, 1.0))
        assert not faults(rectangular_room(4, 4, below, others=(small, large), target=None))


def test_a_room_is_faultless_only_without_any_fault() -> None:
    """Of one room with each fault, and one with none."""
    bench = Item("bench", (0.5, 0.5), (3.0, 0.3))
    rooms = {
        "overlaps": room_with(bench, Item("table", (0.5, 0.5), (3.2, 0.4))),
        "outside": room_with(bench, Item("table", (0.5, 0.5), (3.9, 2.5))),
        "blocks an opening": room_with(bench, Item("table", (0.5, 0.2), (0.3, 1.0))),
        "out of reach": room_with(Item("bench", (0.5, 3), (3.0, 1.5)), Item("table", (0.5, 0.5), (3.7, 2.5))),
        "front not free": room_with(Item("bed", (2, 1), (3, 0.5)), Item("table", (0.5, 0.5), (1, 2.5))),
        "none": room_with(bench, Item("table", (0.5, 0.5), (2, 2.5))),
    }
    found = {name: {fault for _, fault in faults(room)} for name, room in rooms.items()}
    assert found == {name: {name} - {"none"} for name in rooms}
    assert measured(list(rooms.values()), list(rooms.values())).faultless.tolist() == [0, 0, 0, 0, 0, 1]


@pytest.mark.parametrize("room_type", ["bedroom", "kitchen", "tatami"])
def test_what_is_reached_is_what_a_flooded_grid_of_middles_touches(room_type: str) -> None:
    """Surely from a disc three centimetres thinner, and not from one three centimetres thicker."""
    lost = 0
    for seed in range(8):
        layout = shaken(design_room(room_type, "train", 3, seed % 4).room, seed, lost=0.1)
        reached = within_reach([layout], Items.of([layout]))
        radius = passage(room_type) / 2
        assert (flooded(layout, radius + 0.03) <= reached).all()
        assert (reached <= flooded(layout, radius - 0.03)).all()
        lost += (~reached).sum()
    assert lost > 4


def flooded(room: Room, radius: float) -> np.ndarray:
    """Which items a disc touches that enters by the first door; its middle is on a grid of 3 cm."""
    x0, y0, x1, y1 = room.indoor.bounds
    x, y = np.meshgrid(np.arange(x0 - 0.005, x1 + 0.03, 0.03), np.arange(y0 - 0.005, y1 + 0.03, 0.03), indexing="ij")
    points = shapely.points(x, y)
    placed = [item for item in room.furniture if item.center is not None]
    stands = [item.footprint for item in placed if not item.tucked and item.category not in RAISED]
    walls = room.indoor.exterior.difference(shapely.union_all([door.shape.buffer(0.01) for door in room.doors]))
    free = shapely.distance(points, shapely.union_all([walls, *stands])) >= radius
    part, _ = label(free & (shapely.distance(points, room.indoor) <= 0.01))
    at_door = part[(part > 0) & (shapely.distance(points, room.doors[0].shape) <= 0.03)]
    there = shapely.multipoints(points[np.isin(part, at_door)])
    return np.array(
        [item.center is not None and shapely.dwithin(there, item.footprint, radius + 0.03) for item in room.furniture]
    )


@given(st.lists(seeds, min_size=2, max_size=5))
def test_many_layouts_have_the_faults_of_each_alone(drawn: list[int]) -> None:
    """Also an empty one, and one of which nothing is placed."""
    layouts = [shaken(random_room(np.random.default_rng(seed)), seed) for seed in drawn]
    nothing = tuple(replace(item, center=None) for item in layouts[1].furniture)
    layouts[1:1] = [replace(layouts[0], furniture=()), replace(layouts[1], furniture=nothing)]
    assert faults_of_all(layouts) == [faults(layout) for layout in layouts]
    assert faults(layouts[1]) == []
    assert faults(layouts[2]) == [(k, MISSING) for k in range(len(nothing))]


@given(seeds)
def test_what_was_wrong_before_is_not_new_but_for_what_is_still_not_placed(seed: int) -> None:
    layout = shaken(random_room(np.random.default_rng(seed)), seed)
    wrong = faults(layout)
    missing = [(k, fault) for k, fault in wrong if fault == MISSING]
    assert new_faults(wrong, []) == wrong
    assert new_faults(wrong, wrong) == missing
    for fault in wrong:
        assert sorted({*new_faults(wrong, [f for f in wrong if f != fault])}) == sorted({*missing, fault})
