"""The tables' own scripts: what they fill, and what they print."""

from __future__ import annotations

import itertools
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import real_rooms
import table1
import table2
import table3
from cell_config import CellConfig, compared_part, folder_of, name_of
from cells import stated
from hydra import compose, initialize_config_dir
from kept import RESULTS
from omegaconf import OmegaConf
from printing import Row

from layoutrl import InputError
from layoutrl.runs.config import RoomConfig, composed, config_directory
from layoutrl.runs.folder import differences
from tests.commands import PROJECT
from tests.experiments.builders import LITTLE, REAL, script


def test_cells_run_side_by_side_and_one_that_fails_stops_no_other(tmp_path, designed, monkeypatch, capfd):
    both = ("room=tatami,kitchen", "seed=0", designed, "room.item=platform")  # no kitchen has one
    options = (*LITTLE, "column=oracle,rules", *both, f"results={tmp_path / 'results'}")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert table1.main([*options]) == 1  # in this process; workers cannot be forked
    out, err = capfd.readouterr()
    assert "kitchen-platform-own-oracle-seed0 failed: error: room.item" in err
    folder = tmp_path / "results" / "smoke" / "table1"
    assert {path.name for path in folder.glob("*.json")} == {
        f"tatami-platform-own-{column}-seed0.json" for column in ("oracle", "rules")
    }
    assert len(list(folder.glob("*.error"))) == 2
    printed = [line.split(" |")[0] for line in out.splitlines() if line.startswith("| ")]
    assert {*printed} == {"| ", "| ---", "| tatami", "| kitchen"}  # what was asked for
    assert "| balcony | 0.951" in (folder.parent / "table1.md").read_text()  # all that there is


@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real rooms are not in {REAL}")
def test_real_rooms_are_filled_and_printed_as_they_are_asked_for(tmp_path):
    roots = [f"{source}={REAL / source}" for source in ("designer_rooms", "floorplans")]
    real = script("real_rooms.py", *roots, "task=platform", "trained_on=own", cwd=tmp_path)
    assert real.returncode == 0, real.stderr
    cells_of_platforms = sorted(path.name for path in (tmp_path / "results" / "smoke" / "real").iterdir())
    assert cells_of_platforms == [
        f"tatami-platform-designer_rooms-snapped-own-{column}-seed0.json" for column in ("geometric", "rules", "scorer")
    ]
    platforms = [line for line in real.stdout.splitlines() if line.startswith("| platform")]
    # Trained on designed rooms and on both; the best of three of these; and the hand rule is for bathtubs.
    assert [line.count("not run") for line in platforms] == [2, 0, 1]
    assert "| - |" in platforms[1]


def test_table_2_has_a_line_for_each_type_and_lands_beside_table_1(tmp_path, designed):
    scenes = script("table2.py", "column=geometric", "room=tatami,study", "seed=0", designed, cwd=tmp_path)
    assert scenes.returncode == 0, scenes.stderr
    assert "Table 2 (a)" in scenes.stdout
    tatami = [line for line in scenes.stdout.splitlines() if line.startswith("| tatami")]
    assert [line.split(" | ")[1] for line in tatami] == ["0.949 ± 0.009"] * 2
    assert [line.count("not run") for line in tatami] == [3, 3]
    assert "| kitchen" not in scenes.stdout
    scenes_csv = (tmp_path / "results" / "smoke" / "table2-scenes.csv").read_text().splitlines()
    assert any(line.startswith("study,agent,0.") and line.endswith(",16,1") for line in scenes_csv)  # starts, rooms


def test_a_script_says_what_it_expects(tmp_path):
    assert "Table 1 of Di & Yu" in script("table1.py", "--help", cwd=tmp_path).stdout
    wrong = script("table1.py", "smoke", cwd=tmp_path)
    assert wrong.returncode != 0
    assert wrong.stderr == "error: smoke: expected options as name=value; --help says which\n"
    assert not (tmp_path / "results").exists()


EVERY = (
    ("oracle,rules", 8, 1),
    ("geometric", 8, 3),
    ("regressor,pointer,planit", 8, 1),
    ("planit", 2, 2),
    ("planit_long", 2, 1),
)
LONG = ("paper_every_move", 1, 1)  # a type in which it is trained for longer
PICTURES = (("paper", 2, 1), ("paper_every_move", 1, 1), *[LONG] * 7, ("paper_every_move", 1, 2))  # without a GPU
ALL_SEEDS = (("paper", 8, 3), ("paper_every_move", 1, 3), *[("paper_every_move", 1, 3)] * 7)


