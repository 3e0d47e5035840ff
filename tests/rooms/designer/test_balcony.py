"""What makes a balcony: a glass front, a free way before the sliding door, laundry at one end, a seat at the other."""

from __future__ import annotations

import pytest

from layoutrl.rooms.designer.balcony import DOOR_STRIP
from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Plan


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("balcony", "train", 0, k) for k in range(90)]


def plan(design: Design) -> Plan:
    return Plan(design.shell, tuple(choice.place for choice in design.choices))


def test_every_template_occurs(designs: list[Design]) -> None:
    assert {design.template for design in designs} == {"across", "along", "counter"}


def test_glass_lies_opposite_an_off_centre_sliding_door(designs: list[Design]) -> None:
    for design in designs:
        shell, door = design.shell, design.shell.entrance
        depth, length = shell.short, shell.long
        assert 110 <= depth <= 180
        assert 240 <= length <= 450
        assert door.sliding
        assert 160 <= door.width <= 240
        assert shell.windows[0].wall.normal == (door.wall.normal + 2) % 4
        assert shell.windows[0].width >= 0.85 * length
        assert abs(door.lo + door.hi - length) >= 40


def test_nothing_stands_before_the_door(designs: list[Design]) -> None:
    for design in designs:
        way = design.shell.entrance.strip(DOOR_STRIP)
        assert not any(choice.place.box.overlaps(way) for choice in design.choices)


def test_laundry_stands_at_a_solid_end_where_it_can_else_far_from_the_door(designs: list[Design]) -> None:
    for design in designs:
        if design.template != "across":
            continue
        room, shell = plan(design), design.shell
        cabinet, length = room["laundry_cabinet"], shell.long
        assert (cabinet.facing - shell.entrance.wall.normal) % 2
        along = 0 if shell.width > shell.height else 1
        door_low, cabinet_low = shell.entrance.lo + shell.entrance.hi < length, cabinet.twice_center[along] < length
        glazed = {window.wall for window in shell.windows[1:]}
        if not glazed and not shell.notches:
            assert door_low != cabinet_low
        if cabinet.wall in glazed:  # as the solid end has a column or no room beside the door
            beside = shell.entrance.lo if not cabinet_low else length - shell.entrance.hi
            assert shell.notches or beside < 65


def test_who_sits_does_not_look_at_the_house_nor_sit_by_the_laundry(designs: list[Design]) -> None:
    chairs = 0
    for design in designs:
        room = plan(design)
        for chair in room.all("lounge_chair"):
            chairs += 1
            assert chair.facing != design.shell.windows[0].wall.normal
            assert chair.box.gap(room["laundry_cabinet"].box) >= 60
    assert chairs >= 30


def test_washer_or_sink_touches_the_laundry(designs: list[Design]) -> None:
    for room in map(plan, designs):
        for place in room.all("washer") + room.all("sink"):
            assert place.box.gap(room["laundry_cabinet"].box) == 0
