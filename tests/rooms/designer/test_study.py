"""What makes a study: daylight from the side on the desk, a wall or books behind who sits there, books at hand."""

from __future__ import annotations

import pytest

from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Plan
from layoutrl.rooms.designer.shell import Box


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("study", "train", 0, k) for k in range(60)]


def plan(design: Design) -> Plan:
    return Plan(design.shell, tuple(choice.place for choice in design.choices))


def ahead(box: Box, direction: int, other: Box) -> bool:
    """Whether all of the other lies beyond the side in this direction."""
    near, far = box.side(direction), other.side((direction + 2) % 4)
    return far >= near if direction < 2 else far <= near


def test_every_template_occurs(designs: list[Design]) -> None:
    assert {design.template for design in designs} == {"command", "at_wall", "with_sofa_bed"}


def test_the_chair_is_tucked_under_the_desk_and_looks_at_it(designs: list[Design]) -> None:
    for room in map(plan, designs):
        desk, chair = room["desk"], room["chair"]
        assert chair.piece.tucked
        assert 0 < desk.box.shared(chair.box) < chair.box.area / 2
        assert (chair.facing - desk.facing) % 4 == 2


def test_commander_has_books_behind_and_mostly_the_door_ahead(designs: list[Design]) -> None:
    rooms = [plan(design) for design in designs if design.template == "command"]
    for room in rooms:
        desk, books = room["desk"], room["bookcase"]
        assert 90 <= desk.box.gap(books.box) <= 120
        assert books.facing == (desk.facing + 2) % 4
    seen = [ahead(r["desk"].box, (r["desk"].facing + 2) % 4, r.shell.entrance.strip(1)) for r in rooms]
    assert sum(seen) >= 0.6 * len(seen)


def test_other_desks_stand_at_a_wall_mostly_across_the_daylight(designs: list[Design]) -> None:
    across = []
    for design in designs:
        if design.template == "command":
            continue
        desk, shell = plan(design)["desk"], design.shell
        assert not shell.holds(desk.box.beyond((desk.facing + 2) % 4, 1))
        largest = max(shell.windows, key=lambda window: window.width)
        across.append((desk.facing - largest.wall.normal) % 2 == 1)
    assert sum(across) >= 0.9 * len(across)


def test_guests_sleep_away_from_the_desk(designs: list[Design]) -> None:
    rooms = [plan(design) for design in designs if design.template == "with_sofa_bed"]
    distances = [room["desk"].box.gap(room["sofa_bed"].box) for room in rooms]
    assert min(distances) >= 60
    assert sorted(distances)[len(distances) // 2] >= 120