@pytest.mark.parametrize(("chosen", "gpu", "expected"), [
    ({}, True, [*EVERY, *ALL_SEEDS]),
    ({}, False, [*EVERY, *PICTURES]),
    ({"hydra/launcher": "slurm"}, False, [*EVERY, *ALL_SEEDS]),
    ({"budget": "smoke"}, False, [(column, rooms, 1) for column, rooms, _ in (*EVERY, *PICTURES)]),
    ({"budget": "smoke", "seed": "0,2", "column": "paper"}, False, [("paper", 8, 2)]),
    ({"room": "study"}, False, [(columns, 1, seeds) for columns, _, seeds in (*EVERY[:3], ("paper_every_move", 1, 1))]),
    ({"seed": "1"}, False, [(column, rooms, 1) for column, rooms, _ in (*EVERY, *PICTURES)]),
    ({"column": "paper"}, False, [("paper", 8, 3)]),
    ({"column": "oracle,rules"}, False, [("oracle,rules", 8, 1)]),
    ({"column": "rules,geometric"}, False, [("rules", 8, 1), ("geometric", 8, 3)]),
])  # fmt: skip
def test_the_sweeps_of_table_1_are_those_that_are_asked_for(chosen, gpu, expected, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: gpu)
    sweeps = table1.stages(chosen)
    found = [(sweep["column"], len(sweep["room"].split(",")), len(sweep["seed"].split(","))) for sweep in sweeps]
    assert found == expected
    for sweep in sweeps:
        long = sweep["column"] == "paper_every_move" and {*sweep["room"].split(",")} <= {*table1.UPDATES}
        assert sweep.get("method.updates.default") == ("12000" if long else None)


