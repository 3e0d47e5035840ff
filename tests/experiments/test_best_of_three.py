"""What the best of three layouts is worth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import best_of_three
import pytest

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Room


def test_the_nearest_of_three_is_the_one_with_the_highest_iou(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    designs = {design.id: design for design in design_rooms("balcony", "test", 0, 3).rooms}

    class SecondTime:
        """Knows the designer's layout, and gives it as its second choice: the first is half a metre off."""

        def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
            right = [designs[brief.id] for brief in briefs]
            wrong = [
                replace(
                    room, furniture=tuple(replace(i, center=(i.center[0] + 0.5, i.center[1])) for i in room.furniture)
                )
                for room in right
            ]
            return [[Furnished(w, 1.0), Furnished(r, 0.0)][:choices] for w, r in zip(wrong, right, strict=True)]

    monkeypatch.setattr(best_of_three, "load", lambda *_: SecondTime())
    monkeypatch.setattr("sys.argv", ["best_of_three.py", "balcony", "--rooms=3", f"--results={tmp_path / 'new'}"])
    best_of_three.main()
    result = json.loads((tmp_path / "new" / "balcony.json").read_text())
    only, nearest = (result[name]["iou"]["mean"] for name in ("the only one", "the nearest of three"))
    assert only < 0.9
    assert nearest == pytest.approx(1)
    assert (result["rooms"], result["layouts"]) == (3, 2)


def test_what_is_kept_of_other_rooms_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "balcony.json").write_text('{"rooms": 200, "seed": 0}')
    for rooms, seed, others in ((3, 0, "rooms"), (200, 1, "seed"), (3, 1, "rooms, seed")):
        said = ["best_of_three.py", "balcony", f"--rooms={rooms}", f"--seed={seed}", f"--results={tmp_path}"]
        monkeypatch.setattr("sys.argv", said)
        with pytest.raises(SystemExit, match=rf"balcony\.json is of other {others}; expected the same, or to be moved"):
            best_of_three.main()
    assert (tmp_path / "balcony.json").read_text() == '{"rooms": 200, "seed": 0}'
