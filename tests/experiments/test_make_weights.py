"""The agents in the package are made again from nothing, or of what is finished, and one that fails stops no other."""

from __future__ import annotations

import json
from pathlib import Path

import make_weights
import pytest
import torch
from make_weights import COLUMN, page_of
from table3 import METHODS

from layoutrl.runs.pretrained import ABOUT, unpacked
from tests.experiments.builders import script


def test_agents_are_made_from_nothing_and_of_what_is_finished(tmp_path: Path, capsys, designed: str) -> None:
    assert COLUMN in METHODS.values()
    done = script("make_weights.py", "room=bathroom", designed, f"runs={tmp_path / 'runs'}", "weights=w", cwd=tmp_path)
    assert done.returncode == 1
    assert "bathroom failed: results: " in done.stderr  # where runs are given, nothing is trained
    done = script("make_weights.py", "room=bathroom", designed, "weights=w", "version=3", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    about = json.loads((tmp_path / "w" / ABOUT).read_text())
    assert about["version"] == 3
    card = about["agents"]["bathroom"]
    assert (card["updates"], card["seed"], card["data"]["rooms"], card["items"]["rooms"]) == (8, 0, 12, 6)
    assert card["command"].startswith(f"python experiments/cells.py table=table3 column={COLUMN} room=bathroom ")
    unpacked((tmp_path / "w" / card["file"]).read_bytes(), card, torch.device("cpu"))
    page = tmp_path / "w" / "agents.md"
    assert page.read_text() == page_of(about)
    (cell,) = (tmp_path / "results").rglob("*.json")
    kept = json.loads(cell.read_text())["rows"]["layouts"]
    assert card["measures"]["iou"] == kept["mean_iou"]
    assert card["measures"]["faultless"] == kept["faultless"]

    page.unlink()
    given = ["room=study,bathroom", f"results={tmp_path / 'results'}", "budget=smoke", f"runs={tmp_path / 'runs'}"]
    assert make_weights.main([*given, f"weights={tmp_path / 'w'}"]) == 1
    said = capsys.readouterr()
    assert said.err.startswith("study failed: results: ")
    assert said.out.startswith("bathroom: IoU ")
    assert json.loads((tmp_path / "w" / ABOUT).read_text()) == about
    assert page.is_file()


def test_a_version_that_is_no_number_is_answered_before_any_training(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(make_weights, "multirun", None)
    with pytest.raises(SystemExit, match=r"^error: version: expected a whole number; got x$"):
        make_weights.main(["version=x"])
