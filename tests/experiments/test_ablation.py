"""What each part of the method is worth."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import ablation
import pytest

from tests import commands
from tests.experiments.builders import LITTLE

pytestmark = pytest.mark.usefixtures("content_furnisher")


def test_ablation_trains_every_change_on_every_seed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ablation, "KEPT", tmp_path / "results")
    monkeypatch.setattr("subprocess.run", commands.run)
    few = [*LITTLE, "data.train_rooms=6", "data.test_rooms=2"]
    changes = {"as it is": few, "no slides": [*few, "method.slide=false"]}
    monkeypatch.setattr(ablation, "CHANGES", {"item": changes, "room": {"no slides": [*few, "reward=usable"]}})
    monkeypatch.setattr(ablation, "ALWAYS", {"item": [], "room": ["scope=room"]})
    monkeypatch.setenv("HOME", str(tmp_path))
    arguments = ["ablation.py", "tatami", "--updates=5", "--seeds", "0", "1", "--runs=~"]
    monkeypatch.setattr("sys.argv", arguments)
    ablation.main()
    checkpoints = sorted(tmp_path.glob("tatami/*/config.yaml"))
    assert [path.parent.name for path in checkpoints] == [
        "as-it-is-5-seed0", "as-it-is-5-seed1", "no-slides-5-seed0", "no-slides-5-seed1",
    ]  # fmt: skip
    result = json.loads((tmp_path / "results" / "tatami.json").read_text())
    assert ablation.table(result).markdown() in capsys.readouterr().out
    rows = result["rows"]
    assert rows["as it is"]["ceiling"] > rows["no slides"]["ceiling"]
    first, second = rows["no slides"]["iou_by_seed"]
    assert rows["no slides"]["mean_iou"] == pytest.approx((first + second) / 2)
    written = [path.stat().st_mtime for path in checkpoints]

    (tmp_path / "tatami" / "no-slides-5-seed1" / "evaluation.json").unlink()  # as if it had been interrupted
    ablation.main()
    assert [path.stat().st_mtime for path in checkpoints[:3]] == written[:3]
    assert json.loads((tmp_path / "results" / "tatami.json").read_text())["rows"] == rows
    assert "going on after" in (tmp_path / "tatami-no-slides-5-seed1.log").read_text()

    changes["no slides"].append("method.snap=0.002")
    with pytest.raises(SystemExit) as ended:
        ablation.main()
    assert str(ended.value).endswith("seed0 was trained with another method.snap; expected another --runs")
    changes["no slides"].pop()

    lost = tmp_path / "tatami" / "no-slides-5-seed1"
    for file in lost.glob("*"):  # as if it had been killed before it had its configuration
        shutil.rmtree(file) if file.is_dir() else file.unlink()
    ablation.main()
    assert json.loads((tmp_path / "results" / "tatami.json").read_text())["rows"] == rows
    assert (tmp_path / "tatami" / "no-slides-5-seed1-2" / "evaluation.json").exists()

    monkeypatch.setattr("sys.argv", [*arguments[:2], "--scope=room", *arguments[2:4], "0", arguments[-1]])
    ablation.main()
    whole = json.loads((tmp_path / "results" / "tatami-rooms.json").read_text())
    assert "faultless" in ablation.table(whole).markdown()
    assert 0 <= whole["rows"]["no slides"]["faultless"] <= 1
    assert "theta4: -100" in (tmp_path / "tatami" / "no-slides-rooms-5-seed0" / "config.yaml").read_text()

    monkeypatch.setattr("sys.argv", [*arguments[:2], "--updates=6", *arguments[3:]])
    with pytest.raises(
        SystemExit, match=r"error: .*tatami\.json is of other updates; expected the same, or to be moved"
    ):
        ablation.main()

    monkeypatch.setattr("sys.argv", arguments)
    nothing = {"nothing to learn": ["budget=smoke", "data.train_rooms=0"]}
    monkeypatch.setattr(ablation, "CHANGES", {"item": nothing})
    with pytest.raises(SystemExit, match=r"error: .*: was not trained; .*nothing-to-learn-5-seed0\.log says why"):
        ablation.main()


@pytest.mark.parametrize("option", ["--updates", "--jobs"])
def test_a_count_below_one_is_answered_in_a_line(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["ablation.py", "tatami", f"{option}=0"])
    monkeypatch.setattr(ablation, "composed", None)  # before anything is done
    with pytest.raises(SystemExit, match=f"^error: {option}: expected 1 or more; got 0$"):
        ablation.main()
