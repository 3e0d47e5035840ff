"""Every column of one item is scored in the same rooms, from the same places."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import replace
from pathlib import Path

import item_columns
import numpy as np
import pytest
import table1
from cell_config import PLANIT, folder_of, name_of
from cells import fill
from packing import METRES, unpacked, unpacked_iou

from layoutrl import InputError
from layoutrl.rivals.budgets import updates_budget
from layoutrl.runs import planit_training
from tests.experiments.builders import REAL, cell, configured


@pytest.fixture(scope="module")
def agent_folder(designed: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where an agent was trained in one type, and its cell filled."""
    folder = tmp_path_factory.mktemp("agent")
    fill(configured(folder, designed, "column=geometric", "room=tatami"))
    return folder


@pytest.fixture
def filled(agent_folder: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(agent_folder, tmp_path / "filled"))


def test_a_cell_says_where_it_comes_from_and_every_column_starts_from_the_same_places(tmp_path, designed, capsys):
    agent = configured(tmp_path, designed, "column=geometric", "room=tatami")
    for config in (agent, configured(tmp_path, designed, "column=rules", "room=tatami")):
        fill(config)
    for column in ("regressor", "pointer"):
        fill(configured(tmp_path, designed, f"column={column}", "room=tatami"))
    assert "tatami-own-geometric-seed0 done" in capsys.readouterr().out
    found = cell(agent)
    assert found["rooms"] == 6
    assert found["training_rooms"] == 12
    assert found["config"]["method"]["name"] == "geometric"
    assert found["machine"]["torch"]
    assert set(found["rows"]) == {"agent", "best of 3", "random starts"}
    assert len(unpacked_iou(found["rows"]["random starts"]["iou"])) == 16
    for numbers in found["rows"].values():
        iou = unpacked_iou(numbers["iou"])
        assert iou.mean() == pytest.approx(numbers["mean_iou"], abs=1e-4)
    best = unpacked_iou(found["rows"]["best of 3"]["iou"])
    assert (best >= unpacked_iou(found["rows"]["agent"]["iou"])).all()
    rules = cell(replace(agent, column="rules"))["rows"]
    another = configured(tmp_path, designed, "column=paper", "room=tatami", "seed=1", "method.max_moves=3")
    settings = [item_columns.setting_of(config, "cpu") for config in (agent, another)]
    np.testing.assert_array_equal(settings[0].starts, settings[1].starts)
    np.testing.assert_allclose(
        unpacked(rules["random start"]["place"], METRES).reshape(-1, 2), settings[0].starts, atol=1e-5
    )
    for column in ("regressor", "pointer"):
        assert cell(replace(agent, column=column))["training_seconds"] == found["training_seconds"]


def test_what_the_rule_costs_that_an_illegal_move_ends_a_test(tmp_path, designed):
    longer = ("method.updates={smoke: 24}", "method.batch=128", "method.evaluation_moves=30")  # else no move is illegal
    masking, stopping = (
        configured(tmp_path / rule, designed, "column=geometric", "room=tatami", f"method.on_illegal={rule}", *longer)
        for rule in ("mask", "stop")
    )
    for config in (masking, stopping):
        fill(config)
    masked, stopped = cell(masking)["rows"], cell(stopping)["rows"]
    assert stopped["illegal moves masked"] == masked["agent"]
    assert stopped["agent"]["place"] != masked["agent"]["place"]
    assert "illegal moves masked" not in masked


@pytest.mark.parametrize("column", ["regressor", "pointer", "scorer"])
def test_the_supervised_are_trained_for_as_long_as_the_agent(column, filled, designed, monkeypatch):
    config = configured(filled, designed, f"column={column}", "room=tatami")
    asked, made = [], []

    def budget(seconds, clock):
        def spent(updates):
            made.append(updates)
            return updates / 3

        asked.append((seconds, clock))
        return spent

    monkeypatch.setattr(item_columns, "seconds_budget", budget)
    fill(config)
    assert asked == [(cell(replace(config, column="geometric"))["training_seconds"], time.process_time)]
    assert made == [0, 1, 2, 3]


