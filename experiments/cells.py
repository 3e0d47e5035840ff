"""The cells of the tables: one column, one room type or task, one seed each. Filled once, kept as a JSON file.

    python experiments/cells.py table=table1 column=geometric,rules room=bedroom,study seed=0,1,2

Hydra's multirun fills them side by side. A cell whose file is there is not filled again; one that fails says why beside
it, and the others go on. The tables' own scripts know which cells there are.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import subprocess
import sys
import traceback
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, DictConfig, OmegaConf

from layoutrl import build
from layoutrl import train as training_entry
from layoutrl.config import DataConfig, TrainConfig, config_directory
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import categories_of
from layoutrl.env.simulator import Simulator
from layoutrl.errors import InputError
from layoutrl.evaluation.baselines import best_wall_place, far_end_place, nearest_room_place, nearest_wall_place
from layoutrl.evaluation.metrics import lattice_ceiling, score
from layoutrl.evaluation.oracle import perfect_places
from layoutrl.evaluation.protocols import Greedy
from layoutrl.evaluation.supervised import (
    regressed_places,
    scored_places,
    seconds_budget,
    train_regressor,
    train_scorer,
)
from layoutrl.rooms.room import Room
from layoutrl.runs import load_checkpoint, machine, write_json

RESULTS = Path(__file__).parent / "results"
STARTS_SEED = 0  # of the one list of starts that every method is scored from
IOU, METRES, INDEX = (np.dtype(kind) for kind in ("<u2", "<f4", "<u2"))  # of what is packed; IoU in 1/65535


@dataclass
class CellConfig(TrainConfig):
    table: str = MISSING
    column: str = MISSING
    fill: Any = MISSING  # agent, regressor, scorer, rules or oracle
    protocol: Any = "unseen"  # unseen: other rooms are held out; scene: one room, in which it is trained and tested
    trained_on: Any = "own"  # own: the rooms of data; designer: designed rooms of the type; both
    results: str | None = None  # folder; null: experiments/results

    def __post_init__(self) -> None:
        super().__post_init__()
        expected = {"fill": list(FILLS), "protocol": ["unseen", "scene"], "trained_on": ["own", "designer", "both"]}
        for name, values in expected.items():
            if getattr(self, name) not in values:
                raise InputError(f"{name}: expected one of {', '.join(values)}; got {getattr(self, name)}")


ConfigStore.instance().store(name="cell_schema", node=CellConfig)


@dataclass(frozen=True)
class Task:
    """Rooms to learn from, rooms to be scored in, and one start in each of these or many in the only one."""

    training: list[Room]
    simulator: Simulator  # of the rooms to be scored in
    room: np.ndarray
    starts: np.ndarray
    device: torch.device


def folder_of(config: CellConfig) -> Path:
    """Where the cells of a table lie. Those of another budget lie elsewhere."""
    return Path(config.results or RESULTS) / config.budget.name / config.table


def name_of(config: CellConfig) -> str:
    """Of a cell's file: the task, what was trained on, column and seed."""
    data = "" if config.data.source == "designer" else f"-{config.data.source}-{config.data.labels}"
    item = "" if config.room.item == "main" else f"-{config.room.item}"
    return f"{config.room.type}{item}{data}-{config.trained_on}-{config.column}-seed{config.seed}"


