"""Cells are filled once, side by side; one failure costs one cell."""

from __future__ import annotations

import itertools
import json
import subprocess
import threading
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from typing import Any

import cell_trainings
import numpy as np
import pytest
from cell_config import folder_of, name_of
from cells import fill, stated
from hydra import compose, initialize_config_dir
from packing import METRES, packed, unpacked
from sweeps import cells_of, multirun, parsed_options

from layoutrl import InputError
from layoutrl.rivals.planit.training import Training
from layoutrl.runs import planit_training
from layoutrl.runs.checkpoints import checkpoints
from layoutrl.runs.config import TrainConfig, composed, config_directory, narrowed
from layoutrl.runs.monitor import watched
from tests.commands import script
from tests.experiments.builders import LITTLE, cell, configured


def test_a_filled_cell_is_not_filled_again_and_its_agent_not_trained_again(tmp_path, designed, monkeypatch, capsys):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")
    fill(config)
    file = folder_of(config) / f"{name_of(config)}.json"
    before = file.read_text()
    monkeypatch.setattr(cell_trainings.agent_training, "train", None)  # would fail
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


@pytest.mark.parametrize(("column", "others"), [("geometric", "another method.climbs, method.snap;"), ("rules", None)])
def test_what_a_kept_agent_does_not_say_is_as_it_was_before_there_was_that(column, others, tmp_path, designed):
    config = configured(tmp_path, designed, f"column={column}", "room=tatami")
    file, said = folder_of(config) / f"{name_of(config)}.json", stated(config)
    del said["method"]["climbs"], said["method"]["snap"]
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps({"config": said}))
    fill(config)
    error = file.with_suffix(".error")
    assert others in error.read_text() if others else not error.exists()


@pytest.mark.parametrize(
    ("column", "setting", "counts"),
    [
        ("annealer", "annealer.chains=8", True),
        ("rooms_package", "annealer.chains=8", False),
        ("search_long", "search.nodes=7", True),
        ("annealer", "search.nodes=7", False),
        ("search", "seconds_a_room.smoke=7", True),
        ("geometric", "seconds_a_room.smoke=7", False),
        ("rooms_pointer", "training_minutes.smoke=7", True),
        ("search", "training_minutes.smoke=7", False),
        ("rooms_planit", "planit.batch=7", True),
        ("rules", "planit.batch=7", False),
        ("planit", "planit_time=updates", True),
        ("rooms_planit", "planit_time=agent", False),
        ("planit", "budget.evaluation_rooms=7", True),
        ("rules", "budget.reports=7", False),
        ("geometric", "budget.evaluations=2", False),
    ],
)
def test_a_kept_cell_is_another_by_what_its_column_reads_alone(column, setting, counts, tmp_path, designed):
    config, other = (configured(tmp_path, designed, f"column={column}", *more) for more in ((), (setting,)))
    file = folder_of(config) / f"{name_of(config)}.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps({"config": stated(config)}))
    fill(other)
    error = file.with_suffix(".error")
    assert f"filled with another {setting.split('=')[0]};" in error.read_text() if counts else not error.exists()


def test_a_cell_that_nobody_knows_how_to_fill_is_refused(tmp_path):
    config = configured(tmp_path, "column=rules", "fill=guesses")
    with pytest.raises(InputError, match=r"^fill: expected one of agent, .*; got guesses$"):
        fill(config)
    assert not folder_of(config).exists()


def test_what_draws_nothing_is_filled_once_whatever_the_seed(tmp_path, designed, capsys):
    first, second = (configured(tmp_path, designed, "column=rules", "room=tatami", f"seed={seed}") for seed in (0, 1))
    for config in (first, second):
        fill(config)
    assert [path.name for path in folder_of(first).iterdir()] == ["tatami-own-rules-seed0.json"]
    assert "tatami-own-rules-seed1 left out: rules has one cell, seed 0" in capsys.readouterr().out


def test_the_designers_own_layouts_are_one_cell_whatever_the_seed(tmp_path, designed, capsys):
    fill(config := configured(tmp_path, designed, "table=table3", "column=designer", "room=tatami", "seed=1"))
    assert not folder_of(config).exists()
    assert "tatami-own-designer-seed1 left out: designer has one cell, seed 0" in capsys.readouterr().out


