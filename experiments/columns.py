"""The columns of the tables: their configuration, their rooms and starts, and how a cell of each is filled."""

from __future__ import annotations

import json
import shutil
import time
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra.core.config_store import ConfigStore
from omegaconf import MISSING
from torch import nn

from layoutrl import InputError
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import GeometryObservation, categories_of, observation_of
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.oracle import perfect_places
from layoutrl.evaluation.policy import greedy
from layoutrl.rivals.budgets import seconds_budget, updates_budget
from layoutrl.rivals.planit.canvas import box_of
from layoutrl.rivals.planit.placement import Placer
from layoutrl.rivals.planit.scoring import furnished_rooms, score_all
from layoutrl.rivals.rooms.annealer import Annealing, anneal
from layoutrl.rivals.rooms.baselines import Library, nearest_layout, random_layout
from layoutrl.rivals.rooms.pointer import furnish as furnish_by_pointer
from layoutrl.rivals.rooms.pointer import train_rooms_pointer
from layoutrl.rivals.rooms.relations import mine
from layoutrl.rivals.rooms.search import Searching, search
from layoutrl.rivals.rules import best_wall_place, far_end_place, nearest_room_place, nearest_wall_place
from layoutrl.rivals.supervised import (
    Network,
    pointed_places,
    regressed_places,
    scored_places,
    train_pointer,
    train_regressor,
    train_scorer,
)
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import Data, both, designed_rooms, designs, two_parts, whole_parts
from layoutrl.runs import planit_training, resume
from layoutrl.runs import training as agent_training
from layoutrl.runs.config import Config, PlanitConfig, PlanitMethodConfig, TrainConfig, part
from layoutrl.runs.files import locked, write_json
from layoutrl.runs.folder import differences, folders_of, load_config, wanted_folder
from layoutrl.runs.machine import device_of, keep_freed_memory, machine
from layoutrl.runs.ranges import check_furnishing, one_of
from layoutrl.runs.trained import trained_network as load_network

RESULTS = Path(__file__).parent / "results"
DRAWN = 1  # rooms whose layouts are kept, to be drawn
STARTS_SEED = 0  # of the one list of starts that every method is scored from


@dataclass
class CellConfig(TrainConfig):
    planit: PlanitMethodConfig = field(default_factory=PlanitMethodConfig)
    annealer: Annealing = MISSING
    search: Searching = MISSING
    table: str = MISSING
    column: str = MISSING
    fill: Any = MISSING  # one of FILLS, or of FURNISHES for whole rooms
    protocol: Any = "unseen"  # this and what follows: conf/cell.yaml says what each is
    trained_on: Any = "own"
    planit_time: Any = "agent"
    seconds_a_room: dict[str, float] = MISSING
    training_minutes: dict[str, float] = MISSING
    share_of_rooms: float = 1.0
    results: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.planit.check("planit")
        one_of("fill", self.fill, *FILLS, *FURNISHES)
        check_furnishing(self.search, self.annealer)
        one_of("protocol", self.protocol, "unseen", "scene")
        one_of("trained_on", self.trained_on, "own", "designer", "both")
        one_of("planit_time", self.planit_time, "agent", "updates")
        if self.data.source not in SOURCES:
            raise InputError(f"data: the tables are of {', '.join(SOURCES)}; got {self.data.source}")
        if self.fill in FURNISHES and self.data.source == "designer":
            one_of("trained_on of whole rooms", self.trained_on, "own")
        named: dict[str, dict[str, Any]] = {  # by budget, how long it takes
            **dict.fromkeys(("planit", "rooms_planit"), self.planit.updates),
            **dict.fromkeys(("annealer", "search"), self.seconds_a_room),
            "rooms_pointer": self.training_minutes,
        }
        if self.fill in named:
            one_of(f"budget.name of column={self.column}", self.budget.name, *named[self.fill])

    @property
    def learns_from_designs(self) -> bool:
        """Whether any of the rooms to train on are the designer's."""
        return self.data.source == "designer" or self.trained_on != "own"


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


def setting_of(config: CellConfig, device: torch.device) -> Setting:
    """The rooms of a cell, and its starts: the same for every column and seed. Raises InputError beyond the scenes."""
    if config.protocol == "scene":
        scenes = designed_rooms(config.room.type, config.room.item, config.data, "test")
        if config.seed >= len(scenes):
            raise InputError(f"seed: expected a scene, 0 to {len(scenes) - 1}; got {config.seed}")
        training = held_out = [scenes[config.seed]]
        room = np.zeros(config.budget.random_starts, dtype=int)
    else:
        training, held_out = two_parts(config.room.type, config.room.item, config.data, config.fold)
        training = learned_from(
            config, training, lambda d: designed_rooms(config.room.type, config.room.item, d, "train")
        )
        room = np.arange(len(held_out))
    simulator = Simulator(held_out, config.method.moves, config.reward)
    return Setting(training, simulator, room, simulator.starts(room, np.random.default_rng(STARTS_SEED)), device)


