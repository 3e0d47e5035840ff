"""Rooms disturbed as flats are, and the layouts that stand in them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import box

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.disturbances import DISTURBANCES, MOST, disturbed, one_more_door, without
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import WALL_THICKNESS, Item, wall_band
from tests.builders import opening, rectangular_room

FLOOR = {"corner_cut", "corner_built_in", "column", "pier"}


@given(st.sampled_from(["bedroom", "kitchen", "balcony"]), st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_a_disturbed_room_holds_the_same_layout_without_a_fault(room_type: str, seed: int) -> None:
    rooms = design_rooms(room_type, "test", 0, 3).rooms
    for room, (changed, names) in zip(rooms, disturbed(rooms, generators(seed)), strict=True):
        assert not faults(changed)
        assert changed.furniture == room.furniture
        assert room_from_dict(json.loads(json.dumps(room_to_dict(changed)))).indoor.equals_exact(changed.indoor, 1e-6)
        assert len({*names}) == len(names) <= MOST
        assert room.indoor.buffer(1e-6).covers(changed.indoor)
        assert (changed.indoor.area < room.indoor.area - 1e-6) == bool(FLOOR & {*names})
        assert bool(names) == (changed != room)
        assert len(changed.doors) == len(room.doors) + ("one_more_door" in names)
        assert changed.windows == (() if "bricked_up" in names else room.windows)
        if not FLOOR & {*names}:
            assert changed.envelope.symmetric_difference(room.envelope).area < 1e-6  # the walls are as thick as before


def test_a_room_is_disturbed_the_same_beside_any_others() -> None:
    rooms = design_rooms("bedroom", "test", 0, 3).rooms
    assert disturbed(rooms, generators(5))[1] == disturbed(rooms[1:2], generators(5)[1:2])[0]


@pytest.mark.parametrize("disturb", DISTURBANCES)
def test_every_disturbance_happens_and_leaves_two_thirds_of_the_room(disturb) -> None:
    door, window = opening("door", 1.5, -0.2, 2.3, 0), opening("window", 1, 3, 2, 3.2)
    room, rng = replace(rectangular_room(4, 3, openings=(door, window)), furniture=()), np.random.default_rng(0)
    changed = [found for _ in range(20) if (found := disturb(room, rng))]
    assert changed
    assert all(found != room for found in changed)
    assert min(found.indoor.area for found in changed) > 8


def test_nothing_is_taken_where_an_item_stands_or_an_opening_is() -> None:
    room = rectangular_room(4, 3, Item("bed", (1.0, 1.0), (1.0, 1.0)))
    assert without(room, box(0, 0, 1, 1)) is None
    assert without(room, box(5, 0, 6, 1)) is None
    assert without(room, box(1.9, 0, 2.1, 3)) is None  # two rooms
    assert without(room, box(2, 2, 3, 3)) is not None
    before = box(1.4, 0, 2.4, 0.3)
    assert without(replace(room, furniture=()), before) is not None
    with_door = replace(room, furniture=(), openings=(opening("door", 1.5, -0.2, 2.3, 0),))
    assert without(with_door, before) is None


def test_a_further_door_is_beside_no_other_and_leads_out_of_the_room() -> None:
    u = ((0, 0), (4.6, 0), (4.6, 3), (2.6, 3), (2.6, 1.5), (2, 1.5), (2, 3), (0, 3))  # a recess 0.6 m wide
    room, rng = (
        replace(rectangular_room(), outline=u, walls=wall_band(u, (), ()), furniture=()),
        np.random.default_rng(0),
    )
    changed = [found for _ in range(60) if (found := one_more_door(room, rng))]
    for other in changed:
        (door,) = other.doors
        assert 0.7 * WALL_THICKNESS - 1e-9 <= door.shape.area <= WALL_THICKNESS + 1e-9
        assert door.shape.intersection(room.indoor).area < 1e-9
        assert door.shape.distance(box(2, 1.6, 2.6, 3)) > 0
        again = one_more_door(other, rng)
        assert again is None or door.shape.distance(again.doors[1].shape) >= WALL_THICKNESS - 1e-9
    assert len(changed) > 10


def generators(seed: int) -> list[np.random.Generator]:
    return [np.random.default_rng([seed, k]) for k in range(3)]
