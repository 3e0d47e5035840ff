"""Rooms as figures show them."""

from __future__ import annotations

from matplotlib.figure import Figure

from layoutrl.figures import draw_room
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room


def test_a_name_runs_along_a_narrow_item() -> None:
    wardrobe, desk, table = (
        Item("wardrobe", (0.6, 1.8), (1.0, 2.0), 0.0),
        Item("desk", (0.6, 1.2), (3.0, 2.0), 90.0),
        Item("table", (1.0, 1.0), (5.0, 2.0), 0.0),
    )
    axes = Figure().subplots()
    draw_room(axes, rectangular_room(6, 4, wardrobe, others=(desk, table)))
    assert {text.get_text(): text.get_rotation() for text in axes.texts} == {"wardrobe": 90, "desk": 0, "table": 0}
