"""Briefs: what who furnishes a room is told, and what not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from layoutrl.rooms.brief import (
    brief_of,
    distinct_rotations,
    facings,
    largest_first,
    missing,
    with_poses,
    without_poses,
)
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.room import MAIN_ITEM, Item, Ring
from tests.builders import rectangular_room


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_a_brief_tells_neither_places_nor_rotations_nor_the_order(room_type: str) -> None:
    rng = np.random.default_rng(0)
    for room in design_rooms(room_type, "test", 0, 3).rooms:
        brief = brief_of(room)
        assert all(item.center is None and item.rotation is None for item in brief.furniture)
        assert missing(brief) == list(range(len(room.furniture)))
        moved = tuple(
            replace(item, center=tuple(map(float, rng.uniform(0, 1, 2))), rotation=90.0 * rng.integers(4))
            for item in rng.permutation(np.array(room.furniture, dtype=object))
        )
        assert brief_of(replace(room, furniture=moved, target=None)) == brief
        what = sorted((item.category, item.size, item.form, item.tucked) for item in room.furniture)
        assert [(item.category, item.size, item.form, item.tucked) for item in brief.furniture] == what


def test_a_brief_does_not_tell_which_chair_stood_under_the_table() -> None:
    table, under, apart = (
        Item("table", (1.2, 0.8), (1.0, 1.0)),
        Item("chair", (0.4, 0.4), (1.0, 1.0), tucked=True),
        Item("chair", (0.4, 0.4), (3.0, 2.5)),
    )
    room = rectangular_room(4, 3, table, others=(under, apart), target=None)
    assert [item.tucked for item in brief_of(room).furniture] == [True, True, False]
    assert brief_of(replace(room, furniture=(table, apart, replace(under, center=(2.0, 2.5), tucked=False)))) == (
        brief_of(room)
    )
    assert not brief_of(replace(room, furniture=(apart,))).furniture[0].tucked  # there is nothing to stand under
    stool = replace(under, category="stool")  # as drawn, where somebody pushed one under the table
    (said,) = (item for item in brief_of(replace(room, furniture=(table, stool))).furniture if item.category == "stool")
    assert not said.tucked


def test_what_is_to_be_placed_is_not_locked() -> None:
    bed = Item("bed", (2.0, 1.5), (1.0, 0.75), locked=True)
    room = rectangular_room(4, 3, bed)
    assert not brief_of(room).furniture[0].locked
    assert not without_poses([bed], {0})[0].locked
    assert without_poses([bed], set())[0].locked
    assert room_from_dict(room_to_dict(brief_of(room))).furniture == brief_of(room).furniture


def test_the_largest_item_comes_first_and_what_is_tucked_under_others_after_them() -> None:
    chair, desk = Item("chair", (1.5, 1.5), None, tucked=True), Item("desk", (0.7, 1.4), None)
    bed, lamp = Item("bed", (2.0, 1.5), (1.0, 0.75)), Item("lamp", (0.4, 0.4), None)
    assert largest_first(rectangular_room(4.0, 4.0, chair, others=(lamp, bed, desk), target=None)) == [3, 1, 0]


def test_items_face_along_the_walls() -> None:
    room = rectangular_room(3.0, 4.0, Item("bed", (2.0, 1.5), (1.5, 2.0)))
    assert facings(room) == (0, 90, 180, 270)
    for degrees in (30, 75, 100):
        turn = np.exp(1j * math.radians(degrees))
        corners = [turn * complex(*corner) for corner in room.outline]
        turned = replace(room, outline=tuple((c.real, c.imag) for c in corners))
        assert np.sort(np.mod(facings(turned), 90)) == pytest.approx([degrees % 90] * 4)
        assert np.diff(facings(turned)) == pytest.approx([90] * 3)


def test_items_face_along_most_of_the_walls_and_not_along_the_longest() -> None:
    cut: Ring = ((0.0, 0.0), (4.0, 0.0), (4.0, 1.2), (1.2, 4.0), (0.0, 4.0))  # the slanting wall is 3.96 m long
    room = replace(rectangular_room(), outline=cut, walls=())
    assert facings(room) == (0, 90, 180, 270)
    split: Ring = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 4.0))
    assert facings(replace(room, outline=split)) == (0, 90, 180, 270)


def test_the_ways_of_an_item_look_different() -> None:
    room = rectangular_room()
    sizes = {"bed": ((1.0, 1.0), 4), "table": ((1.0, 2.0), 2), "stool": ((0.4, 0.4), 1)}
    for category, (size, count) in sizes.items():
        assert distinct_rotations(room, Item(category, size, None, None)) == facings(room)[:count]
    assert distinct_rotations(room, Item("bed", (1.0, 2.0), None, 30.0)) == (30.0,)


def test_a_layout_is_the_brief_with_poses() -> None:
    room = rectangular_room(3.0, 4.0, Item("bed", (2.0, 1.5), (1.0, 2.0), 90.0))
    brief = brief_of(room)
    assert replace(with_poses(brief, {0: ((1.0, 2.0), 90.0)}), target=room.target) == room
    assert with_poses(brief, {}) == brief
