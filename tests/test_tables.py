"""Cells of the tables: filled once, side by side, from the same starts; one failure costs one cell. What is printed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cells
import numpy as np
import pytest
from cells import CellConfig, fill, folder_of, name_of, packed, unpacked
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from printing import NOT_RUN, Table, row, write

from layoutrl.config import config_directory

EXPERIMENTS = Path(cells.__file__).parent
LITTLE = ("budget=smoke", "data.train_rooms=12", "data.test_rooms=6")
REAL = EXPERIMENTS.parents[1] / "shared" / "data"


@pytest.fixture(scope="module")
def designed(tmp_path_factory: pytest.TempPathFactory) -> str:
    return f"data.root={tmp_path_factory.mktemp('designed')}"


def configured(folder: Path, *overrides: str) -> CellConfig:
    with initialize_config_dir(str(config_directory()), version_base="1.3"):
        places = (f"results={folder / 'results'}", f"runs={folder / 'runs'}")
        config = compose("cell", ["table=table1", *LITTLE, *places, *overrides])
    return OmegaConf.to_object(config)  # type: ignore[return-value]


def cell(config: CellConfig) -> dict[str, Any]:
    return json.loads((folder_of(config) / f"{name_of(config)}.json").read_text())


def script(name: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(EXPERIMENTS.parent), "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, str(EXPERIMENTS / name), *LITTLE, f"results={cwd / 'results'}", *arguments],
        cwd=cwd, env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip


def test_a_cell_says_where_it_comes_from_and_every_column_starts_from_the_same_places(tmp_path, designed, capsys):
    agent = configured(tmp_path, designed, "column=geometric", "room=tatami")
    for config in (agent, configured(tmp_path, designed, "column=rules", "room=tatami")):
        fill(config)
    regressor = configured(tmp_path, designed, "column=regressor", "room=tatami")
    fill(regressor)
    assert "tatami-own-geometric-seed0 done" in capsys.readouterr().out
    found = cell(agent)
    assert found["rooms"] == 6
    assert found["training_rooms"] == 12
    assert found["config"]["method"]["name"] == "geometric"
    assert found["machine"]["torch"]
    assert set(found["rows"]) == {"agent", "best of 3", "random starts"}
    assert len(unpacked(found["rows"]["random starts"]["iou"], cells.IOU)) == 16
    for numbers in found["rows"].values():
        iou = unpacked(numbers["iou"], cells.IOU) / 65535
        assert iou.mean() == pytest.approx(numbers["mean_iou"], abs=1e-4)
    best = unpacked(found["rows"]["best of 3"]["iou"], cells.IOU)
    assert (best >= unpacked(found["rows"]["agent"]["iou"], cells.IOU)).all()
    rules = cell(replace(agent, column="rules"))["rows"]
    assert rules["designer"]["mean_iou"] == 1
    assert rules["designer"]["blocked"] == 0
    another = configured(tmp_path, designed, "column=geometric", "room=tatami", "seed=1", "method.max_moves=3")
    tasks = [cells.task_of(config, "cpu") for config in (agent, another)]
    np.testing.assert_array_equal(tasks[0].starts, tasks[1].starts)
    np.testing.assert_allclose(
        unpacked(rules["random start"]["place"], cells.METRES).reshape(-1, 2), tasks[0].starts, atol=1e-5
    )
    assert cell(regressor)["training_seconds"] == found["training_seconds"]


def test_a_filled_cell_is_not_filled_again_and_its_agent_not_trained_again(tmp_path, designed, monkeypatch, capsys):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")
    fill(config)
    file = folder_of(config) / f"{name_of(config)}.json"
    before = file.read_text()
    monkeypatch.setattr(cells.training_entry, "train", None)  # would fail
    fill(config)
    assert file.read_text() == before
    assert "begins" in capsys.readouterr().out.split("done")[0]
    fill(configured(tmp_path, designed, "column=geometric", "room=tatami", "method.discount=0.5", "device=cpu"))
    error = folder_of(config) / f"{name_of(config)}.error"
    assert "filled with another method.discount; expected a new folder" in error.read_text()
    assert file.read_text() == before
    fill(config)
    assert not error.exists()
    file.unlink()
    fill(config)
    again = json.loads(file.read_text())
    assert again["rows"] == json.loads(before)["rows"]
    for column in ("rules", "oracle"):  # they know no seed: the first is enough
        other = replace(config, column=column, fill=column, seed=1)
        fill(other)
        assert not (folder_of(other) / f"{name_of(other)}.json").exists()


def test_what_interrupts_a_training_leaves_no_cell(tmp_path, designed, monkeypatch):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")

    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr("layoutrl.train.watched", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fill(config)
    monkeypatch.undo()
    assert not list(folder_of(config).glob("*.json"))
    fill(config)
    assert cell(config)["updates"] == config.method.updates["smoke"]
    assert sorted(path.name.split("-")[-1] for path in (tmp_path / "runs" / "tatami").iterdir()) == [
        "interrupted",
        "seed0",
    ]


def test_cells_run_side_by_side_and_one_that_fails_stops_no_other(tmp_path, designed):
    both = ("room=tatami,kitchen", "seed=0", designed, "room.item=platform")  # no kitchen has one
    done = script("table1.py", "column=geometric,rules", *both, cwd=tmp_path)
    assert done.returncode == 1
    assert "kitchen-platform-own-geometric-seed0 failed: error: room.item" in done.stderr
    folder = tmp_path / "results" / "smoke" / "table1"
    assert {path.name for path in folder.glob("*.json")} == {
        f"tatami-platform-own-{column}-seed0.json" for column in ("geometric", "rules")
    }
    assert len(list(folder.glob("*.error"))) == 2
    assert "Table 1" in done.stdout
    assert (folder.parent / "table1.md").exists()


def test_jobs_that_died_with_another_begin_again_while_that_helps(tmp_path, monkeypatch):
    """A job that is killed for its memory, say, each time after others were finished."""
    statuses, runs = iter([1, 1, 1]), []

    def dies(command: list[str], check: bool) -> subprocess.CompletedProcess[str]:
        runs.append(command)
        if len(runs) < 3:
            folder = tmp_path / "default" / "table1"
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{len(runs)}.json").touch()
        return subprocess.CompletedProcess(command, next(statuses))

    monkeypatch.setattr(subprocess, "run", dies)
    assert cells.multirun("table1", {"column": "rules", "room": "study"}, [f"results={tmp_path}", "room=tatami"]) == 1
    assert len(runs) == 3
    assert runs[0][2:] == ["table=table1", "column=rules", "room=tatami", f"results={tmp_path}"]


def test_the_regressor_waits_for_the_agent_whose_time_it_gets(tmp_path, designed):
    config = configured(tmp_path, designed, "column=regressor", "room=tatami")
    fill(config)
    assert "as long as geometric" in (folder_of(config) / f"{name_of(config)}.error").read_text()


def test_the_slurm_launchers_local_executor_fills_cells(tmp_path, designed):
    launcher = (
        "hydra/launcher=submitit_local",
        "hydra.launcher.timeout_min=5",
        "hydra.launcher.submitit_folder=jobs/%j",
    )
    done = script("cells.py", "table=table1", "column=rules", "room=tatami", designed, *launcher, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "smoke" / "table1" / "tatami-own-rules-seed0.json").exists()


def test_one_scene_is_trained_and_tested_in(tmp_path, designed):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami", "protocol=scene", "seed=2")
    task = cells.task_of(config, "cpu")
    assert task.training == task.simulator.rooms
    assert len(task.training) == 1
    assert len(task.starts) == 16
    assert len(np.unique(task.starts, axis=0)) == 16
    other = cells.task_of(replace(config, seed=1), "cpu")
    assert other.training != task.training


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real rooms are not in {REAL}")
def test_real_rooms_are_trained_on_alone_and_beside_designed_ones(tmp_path):
    tasks = {}
    for trained_on in ("own", "designer", "both"):
        config = configured(
            tmp_path,
            "task=platform",
            f"data.root={REAL / 'designer_rooms'}",
            "column=geometric",
            f"trained_on={trained_on}",
        )
        tasks[trained_on] = cells.task_of(config, "cpu")
    real, designed, both = (tasks[name].training for name in ("own", "designer", "both"))
    assert both == designed + real
    assert len(designed) == 12
    held_out = {room.group for room in tasks["own"].simulator.rooms}
    for task in tasks.values():
        assert {room.group for room in task.simulator.rooms} == held_out
        assert not held_out & {room.group for room in task.training}
        np.testing.assert_array_equal(task.starts, tasks["own"].starts)


def test_arrays_survive_packing():
    values = np.random.default_rng(0).random((50, 2)).astype("f4")
    np.testing.assert_array_equal(unpacked(packed(values, cells.METRES), cells.METRES).reshape(-1, 2), values)


def test_a_row_joins_seeds_and_one_that_is_missing_is_none(tmp_path):
    for seed, ious in enumerate(([0.5, 1.0, 0.75], [0.7, 1.0, 0.55])):
        numbers = {
            "iou": packed(np.round(np.array(ious) * 65535), cells.IOU),
            "group": packed([0, 1, 2], cells.INDEX),
            "overlap": 0.1 * seed,
        }
        (tmp_path / f"study-own-geometric-seed{seed}.json").write_text(json.dumps({"rows": {"agent": numbers}}))
    found = row(tmp_path, "study-own-geometric")
    assert found
    assert found.mean == pytest.approx(0.75, abs=1e-4)
    assert found.text() == f"0.750 ± {np.std([0.5, 1.0, 0.75, 0.7, 1.0, 0.55]):.3f}"
    assert found.error_over_seeds() == "0.0000"
    assert found.number("overlap") == pytest.approx(0.05)
    low, high = map(float, found.interval().split(" to "))
    assert 0.6 <= low < 0.75 < high <= 1
    assert row(tmp_path, "study-own-paper") is None


def test_tables_are_written_in_three_formats(tmp_path):
    table = Table("Means", ("", "IoU >= 0.9"), [("living_room", "0.9 ± 0.1, 5%"), ("study", NOT_RUN)])
    write([table], tmp_path / "out" / "table")
    assert (tmp_path / "out" / "table.md").read_text().splitlines()[2:] == [
        "|  | IoU >= 0.9 |", "| --- | --- |", "| living_room | 0.9 ± 0.1, 5% |", "| study | not run |"
    ]  # fmt: skip
    assert (tmp_path / "out" / "table.csv").read_text().splitlines()[2] == 'living_room,"0.9 ± 0.1, 5%"'
    tex = (tmp_path / "out" / "table.tex").read_text()
    assert r"living\_room & 0.9 $\pm$ 0.1, 5\% \\" in tex
    assert tex.count(r"\begin") == tex.count(r"\end") == 2
