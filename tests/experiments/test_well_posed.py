"""Whether the designer answers the question at all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import well_posed


def test_well_posed_measures_a_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(well_posed, "RESULTS", tmp_path)
    monkeypatch.setattr("sys.argv", ["well_posed.py", "tatami", "--train=60", "--test=20"])
    well_posed.main()
    result = json.loads((tmp_path / "tatami.json").read_text())
    assert result["ambiguity"]["near_ties"] == 0
    assert 0 < result["yardsticks"]["random_start"] < result["yardsticks"]["nearest_training_room"] <= 1
