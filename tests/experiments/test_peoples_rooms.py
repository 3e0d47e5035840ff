"""What is counted of rooms that people drew."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import peoples_rooms
import pytest

from layoutrl.rooms.brief import missing, with_poses
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Room
from layoutrl.runs import furnishers
from layoutrl.runs.furnishers import Hired
from tests.rooms.sources.test_sweethome3d import home_file


class InTheMiddle:
    """Puts everything into the middle of its room."""

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        middles = [brief.indoor.centroid.coords[0] for brief in briefs]
        return [
            [Furnished(with_poses(brief, dict.fromkeys(missing(brief), (middle, 0.0))), 0.0)]
            for brief, middle in zip(briefs, middles, strict=True)
        ]


def test_what_is_placed_anew_is_held_against_what_stood_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    homes = tmp_path / "homes"
    homes.mkdir()
    home_file(homes / "flat.sh3d")
    (homes / "broken.sh3d").write_bytes(b"no home")
    monkeypatch.setattr(furnishers, "hired", lambda config: Hired(InTheMiddle(), lambda room_type: ["bed", "toilet"]))
    monkeypatch.setattr("sys.argv", ["peoples_rooms.py", "flat", str(homes), f"--results={tmp_path}"])
    peoples_rooms.main()
    result = json.loads((tmp_path / "flat.json").read_text())
    assert result.keys() == {"read", "rooms", "items", "as they were drawn", *peoples_rooms.WHO}
    assert result["read"] == 2
    assert (result["rooms"], result["items"]) == (2, 2)  # a bed and a toilet; all else stays
    assert result["as they were drawn"] == {"faultless": 2, "wrong": {}}
    for name in peoples_rooms.WHO:
        assert result[name] == {"faultless": 2, "wrong": {"off its wall": 2, "in a door's swing": 1}}
