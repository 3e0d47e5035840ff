"""The cells of the tables: one column, one room type or task, one seed each. Filled once, kept as a JSON file.

    python experiments/cells.py table=table1 column=geometric,rules room=bedroom,study seed=0,1,2

Hydra's multirun fills them side by side. A cell whose file is there is not filled again; one that fails says why beside
it, and the others go on. The tables' own scripts know which cells there are.
"""

from __future__ import annotations

import base64
import contextlib
import fcntl
import json
import subprocess
import sys
import time
import traceback
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, DictConfig, OmegaConf

from layoutrl import build, resume
from layoutrl import train as training_entry
from layoutrl.agents.dqn import Observe
from layoutrl.agents.networks import GeometryNetwork
from layoutrl.config import DataConfig, PlanitConfig, PlanitMethodConfig, TrainConfig, config_directory, one_of
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
    updates_budget,
)
from layoutrl.planit import train as planit_entry
from layoutrl.planit.canvas import box_of
from layoutrl.planit.scoring import score_all
from layoutrl.rooms.room import Room
from layoutrl.runs import differences, load_config, machine, write_json

RESULTS = Path(__file__).parent / "results"
DRAWN = 8  # rooms whose layouts are kept
PLANIT = "given categories, sampled, own size"  # what is PlanIT's answer where all other items stand
STARTS_SEED = 0  # of the one list of starts that every method is scored from
IOU, METRES, INDEX = (np.dtype(kind) for kind in ("<u2", "<f4", "<u2"))  # of what is packed; IoU in 1/65535


@dataclass
class CellConfig(TrainConfig):
    planit: PlanitMethodConfig = field(default_factory=PlanitMethodConfig)
    table: str = MISSING
    column: str = MISSING
    fill: Any = MISSING  # agent, regressor, scorer, planit, rules or oracle
    protocol: Any = "unseen"  # unseen: other rooms are held out; scene: one room, in which it is trained and tested
    trained_on: Any = "own"  # own: the rooms of data; designer: designed rooms of the type; both
    planit_time: Any = "agent"  # PlanIT is trained for as long as the agent was, or for its own number of `updates`
    results: str | None = None  # folder; null: experiments/results

    def __post_init__(self) -> None:
        super().__post_init__()
        self.planit.check("planit")
        one_of("fill", self.fill, *FILLS)
        one_of("protocol", self.protocol, "unseen", "scene")
        one_of("trained_on", self.trained_on, "own", "designer", "both")
        one_of("planit_time", self.planit_time, "agent", "updates")


ConfigStore.instance().store(name="cell_schema", node=CellConfig)


@dataclass(frozen=True)
class Setting:
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
    if config.seed > 0 and config.fill in SEEDLESS and config.protocol == "unseen":
        return
    if file.exists():
        error.unlink(missing_ok=True)
        if others := differences(json.loads(file.read_text())["config"], stated(config)):
            what = f"filled with another {', '.join(others)}; expected a new folder (results=...), or delete the cell"
            error.write_text(f"error: {name} is {what}\n")
            print(f"{config.table}: {name} is {what}", flush=True)
        return
    log = Path(config.runs) / config.table / f"{config.budget.name}-{name}.log"
    for needed in (folder, log.parent):
        needed.mkdir(parents=True, exist_ok=True)
    print(f"{config.table}: {name} begins", flush=True)
    error.write_text(f"{name} began and did not end: it was killed, or is running\n")
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
    began, device = datetime.now(UTC), build.device(config.device)
    about = machine(device)
    setting = setting_of(config, device)
    found = FILLS[config.fill](config, setting)
    simulator = setting.simulator
    groups = {group: k for k, group in enumerate(sorted({room.group for room in simulator.rooms}))}
    rows = {}
    for row, (room, place) in found.pop("places", {}).items():
        iou = simulator.reward(room, place).iou
        rows[row] = score(simulator, room, place).as_dict() | {
            "iou": packed(np.round(iou * 65535), IOU),
            "place": packed(place, METRES),
            "group": packed([groups[simulator.rooms[k].group] for k in room], INDEX),
        }
    for row, put in found.pop("items", {}).items():  # one in each room, of a size of its own
        rows[row] = put.score.as_dict() | {
            "missing": put.missing,
            "iou": packed(np.round(put.iou * 65535), IOU),
            "group": packed([groups[room.group] for room in simulator.rooms], INDEX),
        }
        if row == PLANIT:
            boxes = [box_of(item) if item else (np.nan,) * 4 for item in put.items]
            rows[row]["box"] = packed(np.round(boxes, 3), METRES)
    return {
        "rows": rows,
        "ceiling": float(lattice_ceiling(simulator, setting.room, setting.starts).mean()),
        **found,
        "rooms": len(simulator.rooms),
        "training_rooms": len(setting.training),
        "date": f"{began:%Y-%m-%d}",
        "minutes": (datetime.now(UTC) - began).total_seconds() / 60,
        "machine": about,
        "config": stated(config),
    }


