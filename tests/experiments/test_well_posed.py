"""Whether the designer answers the question at all."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import well_posed


def test_well_posed_measures_a_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(well_posed, "KEPT", tmp_path)
    monkeypatch.setattr("sys.argv", ["well_posed.py", "tatami", "--train=60", "--test=20"])
    well_posed.main()
    result = json.loads((tmp_path / "tatami.json").read_text())
    told = result["ambiguity"]
    assert 0 < told["rooms_with_a_second_place"] <= 1
    assert 0 < told["iou_with_second_place"] < 0.9  # else it would not be another place
    assert 0 <= told["tries_rejected_as_ties"] < 0.2
    assert all(0 <= share < 1 for share in result["reject_rate"].values())
    kept = (tmp_path / "tatami.json").read_bytes()
    monkeypatch.setattr("sys.argv", ["well_posed.py", "tatami", "--train=5", "--test=20"])
    with pytest.raises(SystemExit, match=r"^error: .*tatami\.json is of other train; expected the same, or"):
        well_posed.main()
    assert (tmp_path / "tatami.json").read_bytes() == kept
    monkeypatch.setattr("sys.argv", [*sys.argv, f"--results={tmp_path / 'trial'}"])
    well_posed.main()
    assert (tmp_path / "trial" / "tatami.json").exists()


@pytest.mark.parametrize("option", ["--train", "--test"])
def test_no_rooms_are_answered_in_a_line(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["well_posed.py", "tatami", f"{option}=0"])
    with pytest.raises(SystemExit, match=f"^error: {option}: expected 1 or more; got 0$"):
        well_posed.main()
