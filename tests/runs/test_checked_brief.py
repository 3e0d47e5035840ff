"""What a brief asks for that cannot be, a line each, and the rest of it all the same."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.brief import missing, with_poses
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import Item
from layoutrl.runs import pretrained
from layoutrl.runs.checked_brief import checked_brief, fits, unstacked
from tests.builders import opening, random_brief, random_room, rectangular_room

DOOR = opening("door", -0.2, 1.0, 0.0, 2.0)
KNOWN = ("bed", "chair", "desk", "wardrobe")
BED = Item("bed", (2.0, 1.5), None, None)


def room_with(*items: Item, **fields):
    return rectangular_room(4.0, 3.0, items[0], others=items[1:], **{"openings": (DOOR,), "target": None} | fields)


def test_a_sound_brief_is_answered_whole_and_nothing_is_said() -> None:
    room = room_with(BED, Item("desk", (0.6, 1.2), (3.0, 1.0), 90.0))
    found = checked_brief(room, KNOWN)
    assert (found.brief, found.lines) == (room, [])
    assert found.merge(room) == room


@pytest.mark.parametrize(
    ("furniture", "line"),
    [
        (
            (BED, Item("wardrobe", (5.0, 3.5), None, None)),
            "wardrobe of 5 by 3.5 m is not placed: it fits into the room in",
        ),
        ((BED, Item("wardrobe", (0.6, 3.5), None, 0.0)), "wardrobe of 0.6 by 3.5 m is not placed: it fits into"),
        (
            (BED, Item("wardrob", (0.6, 1.0), None, None)),
            "wardrob is not placed: who is asked places no wardrob in a bedroom; expected one of bed,",
        ),
    ],
)
def test_what_cannot_be_placed_is_named_and_the_rest_is_furnished(furniture: tuple[Item, ...], line: str) -> None:
    room = room_with(*furniture)
    found = checked_brief(room, KNOWN)
    (said,) = found.lines
    assert line in said
    assert found.brief.furniture == (BED,)
    placed = replace(BED, center=(1.0, 1.5), rotation=90.0)
    assert found.merge(replace(found.brief, furniture=(placed,))).furniture == (placed, furniture[1])


@pytest.mark.parametrize(("name", "hint"), [("wardrob", r"; did you mean wardrobe\?"), ("aquarium", "")])
def test_a_category_that_is_misspelt_is_answered_with_the_one_that_is_meant(name: str, hint: str) -> None:
    (said,) = checked_brief(room_with(BED, Item(name, (0.6, 1.0), None, None)), KNOWN).lines
    assert re.search(rf", \w+{hint}$", said)


def test_what_nobody_places_is_told_once_with_its_number() -> None:
    lamp = Item("lamp", (0.3, 0.3), None, None)
    found = checked_brief(room_with(lamp, BED, lamp, Item("harp", (0.8, 0.8), None, None)), KNOWN)
    assert [line.partition(":")[0] for line in found.lines] == ["the lamp (2) is not placed", "the harp is not placed"]
    assert found.unseen == {0, 2, 3}


def test_lines_call_items_as_the_file_does() -> None:
    room = room_with(Item("sofa_bed", (0.9, 2.0), None, None), Item("bed", (9.0, 9.0), None, None), BED)
    found = checked_brief(room, ("bed",), lambda _: ("study",), ["daybed", "Bett", "bed"]).lines
    assert found[:2] == [
        "the daybed is not placed: it is known as sofa_bed, which the agent of study places, not that of a bedroom",
        "the Bett of 9 by 9 m is not placed: it fits into the room in no way",
    ]
    assert found[2].startswith("the Bett of 9 by 9 m is more than twice as large")


@pytest.mark.parametrize(
    ("rotation", "asked"),
    [
        (math.pi / 2, True),
        (-math.pi, True),
        (4.712389, True),
        (3.14, True),
        (4.71, True),
        (1.57, True),
        (1.6, False),
        (90.0, False),
        (0.0, False),
        (2 * math.pi, False),
    ],
)
def test_a_rotation_that_is_a_right_angle_in_radians_is_asked_about(rotation: float, asked: bool) -> None:
    stands = replace(BED, center=(2.0, 1.5), rotation=rotation)
    for room in (room_with(stands, BED), room_with(replace(stands, center=None), BED)):
        lines = checked_brief(room, KNOWN).lines
        assert any(line.endswith("are these radians?") for line in lines) == asked


def test_what_another_name_means_is_offered_first() -> None:
    room = replace(room_with(Item("couch", (0.9, 2.0), None, None)), room_type="living_room")
    (line,) = checked_brief(room, pretrained.known("living_room"), pretrained.types_with).lines
    assert line == "the couch is not placed: it is known as sofa; expected that category"
    (line,) = checked_brief(
        replace(room, room_type="bedroom"), pretrained.known("bedroom"), pretrained.types_with
    ).lines
    assert (
        line
        == "the couch is not placed: it is known as sofa, which the agent of living_room places, not that of a bedroom"
    )


@pytest.mark.parametrize(
    ("types", "said"),
    [
        (["study"], "the agent of study places it; that of a bedroom does not"),
        (["study", "tatami"], "the agents of study, tatami place it; that of a bedroom does not"),
    ],
)
def test_what_is_placed_in_rooms_of_other_types_is_said_to_be(types: list[str], said: str) -> None:
    room = room_with(Item("sofa", (0.9, 2.0), None, None))
    (line,) = checked_brief(replace(room, room_type="bedroom"), KNOWN, lambda category: types).lines
    assert line == f"the sofa is not placed: {said}"


def test_an_item_that_fits_turned_is_placed() -> None:
    assert fits(room_with(BED), Item("wardrobe", (0.6, 3.5), None, None))
    assert not fits(room_with(BED), Item("wardrobe", (0.6, 3.5), None, 0.0))


def test_what_a_layout_puts_beyond_the_walls_has_no_place() -> None:
    room = room_with(BED, Item("desk", (0.6, 1.2), None, None))
    found = checked_brief(room, KNOWN)
    beside = [replace(item, center=(x, 1.5), rotation=0.0) for item, x in zip(room.furniture, (1.0, 9.0), strict=True)]
    assert found.merge(replace(room, furniture=tuple(beside))).furniture == (beside[0], room.furniture[1])


@pytest.mark.parametrize(
    ("width", "said"),
    [
        (0.45, "its widest door is 0.45 m wide, and nobody fits through: is the unit right?"),
        (0.55, "its widest door is 0.55 m wide: what can be reached is told of who fits through"),
        (0.6, None),
    ],
)
def test_a_door_that_is_too_narrow_is_named(width: float, said: str | None) -> None:
    door = opening("door", 3, 3, 3 + width, 3.2)
    assert checked_brief(room_with(BED, openings=(door,)), KNOWN).lines == [said] * (said is not None)


def test_two_items_at_one_place_and_a_missing_door_are_said_and_all_is_kept() -> None:
    desks = [Item("desk", (0.6, 1.2), (3.0, 1.0 + by), 90.0) for by in (0.0, 0.1)]
    chair = Item("chair", (0.5, 0.5), (3.0, 1.5), 90.0)
    room = room_with(BED, *desks, chair, openings=())
    found = checked_brief(room, KNOWN)
    assert found.lines == [
        "the desk at 3, 1 and the desk overlap by more than half; both are kept",
        "it has no door: what can be reached is told from the largest free floor",
    ]
    assert found.brief == room


def test_what_overlaps_twice_alike_is_said_once_to_a_centimetre() -> None:
    counter = Item("counter", (0.6, 1.2), (3.00004, 1.0), 90.0)
    taps = [Item("tap", (0.1, 0.1), (x, 1.0), 90.0) for x in (2.8, 3.2)]
    (line,) = checked_brief(room_with(BED, counter, *taps), KNOWN).lines
    assert line == "the counter at 3, 1 and the tap overlap by more than half; both are kept"


def test_no_place_is_where_another_stands() -> None:
    bed, desk = Item("bed", (2.0, 1.4), None, None), Item("desk", (0.6, 1.2), (3.7, 1.5), 180.0)
    brief = room_with(bed, bed, desk)

    def places(*centers: tuple[float, float]) -> list[bool]:
        layout = with_poses(brief, {k: (center, 0.0) for k, center in enumerate(centers)})
        return [item.center is not None for item in unstacked(brief, layout).furniture]

    assert places((1.0, 0.7), (1.0, 2.2)) == [True, True, True]
    assert places((1.0, 0.7), (1.0, 0.9)) == [True, False, True]
    assert places((1.0, 0.7), (3.2, 1.5)) == [True, False, True]  # on the desk, which stays


def test_a_rug_is_floor_and_stays_where_it_lies() -> None:
    rug = Item("rug", (2.0, 1.5), (2.0, 1.5), 0.0)
    room = room_with(BED, rug, Item("wardrobe", (0.6, 1.2), (3.7, 1.5), 180.0))
    found = checked_brief(room, KNOWN)
    assert found.lines == []
    assert found.brief.furniture == (BED, room.furniture[2])
    placed = replace(BED, center=(2.0, 2.0), rotation=270.0)  # upon it
    layout = found.merge(replace(found.brief, furniture=(placed, room.furniture[2])))
    assert layout.furniture == (placed, *room.furniture[1:])
    assert not faults(layout)


@given(st.integers(0, 2**32 - 1))
def test_any_brief_is_answered_as_far_as_it_goes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = random_brief(rng, random_room(rng))
    found = checked_brief(room, KNOWN)
    assert {*missing(room)} >= found.unseen
    assert len(missing(found.brief)) == len(missing(room)) - len(found.unseen)
    assert len([line for line in found.lines if "is not placed" in line]) == len(found.unseen)
    assert replace(found.merge(found.brief), target=room.target) == room
