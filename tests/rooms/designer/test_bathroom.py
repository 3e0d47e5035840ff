"""What makes a designed bathroom."""

import pytest

from layoutrl.rooms.designer.generator import Design, design_room
from layoutrl.rooms.designer.search import Place


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return [design_room("bathroom", "train", 3, k) for k in range(60)]


def placed(design: Design, category: str) -> list[Place]:
    return [c.place for c in design.choices if c.place.piece.category == category]


def test_every_template_and_fixture_occurs(designs: list[Design]) -> None:
    assert {d.template for d in designs} == {"line", "square"}
    washed = [p for d in designs for p in (*placed(d, "shower"), *placed(d, "bathtub"))]
    assert len(washed) == len(designs)
    assert {p.piece.category for p in washed} == {"shower", "bathtub"}
    assert {p.piece.circle for p in washed if p.piece.category == "shower"} == {True, False}
    assert any(placed(d, "washing_machine") for d in designs)


def test_the_toilets_axis_keeps_40_cm_from_what_stands_beside_it(designs: list[Design]) -> None:
    for design in designs:
        (toilet,) = placed(design, "toilet")
        out = 40 - toilet.piece.width // 2
        for side in (1, -1):
            strip = toilet.box.beyond((toilet.facing + side) % 4, out)
            assert design.shell.holds(strip)
            assert not any(strip.overlaps(c.place.box) for c in design.choices if c.place != toilet)


def test_in_a_line_the_toilet_stands_midway_in_what_is_left(designs: list[Design]) -> None:
    for design in (d for d in designs if d.template == "line"):
        (toilet,), (vanity,) = placed(design, "toilet"), placed(design, "vanity")
        assert toilet.wall == vanity.wall
        lo, hi = toilet.box.span(toilet.facing)
        assert toilet.wall is not None
        strip = toilet.wall.box(toilet.wall.lo, toilet.wall.hi, toilet.piece.depth)
        blocks = [*(c.place.box for c in design.choices if c.place != toilet), *design.shell.swings]
        spans = [block.span(toilet.facing) for block in blocks if block.overlaps(strip)]
        before = lo - max(end for _, end in spans if end <= lo)
        after = min(start for start, _ in spans if start >= hi) - hi
        assert abs(before - after) <= 1
        bathed = (placed(design, "shower") or placed(design, "bathtub"))[0]
        door = design.shell.entrance.strip(1)
        assert vanity.box.gap(door) < bathed.box.gap(door)


def test_in_a_square_the_shower_stands_farther_from_the_door_than_the_vanity(designs: list[Design]) -> None:
    for design in (d for d in designs if d.template == "square" and placed(d, "shower")):
        door = design.shell.entrance.strip(1)
        assert placed(design, "shower")[0].box.gap(door) > placed(design, "vanity")[0].box.gap(door)
