"""An agent of whole rooms is trained, scored and furnishes, and says what it cannot."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from layoutrl import InputError
from layoutrl.evaluate import run as evaluate
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.runs.config import EvaluateConfig, TrainConfig, composed, part
from layoutrl.runs.rooms_report import SHOWN, rooms_table
from layoutrl.train import run
from tests.runs.test_resume import SHORT


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms")
    designed = design_rooms("tatami", "train", 0, 12).rooms
    rooms = folder / "rooms.jsonl"
    rooms.write_text("\n".join(json.dumps(room_to_dict(room)) for room in designed))
    given = ("room=tatami", "scope=room", "data=json", f"data.root={rooms}", f"runs={folder}", "name=one")
    few = ("method.updates.smoke=2", "budget.evaluations=1", "budget.reports=1", "budget.evaluation_rooms=2")
    return run(part(composed("train", *given, *SHORT, *few), TrainConfig))


def test_a_run_of_whole_rooms_is_scored_beside_what_needs_no_training(trained: Path) -> None:
    found = json.loads((trained / "evaluation.json").read_text())
    assert list(found["rows"]) == ["agent", "designer", "random", "nearest room"]
    assert found["rows"]["designer"]["mean_iou"] == pytest.approx(1)
    assert found["rows"]["agent"]["rooms"] == found["rooms"] == len(found["layouts"]) > 0
    head, *rows = rooms_table(found).splitlines()
    assert all(title in head for title in SHOWN.values())
    assert len(rows) == len(found["rows"]) + 2


def test_it_is_scored_again_alike_and_from_one_start_alone(trained: Path, tmp_path: Path) -> None:
    once, again = (evaluate(EvaluateConfig(str(trained), out=str(tmp_path / f"{name}.json"))) for name in "ab")
    assert once["layouts"] == again["layouts"]
    with pytest.raises(InputError, match=r"^starts: a whole room is furnished once, from nothing; expected 1; got 2$"):
        evaluate(EvaluateConfig(str(trained), starts=2))
