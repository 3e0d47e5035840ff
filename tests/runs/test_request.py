"""What is asked of a room: each item that was lifted is placed, stays, or is nowhere, and nobody is told otherwise."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.doors import entrance
from layoutrl.rooms.faults import OUT_OF_REACH, faults
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.request import Request, request_of, said_to_stay
from layoutrl.runs.streams import Entry
from tests.builders import opening, rectangular_room

TABLE, DESK = "table", "desk"
CHAIR = Item("chair", (0.45, 0.45), (2.0, 2.0), 0.0, tucked=True)


def under(host: str) -> Room:
    """A room with a chair tucked under a host, and a bed aside."""
    furniture = (
        Item(host, (1.6, 0.8), (2.0, 2.2), 0.0),
        CHAIR,
        Item("bed", (2.0, 1.4), (5.0, 1.2), 0.0),
    )
    return replace(rectangular_room(), furniture=furniture, target=None)


def request(
    room: Room, lifts: set[int], known: set[str], category: str | None = None, moves_all: bool = True
) -> Request:
    brief = replace(room, furniture=without_poses(room.furniture, lifts))
    entry = Entry(room.id, brief, room_to_dict(room), stood=room.furniture)
    meant = [k for k, item in enumerate(room.furniture) if category in (None, item.category)]
    return request_of(entry, meant, moves_all, known)


def test_a_chair_stays_under_a_table_that_nobody_knows_and_goes_from_one_that_is_not_asked_for() -> None:
    room = under(TABLE)
    assert request(room, {0, 1, 2}, {"chair", "bed"}).stays == {0, 1}
    assert request(room, {1, 2}, {"chair", "bed"}).stays == {1}  # though the table was not lifted
    assert request(under("harp"), {0, 1, 2}, {"chair", "bed"}).stays == {0}  # which one does not sit at
    assert request(under("obstacle"), {1, 2}, {"chair", "bed"}).stays == {1}  # as a table drawn through a wall
    for only in (None, "chair"):
        found = request(room, {0, 1, 2}, {TABLE, "chair", "bed"}, only)
        assert not found.stays
        assert 1 in found.wanted
    assert request(room, {0, 1, 2}, {TABLE, "chair", "bed"}, "chair").checked.room.furniture[0] == room.furniture[0]


def test_the_chairs_that_stay_under_what_nobody_knows_are_known_by_themselves() -> None:
    found = request(under(TABLE), {0, 1, 2}, {"chair", "bed"})
    assert found.under == {1}
    said = "nobody places these in a bedroom, and they stay: table; what is tucked under them stays, too: chair"
    assert said_to_stay(under(TABLE), found, [TABLE, "chair", "bed"]) == said
    found = request(under("harp"), {0, 1, 2}, {"bed"})
    said = "nobody places these in a bedroom, and they stay: Harfe, chair"
    assert said_to_stay(under("harp"), found, ["Harfe", "chair", "bed"]) == said  # as the file calls it


def test_a_chair_under_what_was_never_asked_about_stays_by_itself() -> None:
    found = replace(request(under("harp"), {1, 2}, {"chair", "bed"}), stays=frozenset({1}), under=frozenset({1}))
    said = "these are tucked under what stays, and stay, too: chair"
    assert said_to_stay(under("harp"), found, ["harp", "chair", "bed"]) == said


def test_lines_have_the_words_of_the_items_that_they_are_about() -> None:
    """Also where an item before them is left out, as it is not asked about and is nowhere."""
    nowhere, table, bed = (
        Item("sofa", (0.9, 2.0), None, None),
        Item(TABLE, (1.6, 0.8), (2.0, 2.2), 0.0),
        Item("bed", (9, 9), None, None),
    )
    room = replace(rectangular_room(), furniture=(nowhere, table, bed), target=None)
    words = ["Sofa", "Tisch", "Bett"]
    furniture = [each | {"category": word} for each, word in zip(room_to_dict(room)["furniture"], words, strict=True)]
    entry = Entry(room.id, room, room_to_dict(room) | {"furniture": furniture}, stood=room.furniture)
    lines = request_of(entry, [2], False, {"bed", "sofa"}).checked.lines
    assert lines[0] == "the Bett of 9 by 9 m is not placed: it fits into the room in no way"


def test_one_enters_by_a_door_that_what_stands_leaves_free_and_is_told_if_there_is_none() -> None:
    piano = Item("piano", (1.5, 0.6), (0.4, 1.5), 90.0)
    left, right = opening("door", -0.2, 1.0, 0.0, 2.0), opening("door", 4.0, 1.0, 4.2, 2.0)
    bed = Item("bed", (1.0, 1.0), (2.0, 2.4), 0.0)
    for openings in ((left, right), (right, left)):
        room = rectangular_room(4.0, 3.0, bed, others=(piano,), openings=openings, target=None)
        found = request(room, {0}, {"bed"})
        assert entrance(found.checked.brief) == right
        assert found.checked.room.openings == openings
        assert found.checked.lines == []
        assert OUT_OF_REACH not in {fault for _, fault in faults(room)}
    room = rectangular_room(4.0, 3.0, bed, others=(piano,), openings=(left,), target=None)
    (said,) = request(room, {0}, {"bed"}).checked.lines
    assert said == "nobody gets in past the piano: no door is free, and so nothing is within reach"
    assert request(room, set(), {"bed"}).checked.lines == []  # where nothing is to be placed
    to_be_turned = replace(room, furniture=(bed, Item("wardrobe", (0.6, 2.0), (3.0, 1.5), None)))
    assert request(to_be_turned, {0}, {"bed"}).checked.lines == []


@given(
    lifts=st.sets(st.integers(0, 3)),
    known=st.sets(st.sampled_from([DESK, "chair", "bed", "sofa"])),
    category=st.sampled_from([None, "chair", DESK, "bed"]),
    moves_all=st.booleans(),
    beyond=st.booleans(),
)
def test_every_lifted_item_is_placed_or_stays_or_is_nowhere(
    lifts: set[int], known: set[str], category: str | None, moves_all: bool, beyond: bool
) -> None:
    room = under(DESK)
    parked = Item("sofa", (0.8, 1.8), (-9.0 if beyond else 4.5, 3.0), 0.0)
    room = replace(room, furniture=(*room.furniture, parked))
    found = request(room, lifts, known, category, moves_all)
    placed = {*found.wanted} - found.left - found.checked.unseen
    items = found.checked.room.furniture
    assert {*found.wanted} | found.stays <= lifts
    assert not {*found.wanted} & found.stays
    for k, item in enumerate(items):
        if k in placed:
            assert item.center is None
            assert item.category in known
        elif k not in lifts or k in found.stood | found.stays or (category and item.category != category):
            assert item == room.furniture[k] or (item.center is None and not room.holds(room.furniture[k]))
    assert {items[k].category for k in found.stays} <= {DESK, "chair", "bed", "sofa"} - known | {"chair"}
    assert [item.category for item in found.checked.brief.furniture if item.center is None] == [
        items[k].category for k in sorted(placed)
    ]
