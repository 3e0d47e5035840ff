"""Which held-out rooms are rooms to learn from."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import copies
import pytest
import shapely
import table3
from kept import RESULTS
from packing import unpacked_iou

from layoutrl.rooms.designer.generator import Designs, design_rooms
from layoutrl.rooms.room import Room

ROOMS = design_rooms("balcony", "test", 7, 3).rooms


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_a_room_that_is_turned_or_furnished_otherwise_is_a_copy(room: Room, degrees: int) -> None:
    elsewhere = tuple(replace(item, center=None, rotation=None) for item in reversed(room.furniture))
    assert copies.key(replace(room, furniture=elsewhere, target=None).rotated(degrees)) == copies.key(room)


def test_a_mirrored_room_is_a_copy_where_mirrored_rooms_are_furnished_alike() -> None:
    (study,) = design_rooms("study", "test", 7, 1).rooms
    for room, alike in ((ROOMS[0], True), (study, False)):
        assert (copies.key(room.turned(1, True)) == copies.key(room)) == alike
        assert copies.key(room.turned(1, False)) == copies.key(room)


def test_a_room_with_another_size_or_door_is_none() -> None:
    room = ROOMS[0]
    larger = tuple(replace(item, size=(item.size[0] + 0.02, item.size[1])) for item in room.furniture)
    assert copies.key(replace(room, furniture=larger)) != copies.key(room)
    opening, *others = room.openings
    moved = shapely.affinity.translate(shapely.Polygon(opening.polygon), 0.02, 0.02).exterior.coords[:-1]
    assert copies.key(replace(room, openings=(replace(opening, polygon=tuple(moved)), *others))) != copies.key(room)


@pytest.mark.parametrize("kept", sorted(copies.KEPT.glob("*.json")), ids=lambda path: path.stem)
def test_what_is_kept_is_of_the_methods_as_they_are_in_table_3(kept: Path) -> None:
    told = json.loads(kept.read_text())
    for name in copies.LEARNED:
        cell = json.loads((RESULTS / f"default/table3/{kept.stem}-own-{table3.METHODS[name]}-seed0.json").read_text())
        assert told[name]["all"] == pytest.approx(unpacked_iou(cell["rows"]["layouts"]["iou"]).mean())


def test_copies_are_counted_and_the_table_is_told_without_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = {"train": ROOMS[:1], "test": ROOMS}
    monkeypatch.setattr(copies, "design_rooms", lambda _, part, *__: Designs(parts[part]))
    monkeypatch.setattr("sys.argv", ["copies.py", "balcony", "--rooms=3", f"--results={tmp_path}"])
    copies.main()
    told = json.loads((tmp_path / "balcony.json").read_text())
    assert told["copies"] == 1
    cell = json.loads((RESULTS / "default/table3/balcony-own-rooms_package-seed0.json").read_text())
    iou = unpacked_iou(cell["rows"]["layouts"]["iou"])[:3]
    assert told["agent"] == {"all": pytest.approx(iou.mean()), "without": pytest.approx(iou[1:].mean())}
