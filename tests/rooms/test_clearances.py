"""The clearances are the designer's."""

from __future__ import annotations

from collections import defaultdict

import pytest

from layoutrl.rooms.clearances import FRONT_DEPTH, HOSTS, RAISED, RUGS, angle_off, passage, period
from layoutrl.rooms.designer.generator import ROOM_TYPES, design_room
from layoutrl.rooms.designer.search import Piece
from layoutrl.rooms.room import Item

WITHOUT_FRONT = {"table", "coffee_table", "side_table", "stool", "platform"}
LESS_ELSEWHERE = {"wardrobe"}  # at a platform's end, over which it opens


@pytest.fixture(scope="module")
def pieces() -> dict[str, list[Piece]]:
    """Of some rooms of all types, by category."""
    found = defaultdict(list)
    for room_type in ROOM_TYPES:
        for index in range(40):
            for choice in design_room(room_type, "train", 0, index).choices:
                found[choice.place.piece.category].append(choice.place.piece)
    return found


def test_a_front_is_the_least_that_the_designer_keeps_free(pieces: dict[str, list[Piece]]) -> None:
    assert set(pieces) | {"dresser", "loveseat", "washer"} == set(FRONT_DEPTH) | WITHOUT_FRONT  # these three are rare
    least = {category: min(piece.front for piece in found) / 100 for category, found in pieces.items()}
    for category in set(least) - WITHOUT_FRONT - LESS_ELSEWHERE:
        assert FRONT_DEPTH[category] == least[category], category


def test_raised_and_tucked_pieces_are_the_designers(pieces: dict[str, list[Piece]]) -> None:
    assert {category for category, found in pieces.items() if any(piece.raised for piece in found)} == RAISED - RUGS
    assert {category for category, found in pieces.items() if any(piece.tucked for piece in found)} == {"chair"}
    assert set(pieces) >= HOSTS


def test_a_passage_is_the_designers() -> None:
    assert {room_type: passage(room_type) for room_type in ROOM_TYPES} == {
        room_type: 0.5 if room_type in ("kitchen", "bathroom") else 0.6 for room_type in ROOM_TYPES
    }
    assert passage("hall") == 0.6


def test_degrees_after_which_items_look_as_before() -> None:
    assert period(Item("bed", (2.0, 2.0))) == 360
    assert period(Item("table", (1.0, 2.0))) == 180
    assert period(Item("table", (1.0, 1.0))) == 90
    assert period(Item("shower", (1.0, 1.0), form="circle")) == 90
    assert [angle_off(degrees, 180.0) for degrees in (0, 90, 180, -10, 350)] == [0, 90, 0, 10, 10]
