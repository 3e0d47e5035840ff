"""What makes a living room: a sofa that looks across the coffee table at the television."""

from __future__ import annotations

import pytest

from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Plan


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("living_room", "train", 0, k) for k in range(60)]


def plan(design: Design) -> Plan:
    return Plan(design.shell, tuple(choice.place for choice in design.choices))


def test_every_template_occurs(designs: list[Design]) -> None:
    assert {design.template for design in designs} == {"parallel", "vertical", "island"}


def test_sofa_and_television_face_each_other_on_one_axis(designs: list[Design]) -> None:
    for room in map(plan, designs):
        sofa, tv = room["sofa"], room["tv_unit"]
        across = (sofa.facing + 1) % 2
        assert (sofa.facing - tv.facing) % 4 == 2
        assert abs(sofa.twice_center[across] - tv.twice_center[across]) <= 2  # twice a centimetre of rounding
        assert 200 <= sofa.box.gap(tv.box) <= 350


def test_coffee_table_stands_between_them_within_reach(designs: list[Design]) -> None:
    for room in map(plan, designs):
        sofa, table, tv = room["sofa"], room["coffee_table"], room["tv_unit"]
        assert 30 <= sofa.box.gap(table.box) <= 45
        assert table.box.gap(tv.box) < sofa.box.gap(tv.box)


def test_extra_seat_is_at_right_angles_and_looks_at_the_coffee_table(designs: list[Design]) -> None:
    for design in designs:
        room = plan(design)
        seats = room.all("loveseat") + room.all("armchair")
        assert seats or design.template != "vertical"
        for seat in seats:
            table = room["coffee_table"].box
            assert (seat.facing - room["sofa"].facing) % 2 == 1
            along = seat.facing % 2
            assert (table[along] + table[along + 2] > seat.twice_center[along]) == (seat.facing < 2)


def test_only_the_island_leaves_the_sofa_off_the_wall(designs: list[Design]) -> None:
    for design in designs:
        sofa = plan(design)["sofa"]
        against_wall = not design.shell.holds(sofa.box.beyond((sofa.facing + 2) % 4, 1))
        assert against_wall == (design.template != "island")
        assert against_wall or design.shell.holds(sofa.box.beyond((sofa.facing + 2) % 4, 90))


def test_television_is_off_windows(designs: list[Design]) -> None:
    for room in map(plan, designs):
        assert not any(room["tv_unit"].box.overlaps(strip) for strip in room.shell.daylight)


def test_some_rooms_are_entered_through_a_corridor(designs: list[Design]) -> None:
    def narrow(design: Design) -> bool:
        walls = design.shell.walls
        return len(walls) == 6 and min(wall.length for wall in walls if all(wall.convex)) <= 140

    assert 3 <= sum(map(narrow, designs)) <= 30
