"""What the best of three layouts is worth."""

from __future__ import annotations

import json
from pathlib import Path

import best_of_three
import pytest


def test_the_nearest_of_three_is_no_farther_than_the_first_and_who_has_one_gives_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["best_of_three.py", "balcony", "--rooms=3", f"--results={tmp_path / 'new'}"])
    best_of_three.main()
    result = json.loads((tmp_path / "new" / "balcony.json").read_text())
    only, first, nearest = (result[name]["iou"]["mean"] for name in list(result)[-3:])
    assert nearest >= max(only, first) > 0
    assert 1 <= result["layouts"] <= 3
