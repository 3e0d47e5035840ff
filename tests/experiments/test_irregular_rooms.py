"""Rooms disturbed as flats are, and what stands at their walls."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import irregular_rooms
import pytest
from irregular_rooms import at_the_wall

from layoutrl.rooms.room import Item
from tests.builders import rectangular_room


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
