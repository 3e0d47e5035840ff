"""Layouts of a room that was asked for, judged by what was not so before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import pytest

from layoutrl.rooms.brief import missing, with_poses
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.faults import BLOCKS, FRONT_NOT_FREE, MISSING, OUT_OF_REACH, OUTSIDE, OVERLAPS, Fault
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.oddities import CROWDED, faults_and_oddities
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.answer import Answer, Choice
from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.request import request_of
from layoutrl.runs.room_placer import Draft, RoomPlacer, judged
from layoutrl.runs.streams import Entry
from tests.builders import opening, rectangular_room

CHEST, SOFA = Item("dresser", (0.45, 1.2), (0.225, 1.5), 0.0), Item("sofa", (0.9, 1.8), (3.5, 1.5), 180.0)


def judged_with(*sofas: Item | None) -> list[tuple[int, str]]:
    """What is said of a room with a chest and a sofa, which stood at the first place and is put at the second."""
    room = replace(rectangular_room(4, 3), target=None)
    was, now = (replace(room, furniture=(CHEST, sofa or replace(SOFA, center=None))) for sofa in sofas)
    draft = Draft(now, "", [], frozenset(), was)
    return judged(draft, *faults_and_oddities([was, now])).wrong


def test_what_crowds_a_thing_that_stays_is_said() -> None:
    at_the_chest = replace(SOFA, center=(1.2, 1.5), rotation=0.0)
    assert judged_with(None, SOFA) == []
    assert judged_with(None, at_the_chest) == [(0, CROWDED)]


def test_what_was_odd_before_is_not_said_again() -> None:
    at_the_chest = replace(SOFA, center=(1.2, 1.5), rotation=0.0)
    assert judged_with(at_the_chest, replace(at_the_chest, center=(1.25, 1.5))) == []


def test_a_room_as_it_stood_is_judged_as_what_is_placed_in_it() -> None:
    """The sofa crowds the chest, before and after: nothing was better where all stood."""
    stood, place = replace(SOFA, center=(1.2, 1.5), rotation=0.0), ((1.25, 1.5), 0.0)
    chest, lifted = replace(CHEST, locked=True), replace(stood, center=None)
    room = rectangular_room(6, 4, openings=(opening("door", 5.0, -0.1, 5.9, 0.0),))
    room = replace(room, room_type="living_room", target=None, furniture=(chest, lifted))

    class Same:
        def furnish(self, briefs: Sequence[Room], *_: int) -> list[list[Furnished]]:
            return [[Furnished(with_poses(brief, dict.fromkeys(missing(brief), place)), 1.0)] for brief in briefs]

    placer = RoomPlacer(PlaceConfig(rooms="rooms.json", move="sofa"))
    known = {"sofa", "dresser"}
    about = SimpleNamespace(furnisher=Same(), known=lambda _: known, types_placing=lambda _: [])
    vars(placer)["info"] = about
    document = room_to_dict(replace(room, furniture=(chest, stood)))
    (answer,) = placer.place([Entry("rooms.json", room, document, stood=(chest, stood))])
    assert answer.wrong == [answer.wrong_where_stood] == [[(0, CROWDED)]]
    assert "less was wrong" not in " ".join(answer.lines())


@pytest.mark.parametrize("harm", [OUTSIDE, BLOCKS, OVERLAPS, MISSING])
def test_a_layout_with_fewer_items_ill_placed_is_better_however_many_shortcomings_others_have(harm: str) -> None:
    room = replace(rectangular_room(6, 4), target=None, furniture=(CHEST, SOFA))

    def answer(x: float, *wrong: Fault) -> Answer:
        layout = replace(room, furniture=(CHEST, replace(SOFA, center=(x, 1.5))))
        entry = Entry("rooms.json", room, room_to_dict(room), stood=room.furniture)
        return Answer(entry, request_of(entry, [1], False, {"sofa"}), [Choice(layout, "", [], [*wrong], set())])

    ill_placed = answer(1, (1, harm))
    shut_in = answer(3.5, (0, OUT_OF_REACH), (1, OUT_OF_REACH), (1, FRONT_NOT_FREE))
    assert ill_placed.joined(shut_in, 2).layouts == shut_in.layouts + ill_placed.layouts