@pytest.mark.parametrize(("chosen", "expected"), [
    ({}, [("geometric", "0,1,2", "scene"), ("paper", "0", "scene")]),
    ({"hydra/launcher": "slurm"}, [("geometric", "0,1,2", "scene"), ("paper", "0,1,2", "scene")]),
    ({"budget": "smoke"}, [("geometric", "0", "smoke"), ("paper", "0", "smoke")]),
    ({"budget": "full", "column": "paper"}, [("paper", "0,1,2", "scene")]),
])  # fmt: skip
def test_the_sweeps_of_table_2_have_a_budget_of_their_own(chosen, expected, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    sweeps = table2.stages(chosen)
    assert [(sweep["column"], sweep["seed"], sweep["budget"]) for sweep in sweeps] == expected
    assert {sweep["protocol"] for sweep in sweeps} == {"scene"}


def test_a_column_of_real_rooms_is_filled_as_it_is_asked_for(tmp_path):
    chosen = {"floorplans": str(tmp_path), "task": "toilet,bed"}
    usual = real_rooms.stages("floorplans", chosen)
    assert [(sweep["column"], sweep["trained_on"]) for sweep in usual] == [
        ("rules", "own"), ("geometric", "own,designer,both"), ("scorer", "own")
    ]  # fmt: skip
    asked = {"data.labels": "snapped,raw", "data.root": str(tmp_path), "task": "toilet", "seed": "0"}
    (sweep,) = real_rooms.stages("floorplans", chosen | {"column": "rules"})
    assert sweep == asked | real_rooms.ENDS | {"column": "rules", "trained_on": "own"}


def test_real_rooms_of_a_type_are_its_tasks(tmp_path):
    sources = dict.fromkeys(real_rooms.TASKS, str(tmp_path))

    def tasks(**chosen: str) -> list[str]:
        sweeps = [real_rooms.stages(source, sources | chosen) for source in sources]
        assert not any("room" in sweep for of_source in sweeps for sweep in of_source)  # each task has its own
        return [task for of_source in sweeps if of_source for task in of_source[0]["task"].split(",")]

    assert tasks(room="kitchen") == ["counter"]
    assert tasks(room="kitchen,bedroom") == ["counter", "bed"]
    assert tasks(room="bathroom", task="toilet,bed") == ["toilet"]
    assert tasks(room="study") == []


@pytest.mark.parametrize("stages", [table1.stages, lambda chosen: real_rooms.stages("floorplans", chosen)])
def test_what_draws_nothing_has_one_seed_whatever_is_asked_for(stages, capsys):
    chosen = {"column": "rules,geometric", "seed": "0,1", "floorplans": "anywhere"}
    assert {sweep["column"]: sweep["seed"] for sweep in stages(chosen)} == {"rules": "0", "geometric": "0,1"}
    assert "rules: seed=0,1 is left out" in capsys.readouterr().out


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_make_tables_takes_a_type_where_one_is_given():
    def commands(*arguments: str) -> list[str]:
        made = subprocess.run(["make", "-n", "tables", *arguments], cwd=PROJECT, capture_output=True, text=True)
        return re.findall(r"python (experiments/\w+\.py.*?) *\|\|", made.stdout)

    scripts = [f"experiments/{name}.py" for name in ("table1", "table2", "table3", "real_rooms")]
    assert [command.split() for command in commands("DATA=/nowhere")] == [[script] for script in scripts]
    given = commands("DATA=/nowhere", "ROOM=kitchen", "budget=smoke")
    assert [command.split() for command in given] == [[script, "room=kitchen", "budget=smoke"] for script in scripts]


@pytest.mark.parametrize(("asked", "there", "n"), [(64, 1000, 24), (64, 6, 6), (1, 6, 1)])
def test_whole_rooms_count_as_many_as_planit_furnished(asked, there, n):
    of_all = {"mean_iou": 0.5, "standard_error": 0.1, "missing": 0.0}
    cell = {"rooms": there, "config": {"budget": {"evaluation_rooms": asked}}, "all items": {"told": of_all}}
    found = Row(np.zeros((1, there)), np.arange(there), [], {Path("cell.json"): cell})
    assert table1.of_all(found, "told").numbers["n"] == n


def configurations(table: str, sweep: dict[str, str]) -> Iterator[CellConfig]:
    """Of all cells of a sweep. To compose one takes long, and only groups need it; of types only conf/room/ is read."""
    types = sweep.get("room", "").split(",")
    groups = [name for name in sweep if name != "room" and (config_directory() / name).is_dir()]
    plain = [name for name in sweep if name not in (*groups, "room")]
    for values in itertools.product(*(sweep[name].split(",") for name in groups)):
        chosen = [
            f"table={table}",
            *map("=".join, zip(groups, values, strict=True)),
            *(f"room={t}" for t in types[:1] if t),
        ]
        with initialize_config_dir(str(config_directory()), version_base="1.3"):
            config = compose("cell", chosen)
        for room_type in types:
            if room_type:
                room = OmegaConf.load(config_directory() / "room" / f"{room_type}.yaml")
                OmegaConf.update(config, "room", OmegaConf.merge(RoomConfig, room))  # nothing of the type before
            for said in itertools.product(*(sweep[name].split(",") for name in plain)):
                for name, value in zip(plain, said, strict=True):
                    OmegaConf.update(config, name, value)
                yield OmegaConf.to_object(config)


def test_cells_are_composed_as_hydra_does() -> None:
    sweep = {"column": "geometric", "seed": "0,1", "fold": "0,1", "room": "bedroom,kitchen"}
    *_, last = configurations("table1", sweep)
    assert last == composed("cell", "table=table1", "column=geometric", "seed=1", "fold=1", "room=kitchen")


def test_every_cell_that_is_kept_is_one_that_the_tables_ask_for(monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    sources = dict.fromkeys(real_rooms.TASKS, "anywhere")
    sweeps = [("table1", sweep) for sweep in table1.stages({})] + [("table2", sweep) for sweep in table2.stages({})]
    sweeps += [("table3", sweep) for sweep in table3.stages({"designer_rooms": "anywhere"})]
    sweeps += [("real", sweep) for source in sources for sweep in real_rooms.stages(source, sources)]
    asked = set()
    for table, sweep in sweeps:
        seeds = sweep.get("seed", "0").split(",")
        for of_first_seed in configurations(table, sweep | {"seed": seeds[0]}):
            for config in (replace(of_first_seed, seed=int(seed)) for seed in seeds):
                file = folder_of(config) / f"{name_of(config)}.json"
                asked.add(file)
                if file.exists():
                    assert differences(json.loads(file.read_text())["config"], stated(config)) == [], file
                    compared = compared_part(json.loads(file.read_text())["config"])
                    assert differences(compared, stated(config)) == [], file
    kept = {*RESULTS.glob("*/*/*.json")}
    assert kept
    assert kept <= asked
    wanting = {file.relative_to(RESULTS / "default").as_posix() for file in asked - kept}
    seeds = {f"table1/{room}-own-geometric-seed{seed}.json" for room in table1.PAPER for seed in (1, 2)}
    learn = [name for name in wanting if re.match(r"table3/\w+-designer_rooms-\w+-\w+-rooms_(agent|pointer)-", name)]
    assert wanting - {*learn} == seeds


@pytest.mark.parametrize("room", table1.PAPER)
def test_kept_pointers_were_trained_for_no_less_than_the_agent(room):
    folder = RESULTS / "default/table1"
    agent, rival = (
        json.loads((folder / f"{room}-own-{name}-seed0.json").read_text()) for name in ("geometric", "pointer")
    )
    assert rival["training_seconds"] >= 0.98 * agent["training_seconds"]


def test_rivals_are_trained_after_the_agent_whose_time_they_get():
    named = {"column": "pointer,geometric,planit,oracle"}
    assert [sweep["column"] for sweep in table1.stages(named)] == ["oracle", "geometric", "pointer,planit"]


@pytest.mark.parametrize(("stages", "wrong"), [
    (table1.stages, {"room": "bedroom,kitchn"}),
    (table1.stages, {"room": "kitchn", "column": "rules"}),
    (table2.stages, {"room": "kitchn"}),
    (table2.stages, {"budget": "scene"}),
    (table1.stages, {"column": "geometric,designer"}),
    (table2.stages, {"column": "designer"}),
    (lambda chosen: real_rooms.stages("floorplans", chosen), {"task": "toilt"}),
    (lambda chosen: real_rooms.stages("floorplans", chosen), {"room": "kitchn"}),
])  # fmt: skip
def test_a_room_column_task_or_budget_that_a_table_does_not_have_is_answered(stages, wrong):
    name, value = next(iter(wrong.items()))
    with pytest.raises(InputError, match=rf"{name}: expected some of .*; got {value.split(',')[-1]}"):
        stages(wrong)
