"""The agents in the package are made again from nothing, or of what is finished, and one that fails stops no other."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict
from pathlib import Path

import make_weights
import numpy as np
import pytest
import torch
from cells import fill
from make_weights import COLUMN, PACKAGED, command_of, items_of, page_of
from packing import packed_iou
from table3 import LEARNS

from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.config import composed
from layoutrl.runs.pretrained import ABOUT, unpacked
from tests.experiments.builders import configured, script

pytestmark = pytest.mark.usefixtures("content_furnisher")


def test_agents_are_made_from_nothing_and_of_what_is_finished(tmp_path: Path, capsys, designed: str) -> None:
    assert COLUMN in LEARNS.values()
    done = script("make_weights.py", "room=bathroom", designed, f"runs={tmp_path / 'runs'}", "weights=w", cwd=tmp_path)
    assert done.returncode == 1
    assert "bathroom failed: results: " in done.stderr  # where runs are given, nothing is trained
    given = ("room=bathroom", designed, "data.test_rooms=3", "weights=w", "version=3")
    done = script("make_weights.py", *given, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    about = json.loads((tmp_path / "w" / ABOUT).read_text())
    assert about["version"] == 3
    card = about["agents"]["bathroom"]
    assert (card["updates"], card["seed"], card["data"]["rooms"], card["items"]["rooms"]) == (8, 0, 12, 3)
    assert card["command"].startswith(f"python experiments/cells.py table=table3 column={COLUMN} room=bathroom ")
    unpacked((tmp_path / "w" / card["file"]).read_bytes(), card, torch.device("cpu"))
    page = tmp_path / "w" / "agents.md"
    assert page.read_text() == page_of(about)
    (cell,) = (tmp_path / "results").rglob("*.json")
    kept = json.loads(cell.read_text())["rows"]["layouts"]
    assert card["measures"]["iou"] == kept["mean_iou"]
    assert card["measures"]["faultless"] == kept["faultless"]
    assert card["rounded"]["iou_before"] == pytest.approx(kept["mean_iou"], abs=1e-4)
    assert card["rounded"]["iou"] == card["items"]["iou"]

    page.unlink()
    finished = ["room=study,bathroom", f"results={tmp_path / 'results'}", "budget=smoke", f"runs={tmp_path / 'runs'}"]
    assert make_weights.main([*finished, f"weights={tmp_path / 'w'}"]) == 1
    said = capsys.readouterr()
    assert said.err.startswith("study failed: results: ")
    assert said.out.startswith("bathroom: IoU ")
    assert json.loads((tmp_path / "w" / ABOUT).read_text()) == about
    assert page.is_file()


def test_the_agents_in_the_package_are_scored_anew_and_stay_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], designed: str
) -> None:
    weights, page = tmp_path / "weights", tmp_path / "agents.md"
    shutil.copytree(make_weights.WEIGHTS, weights)
    monkeypatch.setattr(make_weights, "WEIGHTS", weights)
    monkeypatch.setattr(make_weights, "PAGE", page)
    before = json.loads((weights / ABOUT).read_text())["agents"]
    fill(configured(tmp_path, "table=table3", f"column={PACKAGED}", "room=bathroom", designed, "data.test_rooms=3"))
    scores, found = f"scores={tmp_path / 'results'}", []
    monkeypatch.setattr(make_weights, "items_of", lambda *asked: found.append(items_of(*asked)) or found[-1])
    assert make_weights.main([scores, "budget=smoke", "room=bathroom,study"]) == 1
    assert capsys.readouterr().err.startswith("study failed: results: ")
    about = json.loads((weights / ABOUT).read_text())
    assert page.read_text() == page_of(about)
    (cell,) = (tmp_path / "results").rglob("*.json")
    kept, card = json.loads(cell.read_text())["rows"]["layouts"], about["agents"]["bathroom"]
    assert (card["rooms"], card["items"]["rooms"]) == (3, 3)
    assert card["measures"]["iou"] == kept["mean_iou"] == pytest.approx(card["items"]["iou"], abs=1e-4)
    new = {"rooms", "measures", "standard_errors", "seconds", "furnished_by", "items"}
    for room_type, was in before.items():
        now = about["agents"][room_type]
        assert {name for name in now if now[name] != was[name]} <= (new if room_type == "bathroom" else set())
        assert hashlib.sha256((weights / now["file"]).read_bytes()).hexdigest() == was["sha256"]

    (known,) = found  # the same agent furnishes the same rooms
    monkeypatch.setattr(make_weights, "items_of", lambda *_: known)
    record = json.loads(cell.read_text())
    record["rows"]["layouts"]["iou"] = packed_iou(np.zeros(3))
    cell.write_text(json.dumps(record))
    assert make_weights.main([scores, "budget=smoke", "room=bathroom"]) == 1
    assert "bathroom failed: scores: the cell's rooms have an IoU of 0.0000, and now " in capsys.readouterr().err


@pytest.mark.parametrize("other", ["weights=x", "runs=x", "results=x", "seed=1"])
def test_only_networks_of_the_package_are_scored_anew(other: str) -> None:
    with pytest.raises(SystemExit, match=rf"^error: {other[:-2]}: expected none with scores="):
        make_weights.main(["scores=x", other])


def test_a_version_that_is_no_number_is_answered_before_any_training(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(make_weights, "multirun", None)
    with pytest.raises(SystemExit, match=r"^error: version: expected a whole number; got x$"):
        make_weights.main(["version=x"])


def test_each_agent_in_the_package_is_trained_again_as_its_card_says() -> None:
    cards = json.loads((make_weights.WEIGHTS / ABOUT).read_text())["agents"]
    assert sorted(cards) == sorted(MAIN_ITEM)
    for room_type, card in cards.items():
        config = composed("cell", "table=table3", f"column={COLUMN}", f"room={room_type}")
        assert command_of(asdict(config)) == card["command"]
