"""What a run left is taken as what its configuration says, or refused in a line."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from layoutrl import InputError
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.sources.parts import Data
from layoutrl.runs.checkpoints import checkpoints, load_checkpoint, save_checkpoint
from layoutrl.runs.config import AS_IN_THE_RUN, EvaluateConfig, RunConfig, TrainConfig, composed, narrowed
from layoutrl.runs.trained import asked_data, trained_run
from layoutrl.train import run
from tests.runs.test_resume import SHORT

CPU = torch.device("cpu")
UPDATES = 4


def trained(folder: Path, room_type: str) -> Path:
    rooms = folder / f"{room_type}.jsonl"
    designed = design_rooms(room_type, "train", 0, 12).rooms
    rooms.write_text("\n".join(json.dumps(room_to_dict(room)) for room in designed))
    given = (f"room={room_type}", "data=json", f"data.root={rooms}", f"runs={folder}", "name=one")
    few = (f"method.updates.smoke={UPDATES}", "budget.evaluations=2", "budget.reports=2")
    given += ("method.snap=0",)  # as observation=image has it, too
    return run(narrowed(composed("train", *given, *SHORT, *few), TrainConfig))


@pytest.fixture(scope="module")
def tatami(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return trained(tmp_path_factory.mktemp("tatami"), "tatami")


@pytest.fixture
def copy(tatami: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(tatami, tmp_path / "tatami" / "one"))


def changed(folder: Path, before: str, after: str) -> None:
    text = (folder / "config.yaml").read_text()
    assert before in text
    (folder / "config.yaml").write_text(text.replace(before, after))


@pytest.mark.parametrize(
    ("before", "after", "name"),
    [
        ("slide: true", "slide: false", "method.slide"),
        ("type: tatami", "type: kitchen", "room.type"),
        ("observation: geometry", "observation: image", "method.observation"),
        ("theta2: -100", "theta2: -50", "reward.theta2"),
    ],
)
def test_a_configuration_that_was_changed_after_the_training_is_refused(
    before: str, after: str, name: str, copy: Path
) -> None:
    changed(copy, before, after)
    last = checkpoints(copy)[0].file
    with pytest.raises(InputError, match=rf"^{last} is of another {name}; expected the same as in config\.yaml$"):
        trained_run(RunConfig(str(copy)))


def test_a_checkpoint_of_another_run_is_refused(copy: Path, tmp_path: Path) -> None:
    other = trained(tmp_path, "kitchen")
    shutil.rmtree(copy / "checkpoints")
    shutil.copytree(other / "checkpoints", copy / "checkpoints")
    with pytest.raises(InputError, match=r"is of another .*room\.type; expected the same"):
        trained_run(RunConfig(str(copy)))


@pytest.mark.parametrize(
    "content",
    [
        {"training": {}},
        {"training": {"agent": []}},
        {"training": {"agent": {"network": {"x": torch.ones(3)}}}},
        {"categories": 3},
        {"categories": ["bed"]},
    ],
)
def test_a_checkpoint_that_says_what_it_is_not_is_refused(content: dict[str, Any], copy: Path) -> None:
    save_checkpoint(copy, load_checkpoint(copy, CPU) | content, UPDATES)
    with pytest.raises(InputError, match=rf"^the checkpoint of {copy} does not fit \(.*\); expected .*$"):
        trained_run(RunConfig(str(copy)))


def test_rooms_that_changed_since_the_training_are_told(
    copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trained_run(RunConfig(str(copy)))
    assert "other rooms" not in capsys.readouterr().out
    file = tmp_path / "more.jsonl"
    more = design_rooms("tatami", "test", 0, 12).rooms
    file.write_text("\n".join(json.dumps(room_to_dict(room)) for room in more))
    text = (copy / "config.yaml").read_text()
    (root,) = (line for line in text.splitlines() if line.strip().startswith("root:"))
    changed(copy, root, f"  root: {file}")
    trained_run(RunConfig(str(copy)))
    assert f"{copy} was trained on other rooms than there are now" in capsys.readouterr().out


def test_rooms_that_are_elsewhere_now_are_the_runs_own(
    tatami: Path, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    here, there = tatami.parents[1] / "tatami.jsonl", tmp_path / "there.jsonl"
    text = (copy / "config.yaml").read_text()
    gone = str(tmp_path / "gone.jsonl")
    changed(copy, str(here), gone)
    with pytest.raises(InputError, match=rf"^data\.root: {copy} has its rooms of {gone}, which is not there; expected"):
        trained_run(RunConfig(str(copy)))
    there.write_text(here.read_text())
    for source in (None, "json"):
        given = RunConfig(str(copy), data=replace(AS_IN_THE_RUN, source=source, root=str(there)))
        capsys.readouterr()
        shown, own = trained_run(given), trained_run(RunConfig(str(tatami)))
        assert "other rooms" not in capsys.readouterr().out
        assert (shown.rooms, shown.training, shown.part) == (own.rooms, own.training, "held_out")
    there.write_text("\n".join(here.read_text().splitlines()[1:]))
    with pytest.raises(
        InputError, match=rf"^data: {there} has other rooms than {copy} was trained on, which are not at"
    ):
        trained_run(given)
    (copy / "config.yaml").write_text(text)  # rooms that are still there are the run's own, and others are others
    assert trained_run(given).part == "all"


def test_other_rooms_that_are_not_there_are_told_before_its_own_are_read(
    tatami: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere = replace(AS_IN_THE_RUN, source="json", root=str(tmp_path / "gone.jsonl"))
    capsys.readouterr()
    with pytest.raises(InputError, match=r"gone\.jsonl: no such file or folder"):
        trained_run(RunConfig(str(tatami), data=elsewhere))
    assert capsys.readouterr().out == ""


def test_furniture_that_the_agent_never_saw_is_told(
    tatami: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rooms = [room_to_dict(room) for room in design_rooms("tatami", "test", 0, 4).rooms]
    file = tmp_path / "strange.jsonl"
    told = "of them have furniture that the agent does not know"
    for strange, said in ((0, None), (2, f"2 {told}: waterbed")):
        for room in rooms[:strange]:
            next(item for item in room["furniture"] if item["category"] != "platform")["category"] = "waterbed"
        file.write_text("\n".join(map(json.dumps, rooms)))
        trained_run(RunConfig(str(tatami), data=replace(AS_IN_THE_RUN, source="json", root=str(file)), part="all"))
        out = capsys.readouterr().out
        assert said in out if said else told not in out


def test_what_is_given_counts_though_it_be_the_usual() -> None:
    own = Data("json", "rooms.json", unit="cm", strict=True)
    nothing = narrowed(composed("evaluate", "run=there"), EvaluateConfig).data
    assert nothing == AS_IN_THE_RUN
    assert asked_data(own, nothing) == (own, True)
    given = narrowed(composed("evaluate", "run=there", "data.unit=auto", "data.strict=false"), EvaluateConfig).data
    assert asked_data(own, given) == (Data("json", "rooms.json"), True)


def test_what_is_given_of_the_training_rooms_and_cannot_count_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    own = Data("designer", train_rooms=20, disturbed=0.5)
    given = replace(AS_IN_THE_RUN, train_rooms=30, disturbed=0.0)
    assert asked_data(own, given) == (own, True)
    assert capsys.readouterr().out == (
        "data.train_rooms: 30 is not taken; the rooms of the training are as in the run (20)\n"
        "data.disturbed: 0.0 is not taken; the rooms of the training are as in the run (0.5)\n"
    )
    assert asked_data(own, replace(Data("designer"), disturbed=0.2)) == (own, True)
    assert capsys.readouterr().out.startswith("data.disturbed: 0.2 is not taken")
    for counts in (Data("designer"), replace(AS_IN_THE_RUN, train_rooms=10), replace(given, seed=1), AS_IN_THE_RUN):
        asked_data(own, counts)
    assert not capsys.readouterr().out