def stated(config: CellConfig) -> dict[str, Any]:
    """The configuration of a cell, as JSON has it, but for where files lie."""
    return resume.stated(replace(config, results=None))


def setting_of(config: CellConfig, device: torch.device) -> Setting:
    """The rooms of a cell, and its starts: the same for every column and seed."""
    if config.protocol == "scene":
        scenes = build.designed_rooms(config.room, config.data, "test")
        if config.seed >= len(scenes):
            raise InputError(f"seed: expected a scene, 0 to {len(scenes) - 1}; got {config.seed}")
        training = held_out = [scenes[config.seed]]
        room = np.zeros(config.budget.random_starts, dtype=int)
    else:
        training, held_out = build.two_parts(config.room, config.data, config.fold)
        if config.trained_on != "own":
            designed = build.designed_rooms(config.room, designer(config), "train")
            training = designed + (training if config.trained_on == "both" else [])
        room = np.arange(len(held_out))
    simulator = build.simulator(held_out, config.method, config.reward)
    return Setting(training, simulator, room, simulator.starts(room, np.random.default_rng(STARTS_SEED)), device)


def designer(config: CellConfig) -> DataConfig:
    """Designed rooms, as many as the budget has."""
    return DataConfig("designer", train_rooms=config.data.train_rooms, test_rooms=config.data.test_rooms)


