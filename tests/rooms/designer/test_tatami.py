"""What makes a tatami room: a platform built in between walls and wardrobe, a strip of floor with a desk at its end."""

from __future__ import annotations

import pytest

from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Plan


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("tatami", "train", 0, k) for k in range(60)]


def plan(design: Design) -> Plan:
    return Plan(design.shell, tuple(choice.place for choice in design.choices))


def test_every_template_occurs(designs: list[Design]) -> None:
    assert {design.template for design in designs} == {"l_shape", "across", "beside_wardrobe"}


def test_platform_is_built_in(designs: list[Design]) -> None:
    """Flush with walls on two sides and with the wardrobe on a third; its front is free."""
    for design in designs:
        room, shell = plan(design), design.shell
        platform, wardrobe = room["platform"], room["wardrobe"]
        sides = [platform.box.beyond((platform.facing + side) % 4, 1) for side in (1, 2, 3)]
        assert not shell.holds(sides[1])
        assert sum(not shell.holds(side) for side in sides) == 2
        assert sum(wardrobe.box.overlaps(side) for side in sides) == 1
        assert 160 <= platform.piece.depth <= 210


def test_platform_and_wardrobe_fill_the_wall(designs: list[Design]) -> None:
    for room in map(plan, designs):
        facing = room["platform"].facing
        spans = sorted(room[category].box.span(facing) for category in ("platform", "wardrobe"))
        side = room.shell.height if facing % 2 == 0 else room.shell.width
        assert (spans[0][0], spans[1][1]) == (0, side)
        assert spans[0][1] == spans[1][0]


def test_the_way_in_is_a_strip_of_at_least_ninety(designs: list[Design]) -> None:
    for design in designs:
        platform, shell = plan(design)["platform"], design.shell
        extent = shell.width if platform.facing % 2 == 0 else shell.height
        assert extent - platform.piece.depth >= 90


def test_l_shape_is_the_authors_room(designs: list[Design]) -> None:
    """Platform along a side wall, desk opposite the door; mostly the wardrobe too, unless the window is there."""
    rooms = [plan(design) for design in designs if design.template == "l_shape"]
    for room in rooms:
        door = room.shell.entrance.wall
        assert room["desk"].facing == (door.normal + 2) % 4
        assert (room["platform"].facing - door.normal) % 2 == 1
    assert sum(room["wardrobe"].facing == room["desk"].facing for room in rooms) >= 0.7 * len(rooms)


def test_platform_across_the_room_reaches_up_to_the_window(designs: list[Design]) -> None:
    """Unless the window is opposite or none of its ends can hold the wardrobe: the dark end is the wardrobe's."""
    for design in designs:
        room, window = plan(design), design.shell.windows[0]
        if design.template == "l_shape":
            continue
        assert room["platform"].facing == (design.shell.entrance.wall.normal + 2) % 4
        if (window.wall.normal - design.shell.entrance.wall.normal) % 2:
            assert room["platform"].box.gap(window.strip(1)) < room["wardrobe"].box.gap(window.strip(1))


def test_who_sits_on_the_stool_sits_at_the_desk(designs: list[Design]) -> None:
    for room in map(plan, designs):
        desk, stool = room["desk"], room["stool"]
        assert desk.box.gap(stool.box) == 0
        assert (stool.facing - desk.facing) % 4 == 2
