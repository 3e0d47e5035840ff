"""Layouts of a room that was asked for, judged by what was not so before."""

from __future__ import annotations

from dataclasses import replace

from layoutrl.rooms.faults import faults
from layoutrl.rooms.oddities import CROWDED
from layoutrl.rooms.room import Item
from layoutrl.runs.room_placer import Draft, judged
from tests.builders import rectangular_room

CHEST, SOFA = Item("dresser", (0.45, 1.2), (0.225, 1.5), 0.0), Item("sofa", (0.9, 1.8), (3.5, 1.5), 180.0)


def judged_with(*sofas: Item | None) -> list[tuple[int, str]]:
    """What is said of a room with a chest and a sofa, which stood at the first place and is put at the second."""
    room = replace(rectangular_room(4, 3), target=None)
    was, now = (replace(room, furniture=(CHEST, sofa or replace(SOFA, center=None))) for sofa in sofas)
    draft = Draft(now, "", [], frozenset(), was)
    return judged(draft, faults(was), faults(now)).wrong


def test_what_crowds_a_thing_that_stays_is_said() -> None:
    at_the_chest = replace(SOFA, center=(1.2, 1.5), rotation=0.0)
    assert judged_with(None, SOFA) == []
    assert judged_with(None, at_the_chest) == [(0, CROWDED)]


def test_what_was_odd_before_is_not_said_again() -> None:
    at_the_chest = replace(SOFA, center=(1.2, 1.5), rotation=0.0)
    assert judged_with(at_the_chest, replace(at_the_chest, center=(1.25, 1.5))) == []
