"""The scripts in experiments/ run, on little, and measure what they say."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest

PROJECT = Path(__file__).resolve().parents[1]
SMOKE_WITHOUT_SLIDES = ["budget=smoke", "method.slide=false"]
REAL = PROJECT.parent / "shared" / "data" / "designer_rooms"


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, PROJECT / "experiments" / f"{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_well_posed_measures_a_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = script("well_posed")
    monkeypatch.setattr(module, "RESULTS", tmp_path)
    monkeypatch.setattr("sys.argv", ["well_posed.py", "tatami", "--train=60", "--test=20", "--steps=30"])
    module.main()
    result = json.loads((tmp_path / "tatami.json").read_text())
    assert result["ambiguity"]["near_ties"] == 0
    assert 0 < result["yardsticks"]["random_start"] < result["yardsticks"]["nearest_training_room"] <= 1
    assert result["regressor"]["steps"] == 30
    assert 0 <= result["regressor"]["iou_held_out"] <= 1


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the designers' rooms are not in {REAL}")
def test_room_statistics_draws_designed_beside_real_rooms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("room_statistics")
    monkeypatch.setattr(module, "RESULTS", tmp_path)
    monkeypatch.setattr("sys.argv", ["room_statistics.py", str(REAL), "--rooms", "20"])
    module.main()
    assert (tmp_path / "room_statistics.png").stat().st_size > 10_000
    assert capsys.readouterr().out.count("designed") == 2 + 10


def test_ablation_trains_every_change_on_every_seed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = script("ablation")
    monkeypatch.setattr(module, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(module, "CHANGES", {"as it is": ["budget=smoke"], "no slides": SMOKE_WITHOUT_SLIDES})
    arguments = ["ablation.py", "tatami", "--updates=5", "--seeds", "0", "1", f"--runs={tmp_path}"]
    monkeypatch.setattr("sys.argv", arguments)
    module.main()
    checkpoints = sorted(tmp_path.glob("tatami/*/config.yaml"))
    assert [path.parent.name for path in checkpoints] == [
        "as-it-is-5-seed0", "as-it-is-5-seed1", "no-slides-5-seed0", "no-slides-5-seed1",
    ]  # fmt: skip
    rows = json.loads((tmp_path / "results" / "tatami.json").read_text())["rows"]
    assert rows["as it is"]["ceiling"] > rows["no slides"]["ceiling"]
    first, second = rows["no slides"]["iou_by_seed"]
    assert rows["no slides"]["mean_iou"] == pytest.approx((first + second) / 2)
    written = [path.stat().st_mtime for path in checkpoints]

    (tmp_path / "tatami" / "no-slides-5-seed1" / "evaluation.json").unlink()  # as if it had been interrupted
    module.main()
    assert [path.stat().st_mtime for path in checkpoints[:3]] == written[:3]
    assert json.loads((tmp_path / "results" / "tatami.json").read_text())["rows"] == rows


def test_soak_watches_the_memory_and_files_of_a_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("soak")
    monkeypatch.setenv("PYTHONPATH", str(PROJECT))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    little = ["room=tatami", "data.train_rooms=8", "data.test_rooms=2", "method.batch=8", "method.warmup_moves=64"]
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes=0.2", f"--runs={tmp_path / 'soak'}", *little])
    module.main()
    rows = (tmp_path / "soak" / "soak.csv").read_text().splitlines()
    assert rows[0] == "minutes,memory_mb,checkpoints_mb,other_files_mb"
    assert 100 < float(rows[-1].split(",")[1]) < 4000
    assert (tmp_path / "soak" / "soak.svg").stat().st_size > 1000
    assert "memory: " in capsys.readouterr().out
    monkeypatch.setattr("sys.argv", ["soak.py", "--minutes=0.2", f"--runs={tmp_path / 'wrong'}", "room=attic"])
    with pytest.raises(SystemExit, match="soak: the training ended after"):
        module.main()
