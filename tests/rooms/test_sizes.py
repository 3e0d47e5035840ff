"""What is asked about sizes: nothing of furniture as it is; what is meant, where the unit or the order is another."""

from __future__ import annotations

from dataclasses import replace

import pytest

from layoutrl.rooms.clearances import FRONT_DEPTH
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Item
from layoutrl.rooms.sizes import OUTSIZE, SIZES, doubt
from layoutrl.rooms.units import UNITS


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_nothing_is_asked_of_what_the_designer_has_and_the_unit_of_what_is_in_feet(room_type: str) -> None:
    for room in design_rooms(room_type, "test", 0, 20).rooms:
        for item in room.furniture:
            depth, width = SIZES[item.category]
            assert doubt(item) is None
            in_feet = replace(item, size=(item.size[0] * UNITS["ft"], item.size[1] * UNITS["ft"]))
            if max(depth[1] / depth[0], width[1] / width[0]) < UNITS["ft"] / OUTSIZE:  # of others it may be a large one
                assert "is the unit right" in (doubt(in_feet) or "")


@pytest.mark.parametrize(("category", "depth", "width"), [
    ("bed", 2.0, 1.4),
    ("bed", 2.2, 1.0),  # narrower than the designer's
    ("bed", 2.0, 0.9),
    ("bed", 2.0, 1.6),
    ("bed", 2.0, 1.8),
    ("wardrobe", 0.6, 1.8),
    ("sofa", 0.9, 2.2),
    ("bookcase", 0.25, 0.8),
    ("counter", 0.6, 2.4),
    ("toilet", 0.7, 0.4),
    ("tv_unit", 0.4, 1.8),
])  # fmt: skip
def test_who_gives_the_width_first_is_asked(category: str, depth: float, width: float) -> None:
    assert doubt(Item(category, (depth, width))) is None
    assert "depth, then width" in (doubt(Item(category, (width, depth))) or "")


@pytest.mark.parametrize("item", [
    Item("table", (1.8, 0.9)),  # has no front
    Item("counter", (0.42, 0.6)),  # a shallow one
    Item("armchair", (1.0, 0.75)),
    Item("piano", (5.0, 5.0)),  # nobody knows how large they are
])  # fmt: skip
def test_nothing_is_asked_of_what_may_be_meant(item: Item) -> None:
    assert doubt(item) is None


def test_the_unit_of_furniture_in_metres_in_a_room_in_millimetres_is_asked_for() -> None:
    assert "less than half as large as others are: is the unit right?" in (doubt(Item("bed", (0.0021, 0.0015))) or "")
    assert doubt(Item("bed", (1.1, 0.7))) is None  # a cot


def test_sizes_are_known_of_all_that_has_a_front() -> None:
    assert SIZES.keys() >= FRONT_DEPTH.keys()
