"""What the best of three layouts is worth."""

from __future__ import annotations

import json
from pathlib import Path

import best_of_three
import pytest


def test_the_nearest_of_three_is_no_farther_than_the_only_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["best_of_three.py", "balcony", "--rooms=3", f"--results={tmp_path / 'new'}"])
    best_of_three.main()
    result = json.loads((tmp_path / "new" / "balcony.json").read_text())
    only, nearest = (result[name]["iou"]["mean"] for name in ("the only one", "the nearest of three"))
    assert nearest >= only > 0
    assert 1 <= result["layouts"] <= 3
