"""What makes a dining room: one table, chairs that look at it, room to sit down."""

from __future__ import annotations

import pytest

from layoutrl.rooms.designer.dining_room import UNDER
from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Plan


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("dining_room", "train", 0, k) for k in range(60)]


def plan(design: Design) -> Plan:
    return Plan(design.shell, tuple(choice.place for choice in design.choices))


def test_every_template_occurs(designs: list[Design]) -> None:
    templates = {design.template for design in designs}
    assert templates == {"centred", "heads", "round", "bench", "at_wall", "in_a_corner"}


def test_number_of_chairs(designs: list[Design]) -> None:
    allowed = {"centred": {4, 6}, "heads": {6}, "round": {4}, "bench": {2}, "at_wall": {4}, "in_a_corner": {3}}
    for design in designs:
        room = plan(design)
        assert len(room.all("table")) == 1
        assert len(room.all("chair")) in allowed[design.template]


def test_chairs_stand_under_the_table_and_look_at_its_middle(designs: list[Design]) -> None:
    for room in map(plan, designs):
        table = room["table"]
        for chair in room.all("chair"):
            along = chair.facing % 2
            assert chair.piece.tucked
            assert chair.box.beyond(chair.facing, 1).overlaps(table.box)
            assert (table.twice_center[along] > chair.twice_center[along]) == (chair.facing < 2)
            assert chair.box.shared(table.box) == UNDER * chair.piece.width


def test_whoever_sits_can_pull_the_chair_out(designs: list[Design]) -> None:
    for room in map(plan, designs):
        for chair in room.all("chair"):
            assert room.shell.holds(chair.box.beyond((chair.facing + 2) % 4, 56))  # 81 from the table's edge


def test_table_stands_free_or_at_a_wall_as_its_template_says(designs: list[Design]) -> None:
    at_walls = {"centred": 0, "heads": 0, "round": 0, "bench": 0, "at_wall": 1, "in_a_corner": 2}
    for design in designs:
        table = plan(design)["table"].box
        touched = sum(not design.shell.holds(table.beyond(direction, 1)) for direction in range(4))
        if design.template != "bench":
            assert touched == at_walls[design.template]


def test_sideboard_is_off_the_table_and_off_doors(designs: list[Design]) -> None:
    boards = [(room, board) for room in map(plan, designs) for board in room.all("sideboard")]
    assert len(boards) >= 10
    for room, board in boards:
        front = board.box.beyond(board.facing, 90)
        assert not any(front.overlaps(place.box) for place in room.places)
        assert not any(board.box.overlaps(swing) for swing in room.shell.swings)


def test_rooms_without_a_window_are_small(designs: list[Design]) -> None:
    assert all(design.shell.windows or design.shell.area <= 100000 for design in designs)
