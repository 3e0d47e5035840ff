"""The entry point: a run leaves what it says, goes on exactly, and answers what is wrong in a line."""

from __future__ import annotations

import csv
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
import torch

from layoutrl import InputError
from layoutrl.planit.train import main, run
from layoutrl.rivals.planit.training import Training
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import two_parts
from layoutrl.runs.checkpoints import load_checkpoint
from layoutrl.runs.commands import Stopped
from layoutrl.runs.config import PlanitConfig, composed, narrowed
from layoutrl.runs.planit_training import load, usable
from layoutrl.runs.resume import resume_run
from tests.commands import layoutrl
from tests.rivals.planit.rooms import designed

SHORT = (
    "method.updates={default: 6}",
    "method.batch=4",
    "budget.reports=3",
    "budget.evaluations=3",
    "budget.evaluation_rooms=1",
)


pytestmark = pytest.mark.usefixtures("small_planit")


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("rooms") / "rooms.jsonl", designed("bathroom", 10))


def written(file: Path, rooms: list[Room]) -> Path:
    file.write_text("\n".join(json.dumps(room_to_dict(room)) for room in rooms))
    return file


def configured(rooms: Path, folder: Path, *overrides: str) -> PlanitConfig:
    places = ("room=bathroom", "data=json", f"data.root={rooms}", f"runs={folder}", "name=one")
    return narrowed(composed("planit", *places, *SHORT, *overrides), PlanitConfig)


def digest(weights: dict[str, torch.Tensor]) -> dict[str, str]:
    """Of each tensor a hash: a list of millions of numbers takes long."""
    return {name: hashlib.sha256(value.numpy().tobytes()).hexdigest() for name, value in weights.items()}


def outcome(folder: Path) -> dict[str, Any]:
    state = load_checkpoint(folder, torch.device("cpu"))
    with (folder / "metrics.csv").open() as file:
        metrics = list(csv.DictReader(file))
    evaluation = json.loads((folder / "evaluation.json").read_text())
    return {
        "networks": digest(state["training"]["networks"]),
        "metrics": metrics,
        "evaluation": {k: v for k, v in evaluation.items() if k not in ("training_seconds", "machine")},
    }


def test_a_run_that_is_stopped_and_goes_on_is_the_run_that_never_stopped(
    rooms: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.set_num_threads(1)
    whole = run(configured(rooms, tmp_path / "whole"))
    update = Training._update

    def stopping(training: Training) -> None:
        update(training)
        training.stopping = training.updates in (3, 4)

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    folder = tmp_path / "stopped" / "bathroom" / "one"
    with monkeypatch.context() as patch:
        patch.setattr(Training, "_update", stopping)
        with pytest.raises(Stopped, match=f"stopped after 3 of 6 updates; go on with: .*resume={folder}"):
            run(configured(rooms, tmp_path / "stopped"))
        with pytest.raises(Stopped, match="stopped after 4 of 6 updates"):
            resume_run(folder, run, PlanitConfig)
        patch.setattr(Training, "_update", update)
        patch.setattr("layoutrl.rivals.planit.scoring.evaluated", interrupted)
        with pytest.raises(Stopped, match=f"stopped in its evaluation; go on with: .*resume={folder}"):
            resume_run(folder, run, PlanitConfig)
    assert resume_run(folder, run, PlanitConfig) == folder
    assert outcome(folder) == outcome(whole)
    assert {file.name.split(".")[0] for file in whole.iterdir()} == {
        "config", "metrics", "checkpoints", "evaluation", "events", "lock",
    }  # fmt: skip
    assert [row["updates"] for row in outcome(whole)["metrics"]] == ["2", "4", "6"]
    config = configured(rooms, tmp_path)
    model = load(
        whole, *usable(*two_parts(config.room.type, config.room.item, config.data, config.fold)), torch.device("cpu")
    ).model
    assert digest(model.state_dict()) == outcome(whole)["networks"]
    assert not any(module.training for module in model.modules())


def test_a_loss_that_is_no_number_ends_the_run(rooms: Path, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"the loss/\w+ is (nan|inf) after .* begin another run with a lower method\.learning_rate"
    ):
        run(configured(rooms, tmp_path, "method.learning_rate=1e30"))


def test_slanting_rooms_are_refused_in_a_line(tmp_path: Path) -> None:
    file = tmp_path / "rooms.jsonl"
    lines = [room_to_dict(room) for room in designed("bathroom", 10)]
    for line in lines:
        line["furniture"][0]["rotation"] = 30
        line["furniture"][0]["size"] = [0.3, 0.3]
    file.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(InputError, match="stands at an angle; expected an upright room"):
        run(configured(file, tmp_path))


def test_rooms_that_it_cannot_draw_or_furnish_are_counted_and_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rooms = designed("bathroom", 24)
    config = configured(file_of(tmp_path, [room_to_dict(room) for room in rooms]), tmp_path)
    training, held_out = two_parts(config.room.type, config.room.item, config.data, config.fold)
    slanting, unknown = (room_to_dict(part[0]) for part in (training, held_out))
    slanting["furniture"][0] |= {"rotation": 30, "size": [0.3, 0.3]}
    unknown["furniture"].append({"category": "shelf", "center": [0.5, 0.5], "size": [0.1, 0.1]})
    others = [room_to_dict(room) for room in (*training[1:], *held_out[1:])]
    run(configured(file_of(tmp_path, [slanting, unknown, *others]), tmp_path))
    said = capsys.readouterr().out
    assert f"left out 1 of {len(training)} training rooms, first planit: room {training[0].id}" in said
    assert f"left out 1 of {len(held_out)} held-out rooms, first planit: room {held_out[0].id} has a shelf" in said
    assert f"training on {len(training) - 1} rooms, {len(held_out) - 1} held out" in said


def file_of(folder: Path, rooms: list[dict[str, Any]]) -> Path:
    file = folder / "rooms.jsonl"
    file.write_text("\n".join(map(json.dumps, rooms)))
    return file


def test_what_it_cannot_score_is_refused_before_it_trains(tmp_path: Path) -> None:
    rooms = [room_to_dict(room) for room in designed("bathroom", 10)]
    for room in rooms:
        room["furniture"].append({"category": f"shelf of {room['id']}", "center": [0.5, 0.5], "size": [0.1, 0.1]})
    file = tmp_path / "rooms.jsonl"
    file.write_text("\n".join(map(json.dumps, rooms)))
    with pytest.raises(InputError, match="expected what training rooms have"):
        run(configured(file, tmp_path))
    assert not (tmp_path / "bathroom").exists()


def test_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    few = "budget.evaluation_rooms=1", "data.test_rooms=2", "data.train_rooms=8", "method.batch=4"
    monkeypatch.setattr("sys.argv", ["layoutrl.planit.train", "room=bathroom", "budget=smoke", *few])
    monkeypatch.chdir(tmp_path)
    main()
    said = capsys.readouterr().out
    folder = tmp_path / said.splitlines()[-1].removeprefix("wrote ")
    assert folder == tmp_path / "runs/bathroom/designer-main-planit-smoke-seed0"
    assert "given graph, argmax, true size" in said
    again = layoutrl("planit.train", f"resume={folder}", cwd=tmp_path)
    assert again.stdout.strip() == f"{folder} is finished"
    wrong = layoutrl("planit.train", "room=attic", cwd=tmp_path)
    assert wrong.returncode != 0
    assert "Traceback" not in wrong.stderr