def test_the_regressor_is_refused_without_the_agent_whose_time_it_gets(agent_folder, tmp_path, designed):
    config = configured(tmp_path, designed, "column=regressor", "room=tatami")
    error = folder_of(config) / f"{name_of(config)}.error"
    fill(config)
    assert "as long as geometric" in error.read_text()
    shutil.copytree(agent_folder, tmp_path, dirs_exist_ok=True)
    fill(configured(tmp_path, designed, "column=regressor", "room=tatami", "data.test_rooms=5"))
    assert "cells of different data.test_rooms cannot be compared" in error.read_text()
    agent = folder_of(config) / "tatami-own-geometric-seed0.json"
    agent.with_name("tatami-own-geometric-seed1.error").write_text("began and did not end")
    fill(config)
    assert "as long as geometric, which is not done" in error.read_text()
    agent.with_name("tatami-own-geometric-seed1.error").unlink()
    elsewhere = json.loads(agent.read_text())
    elsewhere["trained_on_machine"]["gpu"] = "a GPU"
    agent.write_text(json.dumps(elsewhere))
    fill(config)
    assert "geometric was trained on a GPU; expected it, got a CPU" in error.read_text()


def test_planit_is_refused_before_it_is_trained(tmp_path, designed, monkeypatch):
    config = configured(tmp_path, designed, "column=planit_long", "room=tatami")
    usable = planit_training.usable
    monkeypatch.setattr(planit_training, "usable", lambda training, held_out: usable(training, held_out[1:]))
    monkeypatch.setattr(planit_training, "train", None)
    fill(config)
    assert "scored in all rooms or none" in (folder_of(config) / f"{name_of(config)}.error").read_text()


@pytest.mark.usefixtures("small_planit")
def test_planit_is_scored_in_the_same_rooms_and_trained_for_as_long(tmp_path, designed, monkeypatch):
    few = ("room=tatami", "budget.evaluation_rooms=1", "data.test_rooms=2")
    fill(configured(tmp_path, designed, "column=planit", *few))
    config = configured(tmp_path, designed, "column=planit", *few)
    error = folder_of(config) / f"{name_of(config)}.error"
    assert "planit trains for as long as geometric, which is not done" in error.read_text()
    for seed in (0, 1):
        fill(configured(tmp_path, designed, "column=geometric", f"seed={seed}", *few))
    asked = []

    def budget(seconds, clock):
        asked.append((seconds, clock))
        return updates_budget(2)

    monkeypatch.setattr("cell_trainings.seconds_budget", budget)
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
        iou = unpacked_iou(numbers["iou"])
        assert iou.mean() == pytest.approx(numbers["mean_iou"], abs=1e-4)
        assert numbers["group"] == agent["rows"]["agent"]["group"]
        assert len(iou) == found["rooms"] == agent["rooms"]
    drawn = found["rows"][PLANIT]
    boxes = unpacked(drawn["box"], METRES).reshape(-1, 4)
    assert np.isnan(boxes).any(1).mean() == pytest.approx(drawn["missing"])
    file = folder_of(config) / f"{name_of(config)}.json"
    before = file.read_text()
    file.unlink()
    monkeypatch.setattr("cell_trainings.seconds_budget", None)  # it is not trained again
    fill(config)
    assert cell(config)["rows"] == json.loads(before)["rows"]
    trained, *tables = table1.planit_tables(folder_of(config), ["study", "tatami"])
    assert [line[:3] for line in trained.lines] == [
        ["tatami", "agent's minutes", "1"],
        ["tatami", "fixed updates", "1"],
    ]
    assert trained.lines[1][-1] == "3"
    assert [table.name for table in tables] == [
        f"planit-{what}-{choice}" for choice in ("argmax", "sampled") for what in ("item", "rooms")
    ]
    by_told = {
        record["told"]: record["mean_iou"] for record in tables[2].records if record["trained"] != "fixed updates"
    }
    assert by_told["given graph, own size"] == pytest.approx(
        found["rows"]["given graph, sampled, own size"]["mean_iou"], abs=1e-4
    )


def test_one_scene_is_trained_and_tested_in(tmp_path, designed):
    config = configured(tmp_path, designed, "column=geometric", "room=tatami", "protocol=scene", "seed=2")
    setting = item_columns.setting_of(config, "cpu")
    assert setting.training == setting.simulator.rooms
    assert len(setting.training) == 1
    assert len(setting.starts) == 16
    assert len(np.unique(setting.starts, axis=0)) == 16
    other = item_columns.setting_of(replace(config, seed=1), "cpu")
    assert other.training != setting.training
    with pytest.raises(InputError, match="expected a scene, 0 to 5; got 6"):
        item_columns.setting_of(replace(config, seed=6), "cpu")


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
        tasks[trained_on] = item_columns.setting_of(config, "cpu")
    real, designed, both = (tasks[name].training for name in ("own", "designer", "both"))
    assert both == designed + real
    assert len(designed) == 12
    held_out = {room.group for room in tasks["own"].simulator.rooms}
    for task in tasks.values():
        assert {room.group for room in task.simulator.rooms} == held_out
        assert not held_out & {room.group for room in task.training}
        np.testing.assert_array_equal(task.starts, tasks["own"].starts)
