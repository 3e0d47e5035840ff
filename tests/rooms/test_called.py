"""What rooms of a type have under another name is furnished as that, and keeps its own."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms.rival import SearchOrAnnealer
from layoutrl.rooms.brief import missing
from layoutrl.rooms.called import CALLED, as_called_here, by_any_name, named_as
from layoutrl.rooms.categories import DESIGNED
from layoutrl.rooms.clearances import period
from layoutrl.rooms.room import Item
from layoutrl.rooms.sizes import SIZES
from layoutrl.runs import pretrained
from layoutrl.runs.config import composed
from tests.builders import opening, rectangular_room

DOOR = opening("door", -0.2, 1.0, 0.0, 2.0)


@pytest.mark.parametrize(("room_type", "name"), [*CALLED])
def test_a_thing_is_called_as_one_that_the_designer_has_there_and_that_turns_alike(room_type: str, name: str) -> None:
    here = CALLED[room_type, name]
    assert name not in DESIGNED[room_type]
    assert here in DESIGNED[room_type]
    assert period(Item(name, (0.5, 0.7), None)) == period(Item(here, (0.5, 0.7), None))
    for of_name, of_here in zip(SIZES[name], SIZES[here], strict=True):
        assert of_name[0] < of_here[1] * 1.25  # their sizes meet, or nearly do
        assert of_here[0] < of_name[1] * 1.25
    known = pretrained.known(room_type)
    assert by_any_name(room_type, known) == {*known, *(theirs for where, theirs in CALLED if where == room_type)}
    assert by_any_name(room_type, {"chair"}) == {"chair"}


def test_only_in_its_type_of_room_and_its_own_name_comes_back() -> None:
    room = rectangular_room(4, 3, Item("washer", (0.6, 0.6), None, None), target=None)
    bathroom = replace(room, room_type="bathroom")
    assert as_called_here(room) == room
    assert [item.category for item in as_called_here(bathroom).furniture] == ["washing_machine"]
    assert named_as(bathroom, as_called_here(bathroom)) == bathroom


@pytest.mark.parametrize("who", ["agents", "search"])
def test_agents_and_search_place_it_under_its_own_name(who: str) -> None:
    search = SearchOrAnnealer(composed("place", "rooms=any").search, lambda: updates_budget(1))
    furnisher = search if who == "search" else pretrained.Agents(torch.device("cpu"))
    items = Item("toilet", (0.7, 0.4), None, None), Item("washer", (0.6, 0.6), None, None)
    brief = rectangular_room(3, 3, items[0], others=items[1:], openings=(DOOR,), target=None, room_type="bathroom")
    ((found, *_),) = furnisher.furnish([brief], 1, 0)
    assert not missing(found.layout)
    assert [item.category for item in found.layout.furniture] == ["toilet", "washer"]
