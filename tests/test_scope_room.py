"""scope=room from the command line: trained, gone on with, evaluated, watched."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from layoutrl import InputError
from layoutrl.agents.learner import Learner
from layoutrl.agents.training import Training
from layoutrl.env.reward import Reward
from layoutrl.evaluate import run as evaluate
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.rooms.sources.parts import parts_of, whole_parts
from layoutrl.runs import pretrained, training
from layoutrl.runs.config import AS_IN_THE_RUN, EvaluateConfig, TrainConfig, WatchConfig, composed, narrowed
from layoutrl.runs.folder import load_config
from layoutrl.runs.monitor import FINAL
from layoutrl.runs.trained import kept_agent, trained_run
from layoutrl.train import run as train
from layoutrl.watch import run as watch

TINY = (
    "room=tatami", "scope=room", "budget=smoke", "data.train_rooms=6", "data.test_rooms=2", "method.updates.smoke=4",
    "method.batch=32", "method.warmup_moves=64", "method.evaluation_moves=3", "budget.evaluations=1", "device=cpu",
)  # fmt: skip


def config(folder: Path, *more: str) -> TrainConfig:
    return narrowed(composed("train", *TINY, f"runs={folder}", f"data.root={folder}/rooms", *more), TrainConfig)


@pytest.fixture(scope="module")
def trained(content_furnisher: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return train(config(tmp_path_factory.mktemp("runs")))


def test_a_run_says_what_its_layouts_are_worth_beside_the_designers(trained: Path) -> None:
    assert trained.name == "designer-rooms-geometric-smoke-seed0"
    found = json.loads((trained / "evaluation.json").read_text())
    assert found["rows"]["designer"]["faultless"] == found["rows"]["designer"]["mean_iou"] == 1
    assert {*found["rows"]} == {"agent", "designer", "random", "nearest room"}
    final = ("mean_iou", "facing", "faultless", "overlap", "outside", "blocked", "reached", "fronts")
    assert all(name in found["rows"]["agent"] for name in final)
    assert {*final} < {*FINAL}
    assert [len(layout["items"]) for layout in found["layouts"]] == [4, 4]


def test_a_run_is_evaluated_and_watched(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("layoutrl.watch.FRAMES_A_MOVE", 1)  # pictures take longest
    result = evaluate(EvaluateConfig(str(trained), out=str(tmp_path / "found.json")))
    assert result["rooms"] == 2
    assert "faultless" in capsys.readouterr().out
    files = watch(WatchConfig(str(trained), rooms=2, width=200, out=str(tmp_path / "film")))
    with Image.open(files[0]) as film:
        assert film.n_frames > 4


def test_an_agent_is_scored_in_a_single_room_of_a_file(trained: Path, tmp_path: Path) -> None:
    file = tmp_path / "one.jsonl"
    file.write_text(json.dumps(room_to_dict(design_rooms("tatami", "test", 9, 1).rooms[0])))
    data = replace(AS_IN_THE_RUN, source="json", root=str(file))
    assert evaluate(EvaluateConfig(str(trained), data=data, part="all"))["rooms"] == 1
    with pytest.raises(InputError, match=r"^out: .* is there already; expected the name of a new \.json file"):
        evaluate(EvaluateConfig(str(trained), out=str(next(trained.glob("evaluation-*.json")))))


def test_half_of_the_rooms_that_it_was_trained_on_were_disturbed(trained: Path) -> None:
    shown = trained_run(EvaluateConfig(str(trained), data=replace(AS_IN_THE_RUN, train_rooms=12)))
    designed = design_rooms("tatami", "train", 0, 6).rooms
    assert len(shown.training) == 6
    assert 0 < sum(room != other for room, other in zip(shown.training, designed, strict=True)) < 6
    rooms = narrowed(composed("train", "scope=room", "data=json", "data.root=any"), TrainConfig)
    assert rooms.data.disturbed == 0  # of a file they are as they are


def test_illegal_moves_end_no_furnishing(trained: Path) -> None:
    with pytest.raises(InputError, match="on_illegal of whole rooms: expected one of mask; got stop"):
        evaluate(EvaluateConfig(str(trained), on_illegal="stop"))


def test_a_training_that_is_stopped_goes_on_as_if_it_had_not(trained: Path, tmp_path: Path) -> None:
    settings = config(tmp_path, f"data.root={trained.parents[1]}/rooms")
    rooms, _ = whole_parts("tatami", settings.data, 0)

    def training() -> Training:
        one, other = np.random.SeedSequence(3).spawn(2)
        return Learner(rooms, settings.method, Reward(), 6, one, other, torch.device("cpu")).training(report_every=3)

    whole, again = training(), training()
    reports = iter(whole)
    next(reports)
    again.load_state_dict(copy.deepcopy(whole.state_dict()))
    list(reports)
    list(again)
    ours, theirs = whole.state_dict(), again.state_dict()
    assert whole.updates == again.updates == 6
    for name, value in ours["agent"]["network"].items():
        assert torch.equal(value, theirs["agent"]["network"][name]), name
    for name in ("room", "position", "own"):
        assert torch.equal(ours["episodes"][name], theirs["episodes"][name]), name
    for one, other in zip(ours["replay"]["columns"], theirs["replay"]["columns"], strict=True):
        assert torch.equal(one, other)


def test_it_begins_with_what_the_agent_in_the_package_knows_and_learns_what_else_there_is(tmp_path: Path) -> None:
    lines = [json.dumps(room_to_dict(room)) for room in design_rooms("tatami", "train", 0, 12).rooms]
    (tmp_path / "own.jsonl").write_text("\n".join(lines).replace("stool", "piano"))
    given = "room=tatami", "scope=room", "data=json", f"data.root={tmp_path / 'own.jsonl'}", "begin=package"
    less = "budget=smoke", "budget.evaluations=1", "budget.evaluation_rooms=1", "method.warmup_moves=64"
    next_to_nothing = "method.updates.smoke=1", "method.learning_rate=1e-12"
    folder = train(narrowed(composed("train", *given, *less, *next_to_nothing, f"runs={tmp_path}"), TrainConfig))

    assert folder.name == "json-rooms-geometric-package-smoke-seed0"
    settings = load_config(folder, TrainConfig)
    agent = kept_agent(folder, settings, torch.device("cpu")).agent
    assert agent.categories == [*pretrained.known("tatami"), "piano"]
    briefs = [brief_of(room) for room in design_rooms("tatami", "test", 5, 2).rooms]
    layouts, of_the_package = (
        [best.layout for best, *_ in furnisher.furnish(briefs, 1)]
        for furnisher in (
            Furnisher(agent),
            pretrained.load("tatami", torch.device("cpu")),
        )
    )
    assert layouts == of_the_package

    text = (folder / "config.yaml").read_text()
    (folder / "config.yaml").write_text(text.replace("- 0.02\n", "- 0.04\n"))  # the package's had other moves then
    assert load_config(folder, TrainConfig).method.steps == [0.32, 0.08, 0.04, 0.005]


@pytest.mark.parametrize("room", MAIN_ITEM)
def test_mirrored_rooms_are_learned_from_but_in_studies(room: str) -> None:
    whole = narrowed(composed("train", f"room={room}", "scope=room"), TrainConfig)
    assert [view.mirror for view in whole.method.views(torch.device("cpu"))] == [False, True][: 1 + (room != "study")]
    item = narrowed(composed("train", f"room={room}"), TrainConfig)
    assert len(item.method.views(torch.device("cpu"))) == 8  # what stands beside the item tells how the room is seen


def test_a_batch_of_any_size_is_seen_in_both_views(tmp_path: Path) -> None:
    settings = config(tmp_path, "method.batch=1", "method.updates.smoke=1")
    one, other = np.random.SeedSequence(3).spawn(2)
    rooms = design_rooms("tatami", "train", 0, 2).rooms
    learner = Learner(rooms, settings.method, Reward(), 1, one, other, torch.device("cpu"))
    (report,) = learner.training(report_every=1)
    assert np.isfinite(report.loss)


@pytest.mark.parametrize(
    ("option", "name"),
    [("room.item=toilet", "room.item"), ("method=paper", "method.observation"), ("method.scope=flat", "method.scope")],
)
def test_what_does_not_go_with_whole_rooms_is_refused(tmp_path: Path, option: str, name: str) -> None:
    with pytest.raises(InputError, match=name):
        config(tmp_path, option)


@pytest.mark.parametrize("scope", ["item", "room"])
def test_what_chooses_the_best_checkpoint_is_measured_in_training_rooms(
    scope: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Looked(Exception):
        pass

    def watched(_: Training, probes: dict[str, Any], *__: Any) -> None:
        raise Looked({name: probe.func for name, probe in probes.items()})

    monkeypatch.setattr(training, "RoomsProbe", lambda few: lambda: {room.id for room in few})
    monkeypatch.setattr(training, "ItemProbe", lambda simulator, *_: lambda: {room.id for room in simulator.rooms})
    monkeypatch.setattr(training, "watched", watched)
    settings = config(tmp_path, f"scope={scope}")
    parts = parts_of(scope, "tatami", "main", settings.data, 0)
    with pytest.raises(Looked) as looked:
        training.train(settings, *parts, torch.device("cpu"))
    (probes,) = looked.value.args
    for name, rooms in zip(("train", "held_out"), parts, strict=True):
        assert probes[name]() <= {room.id for room in rooms}
