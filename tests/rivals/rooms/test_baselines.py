"""Drawn layouts lie indoors; the most similar room is the room itself, in any view, where it is among the others."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity

from layoutrl.env.measures import iou_of
from layoutrl.rivals.rooms.baselines import OTHER_CATEGORY, Library, _unlikeness, nearest_layout, random_layout
from layoutrl.rooms.brief import brief_of, facings
from layoutrl.rooms.room import SYMMETRIES, Item
from tests.builders import random_room, rectangular_room
from tests.rivals.rooms.builders import designed


@given(st.integers(0, 2**32 - 1))
def test_drawn_places_are_indoors_and_who_fits_nowhere_has_none(seed):
    rng = np.random.default_rng(seed)
    brief = brief_of(random_room(rng))
    layout = random_layout(brief, rng)
    assert any(item.center for item in layout.furniture)
    for item in layout.furniture:
        if item.center is not None:
            assert brief.indoor.buffer(1e-5).covers(item.footprint)
            assert item.degrees in facings(brief)


def test_who_fits_nowhere_has_no_place():
    items = Item("bed", (5.0, 5.0), None, None), Item("desk", (4.0, 0.5), None, None)
    brief = rectangular_room(4, 3, items[0], others=items[1:], target=None)
    bed, desk = random_layout(brief, np.random.default_rng(0)).furniture
    assert (bed.center, bed.rotation) == (None, None)
    assert desk.degrees % 180 == 0
    assert desk.center[0] == pytest.approx(2, abs=1e-5)


@pytest.mark.parametrize("view", SYMMETRIES)
def test_of_the_room_itself_in_any_view_the_designers_layout_comes_back(view):
    rooms = designed("bedroom", 5)
    room = next(room for room in rooms if max(Counter(item.category for item in room.furniture).values()) > 1)
    wanted = replace(room.turned(*view), group="another")
    layout = nearest_layout(brief_of(wanted), Library(rooms), np.random.default_rng(0))
    for item in wanted.furniture:
        assert max(iou_of(item.footprint, other.footprint) for other in layout.furniture) > 0.99


def test_the_nearest_room_is_that_of_all():
    rooms = designed("living_room", 30)
    for room in designed("study", 3) + designed("living_room", 33)[30:]:
        assert room.group not in {other.group for other in rooms}
        found, view = Library(rooms).nearest(brief_of(room))
        assert _unlikeness(brief_of(room), found, [view]).item() == min(
            _unlikeness(brief_of(room), other, SYMMETRIES).min() for other in rooms
        )


def test_where_mirrored_rooms_are_not_furnished_alike_none_is_looked_at():
    *others, room = (replace(room, group=f"asked {room.id}") for room in designed("study", 6))
    mirrored = [replace(other.turned(2, mirror=True), group=other.id) for other in (room, *others)]
    assert Library(mirrored).nearest(brief_of(room)) == (mirrored[0], (2, True))
    for brief in (room, *others):
        _, (_, mirror) = Library(mirrored, mirrors_alike=False).nearest(brief_of(brief))
        assert not mirror


def test_rooms_of_the_briefs_own_group_are_left_out_where_there_are_others():
    room, other = designed("bedroom", 2)
    twin = replace(room, id="twin")  # of its group
    brief = brief_of(room)
    found, view = Library([room, twin, other]).nearest(brief)
    assert (found, view) == Library([other]).nearest(brief) == (other, view)
    assert Library([twin, room]).nearest(brief) == (twin, SYMMETRIES[0])


@pytest.mark.parametrize("view", SYMMETRIES)
def test_outlines_are_compared_and_not_their_extents_alone(view):
    corners = (0.0, 0.0), (5.0, 0.0), (5.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0)
    rectangle = rectangular_room(5.0, 4.0, Item("bed", (2.0, 1.4), (1.0, 0.7)))
    angle = replace(rectangle, outline=corners, walls=())
    turned = angle.turned(*view)
    library = Library([rectangle, angle, rectangle])
    found, way = library.nearest(brief_of(turned))
    assert (found, way) == (angle, view)
    unlike = _unlikeness(brief_of(turned), angle, SYMMETRIES)
    assert unlike[SYMMETRIES.index(view)] == pytest.approx(0)
    assert np.delete(unlike, SYMMETRIES.index(view)).min() > 0.1
    of_rectangle = _unlikeness(brief_of(turned), rectangle, SYMMETRIES)
    assert of_rectangle.min() == pytest.approx(OTHER_CATEGORY * (1 - 14 / 20))
    assert _unlikeness(brief_of(rectangle), rectangle, SYMMETRIES).min() == 0
    views = [(2, False), (0, True)]
    mirrored = [affinity.translate(angle.turned(*v).indoor, 5, dy) for v, dy in zip(views, (4, 0), strict=True)]
    slow = [iou_of(shape, angle.indoor) for shape in mirrored]
    fast = _unlikeness(angle, angle, views)
    assert fast == pytest.approx([OTHER_CATEGORY * (1 - iou) for iou in slow])


@pytest.mark.parametrize("nearest", [False, True])
def test_the_same_seed_gives_the_same_layout(nearest):
    *rooms, room = designed("bedroom", 5)
    library, brief = Library(rooms), brief_of(room)

    def furnished(seed):
        rng = np.random.default_rng(seed)
        return nearest_layout(brief, library, rng) if nearest else random_layout(brief, rng)

    assert furnished(1) == furnished(1)
    assert nearest or furnished(1) != furnished(2)
