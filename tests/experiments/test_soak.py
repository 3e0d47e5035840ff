"""A long training, watched."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest
import soak

from layoutrl import InputError
from layoutrl.runs.config import composed

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="only Linux says how much memory a process has"
)
STAND_IN = """
import os, pathlib, signal, sys, time
pathlib.Path("pid").write_text(str(os.getpid()))
held = bytearray(200_000_000)
pathlib.Path("checkpoints").mkdir()
pathlib.Path("checkpoints/1.pt").write_bytes(bytes(3_000_000))
pathlib.Path("events").write_bytes(bytes(500_000))
signal.signal(signal.SIGTERM, lambda *_: sys.exit(pathlib.Path("told").touch()))
time.sleep(60)
"""


def test_soak_watches_memory_checkpoints_and_other_files_until_the_time_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a process that holds 200 MB and writes 3.5 MB; then it is told to stop."""
    monkeypatch.chdir(tmp_path)
    began, asked, told = time.monotonic(), [], soak.resident_bytes
    monkeypatch.setattr(soak, "resident_bytes", lambda process: asked.append(process) or told(process))
    seen = soak.watched([sys.executable, "-c", STAND_IN], tmp_path, minutes=0.05, seconds=0.2)
    assert time.monotonic() - began > 3
    assert {*asked[1:]} == {int((tmp_path / "pid").read_text())}
    minutes, memory, checkpoints, others = zip(*seen, strict=True)
    assert minutes == tuple(sorted(minutes))
    assert 200 < memory[-1] < 300
    assert checkpoints[-1] == 3
    assert others[-1] == pytest.approx(0.5, abs=1e-4)  # and its process id
    assert (tmp_path / "told").exists()


def test_a_training_that_ends_before_the_time_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"soak: the training ended after .*soak\.log says why"):
        soak.watched([sys.executable, "-c", "print('no')"], tmp_path, minutes=5, seconds=0.05)
    assert (tmp_path / "soak.log").read_text() == "no\n"


def test_what_was_watched_is_written_drawn_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def watched(command: list[str], *_: object, **__: object) -> list[tuple[float, ...]]:
        asked.extend(command)
        return [(k / 10, 300.0 + k, 5.0, 2.0) for k in range(11)]

    monkeypatch.setattr(soak, "watched", watched)
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes=1", f"--runs={tmp_path}", "room=tatami", "method.batch=8"])
    soak.main()
    rows = (tmp_path / "soak.csv").read_text().splitlines()
    assert rows[0] == "minutes,memory_mb,checkpoints_mb,other_files_mb"
    assert rows[-1] == "1.0,310.0,5.0,2.0"
    assert (tmp_path / "soak.svg").stat().st_size > 1000
    said = capsys.readouterr().out
    assert "memory: 302.0 MB after 0.2 minutes, 310.0 MB at the end" in said
    assert asked[:3] == [sys.executable, "-m", "layoutrl.train"]
    config = composed("train", *asked[3:])
    assert config.method.updates["default"] == soak.UPDATES
    assert (config.room.type, config.method.batch, config.runs) == ("tatami", 8, str(tmp_path))


def test_no_time_is_answered_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes=0"])
    monkeypatch.setattr(soak, "watched", None)  # before anything is done
    with pytest.raises(SystemExit, match=r"^error: --minutes: expected more than 0; got 0\.0$"):
        soak.main()
