"""What is drawn through a wall is cut to its room."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.room import Item
from layoutrl.rooms.sources.walls import cut_to
from tests.builders import rectangular_room


@given(st.floats(0, 4), st.floats(0, 3), st.floats(0.3, 3), st.floats(0.3, 3), st.floats(0, 360))
def test_what_is_cut_to_a_room_lies_in_it_and_where_the_piece_lay(
    x: float, y: float, depth: float, width: float, degrees: float
) -> None:
    room, item = rectangular_room(), Item("dresser", (depth, width), (x, y), degrees)
    kept = cut_to(room, item)
    if room.holds(item):
        assert kept is item
    elif kept is not None:
        assert kept.category == "obstacle"
        assert room.holds(kept)
        assert kept.footprint.difference(item.footprint.buffer(1e-6)).area < 1e-9
        assert kept.footprint.intersection(room.indoor).area > 0.09 * item.footprint.intersection(room.indoor).area
    else:
        assert item.footprint.intersection(room.indoor).area < 0.1


@pytest.mark.parametrize(("x", "degrees"), [(3.9, 0), (3.9, 90), (0.1, 180), (0.1, 270)])
def test_what_is_upright_is_cut_along_the_wall(x: float, degrees: float) -> None:
    room, item = rectangular_room(), Item("dresser", (1.0, 1.2), (x, 1.5), degrees)
    kept = cut_to(room, item)
    assert kept is not None
    assert kept.footprint.symmetric_difference(item.footprint.intersection(room.indoor)).area < 1e-9
    assert cut_to(room, replace(item, center=(9.0, 9.0))) is None
    assert cut_to(room, replace(item, center=None)) == replace(item, center=None)