def fill(config: CellConfig) -> None:
    """Fill a cell, unless it is. What goes wrong is written beside it and does not stop other cells."""
    folder, name = folder_of(config), name_of(config)
    file, error = folder / f"{name}.json", folder / f"{name}.error"
    if config.seed > 0 and config.fill in SEEDLESS:
        return
    if file.exists():
        error.unlink(missing_ok=True)
        if others := differences(json.loads(file.read_text())["config"], stated(config)):
            what = f"filled with another {', '.join(others)}; expected a new folder (results=...), or delete the cell"
            error.write_text(f"error: {name} is {what}\n")
            print(f"{config.table}: {name} is {what}", flush=True)
        return
    log = Path(config.runs) / config.table / f"{name}.log"
    for needed in (folder, log.parent):
        needed.mkdir(parents=True, exist_ok=True)
    print(f"{config.table}: {name} begins", flush=True)
    try:
        with log.open("w") as out, contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            result = filled(config)
    except Exception as problem:  # whatever it is: the other cells shall not suffer
        error.write_text(f"error: {problem}\n" if isinstance(problem, InputError) else traceback.format_exc())
        print(f"{config.table}: {name} failed ({problem}); see {error}", flush=True)
        return
    write_json(file, result)
    error.unlink(missing_ok=True)
    rows = ", ".join(f"{row} {values['mean_iou']:.3f}" for row, values in result["rows"].items())
    print(f"{config.table}: {name} done in {result['minutes']:.1f} minutes: {rows}", flush=True)


def filled(config: CellConfig) -> dict[str, Any]:
    """All that is kept of a cell: where it comes from, and a row of numbers for each set of places."""
    began = datetime.now(UTC)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    device = build.device(config.device)
    task = task_of(config, device)
    found = FILLS[config.fill](config, task)
    simulator = task.simulator
    groups = {group: k for k, group in enumerate(sorted({room.group for room in simulator.rooms}))}
    rows = {}
    for row, (room, place) in found.pop("places").items():
        iou = simulator.reward(room, place).iou
        rows[row] = score(simulator, room, place).as_dict() | {
            "iou": packed(np.round(iou * 65535), IOU),
            "place": packed(place, METRES),
            "group": packed([groups[simulator.rooms[k].group] for k in room], INDEX),
        }
    return {
        "rows": rows,
        "ceiling": float(lattice_ceiling(simulator, task.room, task.starts).mean()),
        **found,
        "rooms": len(simulator.rooms),
        "training_rooms": len(task.training),
        "date": f"{began:%Y-%m-%d}",
        "minutes": (datetime.now(UTC) - began).total_seconds() / 60,
        "machine": machine(device) | {"cores": cores},
        "config": stated(config),
    }


def stated(config: CellConfig) -> dict[str, Any]:
    """The configuration of a cell, as JSON has it, but for where files lie."""
    return json.loads(json.dumps(asdict(replace(config, runs="", results=None, data=replace(config.data, root=None)))))


def differences(first: dict[str, Any], second: dict[str, Any], prefix: str = "") -> list[str]:
    """The names of what both have, and have differently; the device is not counted."""
    names = []
    for name in first.keys() & second.keys() - {"device"}:
        one, other = first[name], second[name]
        if isinstance(one, dict) and isinstance(other, dict):
            names += differences(one, other, f"{prefix}{name}.")
        elif one != other:
            names.append(prefix + name)
    return sorted(names)


def task_of(config: CellConfig, device: torch.device) -> Task:
    """The rooms of a cell, and its starts: the same for every column and seed."""
    if config.protocol == "scene":
        scene = build.designed_rooms(config.room, config.data, "test")[config.seed]
        training, held_out = [scene], [scene]
        room = np.zeros(config.budget.random_starts, dtype=int)
    else:
        training, held_out = build.two_parts(config.room, config.data, config.fold)
        if config.trained_on != "own":
            given = config.data
            designer = DataConfig("designer", train_rooms=given.train_rooms, test_rooms=given.test_rooms)
            designed = build.designed_rooms(config.room, designer, "train")
            training = designed + (training if config.trained_on == "both" else [])
        room = np.arange(len(held_out))
    simulator = build.simulator(held_out, config.method, config.reward)
    return Task(training, simulator, room, simulator.starts(room, np.random.default_rng(STARTS_SEED)), device)


