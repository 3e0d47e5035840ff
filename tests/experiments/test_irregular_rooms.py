"""Rooms disturbed as flats are, and what stands at their walls."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import irregular_rooms
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from irregular_rooms import DISTURBANCES, at_the_wall, disturbed, without
from shapely import box

from layoutrl.env.faults import faults
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import parse_room, room_to_dict
from layoutrl.rooms.room import Item
from tests.builders import opening, rectangular_room


@example("kitchen", 14816751)  # a sliver of floor is left
@given(st.sampled_from(["bedroom", "kitchen", "balcony"]), st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_a_disturbed_room_holds_the_same_layout_without_a_fault_on_less_floor(room_type: str, seed: int) -> None:
    room = design_rooms(room_type, "test", 0, 1).rooms[0]
    changed, names = disturbed(room, np.random.default_rng(seed))
    assert not faults(changed)
    assert changed.furniture == room.furniture
    assert changed.openings == room.openings
    assert parse_room(json.dumps(room_to_dict(changed))).indoor.equals_exact(changed.indoor, 1e-6)
    if names:
        assert room.indoor.buffer(1e-6).covers(changed.indoor)
        assert changed.indoor.area < room.indoor.area
    else:
        assert changed == room


@pytest.mark.parametrize("disturb", DISTURBANCES)
def test_every_disturbance_takes_some_of_the_floor(disturb) -> None:
    room, rng = rectangular_room(4, 3), np.random.default_rng(0)
    taken = [room.indoor.intersection(disturb(room, rng)).area for _ in range(20)]
    assert max(taken) > 0.02
    assert max(taken) < 12 / 4


def test_nothing_is_taken_where_an_item_stands_or_an_opening_is() -> None:
    room = rectangular_room(4, 3, Item("bed", (1.0, 1.0), (1.0, 1.0)))
    assert without(room, box(0, 0, 1, 1)) is None
    assert without(room, box(5, 0, 6, 1)) is None
    assert without(room, box(1.9, 0, 2.1, 3)) is None  # two rooms
    assert without(room, box(2, 2, 3, 3)) is not None
    before = box(1.4, 0, 2.4, 0.3)
    assert without(replace(room, furniture=()), before) is not None
    with_door = replace(room, furniture=(), openings=(opening("door", 1.5, -0.2, 2.3, 0),))
    assert without(with_door, before) is None


def test_what_belongs_to_the_wall_and_stands_off_it_is_counted() -> None:
    def room(*gaps: float):
        beds = tuple(Item("bed", (2.0, 0.5), (1.0 + gap, 0.5 + 0.6 * k), 0.0) for k, gap in enumerate(gaps))
        return replace(rectangular_room(6, 4, beds[0], others=beds[1:]), target=None)

    design = room(0, 0, 0, 0)
    assert at_the_wall([design], [design]) == 1
    assert at_the_wall([room(0, 0.01, 0.05, 1.0)], [design]) == 0.5
    turned = replace(design, furniture=tuple(replace(item, rotation=180.0) for item in design.furniture))
    assert at_the_wall([turned], [design]) == 0  # their feet are at the wall


def test_a_type_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(irregular_rooms, "RESULTS", tmp_path)
    monkeypatch.setattr("sys.argv", ["irregular_rooms.py", "balcony", "--rooms=2"])
    irregular_rooms.main()
    result = json.loads((tmp_path / "balcony.json").read_text())
    assert result["rooms"] == 2
    assert all(0 <= result[name]["iou"]["mean"] <= 1 for name in ("as designed", "disturbed"))
    assert sum(result["disturbances"].values()) >= 2
