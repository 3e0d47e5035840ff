"""The scripts in experiments/ run, on little, and measure what they say."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from layoutrl.env.observation import GeometryObservation
from layoutrl.rooms.designer.generator import design_room

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


@pytest.mark.parametrize("index", range(3))
def test_turned_batches_are_observations_of_turned_rooms(index: int) -> None:
    module = script("well_posed")
    room = design_room("bathroom", "train", 0, index).room
    wanted = {seen(*observed(room.turned(quarters, mirror))) for quarters in range(4) for mirror in (False, True)}
    elements, target = observed(room)
    found = {seen(*module.turned(elements, target, np.random.default_rng(seed))) for seed in range(60)}
    assert found == wanted


def observed(room) -> tuple[torch.Tensor, torch.Tensor]:
    x0, y0, x1, y1 = room.envelope.bounds
    middle = torch.tensor([[(x0 + x1) / 2, (y0 + y1) / 2]])
    observe = GeometryObservation([room], ["toilet", "vanity", "shower", "bathtub", "washing_machine"])
    return observe(torch.tensor([0]), middle), (torch.tensor([room.moving.center]) - middle).float()


def seen(elements: torch.Tensor, target: torch.Tensor) -> tuple:
    """Elements in any order, to the millimetre."""
    rows = np.round(torch.cat([elements[0], target.expand(elements.shape[1], 2)], 1).numpy(), 3) + 0.0
    return tuple(sorted(map(tuple, rows.tolist())))


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
    checkpoints = sorted(tmp_path.glob("tatami/*/checkpoint.pt"))
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
