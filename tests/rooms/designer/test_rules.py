"""Each rule in a small room with a bed, and that no rule changes when a room is turned."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.designer import rules
from layoutrl.rooms.designer.places import ends, middles
from layoutrl.rooms.designer.rules import NO, YES, center_far_from, centred_on, far_from, near, touches
from layoutrl.rooms.designer.search import Piece, Place, Plan, Rule
from layoutrl.rooms.designer.shell import Box, Shell
from tests.rooms.designer.test_search import L_ROOM, ROOM, plans, put, turned, turned_place
from tests.rooms.designer.test_shell import opened

BLIND = replace(ROOM, windows=())
TWO = opened(Shell(400, 300), doors=((0, 300, 390), (3, 100, 180)), windows=((1, 0, 100), (2, 100, 250)))
BED = put(100, 0, 200, 150, 1, "a")  # against the wall below, its axis at x = 150

AGREE = {  # rule: (shell, places for which it says yes, places for which it says no)
    rules.solid_behind: (
        ROOM, [put(0, 0, 300, 50, 1), put(100, 250, 250, 300, 0), put(100, 240, 250, 290, 3)],
        [put(0, 0, 301, 50, 1), put(249, 250, 300, 300, 3)],
    ),
    rules.across_daylight: (TWO, [put(0, 0, 50, 99, 0), put(0, 0, 50, 99, 2)], [put(0, 0, 9, 9), put(0, 0, 9, 9, 3)]),
    rules.light_from_left: (ROOM, [put(350, 100, 400, 200, 2)], [put(0, 100, 50, 200, 0), put(0, 0, 100, 50, 1)]),
    rules.in_corner: (
        L_ROOM, [put(0, 0, 100, 50, 1), put(0, 200, 50, 300, 0), put(200, 250, 300, 300, 3)],
        [put(1, 0, 100, 50, 1), put(0, 199, 50, 299, 0)],
    ),
    rules.looks_at_door: (ROOM, [put(0, 0, 50, 100, 0), put(0, 250, 100, 300, 3)], [put(0, 0, 100, 50, 1)]),
    rules.faces_entrance_wall: (ROOM, [put(0, 0, 50, 100, 3)], [put(0, 0, 50, 100, 0), put(0, 0, 50, 100, 1)]),
    rules.across_door: (ROOM, [put(0, 0, 50, 100, 0), put(0, 0, 50, 100, 2)], [put(0, 0, 50, 100, 1)]),
    rules.apart(45): (ROOM, [put(245, 0, 300, 50), put(220, 175, 260, 200)], [put(244, 0, 300, 50)]),
    rules.looks_past_door: (
        ROOM, [put(210, 250, 300, 300, 3), put(300, 9, 390, 30, 1)], [put(299, 200, 390, 250, 3), put(0, 0, 9, 9, 0)],
    ),
    touches("a"): (ROOM, [put(200, 0, 250, 50)], [put(201, 0, 250, 50)]),
    touches("c"): (ROOM, [], [put(200, 0, 250, 50)]),
    rules.no_slit: (
        ROOM, [put(200, 0, 250, 50), put(215, 0, 250, 50), put(15, 200, 60, 300, 3), put(0, 200, 60, 299, 3)],
        [put(201, 0, 250, 50), put(214, 0, 250, 50), put(14, 200, 60, 300, 3), put(300, 200, 386, 300, 3)],
    ),
}  # fmt: skip
RULES = [
    *AGREE, rules.long_wall,
    *(of(what) for of in (touches, far_from, near, center_far_from, centred_on) for what in "abx"),
    *(of(gap) for of in (far_from, near, center_far_from) for gap in ("entrance", "door", "window")),
]  # fmt: skip


@given(plans, st.sampled_from(RULES), st.integers(0, 200), st.integers(0, 200), st.integers(0, 3))
def test_no_rule_changes_when_the_room_is_turned(plan: Plan, rule: Rule, x: int, y: int, facing: int) -> None:
    free = Place(Piece("x", 40, 40), Box(2 * x, 2 * y, 2 * x + 40, 2 * y + 40), facing)
    for place in (free, *plan.places, *ends(plan, free.piece), *middles(plan, free.piece)):
        assert rule(turned(plan), turned_place(place, plan.shell)) == rule(plan, place)


@pytest.mark.parametrize("rule", AGREE)
def test_a_rule_agrees_or_not(rule: Rule) -> None:
    shell, good, bad = AGREE[rule]
    assert [rule(Plan(shell, (BED,)), place) for place in (*good, *bad)] == [YES] * len(good) + [NO] * len(bad)


def test_without_a_window_all_walls_are_across_daylight_and_no_light_comes_from_the_left() -> None:
    places = [put(100, 100, 150, 150, facing) for facing in range(4)]
    assert [rules.across_daylight(Plan(BLIND), place) for place in places] == [YES] * 4
    assert [rules.light_from_left(Plan(BLIND), place) for place in places] == [NO] * 4


@pytest.mark.parametrize(
    ("rule", "place", "value"),
    [
        (far_from("a"), put(220, 160, 250, 200), 30), (far_from("entrance"), put(0, 181, 50, 250), 250 + 180),
        (far_from("door"), put(0, 181, 50, 250), 1), (far_from("window"), put(380, 110, 400, 200), 10),
        (far_from("c"), put(0, 0, 50, 50), 0), (near("a"), put(220, 160, 250, 200), -30),
        (center_far_from("a"), put(220, 160, 260, 200), 90 + 105),
        (center_far_from("window"), put(379, 100, 399, 140), 10 + 70),
        (center_far_from("c"), put(0, 0, 50, 50), 0), (centred_on("a"), put(100, 250, 190, 300, 3), -5),
        (centred_on("c"), put(0, 0, 50, 50), 0), (rules.long_wall, put(0, 0, 50, 50), 0),
        (rules.long_wall, replace(put(0, 0, 50, 50, 0), wall=L_ROOM.walls[3]), 100),
    ],
)  # fmt: skip
def test_a_rule_measures(rule: Rule, place: Place, value: int) -> None:
    assert rule(Plan(TWO, (BED,)), place) == value
