"""What is counted of rooms that people drew."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import peoples_rooms
import pytest

from layoutrl.rooms.brief import missing, with_poses
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Room
from layoutrl.runs import furnishers
from layoutrl.runs.furnishers import FurnisherInfo
from tests.rooms.sources.test_sweethome3d import BED, FLAT, TOILET, WALLS, home_file, piece, room_tag


class InTheMiddle:
    """Puts everything into the middle of its room."""

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        middles = [brief.indoor.centroid.coords[0] for brief in briefs]
        return [
            [Furnished(with_poses(brief, dict.fromkeys(missing(brief), (middle, 0.0))), 0.0)]
            for brief, middle in zip(briefs, middles, strict=True)
        ]


def measured(body: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What is kept of a home, and of a file that is none. Nobody places anything but beds and toilets."""
    homes = folder / "homes"
    homes.mkdir(exist_ok=True)
    home_file(homes / "flat.sh3d", body)
    (homes / "broken.sh3d").write_bytes(b"no home")
    monkeypatch.setattr(
        furnishers, "furnisher_for", lambda config: FurnisherInfo(InTheMiddle(), lambda room_type: ["bed", "toilet"])
    )
    monkeypatch.setattr("sys.argv", ["peoples_rooms.py", "flat", str(homes), f"--results={folder}"])
    peoples_rooms.main()
    return json.loads((folder / "flat.json").read_text())


def test_what_is_placed_anew_is_held_against_what_stood_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = measured(FLAT, tmp_path, monkeypatch)
    assert result.keys() == {"read", "files", "rooms", "items", "as they were drawn", *peoples_rooms.WHO}
    assert result["read"] == 2
    assert (result["rooms"], result["items"]) == (2, 2)  # a bed and a toilet; all else stays
    assert result["as they were drawn"] == {"faultless": 2, "wrong": {}}
    for name in peoples_rooms.WHO:
        assert result[name] == {"faultless": 2, "wrong": {"off its wall": 2, "in a door's swing": 1}}


def test_of_both_what_is_wrong_with_all_furniture_counts_and_what_is_odd_about_the_same_pieces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bed_off_its_wall, stays = BED.replace("y='104'", "y='150'"), piece("wardrobe", 510, 150, 40, 40, id="wardrobe")
    result = measured(FLAT.replace(BED, bed_off_its_wall) + stays, tmp_path, monkeypatch)
    assert (result["rooms"], result["items"]) == (2, 2)
    assert result["as they were drawn"]["wrong"]["off its wall"] == 1
    for name in peoples_rooms.WHO:
        assert result[name]["wrong"]["overlaps"] == 2  # the toilet, and the wardrobe under it, which stays


def test_what_is_kept_of_other_rooms_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measured(FLAT, tmp_path, monkeypatch)
    kept = (tmp_path / "flat.json").read_bytes()
    monkeypatch.setattr(peoples_rooms, "furnish", None)  # before anything is furnished
    with pytest.raises(
        SystemExit, match=r"^error: .*flat\.json is of other read, files; expected the same, or to be moved"
    ):
        measured(BED + TOILET + WALLS + room_tag(0, 0, 400, 300), tmp_path, monkeypatch)
    assert (tmp_path / "flat.json").read_bytes() == kept
    with pytest.raises(SystemExit, match=r"^error: .*flat\.json is of other files; expected the same, or to be moved"):
        measured(FLAT.replace("Bedroom", "Bed room"), tmp_path, monkeypatch)
    (tmp_path / "flat.json").write_text("{}")  # of something else
    with pytest.raises(
        SystemExit, match=r"^error: .*flat\.json is of other read, files; expected the same, or to be moved"
    ):
        measured(FLAT, tmp_path, monkeypatch)