def test_what_interrupts_a_training_leaves_no_cell(tmp_path, designed, monkeypatch):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")

    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr("layoutrl.runs.training.watched", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fill(config)
    monkeypatch.undo()
    assert not list(folder_of(config).glob("*.json"))
    fill(config)
    assert cell(config)["updates"] == config.method.updates["smoke"]
    assert not list((tmp_path / "runs" / "tatami").glob("*unfinished*"))


def test_a_training_that_is_killed_goes_on(tmp_path, designed, monkeypatch):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami", "budget.evaluations=2")
    fill(config)
    whole = cell(config)

    def killed(*arguments: Any) -> Any:
        yield from itertools.islice(watched(*arguments), 1)
        raise KeyboardInterrupt

    again = replace(config, results=str(tmp_path / "again"), runs=str(tmp_path / "again"))
    monkeypatch.setattr("layoutrl.runs.training.watched", killed)
    with pytest.raises(KeyboardInterrupt):
        fill(again)
    monkeypatch.undo()
    (unfinished,) = (tmp_path / "again" / "tatami").glob("*unfinished")
    begun = []
    train = cell_trainings.agent_training.train
    monkeypatch.setattr(cell_trainings.agent_training, "train", lambda *a: begun.append(a[-1]) or train(*a))
    fill(again)
    assert begun == [unfinished]
    assert cell(again)["rows"] == whole["rows"]


def test_a_job_waits_for_another_that_trains_the_same(tmp_path, designed):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami")
    training = narrowed(config, TrainConfig)
    began, may_end, trained = threading.Event(), threading.Event(), []

    def train(training: Any, _: Any) -> Any:
        trained.append(training.name)
        began.set()
        assert may_end.wait(60)
        folder = tmp_path / "runs" / "tatami" / training.name
        folder.mkdir()
        return folder, {"updates": 7}

    with ThreadPoolExecutor() as pool:
        first = pool.submit(cell_trainings.trained_once, config, training, "what", train)
        assert began.wait(60)
        second = pool.submit(cell_trainings.trained_once, config, training, "what", train)
        assert not wait([second], timeout=0.2).done
        may_end.set()
        assert first.result() == second.result()
    assert len(trained) == 1


@pytest.mark.usefixtures("small_planit")
def test_planit_goes_on_where_its_updates_are_told(tmp_path, designed, monkeypatch):
    few = ("planit.updates={smoke: 4}", "budget.evaluations=2", "budget.reports=4", "budget.evaluation_rooms=1")
    config = configured(tmp_path, designed, "column=planit_long", "room=tatami", *few)
    fill(config)
    whole, train_on = cell(config), planit_training.reported

    def killed(*arguments: Any) -> Any:
        yield from itertools.islice(train_on(*arguments), 1)
        raise KeyboardInterrupt

    again = replace(config, results=str(tmp_path / "again"), runs=str(tmp_path / "again"))
    with monkeypatch.context() as patch:
        patch.setattr(planit_training, "reported", killed)
        with pytest.raises(KeyboardInterrupt):
            fill(again)
    (unfinished,) = (tmp_path / "again" / "tatami").glob("*unfinished")
    assert [checkpoint.updates for checkpoint in checkpoints(unfinished)] == [2]
    fill(again)
    assert not unfinished.exists()
    assert cell(again)["rows"] == whole["rows"]


@pytest.mark.usefixtures("small_planit")
def test_planit_goes_on_where_its_time_is_told(tmp_path, designed, monkeypatch):
    few = ("planit.updates={smoke: 6}", "budget.evaluations=3", "budget.reports=6", "budget.evaluation_rooms=1")
    config = configured(tmp_path, designed, "column=planit", "room=tatami", *few)
    now, update, train_on = [0.0], Training._update, planit_training.reported

    def a_second(training: Training) -> None:
        update(training)
        now[0] += 1

    def killed(*arguments: Any) -> Any:
        yield from itertools.islice(train_on(*arguments), 2)
        raise KeyboardInterrupt

    monkeypatch.setattr(Training, "_update", a_second)
    monkeypatch.setattr("item_columns.agent_seconds", lambda *_: 10.0)
    monkeypatch.setattr(cell_trainings, "clock_of", lambda _: lambda: now[0])
    with monkeypatch.context() as patch:
        patch.setattr(planit_training, "reported", killed)
        with pytest.raises(KeyboardInterrupt):
            fill(config)
    (unfinished,) = (tmp_path / "runs" / "tatami").glob("*unfinished")
    assert checkpoints(unfinished)[0].updates == 4
    fill(config)
    assert not unfinished.exists()
    assert cell(config)["updates"] == now[0] == 10


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
    assert multirun("table1", {"budget": "scene", "room": "tatami", "results": str(tmp_path)}) == 1
    assert len(runs) == 3
    assert runs[0][2:] == ["table=table1", "budget=scene", "room=tatami", f"results={tmp_path}"]


def test_a_sweep_that_is_killed_did_not_end_well_beside_one_that_did(tmp_path, monkeypatch):
    monkeypatch.setattr(subprocess, "run", lambda command, check: subprocess.CompletedProcess(command, -9))
    assert max(0, multirun("table1", {"budget": "scene", "room": "tatami", "results": str(tmp_path)})) > 0


def test_the_slurm_launchers_local_executor_fills_cells(tmp_path, designed):
    launcher = (
        "hydra/launcher=submitit_local",
        "hydra.launcher.timeout_min=5",
        "hydra.launcher.submitit_folder=jobs/%j",
    )
    where = f"results={tmp_path / 'results'}"
    done = script(
        "cells.py", "table=table1", "column=rules", "room=tatami", designed, *launcher, *LITTLE, where, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "smoke" / "table1" / "tatami-own-rules-seed0.json").exists()


def test_the_slurm_launcher_is_composed():
    with initialize_config_dir(str(config_directory()), version_base="1.3"):
        config = compose("cell", ["table=table1", "column=rules", "hydra/launcher=slurm"], return_hydra_config=True)
    assert config.hydra.launcher._target_.endswith("SlurmLauncher")
    assert config.hydra.launcher.max_num_timeout == 3


def test_arrays_survive_packing():
    values = np.random.default_rng(0).random((50, 2)).astype("f4")
    np.testing.assert_array_equal(unpacked(packed(values, METRES), METRES).reshape(-1, 2), values)


@pytest.mark.parametrize(
    ("argument", "answer"),
    [
        ("colum=geometric", r"^colum: unknown; .*of which column is nearest"),
        ("column=geometrix", r"^column: expected some of .*geometric.*; got geometrix$"),
        ("methodd.batch=8", r"^methodd\.batch: unknown; .*of which method\.batch is nearest"),
    ],
)
def test_a_wrong_option_of_a_table_is_answered_before_anything_is_swept(argument: str, answer: str) -> None:
    with pytest.raises(InputError, match=answer):
        parsed_options(["room=kitchen", argument])
    options = ["room=kitchen", "column=geometric,oracle", "method.batch=8", "floorplans=plans"]
    assert parsed_options(options, "floorplans")["room"] == "kitchen"


@pytest.mark.parametrize(
    "argument", ["floorplans=x", "designer_rooms=x", "task=bed", "scores=x", "version=3", "weights=x"]
)
def test_an_option_of_another_script_is_answered_before_anything_is_swept(argument: str) -> None:
    with pytest.raises(InputError, match=rf"^{argument.partition('=')[0]}: unknown; "):
        parsed_options([argument])
    assert parsed_options([argument], argument.partition("=")[0])


def test_cells_are_looked_for_where_they_are_filled_also_below_the_users_home(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    config = composed("cell", "table=table1", "column=rules", "runs='~/runs'", "results='~/here'")
    assert config.runs == f"{tmp_path}/runs"
    chosen = parsed_options(["results=~/here"])
    assert folder_of(config) == cells_of("table1", chosen) == tmp_path / "here/default/table1"
