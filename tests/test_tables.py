"""Cells of the tables: filled once, side by side, from the same starts; one failure costs one cell. What is printed."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cells
import columns
import numpy as np
import pytest
import table1
import worst_rooms
from cells import fill, packed, unpacked
from columns import CellConfig, folder_of, name_of
from hydra import compose, initialize_config_dir
from printing import NOT_RUN, Table, row, write

from layoutrl.config import DataConfig, composed, config_directory
from layoutrl.errors import InputError
from layoutrl.evaluation.budgets import updates_budget
from layoutrl.monitor import watched
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room

EXPERIMENTS = Path(cells.__file__).parent
LITTLE = ("budget=smoke", "data.train_rooms=12", "data.test_rooms=6")
REAL = EXPERIMENTS.parents[1] / "shared" / "data"


@pytest.fixture(scope="module")
def designed(tmp_path_factory: pytest.TempPathFactory) -> str:
    return f"data.root={tmp_path_factory.mktemp('designed')}"


def configured(folder: Path, *overrides: str) -> CellConfig:
    return composed(
        "cell", "table=table1", *LITTLE, f"results={folder / 'results'}", f"runs={folder / 'runs'}", *overrides
    )


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
    another = configured(tmp_path, designed, "column=paper", "room=tatami", "seed=1", "method.max_moves=3")
    settings = [columns.setting_of(config, "cpu") for config in (agent, another)]
    np.testing.assert_array_equal(settings[0].starts, settings[1].starts)
    np.testing.assert_allclose(
        unpacked(rules["random start"]["place"], cells.METRES).reshape(-1, 2), settings[0].starts, atol=1e-5
    )
    assert cell(regressor)["training_seconds"] == found["training_seconds"]


def test_a_filled_cell_is_not_filled_again_and_its_agent_not_trained_again(tmp_path, designed, monkeypatch, capsys):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")
    fill(config)
    file = folder_of(config) / f"{name_of(config)}.json"
    before = file.read_text()
    monkeypatch.setattr(columns.training_entry, "train", None)  # would fail
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
    assert not list((tmp_path / "runs" / "tatami").glob("*unfinished*"))


def test_a_training_that_is_killed_goes_on_and_two_jobs_do_not_share_one(tmp_path, designed, monkeypatch):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami", "method.updates={smoke: 8}")
    fill(config)
    whole = cell(config)

    def killed(*arguments: Any) -> Any:
        yield from itertools.islice(watched(*arguments), 1)
        raise KeyboardInterrupt

    again = replace(config, results=str(tmp_path / "again"), runs=str(tmp_path / "again"))
    monkeypatch.setattr("layoutrl.train.watched", killed)
    with pytest.raises(KeyboardInterrupt):
        fill(again)
    monkeypatch.undo()
    (unfinished,) = (tmp_path / "again" / "tatami").glob("*unfinished")
    saved = {file.name for file in (unfinished / "checkpoints").iterdir()}
    with columns.alone(unfinished.with_name(unfinished.name.replace("-unfinished", ".lock"))) as mine:
        assert mine
        fill(again)  # elsewhere, since another job may be writing there
    assert {file.name for file in (unfinished / "checkpoints").iterdir()} == saved
    assert cell(again)["rows"] == whole["rows"]
    (folder_of(again) / f"{name_of(again)}.json").unlink()
    (finished,) = (tmp_path / "again" / "tatami").glob("*seed0")
    shutil.rmtree(finished)
    begun = []
    train = columns.training_entry.train
    monkeypatch.setattr(columns.training_entry, "train", lambda *a: begun.append(a[-1]) or train(*a))
    fill(again)
    assert begun == [unfinished]
    assert cell(again)["rows"] == whole["rows"]


def test_planit_is_scored_in_the_same_rooms_and_trained_for_as_long(tmp_path, designed, monkeypatch):
    few = ("room=tatami", "budget.evaluation_rooms=1")
    fill(configured(tmp_path, designed, "column=planit", *few))
    config = configured(tmp_path, designed, "column=planit", *few)
    error = folder_of(config) / f"{name_of(config)}.error"
    assert "planit trains for as long as geometric, which is not done" in error.read_text()
    for seed in (0, 1):
        fill(configured(tmp_path, designed, "column=geometric", "room=tatami", f"seed={seed}"))
    asked = []

    def budget(seconds, clock):
        asked.append((seconds, clock))
        return updates_budget(2)

    monkeypatch.setattr(columns, "seconds_budget", budget)
    fill(config)
    longer = configured(tmp_path, designed, "column=planit_long", "planit.updates={smoke: 3}", *few)
    fill(longer)
    agent, found = cell(replace(config, column="geometric")), cell(config)
    second = cell(replace(config, column="geometric", seed=1))
    seconds = pytest.approx((agent["training_seconds"] + second["training_seconds"]) / 2)
    assert asked == [(seconds, time.process_time)]  # of other work on the machine nothing counts
    assert found["updates"] == 2
    assert cell(longer)["updates"] == 3
    for words in table1.PLANIT_ROWS:
        numbers = found["rows"][words]
        iou = unpacked(numbers["iou"], cells.IOU) / 65535
        assert iou.mean() == pytest.approx(numbers["mean_iou"], abs=1e-4)
        assert numbers["group"] == agent["rows"]["agent"]["group"]
        assert len(iou) == found["rooms"] == agent["rooms"]
    drawn = found["rows"][cells.PLANIT]
    boxes = unpacked(drawn["box"], cells.METRES).reshape(-1, 4)
    assert np.isnan(boxes).any(1).mean() == pytest.approx(drawn["missing"])
    one, every = table1.planit_tables(folder_of(config))
    assert [line[0] for line in one.lines] == ["tatami", "tatami, 3,000 updates"]
    assert every.lines[1][3] == "3"


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
            folder = tmp_path / "scene" / "table1"
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{len(runs)}.json").touch()
        return subprocess.CompletedProcess(command, next(statuses))

    monkeypatch.setattr(subprocess, "run", dies)
    assert cells.multirun("table1", {"budget": "scene", "room": "tatami", "results": str(tmp_path)}) == 1
    assert len(runs) == 3
    assert runs[0][2:] == ["table=table1", "budget=scene", "room=tatami", f"results={tmp_path}"]


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
    setting = columns.setting_of(config, "cpu")
    assert setting.training == setting.simulator.rooms
    assert len(setting.training) == 1
    assert len(setting.starts) == 16
    assert len(np.unique(setting.starts, axis=0)) == 16
    other = columns.setting_of(replace(config, seed=1), "cpu")
    assert other.training != setting.training
    with pytest.raises(InputError, match="expected a scene, 0 to 5; got 6"):
        columns.setting_of(replace(config, seed=6), "cpu")


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
        tasks[trained_on] = columns.setting_of(config, "cpu")
    real, designed, both = (tasks[name].training for name in ("own", "designer", "both"))
    assert both == designed + real
    assert len(designed) == 12
    held_out = {room.group for room in tasks["own"].simulator.rooms}
    for task in tasks.values():
        assert {room.group for room in task.simulator.rooms} == held_out
        assert not held_out & {room.group for room in task.training}
        np.testing.assert_array_equal(task.starts, tasks["own"].starts)


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real rooms are not in {REAL}")
def test_the_tables_scripts_fill_and_print_what_is_asked_of_them(tmp_path, designed):
    roots = [f"{source}={REAL / source}" for source in ("designer_rooms", "floorplans")]
    real = script("real_rooms.py", *roots, "task=platform", "trained_on=own", cwd=tmp_path)
    assert real.returncode == 0, real.stderr
    cells_of_platforms = sorted(path.name for path in (tmp_path / "results" / "smoke" / "real").iterdir())
    assert cells_of_platforms == [
        f"tatami-platform-designer_rooms-snapped-own-{column}-seed0.json" for column in ("geometric", "rules", "scorer")
    ]
    platform = next(line for line in real.stdout.splitlines() if line.startswith("| platform"))
    assert platform.count("not run") == 3  # trained on designed rooms, on both, and the best of three of these
    assert "| -" in platform  # the hand rule is for bathtubs

    scenes = script("table2.py", "column=geometric", "room=tatami,study", "seed=0", designed, cwd=tmp_path)
    assert scenes.returncode == 0, scenes.stderr
    assert "Table 2, 16 random starts" in scenes.stdout
    tatami = next(line for line in scenes.stdout.splitlines() if line.startswith("| tatami"))
    assert tatami.split(" | ")[1] == "0.949 ± 0.009"
    assert tatami.count("not run") == 4


def test_the_worst_rooms_are_drawn_and_explained(tmp_path, designed, monkeypatch, capsys):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")
    fill(config)
    root = f"--root={config.data.root}"
    arguments = ["worst_rooms.py", name_of(config), "--budget=smoke", root, f"--results={tmp_path / 'results'}"]
    monkeypatch.setattr("sys.argv", arguments)
    capsys.readouterr()
    worst_rooms.main()
    assert (tmp_path / "results" / "smoke" / "worst" / f"{name_of(config)}.png").stat().st_size > 10_000
    counts = dict(re.findall(r"  ([a-z ]+?) +(\d+) rooms", capsys.readouterr().out))
    assert sum(map(int, counts.values())) == 6
    monkeypatch.setattr("sys.argv", [*arguments, "--table=table9"])
    with pytest.raises(SystemExit, match="no such cell"):
        worst_rooms.main()


def test_why_a_room_failed(tmp_path):
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.6), (2.0, 1.5)))
    config = replace(configured(tmp_path, "column=geometric"), data=DataConfig("json"))
    assert worst_rooms.why(room, np.array([2.2, 1.5]), True, config) == "imprecise"
    assert worst_rooms.why(room, np.array([2.2, 1.7]), True, config) == "knew better"
    assert worst_rooms.why(room, np.array([2.2, 1.7]), False, config) == "wrong place"


def test_rooms_are_told_apart_by_what_the_plan_calls_them():
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.6), (2.0, 1.5)))
    assert worst_rooms.kind_of(replace(room, id="00/02/0001#washing_room-2")) == "washing_room"
    assert worst_rooms.kind_of(replace(room, id="b-17")) == ""


def test_a_script_says_what_it_expects(tmp_path):
    assert "Table 1 of Di & Yu" in script("table1.py", "--help", cwd=tmp_path).stdout
    wrong = script("table1.py", "smoke", cwd=tmp_path)
    assert wrong.returncode != 0
    assert wrong.stderr == "error: smoke: expected options as name=value; --help says which\n"
    assert not (tmp_path / "results").exists()


def test_the_slurm_launcher_is_composed():
    with initialize_config_dir(str(config_directory()), version_base="1.3"):
        config = compose("cell", ["table=table1", "column=rules", "hydra/launcher=slurm"], return_hydra_config=True)
    assert config.hydra.launcher._target_.endswith("SlurmLauncher")
    assert config.hydra.launcher.cpus_per_task == 2


OURS = (("rules,oracle", 8, 3), ("geometric", 8, 3), ("regressor", 8, 3))
RIVALS = ("planit,planit_long", 8, 1)


@pytest.mark.parametrize(("chosen", "gpu", "expected"), [
    ({}, True, [*OURS, RIVALS, ("planit", 2, 2), ("paper", 8, 3)]),
    ({}, False, [*OURS, RIVALS, ("planit", 2, 2), ("paper", 2, 1)]),
    ({"room": "kitchen"}, False, [*((columns, 1, seeds) for columns, _, seeds in OURS), ("planit,planit_long", 1, 1)]),
    ({"seed": "1"}, False, [(column, rooms, 1) for column, rooms, _ in (*OURS, RIVALS, ("paper", 2, 1))]),
    ({"column": "paper"}, False, [("paper", 8, 3)]),
])  # fmt: skip
def test_table_1_trains_the_papers_network_where_there_is_a_gpu(chosen, gpu, expected, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: gpu)
    sweeps = table1.stages(chosen)
    found = [(sweep["column"], len(sweep["room"].split(",")), len(sweep["seed"].split(","))) for sweep in sweeps]
    assert found == expected


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
        config = {"protocol": "unseen", "seed": seed, "fold": 0}
        cell = {"rows": {"agent": numbers}, "config": config, "ceiling": 0.9}
        (tmp_path / f"study-own-geometric-seed{seed}.json").write_text(json.dumps(cell))
    found = row(tmp_path, "study-own-geometric")
    assert found
    assert found.mean == pytest.approx(0.75, abs=1e-4)
    assert found.text() == f"0.750 ± {np.std([0.5, 1.0, 0.75, 0.7, 1.0, 0.55]):.3f}"
    assert found.error_over_seeds() == "0.0000"
    assert found.number("overlap") == pytest.approx(0.05)
    low, high = map(float, found.interval().split(" to "))
    assert 0.6 <= low < 0.75 < high <= 1
    assert found.ceiling() == "0.900"
    assert row(tmp_path, "study-own-paper") is None
    assert row(tmp_path, "study-own-geometric", "hand rule") is None
    cell["config"] |= {"seed": 2, "fold": 3}
    (tmp_path / "study-own-geometric-seed2.json").write_text(json.dumps(cell))
    with pytest.raises(InputError, match="cells of different fold"):
        row(tmp_path, "study-own-geometric")


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