def agent(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """The agent: from the one start; best of three; and, of designed rooms never seen, from many starts."""
    policy, categories, about = trained_agent(config, setting)
    simulator = setting.simulator
    observe = build.observation(simulator.rooms, config.method, categories, setting.device)
    batch_simulator = BatchSimulator(simulator, setting.device)
    run = policy.rollout(batch_simulator, observe, setting.room, setting.starts)
    places = {
        "agent": (setting.room, run.final),
        "best of 3": (setting.room, best_of(run.choices(3), simulator, setting.room)),
    }
    if config.protocol == "unseen" and config.data.source == "designer":
        room = np.resize(setting.room, config.budget.random_starts)
        starts = simulator.starts(room, np.random.default_rng([STARTS_SEED, 1]))
        places["random starts"] = room, policy.rollout(batch_simulator, observe, room, starts).final
    # In analysis alone: did it know better, and not get there?
    designed = simulator.designer_position[setting.room]
    there, here = (
        policy.best_moves(batch_simulator, observe, setting.room, place)[1] for place in (designed, run.final)
    )
    return {
        "places": places,
        "moves": float(run.moves.mean()),
        "ms_a_room": 1000 * run.seconds / len(setting.room),
        "knew_better": packed(there > here, np.dtype("u1")),
        **about,
    }


def best_of(choices: np.ndarray, simulator: Simulator, room: np.ndarray) -> np.ndarray:
    """Of choices (B, n, 2) the one with the highest IoU, by knowledge of the answer: (B, 2)."""
    count = choices.shape[1]
    iou = simulator.reward(np.repeat(room, count), choices.reshape(-1, 2)).iou.reshape(-1, count)
    return choices[np.arange(len(room)), iou.argmax(1)]


def trained_agent(config: CellConfig, setting: Setting) -> tuple[Greedy, list[str], dict[str, Any]]:
    """Train, or take the agent that was trained on the same rooms in the same way: (policy, categories, about it).

    A training that was killed goes on where its last checkpoint is.
    """
    training = config.training()
    if config.trained_on == "designer":  # the same agent, wherever it is tested
        training.data = designer(config)
    what = [asdict(training.data), config.trained_on, config.protocol, config.fold, config.budget.name, config.seed]
    how = [asdict(part) for part in (config.room, config.method, config.reward)]
    name = f"{config.column}-{zlib.crc32(json.dumps([what, how]).encode()):08x}-seed{config.seed}"
    folder = Path(config.runs) / config.room.type / name
    if not folder.exists():
        training.name = f"{name}-unfinished"
        unfinished = folder.with_name(training.name)
        with alone(folder.with_name(f"{name}.lock")) as mine:
            begun = unfinished if mine and goes_on(unfinished, training) else None
            trained = training_entry.train(training, setting.training, setting.simulator.rooms, begun)
            if trained.learner.agent.updates < trained.learner.updates:
                raise KeyboardInterrupt
            about = {"training_seconds": trained.seconds, "updates": trained.learner.agent.updates}
            write_json(trained.folder / "trained.json", about | {"trained_on_machine": machine(setting.device)})
            with contextlib.suppress(OSError):  # another job was faster: its agent is the same
                trained.folder.rename(folder)
    agent, categories = build.trained_agent(folder, config.method, setting.device)
    return build.greedy(agent, config.method), categories, json.loads((folder / "trained.json").read_text())


def goes_on(folder: Path, config: TrainConfig) -> bool:
    """Whether a training began there, and as it is wanted."""
    if not (folder / "config.yaml").exists():
        return False
    return not differences(resume.stated(load_config(folder, TrainConfig)), resume.stated(config))


@contextlib.contextmanager
def alone(file: Path) -> Iterator[bool]:
    """Whether no other job of this machine holds the file meanwhile. However a job ends, it lets go of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            mine = False
        else:
            mine = True
        yield mine


def regressor(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """The agent's network, told the designer's place for as long as the agent was trained."""
    network, observe, about = supervised(config, setting, train_regressor)
    place = regressed_places(network, observe, setting.room, setting.starts, build.views(config.method, setting.device))
    return {"places": {"agent": (setting.room, place)}, **about}


def scorer(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """The same network, told how good a place is; it takes the best of many. It needs no start."""
    network, observe, about = supervised(config, setting, train_scorer)
    place = scored_places(network, setting.simulator, observe, build.views(config.method, setting.device))
    return {"places": {"agent": (setting.room, place[setting.room])}, **about}


def supervised(
    config: CellConfig, setting: Setting, train: Callable[..., GeometryNetwork]
) -> tuple[GeometryNetwork, Observe, dict[str, Any]]:
    """The agent's network, trained otherwise for as long: (network, what it sees of the test rooms, about it)."""
    seconds = agent_seconds(config, setting)
    build.keep_freed_memory()
    categories = categories_of(setting.training)
    training = build.simulator(setting.training, config.method, config.reward)
    observe = build.observation(setting.training, config.method, categories, setting.device)
    seed = np.random.SeedSequence(config.seed)
    network = train(training, observe, seconds_budget(seconds), seed, device=setting.device)
    observe = build.observation(setting.simulator.rooms, config.method, categories, setting.device)
    return network, observe, {"training_seconds": seconds}


def agent_seconds(config: CellConfig, setting: Setting) -> float:
    """For how long the agent was trained, on the same rooms with the same seed."""
    file = folder_of(config) / f"{name_of(replace(config, column='geometric'))}.json"
    try:
        agent = json.loads(file.read_text())
    except FileNotFoundError:
        raise InputError(f"column: {config.column} trains for as long as geometric, which is not done") from None
    theirs, ours = agent["machine"]["gpu"], machine(setting.device)["gpu"]
    if theirs != ours:
        raise InputError(f"device: geometric was trained on {theirs or 'a CPU'}; expected it, got {ours or 'a CPU'}")
    return float(agent["training_seconds"])


def planit(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """PlanIT: the moving item among all others, and whole rooms from nothing."""
    rooms = setting.simulator.rooms
    spent = updates_budget(config.planit.updates[config.budget.name])
    if config.planit_time == "agent":
        spent = seconds_budget(agent_seconds(config, setting))
    how = {name: getattr(config, name) for name in ("room", "data", "seed", "fold", "device", "runs")}
    budget = replace(config.budget, evaluations=1)
    training = PlanitConfig(**how, budget=budget, method=config.planit, name=f"{config.column}-seed{config.seed}")
    trained = planit_entry.train(training, setting.training, rooms, spent)
    if trained.stopped:
        raise KeyboardInterrupt
    one, every = score_all(trained.placer, config.budget.evaluation_rooms, resume.seeds(training)[3])
    return {
        "items": one,
        "all items": {name: found.as_dict(rooms) for name, found in every.items()},
        "layouts": {
            name: [[[i.category, *np.round(box_of(i), 3).tolist()] for i in items] for items in found.layouts[:DRAWN]]
            for name, found in every.items()
        },
        "training_seconds": trained.seconds,
        "updates": trained.updates,
    }


def rules(_: CellConfig, setting: Setting) -> dict[str, Any]:
    """What needs no learning."""
    simulator, room, starts = setting.simulator, setting.room, setting.starts
    places = {
        "random start": starts,
        "nearest wall": nearest_wall_place(simulator, room, starts),
        "nearest room": nearest_room_place(simulator, room, setting.training),
        "best wall or corner": best_wall_place(simulator, room),  # with knowledge of the answer
    }
    if simulator.rooms[0].moving.category == "bathtub":
        places["hand rule"] = far_end_place(simulator, room)
    return {"places": {name: (room, place) for name, place in places.items()}}


def oracle(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """A perfect Q, with the same moves."""
    place = perfect_places(setting.simulator, setting.room, setting.starts, config.method.discount)
    return {"places": {"oracle": (setting.room, place)}}


FILLS: dict[str, Callable[[CellConfig, Setting], dict[str, Any]]] = {
    "agent": agent,
    "regressor": regressor,
    "scorer": scorer,
    "planit": planit,
    "rules": rules,
    "oracle": oracle,
}
SEEDLESS = ("rules", "oracle")  # nothing is drawn but the starts, which are the same for every seed


def packed(values: Sequence[float] | np.ndarray, kind: np.dtype[Any]) -> str:
    """An array as text: compressed, in base64."""
    return base64.b64encode(zlib.compress(np.asarray(values).astype(kind).tobytes(), 9)).decode()


def unpacked(text: str, kind: np.dtype[Any]) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


def multirun(table: str, chosen: Mapping[str, str]) -> int:
    """Fill the cells of a sweep, given as values by name; the exit status: 1 where a cell failed."""
    overrides = [f"{name}={value}" for name, value in chosen.items()]
    command = [sys.executable, str(Path(__file__).resolve()), f"table={table}", *overrides]
    folder, began, status, filled_before = cells_of(table, chosen), time.time(), 1, -1
    # On this machine a job that is killed takes the others with it: they begin again, as long as any is finished.
    while status and (filled_now := len(list(folder.glob("*.json")))) > filled_before:
        filled_before, status = filled_now, subprocess.run(command, check=False).returncode
        if "hydra/launcher" in chosen:  # a cluster's jobs are on their own
            break
    failed = [error for error in sorted(folder.glob("*.error")) if error.stat().st_mtime >= began]
    for error in failed:
        print(f"{error.stem} failed: {error.read_text().splitlines()[-1]}", file=sys.stderr)
    return status or int(bool(failed))


def cells_of(table: str, chosen: Mapping[str, str]) -> Path:
    """The folder of a table's cells, by what was chosen."""
    return Path(chosen.get("results", RESULTS)) / chosen.get("budget", "default") / table


def given(arguments: Sequence[str]) -> dict[str, str]:
    """What the user gives, as name=value. Raises InputError for anything else."""
    for argument in arguments:
        if "=" not in argument:
            raise InputError(f"{argument}: expected options as name=value; --help says which")
    return dict(argument.split("=", 1) for argument in arguments)


def asked(script: str | None) -> list[str]:
    """The command line's arguments; --help is answered with what the script says of itself."""
    if {"-h", "--help"} & set(sys.argv):
        print(script)
        sys.exit()
    return sys.argv[1:]


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="cell")
@build.answers_errors
def main(config: DictConfig) -> None:
    fill(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
