"""What makes a designed kitchen."""

from itertools import pairwise

import pytest

from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Place

COOKTOP_OFF_WINDOW = 30


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("kitchen", "train", 3, k) for k in range(60)]


def run(design: Design) -> list[Place]:
    """Everything from the fridge on, each touching the one before; what faces the fridge in two lines is left out."""
    rest = [c.place for c in design.choices]
    line = [place for place in rest if place.piece.category == "fridge"]
    while rest:
        rest = [place for place in rest if place not in line]
        following = [place for place in rest if touches(place, line[-1])]
        if not following:
            break
        assert len(following) == 1
        line.append(following[0])
    return line


def touches(a: Place, b: Place) -> bool:
    """Along more than a corner."""
    return a.box.gap(b.box) == 0 and any(a.box.beyond(d, 1).shared(b.box) > 1 for d in range(4))


def test_every_template_occurs(designs: list[Design]) -> None:
    assert {d.template for d in designs} == {"one_line", "l_shaped", "u_shaped", "two_line"}


def test_the_run_leads_from_the_fridge_over_sink_and_counter_to_the_cooktop_and_on_to_a_counter(
    designs: list[Design],
) -> None:
    for design in designs:
        line = run(design)
        if design.template == "two_line":
            assert {c.place.piece.category for c in design.choices if c.place not in line} == {"counter", "cooktop"}
            order = ["fridge", "sink", "counter"]
        else:
            assert len(line) == len(design.choices)
            order = ["fridge", "sink", "counter", "cooktop", "counter"]
        names = iter([place.piece.category for place in line])
        assert all(name in names for name in order)  # in this order, counters between


def test_the_cooktop_has_a_counter_on_both_sides_and_keeps_off_window_and_corner(designs: list[Design]) -> None:
    for design in designs:
        (cooktop,) = (c.place for c in design.choices if c.place.piece.category == "cooktop")
        sides = [c.place for c in design.choices if touches(c.place, cooktop)]
        assert [place.piece.category for place in sides] == ["counter", "counter"]
        for window in design.shell.windows:
            assert cooktop.box.gap(window.strip(1)) >= COOKTOP_OFF_WINDOW


def test_the_sink_stands_at_the_window_of_an_l_and_a_u(designs: list[Design]) -> None:
    for design in (d for d in designs if d.template in ("l_shaped", "u_shaped")):
        (sink,) = (c.place for c in design.choices if c.place.piece.category == "sink")
        assert any(window.wall == sink.wall for window in design.shell.windows)


def test_the_legs_of_an_l_or_a_u_meet_at_right_angles(designs: list[Design]) -> None:
    legs = {"one_line": 1, "l_shaped": 2, "u_shaped": 3}
    for design in (d for d in designs if d.template in legs):
        turns = sum((b.facing - a.facing) % 4 != 0 for a, b in pairwise(run(design)))
        assert turns == legs[design.template] - 1