def agent(config: CellConfig, task: Task) -> dict[str, Any]:
    """The agent: from the one start; best of three; and, of designed rooms never seen, from many starts."""
    policy, categories, about = trained_agent(config, task)
    simulator = task.simulator
    observe = build.observation(simulator.rooms, config.method, categories, task.device)
    batch_simulator = BatchSimulator(simulator, task.device)
    run = policy.rollout(batch_simulator, observe, task.room, task.starts)
    places = {"agent": (task.room, run.final), "best of 3": (task.room, best_of(run.choices(3), simulator, task.room))}
    if config.protocol == "unseen" and config.data.source == "designer":
        room = np.resize(task.room, config.budget.random_starts)
        starts = simulator.starts(room, np.random.default_rng([STARTS_SEED, 1]))
        places["random starts"] = room, policy.rollout(batch_simulator, observe, room, starts).final
    # In analysis alone: did it know better, and not get there?
    designed = simulator.designer_position[task.room]
    there, here = (policy.highest(batch_simulator, observe, task.room, place) for place in (designed, run.final))
    return {
        "places": places,
        "moves": float(run.moves.mean()),
        "ms_a_room": 1000 * run.seconds / len(task.room),
        "knew_better": packed(there > here, np.dtype("u1")),
        **about,
    }


def best_of(choices: np.ndarray, simulator: Simulator, room: np.ndarray) -> np.ndarray:
    """Of choices (B, n, 2) the one with the highest IoU, by knowledge of the answer: (B, 2)."""
    count = choices.shape[1]
    iou = simulator.reward(np.repeat(room, count), choices.reshape(-1, 2)).iou.reshape(-1, count)
    return choices[np.arange(len(room)), iou.argmax(1)]


def trained_agent(config: CellConfig, task: Task) -> tuple[Greedy, list[str], dict[str, Any]]:
    """Train, or take the agent that was trained on the same rooms in the same way: (policy, categories, about it)."""
    own = {field.name for field in fields(TrainConfig)}
    training = TrainConfig(**{name: value for name, value in vars(config).items() if name in own})
    # Designed rooms are the same, wherever else the agent is tested.
    data = config.data.train_rooms if config.trained_on == "designer" else asdict(config.data)
    what = [data, config.trained_on, config.protocol, config.fold, config.budget.name, config.seed]
    how = [asdict(part) for part in (config.room, config.method, config.reward)]
    training.name = f"{config.column}-{zlib.crc32(json.dumps([what, how]).encode()):08x}-seed{config.seed}"
    file = Path(config.runs) / config.room.type / training.name / "trained.json"
    if not file.exists():
        trained = training_entry.train(training, task.training, task.simulator.rooms)
        if trained.learner.agent.updates < trained.learner.updates:
            raise KeyboardInterrupt
        about = {"training_seconds": trained.seconds, "updates": trained.learner.agent.updates}
        write_json(trained.folder / file.name, about)
        if trained.folder != file.parent and not file.exists():  # an earlier training was interrupted
            file.parent.rename(trained.folder.with_name(f"{trained.folder.name}-interrupted"))
            trained.folder.rename(file.parent)
    checkpoint = load_checkpoint(file.parent, task.device)
    agent = build.agent(config.method, checkpoint["categories"], 1, np.random.SeedSequence(0), task.device)
    agent.network.load_state_dict(checkpoint["network"])
    return build.greedy(agent, config.method), checkpoint["categories"], json.loads(file.read_text())


def regressor(config: CellConfig, task: Task) -> dict[str, Any]:
    """The agent's network, told the designer's place for as long as the agent was trained."""
    network, observe, about = supervised(config, task, train_regressor)
    place = regressed_places(network, observe, task.room, task.starts, build.views(config.method, task.device))
    return {"places": {"agent": (task.room, place)}, **about}


def scorer(config: CellConfig, task: Task) -> dict[str, Any]:
    """The same network, told how good a place is; it takes the best of many. It needs no start."""
    network, observe, about = supervised(config, task, train_scorer)
    place = scored_places(network, task.simulator, observe, build.views(config.method, task.device))
    return {"places": {"agent": (task.room, place[task.room])}, **about}


