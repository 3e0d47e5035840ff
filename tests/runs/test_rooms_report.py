"""An agent of whole rooms is trained, scored and furnishes, and says what it cannot."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest
from PIL import Image

from layoutrl import InputError
from layoutrl.evaluate import run as evaluate
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.runs.config import EvaluateConfig, TrainConfig, WatchConfig, composed, narrowed
from layoutrl.runs.rooms_report import SHOWN, rooms_table
from layoutrl.train import run
from layoutrl.watch import run as watch
from tests.runs.test_resume import SHORT


@pytest.fixture(scope="module")
def trained(content_furnisher: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms")
    designed = design_rooms("tatami", "train", 0, 12).rooms
    rooms = folder / "rooms.jsonl"
    rooms.write_text("\n".join(json.dumps(room_to_dict(room)) for room in designed))
    given = ("room=tatami", "scope=room", "data=json", f"data.root={rooms}", f"runs={folder}", "name=one")
    few = ("method.updates.smoke=2", "budget.evaluations=1", "budget.reports=1", "budget.evaluation_rooms=2")
    return run(narrowed(composed("train", *given, *SHORT, *few), TrainConfig))


def test_a_run_of_whole_rooms_is_scored_beside_what_needs_no_training(trained: Path) -> None:
    found = json.loads((trained / "evaluation.json").read_text())
    assert list(found["rows"]) == ["agent", "designer", "random", "nearest room"]
    assert found["rows"]["designer"]["mean_iou"] == pytest.approx(1)
    assert found["rows"]["agent"]["rooms"] == found["rooms"] == len(found["layouts"]) > 0
    head, *rows = rooms_table(found).splitlines()
    assert all(title in head for title in SHOWN.values())
    assert len(rows) == len(found["rows"]) + 2


def test_it_is_scored_again_alike(trained: Path, tmp_path: Path) -> None:
    once, again = (evaluate(EvaluateConfig(str(trained), out=str(tmp_path / f"{name}.json"))) for name in "ab")
    assert once["layouts"] == again["layouts"]


ONCE = r"^starts: a whole room is furnished once, from nothing; expected 1; got 2$"
NOWHERE = r"^out: /dev/null cannot be written to; expected another, as out=<name>$"
MASKED = r"^on_illegal of whole rooms: expected one of mask; got stop$"


@pytest.mark.parametrize(
    ("command", "schema", "options", "said"),
    [
        (evaluate, EvaluateConfig, {"starts": 2}, ONCE),
        (evaluate, EvaluateConfig, {"out": "/dev/null/found.json"}, NOWHERE),
        (evaluate, EvaluateConfig, {"on_illegal": "stop"}, MASKED),
        (watch, WatchConfig, {"out": "/dev/null/film"}, NOWHERE),
        (watch, WatchConfig, {"on_illegal": "stop"}, MASKED),
    ],
)
def test_what_cannot_be_is_said_before_rooms_are_read(command, schema, options, said, trained, monkeypatch) -> None:
    monkeypatch.setattr("layoutrl.runs.trained.load_checkpoint", None)
    with pytest.raises(InputError, match=said):
        command(schema(str(trained), **options))


def test_a_disk_that_is_full_is_answered_with_the_file(trained: Path, tmp_path: Path, monkeypatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("layoutrl.runs.files.os.fsync", full)
    file = tmp_path / "new" / "found.json"
    with pytest.raises(InputError, match=rf"^out: cannot write {file} \(No space left on device\); expected a file in"):
        evaluate(EvaluateConfig(str(trained), out=str(file)))
    assert not list(file.parent.iterdir())


def test_what_was_made_meanwhile_is_not_overwritten(trained: Path, tmp_path: Path, monkeypatch) -> None:
    def theirs(name: str, what: object) -> object:
        (tmp_path / name).write_text("theirs")
        return what

    monkeypatch.setattr("layoutrl.runs.report.scored", lambda *_: theirs("found.json", ({}, "")))
    monkeypatch.setattr("layoutrl.watch.frames", lambda *_: theirs("film.webp", [Image.new("RGB", (4, 3))] * 2))
    with pytest.raises(InputError, match=r"^out: .*found\.json is there already; expected the name of a new"):
        evaluate(EvaluateConfig(str(trained), out=str(tmp_path / "found.json")))
    with pytest.raises(InputError, match=r"^out: .*film\.webp is there already; expected the name of a new"):
        watch(WatchConfig(str(trained), rooms=1, out=str(tmp_path / "film")))
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == dict.fromkeys(
        ("found.json", "film.webp"), "theirs"
    )
