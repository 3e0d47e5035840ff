"""Lengths in other units: told by the size of rooms and doors, and read as the same rooms."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.room import MAIN_ITEM, Opening
from layoutrl.rooms.units import UNITS, in_metres, unit_line, unit_of
from tests.builders import opening, rectangular_room

NUMBERS = st.floats(-1e3, 1e3) | st.integers(-1000, 1000)
ANYTHING: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.text(max_size=3) | NUMBERS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["size", "outline", "id"]), inner),
    max_leaves=8,
)


def scaled(document: dict[str, Any], unit: str) -> dict[str, Any]:
    """A room's document with its lengths in another unit."""
    return in_metres(document, 1 / UNITS[unit])


@pytest.mark.parametrize("room_type", MAIN_ITEM)
@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_metric_units_are_told_by_the_rooms(room_type: str, unit: str) -> None:
    documents = [room_to_dict(room) for room in design_rooms(room_type, "test", 0, 12).rooms]
    assert unit_of(scaled(document, unit) for document in documents) == unit
    most = [scaled(document, unit) for document in documents[:8]]
    assert unit_of([*most, *documents[8:]]) == unit  # as most of a file are


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
@pytest.mark.parametrize(
    ("width", "depth", "openings"),
    [
        (0.9, 1.2, [opening("door", 0.1, -0.2, 0.8, 0.0)]),  # a toilet: in millimetres no longer than a hall in cm
        (4.0, 3.0, [opening("door", 0.1, -0.2, 1.0, 0.0), opening("window", 2.0, -0.2, 2.25, 0.0)]),  # a slit
        (80.0, 70.0, [opening("door", 0.1, -0.2, 2.0, 0.0), opening("door", 9.0, -0.2, 10.0, 0.0)]),  # a hall
    ],
)
def test_the_width_of_doors_says_the_unit_before_the_size_of_the_room(
    width: float, depth: float, openings: list[Opening], unit: str
) -> None:
    document = room_to_dict(rectangular_room(width, depth, openings=tuple(openings)))
    assert unit_of([scaled(document, unit)]) == unit


def test_what_told_the_unit_is_said() -> None:
    door = (opening("door", 0.1, -0.2, 0.9, 0.0),)
    hall, toilet = (room_to_dict(rectangular_room(*size, openings=door)) for size in ((6.0, 4.0), (0.9, 1.2)))
    for document, unit, told in (
        (toilet, "mm", "doors are wide"),  # else it would be a hall in centimetres
        (toilet, "cm", "rooms are large"),
        (hall, "mm", "rooms are large"),
    ):
        documents = [scaled(document, unit)]
        assert unit_of(documents) == unit
        assert unit_line(unit, documents) == f"lengths are read as {unit}, as {told} (unit=m if they are)"


@given(st.floats(3.2, 13), st.floats(3.05, 13), st.sampled_from(["door", "window"]))
def test_a_room_whose_only_opening_is_wide_may_be_in_centimetres(side: float, wide: float, kind: str) -> None:
    only = opening(kind, 0.0, -0.2, min(side, wide), 0.0)
    document = room_to_dict(rectangular_room(side, 3.0, openings=(only,)))
    assert unit_of([scaled(document, "cm")]) == "cm"
    assert unit_of([document]) == "m"


@given(ANYTHING)
def test_what_is_no_room_is_in_metres(document: Any) -> None:
    assert unit_of([document]) == "m"
    assert unit_of([]) == "m"


def test_what_is_deeper_than_a_room_is_left_as_it_is() -> None:
    deep: Any = 7
    for _ in range(5000):
        deep = {"size": deep}
    read = in_metres({"furniture": [{"center": [100, 200], "size": deep}]}, UNITS["cm"])
    assert read["furniture"][0]["center"] == [1, 2]
    while isinstance(read, dict):
        read = read["furniture"][0] if "furniture" in read else read["size"]
    assert read == 7


@given(ANYTHING, st.sampled_from(sorted(UNITS)))
def test_what_is_no_length_is_as_it_was(document: Any, unit: str) -> None:
    assert in_metres(document, 1) is document
    read = in_metres(
        {"id": document, "size": [1, 2], "furniture": [{"category": "bed", "center": [3, 4]}]}, UNITS[unit]
    )
    assert read["id"] == document
    assert read["size"] == pytest.approx([1 / UNITS[unit], 2 / UNITS[unit]])
    assert read["furniture"][0]["category"] == "bed"
    assert read["furniture"][0]["center"] == pytest.approx([3 / UNITS[unit], 4 / UNITS[unit]])


def test_narrow_doors_in_centimetres_may_be_inches() -> None:
    document = room_to_dict(design_rooms("bedroom", "test", 0, 1).rooms[0])
    assert "unit=in" in unit_line("cm", [scaled(document, "in")])
    assert "unit=in" not in unit_line("cm", [scaled(document, "cm")])