def supervised(config: CellConfig, task: Task, train: Callable[..., Any]) -> tuple[Any, Any, dict[str, Any]]:
    agents = folder_of(config) / f"{name_of(replace(config, column='geometric'))}.json"
    try:
        seconds = json.loads(agents.read_text())["training_seconds"]
    except FileNotFoundError:
        raise InputError(f"column: {config.column} trains for as long as geometric, which is not done") from None
    build.keep_freed_memory()
    categories = categories_of(task.training)
    training = build.simulator(task.training, config.method, config.reward)
    observe = build.observation(task.training, config.method, categories, task.device)
    seed = np.random.SeedSequence(config.seed)
    network = train(training, observe, seconds_budget(seconds), seed, device=task.device)
    observe = build.observation(task.simulator.rooms, config.method, categories, task.device)
    return network, observe, {"training_seconds": seconds}


def rules(_: CellConfig, task: Task) -> dict[str, Any]:
    """What needs no learning."""
    simulator, room, starts = task.simulator, task.room, task.starts
    places = {
        "random start": starts,
        "nearest wall": nearest_wall_place(simulator, room, starts),
        "nearest room": nearest_room_place(simulator, room, task.training),
        "best wall or corner": best_wall_place(simulator, room),  # with knowledge of the answer
        "designer": simulator.designer_position[room],
    }
    if simulator.rooms[0].moving.category == "bathtub":
        places["hand rule"] = far_end_place(simulator, room)
    return {"places": {name: (room, place) for name, place in places.items()}}


def oracle(config: CellConfig, task: Task) -> dict[str, Any]:
    """A perfect Q, with the same moves and the same stopping rule."""
    place = perfect_places(task.simulator, task.room, task.starts, config.method.discount)
    return {"places": {"oracle": (task.room, place)}}


FILLS: dict[str, Callable[[CellConfig, Task], dict[str, Any]]] = {
    "agent": agent,
    "regressor": regressor,
    "scorer": scorer,
    "rules": rules,
    "oracle": oracle,
}
SEEDLESS = ("rules", "oracle")  # nothing is drawn but the starts, which are the same for every seed


def packed(values: Sequence[float] | np.ndarray, kind: np.dtype[Any]) -> str:
    """An array as text: compressed, in base64."""
    return base64.b64encode(zlib.compress(np.asarray(values).astype(kind).tobytes(), 9)).decode()


def unpacked(text: str, kind: np.dtype[Any]) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


def multirun(table: str, sweep: Mapping[str, str], arguments: Sequence[str]) -> int:
    """Fill the cells of a sweep, less or more by what the user gives; the exit status: 1 where a cell failed."""
    overrides = [f"{name}={value}" for name, value in (dict(sweep) | given(arguments)).items()]
    flags = [argument for argument in arguments if "=" not in argument]
    command = [sys.executable, str(Path(__file__).resolve()), f"table={table}", *overrides, *flags]
    folder, status, filled_before = cells_of(table, arguments), 1, -1
    # A job that is killed takes the others with it: they begin again, as long as any is finished in between.
    while status and (filled_now := len(list(folder.glob("*.json")))) > filled_before:
        filled_before, status = filled_now, subprocess.run(command, check=False).returncode
    failed = sorted(folder.glob("*.error"))
    for error in failed:
        print(f"{error.stem} failed: {error.read_text().splitlines()[-1]}", file=sys.stderr)
    return status or int(bool(failed))


def cells_of(table: str, arguments: Sequence[str], budget: str = "default") -> Path:
    """The folder of a table's cells."""
    return Path(given(arguments).get("results", RESULTS)) / given(arguments).get("budget", budget) / table


def given(arguments: Sequence[str]) -> dict[str, str]:
    return dict(argument.split("=", 1) for argument in arguments if "=" in argument)


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="cell")
@build.answers_errors
def main(config: DictConfig) -> None:
    fill(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