def designer(config: CellConfig) -> Data:
    """Designed rooms, as many as the budget has."""
    rooms = config.data
    return Data("designer", None, rooms.train_rooms, rooms.test_rooms, rooms.seed, rooms.disturbed)


def learned_from(config: CellConfig, own: list[Room], designed: Callable[[Data], list[Room]]) -> list[Room]:
    """The rooms to train on: `own`, of the source's training folds, those that the designer makes, or both."""
    if config.trained_on == "own":
        return own
    return designed(designer(config)) + (own if config.trained_on == "both" else [])


def agent(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """The agent: from the one start; best of three; without the paper's rule that an illegal move ends a test, where
    that is the method's; and, of designed rooms never seen, from many starts."""
    simulator = setting.simulator
    network, categories, about = trained_network(config, setting.training, simulator.rooms, setting.device)
    policy = greedy(network, config.method)
    observe = observation_of(config.method.observation, simulator.rooms, setting.device, categories)
    batch_simulator = BatchSimulator(simulator, setting.device)
    run = policy.rollout(batch_simulator, observe, setting.room, setting.starts)
    places = {
        "agent": (setting.room, run.final),
        "best of 3": (setting.room, best_of(run.choices(3), simulator, setting.room)),
    }
    if policy.on_illegal == "stop":
        masked = replace(policy, on_illegal="mask").rollout(batch_simulator, observe, setting.room, setting.starts)
        places["illegal moves masked"] = setting.room, masked.final
    if config.protocol == "unseen" and config.data.source == "designer":
        room = np.resize(setting.room, config.budget.random_starts)
        starts = simulator.starts(room, np.random.default_rng([STARTS_SEED, 1]))
        places["random starts"] = room, policy.rollout(batch_simulator, observe, room, starts).final
    # In analysis alone: did it know better, and not get there? What gains nothing more is better than what does.
    designed = simulator.designer_position[setting.room]
    there, here = (
        policy.best_moves(batch_simulator, observe, setting.room, place)[1] for place in (designed, run.final)
    )
    better = there < here if config.method.every_move else there > here
    return {
        "places": places,
        "moves": float(run.moves.mean()),
        "ms_a_room": 1000 * run.seconds / len(setting.room),
        "knew_better": better,
        **about,
    }


def best_of(choices: np.ndarray, simulator: Simulator, room: np.ndarray) -> np.ndarray:
    """Of choices (B, n, 2) the one with the highest IoU, by knowledge of the answer: (B, 2)."""
    count = choices.shape[1]
    iou = simulator.reward(np.repeat(room, count), choices.reshape(-1, 2)).iou.reshape(-1, count)
    return choices[np.arange(len(room)), iou.argmax(1)]


def trained_network(
    config: CellConfig, rooms: list[Room], held_out: list[Room], device: torch.device
) -> tuple[nn.Module, list[str], dict[str, Any]]:
    """The network that is trained on rooms in this way, the categories it knows, and about its training."""
    training = part(config, TrainConfig)
    if config.trained_on == "designer":  # the same agent, wherever it is tested
        training.data = designer(config)
    what = [resume.digest(rooms), config.budget.name, config.seed]
    how = [asdict(part) for part in (config.room, config.method, config.reward)]

    def train(training: TrainConfig, begun: Path | None) -> tuple[Path, dict[str, Any]]:
        trained = agent_training.train(training, rooms, held_out, device, begun)
        if trained.learner.agent.updates < trained.learner.updates:
            raise KeyboardInterrupt
        return trained.folder, {"training_seconds": trained.seconds, "updates": trained.learner.agent.updates}

    folder, about = trained_once(config, training, [what, how], train)
    network, categories, _ = load_network(folder, load_config(folder, TrainConfig), device)
    return network, categories, about


def trained_once(
    config: CellConfig,
    training: Config,
    what: Any,
    train: Callable[[Config, Path | None], tuple[Path, dict[str, Any]]],
) -> tuple[Path, dict[str, Any]]:
    """The folder of a training, and what is said of it; made where there is none of its kind (`what`), and so named.

    `train` is given the configuration, with the name of the folder to train in; and, where a training of so many
    updates was killed, its folder to go on with. Jobs that want the same wait for the first, and take what it made.
    """
    name = f"{config.column}-{zlib.crc32(json.dumps(what).encode()):08x}-seed{config.seed}"
    training = replace(training, name=f"{name}-unfinished")
    folder = Path(config.runs) / config.room.type / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    with locked(folder.with_name(f"{name}.lock"), wait=True):
        if not folder.exists():
            made, about = train(training, resume.begun(training))
            about |= {"trained_on_machine": machine(device_of(config.device))}
            write_json(made / "trained.json", about)
            made.rename(folder)
            for left in folders_of(wanted_folder(training)):  # killed, and not gone on with
                shutil.rmtree(left)
    return folder, json.loads((folder / "trained.json").read_text(encoding="utf-8"))


def regressor(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """The agent's network, told the designer's place for as long as the agent was trained."""
    network, observe, about = supervised(config, setting, train_regressor)
    place = regressed_places(network, observe, setting.room, setting.starts, config.method.views(setting.device))
    return {"places": {"agent": (setting.room, place)}, **about}


def pointer(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """A network made to point at the place, told it for as long as the agent was trained. It needs no start."""
    network, observe, about = supervised(config, setting, train_pointer)
    place = pointed_places(network, observe, config.method.views(setting.device))
    return {"places": {"agent": (setting.room, place[setting.room])}, **about}


def scorer(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """The same network, told how good a place is; it takes the best of many. It needs no start."""
    network, observe, about = supervised(config, setting, train_scorer)
    place = scored_places(network, setting.simulator, observe, config.method.views(setting.device))
    return {"places": {"agent": (setting.room, place[setting.room])}, **about}


def supervised(
    config: CellConfig, setting: Setting, train: Callable[..., Network]
) -> tuple[Network, GeometryObservation, dict[str, Any]]:
    """A network, told the answer for as long as the agent was trained: (network, what it sees in a test, about it)."""
    seconds = agent_seconds(config, setting)
    spent = seconds_budget(seconds, clock_of(setting.device))
    keep_freed_memory()
    categories = categories_of(setting.training)
    training = Simulator(setting.training, config.method.moves, config.reward)
    observe = GeometryObservation(setting.training, categories, setting.device)
    seed = np.random.SeedSequence(config.seed)
    network = train(training, observe, spent, seed, device=setting.device)
    observe = GeometryObservation(setting.simulator.rooms, categories, setting.device)
    return network, observe, {"training_seconds": seconds}


def agent_seconds(config: CellConfig, setting: Setting) -> float:
    """For how long the agent was trained on the same rooms: the mean over its seeds, since some met a busy machine.

    Raises InputError where an agent is not done, or was trained elsewhere.
    """
    name = name_of(replace(config, column="geometric")).removesuffix(f"seed{config.seed}")
    files = sorted(folder_of(config).glob(f"{name}seed*"))
    agents = [json.loads(file.read_text(encoding="utf-8")) for file in files if file.suffix == ".json"]
    if not agents or len(agents) < len(files):  # one that runs or has failed has a file that says so
        raise InputError(f"column: {config.column} trains for as long as geometric, which is not done")
    for agent in agents:
        refuse_other_rooms(name, agent["config"], resume.stated(config))
    ours = machine(setting.device)["gpu"]
    for theirs in {agent["trained_on_machine"]["gpu"] for agent in agents} - {ours}:
        raise InputError(f"device: geometric was trained on {theirs or 'a CPU'}; expected it, got {ours or 'a CPU'}")
    return float(np.mean([agent["training_seconds"] for agent in agents]))


def refuse_other_rooms(name: str, first: dict[str, Any], second: dict[str, Any]) -> None:
    """Raise InputError where two configurations of cells are not scored in the same rooms."""
    one, other = ({part: config[part] for part in ("room", "data", "fold", "protocol")} for config in (first, second))
    one["room"], other["room"] = (part["room"] | {"updates": None} for part in (one, other))  # does not say which
    if others := differences(one, other):
        raise InputError(f"{name}: cells of different {', '.join(others)} cannot be compared; expected the same rooms")


def clock_of(device: torch.device) -> Callable[[], float]:
    """What seconds of training are counted by: on a processor its own time, whatever else runs on the machine."""
    return time.process_time if device.type == "cpu" else time.perf_counter


def planit(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """PlanIT: the moving item among all others, and whole rooms from nothing."""
    seconds = agent_seconds(config, setting) if config.planit_time == "agent" else None
    placer, about = trained_planit(config, setting.training, setting.simulator.rooms, setting.device, seconds)
    seed = resume.seeds(config)[3]
    one, every = score_all(placer, config.budget.evaluation_rooms, seed)
    return {
        "items": one,
        "all items": {name: found.as_dict() for name, found in every.items()},
        "layouts": {
            name: [[[i.category, *np.round(box_of(i), 3).tolist()] for i in items] for items in found.layouts[:DRAWN]]
            for name, found in every.items()
        },
        **about,
    }


def trained_planit(
    config: CellConfig, training_rooms: list[Room], rooms: list[Room], device: torch.device, seconds: float | None
) -> tuple[Placer, dict[str, Any]]:
    """PlanIT, trained on rooms for so long or for its own updates, in the rooms to be scored in; and about that."""
    training, held_out = planit_training.usable(training_rooms, rooms)
    if len(held_out.rooms) < len(rooms):
        raise InputError("data: PlanIT is scored in all rooms or none; expected upright ones, of known furniture")
    updates = config.planit.updates[config.budget.name]
    what = [resume.digest(training.rooms), config.budget.name, config.seed, seconds, asdict(config.planit)]
    how = {part: getattr(config, part) for part in ("room", "data", "seed", "fold", "device", "runs")}
    rival = PlanitConfig(**how, budget=config.budget, method=config.planit)

    def train(rival: PlanitConfig, begun: Path | None) -> tuple[Path, dict[str, Any]]:
        spent = seconds_budget(seconds, clock_of(device)) if seconds else updates_budget(updates)
        trained = planit_training.train(rival, training, held_out, spent, device, begun)
        if trained.stopped:
            raise KeyboardInterrupt
        return trained.folder, {"training_seconds": seconds or trained.seconds, "updates": trained.updates}

    folder, about = trained_once(config, rival, what, train)
    return planit_training.load(folder, training, held_out, device), about


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


SOURCES = ("designer", "floorplans", "designer_rooms")  # of the tables
FILLS: dict[str, Callable[[CellConfig, Setting], dict[str, Any]]] = {
    "agent": agent,
    "regressor": regressor,
    "pointer": pointer,
    "scorer": scorer,
    "planit": planit,
    "rules": rules,
    "oracle": oracle,
}


@dataclass(frozen=True)
class WholeRooms:
    """Rooms to learn from, and designs whose briefs are to be furnished."""

    training: list[Room]
    designs: list[Room]
    device: torch.device

    @property
    def briefs(self) -> list[Room]:
        """What who furnishes the rooms is given."""
        return [brief_of(design) for design in self.designs]


def whole_rooms_of(config: CellConfig, device: torch.device) -> WholeRooms:
    """The whole rooms of a cell: the same for every column and seed, or the first of them."""
    training, held_out = both(*whole_parts(config.room.type, config.data, config.fold))
    training = learned_from(config, training, lambda d: designs(config.room.type, d, "train").rooms)
    return WholeRooms(training, held_out[: max(1, round(config.share_of_rooms * len(held_out)))], device)


def each(config: CellConfig, rooms: WholeRooms, furnish: Callable[[Room, np.random.Generator], Room]) -> list[Room]:
    """Each brief furnished on its own; what is drawn hangs on the seed and on the room's number."""
    return [furnish(brief, np.random.default_rng([config.seed, k])) for k, brief in enumerate(rooms.briefs)]


def by_nearest_room(config: CellConfig, rooms: WholeRooms) -> Furnish:
    library = Library(rooms.training)
    return lambda: each(config, rooms, lambda brief, rng: nearest_layout(brief, library, rng))


def by_rules(config: CellConfig, rooms: WholeRooms) -> Furnish:
    relations, seconds = mine(rooms.training), config.seconds_a_room[config.budget.name]

    def furnish(brief: Room, rng: np.random.Generator) -> Room:
        spent = seconds_budget(seconds, time.process_time)
        if config.fill == "search":
            return search(brief, relations, config.search, spent, rng)
        return anneal(brief, relations, config.annealer, spent, rng)

    return lambda: each(config, rooms, furnish)


def by_pointer(config: CellConfig, rooms: WholeRooms) -> Furnish:
    spent = seconds_budget(60 * config.training_minutes[config.budget.name], clock_of(rooms.device))
    network = train_rooms_pointer(rooms.training, spent, np.random.SeedSequence(config.seed), device=rooms.device)
    return lambda: furnish_by_pointer(network, rooms.briefs)


def by_planit(config: CellConfig, rooms: WholeRooms) -> Furnish:
    placer, _ = trained_planit(config, rooms.training, rooms.designs, rooms.device, None)
    return lambda: furnished_rooms(placer, resume.seeds(config)[3])


def by_agent(config: CellConfig, rooms: WholeRooms) -> Furnish:
    network, categories, _ = trained_network(config, rooms.training, rooms.designs, rooms.device)
    furnisher = Furnisher(network, config.method, categories)
    return lambda: [best.layout for best, *_ in furnisher.furnish(rooms.briefs, 1)]


Furnish = Callable[[], list[Room]]  # layouts; what comes before it is called is no time of furnishing
FURNISHES: dict[str, Callable[[CellConfig, WholeRooms], Furnish]] = {
    "designer": lambda _, rooms: lambda: rooms.designs,
    "random": lambda config, rooms: lambda: each(config, rooms, random_layout),
    "nearest": by_nearest_room,
    "annealer": by_rules,
    "search": by_rules,
    "rooms_agent": by_agent,
    "rooms_pointer": by_pointer,
    "rooms_planit": by_planit,
}
