"""A long training, watched."""

from __future__ import annotations

from pathlib import Path

import pytest
import soak

from tests.experiments.builders import PROJECT


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux says how much memory a process has")
def test_soak_watches_the_memory_and_files_of_a_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(PROJECT))
    little = ["room=tatami", "data.train_rooms=8", "data.test_rooms=2", "method.batch=8", "method.warmup_moves=64"]
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes=0.15", f"--runs={tmp_path / 'soak'}", *little])
    soak.main()
    rows = (tmp_path / "soak" / "soak.csv").read_text().splitlines()
    assert rows[0] == "minutes,memory_mb,checkpoints_mb,other_files_mb"
    assert 10 < float(rows[-1].split(",")[1]) < 4000
    assert (tmp_path / "soak" / "soak.svg").stat().st_size > 1000
    assert "memory: " in capsys.readouterr().out
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes=5", f"--runs={tmp_path / 'wrong'}", "room=attic"])
    with pytest.raises(SystemExit, match="soak: the training ended after"):
        soak.main()
