"""Designed rooms beside real ones."""

from __future__ import annotations

from pathlib import Path

import pytest
import room_statistics

from tests.experiments.builders import REAL

ROOMS = REAL / "designer_rooms"


@pytest.mark.skipif(not ROOMS.is_dir(), reason=f"the designers' rooms are not in {ROOMS}")
def test_room_statistics_draws_designed_beside_real_rooms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(room_statistics, "RESULTS", tmp_path)
    monkeypatch.setattr("sys.argv", ["room_statistics.py", str(ROOMS), "--rooms", "5"])
    room_statistics.main()
    assert (tmp_path / "room_statistics.png").stat().st_size > 10_000
    assert capsys.readouterr().out.count("designed") == 2 + 10
