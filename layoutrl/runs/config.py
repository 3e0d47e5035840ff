"""The schemas of the configuration in `conf/`, which entry points, runs/, benchmarks/ and experiments/ read.

A field of type Any is a Literal, which OmegaConf cannot express; `__post_init__` checks it.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field, fields, replace
from functools import cache
from math import inf
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from omegaconf import MISSING, OmegaConf

import layoutrl
from layoutrl import InputError
from layoutrl.agents.method import Method
from layoutrl.env.reward import Reward
from layoutrl.rivals.rooms.annealer import Annealing
from layoutrl.rivals.rooms.search import Searching
from layoutrl.rooms.categories import names_in
from layoutrl.rooms.collection import FOLDS
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.rooms.sources.parts import Data
from layoutrl.rooms.units import UNITS
from layoutrl.runs.pretrained import cards
from layoutrl.runs.ranges import (
    FOLDER,
    check_annealer,
    check_begin,
    check_data,
    check_method,
    check_new,
    check_of_source,
    check_search,
    names_folder,
    one_of,
    within,
)

COMPOSING = Lock()  # Hydra has one global state
PATHS = ("run", "runs", "resume", "out", "results")  # options that name files and folders
MOST_CHOICES = 20  # layouts of a room: ten take some seconds
COLUMNS = 3  # of rooms side by side, in an animation
LARGEST = 1500  # pixels of an animation, each way: all its pictures are in memory at once
MOST_SECONDS = 3600  # core-seconds a layout
LONGEST = 250  # bytes of the name of a run: file systems take 255, and a number may be put behind it


def config_directory() -> Path:
    """conf/ beside the package in a checkout, inside it when installed: found from any working directory."""
    package = Path(layoutrl.__file__).resolve().parent
    return next((d for d in (package / "conf", package.parent / "conf") if d.is_dir()), package / "conf")


def expanded(path: str) -> str:
    """Return a path with ~ expanded. The ~name of no user stays as it is; pathlib would raise."""
    return os.path.expanduser(path)  # noqa: PTH111


OmegaConf.register_new_resolver("home", expanded, replace=True)  # for the folders in conf/ that Hydra itself writes


def expand_paths(config: Any, *more: str) -> None:
    """Expand ~ in the PATHS of a configuration and its options named in `more`. `data` expands its own when read."""
    for name in (*PATHS, *more):
        if path := getattr(config, name, None):
            setattr(config, name, expanded(path))


@dataclass
class RoomConfig:
    """Which rooms, and which item of theirs moves."""

    type: str = MISSING
    item: str = "main"  # category of the item that moves; main: the source's choice for the type; all: every item
    updates: int = MISSING  # of budget=default with method=geometric: some types take longer to learn
    whole_updates: int = 0  # the same with scope=room; older runs do not have it
    disturbed: float = 0.5  # with scope=room: share of the designed training rooms that are disturbed as flats are
    mirrors_alike: bool = True  # mirrored rooms are mostly furnished as mirror images: scope=room learns from both


@dataclass
class BudgetConfig:
    """How long a training takes, and how often it is looked at."""

    name: str = MISSING
    reports: int = 50  # lines in metrics.csv, or some more where they do not divide the updates
    evaluations: int = 10  # about so many while training; each is made at a report, so there are no more than reports
    evaluation_rooms: int = 64  # at most, in each evaluation: of the training rooms, and of the held-out rooms
    random_starts: int = 2000  # of the paper's Table 2


@dataclass
class LearningConfig:
    """The options of every training: the rooms, how long, the seed, and the folder."""

    room: RoomConfig = field(default_factory=RoomConfig)
    data: Data = MISSING
    budget: BudgetConfig = field(default_factory=BudgetConfig)
    seed: int = 0
    fold: int = 0  # which fifth of the rooms is held out, 0 to 4
    device: str = "auto"
    runs: str = "runs"
    name: str | None = None

    def __post_init__(self) -> None:
        expand_paths(self)
        one_of("room.type", self.room.type, *MAIN_ITEM)
        check_data(self.data)
        if not self.learns_from_designs:
            self.data = replace(self.data, disturbed=0.0)  # rooms of files are not disturbed
        for name in ("reports", "evaluations", "evaluation_rooms", "random_starts"):
            value = getattr(self.budget, name)
            within(f"budget.{name}", value, value >= 1, "1 or more")
        within("fold", self.fold, 0 <= self.fold < FOLDS, f"0 to {FOLDS - 1}")
        within("seed", self.seed, self.seed >= 0, "0 or more")
        within("name", self.name, self.name is None or names_folder(self.name), f"{FOLDER}; runs= says where it goes")
        length = len((self.name or "").encode(errors="replace"))
        within("name", self.name, length <= LONGEST, f"at most {LONGEST} bytes")
        within("runs", self.runs, self.runs.strip() != "", "the name of a folder; it is empty")

    @property
    def learns_from_designs(self) -> bool:
        """Whether the training rooms are the designer's."""
        return self.data.source == "designer"


@dataclass
class TrainConfig(LearningConfig):
    """The options of an agent's training."""

    method: Method = MISSING
    reward: Reward = field(default_factory=Reward)
    begin: Any = "nothing"  # the network's first weights: untrained (nothing), or of the agent in the package (package)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_method("method", self.method)
        if self.method.scope == "room":
            one_of("room.item of whole rooms", self.room.item, "main")
        one_of("budget.name", self.budget.name, *self.method.updates)
        one_of("begin", self.begin, "nothing", "package")

    @property
    def module(self) -> str:
        """The module that trains so, and goes on with a run."""
        return "layoutrl.train"

    def check_used(self) -> None:
        """Raises InputError for options without effect. Not part of __post_init__: older runs may have them."""
        check_new(self.data, self.fold, self.method.name)
        whole, faces_away, own_share = self.method.scope == "room", self.reward.faces_away, self.method.own_share
        useful = self.reward.theta4 == 0 or whole
        within("reward", "a fourth term", useful, "none with scope=item, as reward=usable is of whole rooms")
        usual = f"{Reward.faces_away} with scope=item, which turns nothing"
        within("reward.faces_away", faces_away, whole or faces_away == Reward.faces_away, usual)
        usual = f"{Method.own_share} with scope=item, which furnishes no room"
        within("method.own_share", own_share, whole or own_share == Method.own_share, usual)
        snap = self.method.snap
        within("method.snap", snap, not whole or snap == 0, "0.0 with scope=room, which puts in line from 3 cm")
        first, useful = self.method.discount_start, self.method.every_move
        usual = f"{Method.discount_start} without method.every_move"
        within("method.discount_start", first, useful or first == Method.discount_start, usual)


@dataclass
class PlanitMethodConfig:
    """How PlanIT learns."""

    name: str = "planit"
    updates: dict[str, int] = MISSING  # by budget, of all networks
    batch: int = MISSING
    learning_rate: float = MISSING

    def check(self, prefix: str) -> None:
        """Raises InputError for what is out of range; `prefix` is where it stands in the configuration."""
        within(f"{prefix}.learning_rate", self.learning_rate, 0 < self.learning_rate < inf, "more than 0, and finite")
        within(f"{prefix}.batch", self.batch, self.batch >= 2, "2 or more, for batch normalisation")
        within(f"{prefix}.updates", self.updates, min(self.updates.values(), default=0) >= 1, "1 or more each")


@dataclass
class PlanitConfig(LearningConfig):
    """The options of PlanIT's training."""

    method: PlanitMethodConfig = field(default_factory=PlanitMethodConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.method.check("method")
        one_of("budget.name", self.budget.name, *self.method.updates)

    @property
    def module(self) -> str:
        """The module that trains so, and goes on with a run."""
        return "layoutrl.planit.train"


AnyTraining = TrainConfig | PlanitConfig
Config = TypeVar("Config", TrainConfig, PlanitConfig)


@dataclass
class PlanitCommand(PlanitConfig):
    """What `python -m layoutrl.planit.train` takes."""

    resume: str | None = None  # folder of a run to go on with

    def __post_init__(self) -> None:
        super().__post_init__()
        check_new(self.data, self.fold, self.method.name)


@dataclass
class TrainCommand(TrainConfig):
    """What `python -m layoutrl.train` takes."""

    resume: str | None = None  # folder of a run to go on with

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_used()
        if self.begin == "package":  # here alone: runs that began from the agent of another version can be read
            check_begin(self.method, cards()[self.room.type]["method"])


AS_IN_THE_RUN = Data(**dict.fromkeys(option.name for option in fields(Data)))


@dataclass
class RunConfig:
    """A trained agent, and the rooms to evaluate or show it in."""

    run: str = MISSING
    data: Data = field(default_factory=lambda: replace(AS_IN_THE_RUN))  # except what is given
    part: Any = None
    checkpoint: Any = "last"
    device: str = "auto"
    on_illegal: Any = None

    def __post_init__(self) -> None:
        expand_paths(self)
        check_data(self.data)
        check_of_source(self.data)
        one_of("checkpoint", self.checkpoint, "last", "best")
        if self.part is not None:
            one_of("part", self.part, "held_out", "training", "all")
        if self.on_illegal is not None:
            one_of("on_illegal", self.on_illegal, "stop", "mask")


@dataclass
class EvaluateConfig(RunConfig):
    """A trained agent that is scored, from so many starts a room."""

    starts: int = 1
    seed: int | None = None  # None: as in the training
    out: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        within("starts", self.starts, self.starts >= 1, "1 or more")
        within("seed", self.seed, self.seed is None or self.seed >= 0, "0 or more, or null: as in the training")


@dataclass
class WatchConfig(RunConfig):
    """A trained agent whose episodes are animated, in so many rooms, so many pixels wide."""

    rooms: int = 6
    width: int = 720
    seed: int = 0
    out: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        within("rooms", self.rooms, self.rooms >= 1, "1 or more")
        within("width", self.width, 100 <= self.width <= LARGEST, f"100 to {LARGEST}")
        most = COLUMNS * (COLUMNS * LARGEST // self.width)  # each room has a square
        within("rooms", self.rooms, self.rooms <= most, f"at most {most} with width={self.width}, for {LARGEST} pixels")
        within("seed", self.seed, self.seed >= 0, "0 or more")


@dataclass
class PlaceConfig:
    """Rooms with items to place, and the trained agent or rival that places them."""

    run: str | None = None
    by: Any = None
    seconds: float = 1.0
    search: Searching = MISSING
    annealer: Annealing = MISSING
    rooms: str = MISSING
    unit: Any = "auto"
    move: str | None = None
    only: str | None = None
    into: str | None = None
    room_type: str | None = None
    categories: str | None = None
    item: str | None = None
    choices: int = 1
    shard: str = "0/1"
    out: str | None = None
    pictures: str | None = None
    drawing: Any = "svg"
    checkpoint: Any = "last"
    seed: int = 0
    device: str = "auto"

    @property
    def only_rooms(self) -> set[str]:
        """The names of the only rooms to furnish; empty: all are furnished."""
        return names_in(self.only)

    @property
    def shard_of(self) -> tuple[int, int]:
        """The index of the shard, and the number of shards."""
        shard, shards = map(int, self.shard.split("/"))
        return shard, shards

    def __post_init__(self) -> None:
        expand_paths(self, "rooms", "categories", "pictures")
        one_of("checkpoint", self.checkpoint, "last", "best")
        one_of("drawing", self.drawing, "svg", "png", "dxf")
        one_of("unit", self.unit, "auto", *UNITS)
        if self.room_type is not None:
            one_of("room_type", self.room_type, *MAIN_ITEM)
        within("choices", self.choices, 1 <= self.choices <= MOST_CHOICES, f"1 to {MOST_CHOICES}")
        within("only", self.only, "" not in self.only_rooms, "the id of a room, or several with commas between")
        for name in ("rooms", "out", "pictures", "run", "item"):
            if (value := getattr(self, name)) is not None and not value.strip():
                raise InputError(f"{name}: expected a name; it is empty")
        split = re.fullmatch(r"(\d+)/(\d+)", self.shard)
        in_range = split is not None and int(split[1]) < int(split[2])
        several = "; several need -m" if "," in self.shard else ""
        within("shard", self.shard, in_range, f"one of 0/8, 1/8, ..., 7/8 for the eighths of a file{several}")
        if self.by is not None:
            one_of("by", self.by, "agents", "search", "annealer")
        within("seconds", self.seconds, 0 < self.seconds <= MOST_SECONDS, f"more than 0, {MOST_SECONDS} at most")
        within("seed", self.seed, self.seed >= 0, "0 or more")
        check_search(self.search)
        check_annealer(self.annealer)


@dataclass
class DemoConfig:
    """The demo's page on this machine, and the settings of the search that helps to furnish there."""

    port: int = MISSING
    timeout: float = MISSING
    search: Searching = MISSING

    def __post_init__(self) -> None:
        within("port", self.port, 0 <= self.port <= 65535, "0 to 65535")
        within("timeout", self.timeout, self.timeout > 0, "more than 0")
        check_search(self.search)


@dataclass
class GalleryConfig:
    """Rooms that are drawn on a sheet."""

    room: RoomConfig = field(default_factory=RoomConfig)
    data: Data = MISSING
    rooms: int = 24
    all_types: bool = False
    out: str | None = None

    def __post_init__(self) -> None:
        expand_paths(self)
        check_data(self.data)
        check_of_source(self.data)
        one_of("room.type", self.room.type, *MAIN_ITEM)
        within("rooms", self.rooms, self.rooms >= 1, "1 or more")


@dataclass
class BenchConfig(TrainConfig):
    """The options of the benchmark. Training is configured as in `TrainConfig`; `budget` sets the updates."""

    paper: Method = MISSING  # the paper's network, and how it learns
    parts: list[str] = MISSING
    seconds: float = MISSING
    batch: int = MISSING
    images: int = MISSING
    shapely_batches: list[int] = MISSING
    transitions: int = MISSING
    batches: list[int] = MISSING
    items: list[int] = MISSING
    items_rooms: int = MISSING
    requests: int = MISSING
    clients: int = MISSING
    probe_every: int = MISSING
    minutes: float = MISSING

    def __post_init__(self) -> None:
        super().__post_init__()
        check_method("paper", self.paper)
        one_of("method.scope of bench", self.method.scope, "item")
        for name, method in (("method", self.method), ("paper", self.paper)):
            within(f"{name} of bench", method.name, not method.every_move, "one that learns from the moves made")
        self.check_used()
        known = ("speed", "rooms", "memory", "growth", "demo", "training", "image", "sb3")
        for part in self.parts:
            one_of("parts", part, *known)
        within("parts", self.parts, len(self.parts) > 0, f"one or more of {', '.join(known)}")
        within("transitions", self.transitions, self.transitions >= self.method.batch, "a batch or more")
        for name in ("batch", "images", "items_rooms", "requests", "clients", "probe_every"):
            value = getattr(self, name)
            within(name, value, value >= 1, "1 or more")
        for name in ("shapely_batches", "batches", "items"):
            values = getattr(self, name)
            within(name, values, min(values, default=0) >= 1, "numbers of 1 or more")
        for name in ("seconds", "minutes"):
            value = getattr(self, name)
            within(name, value, value > 0, "more than 0")


def seeds(config: AnyTraining) -> list[np.random.SeedSequence]:
    """Return the seeds of the networks, the training, the probes and the evaluation."""
    return np.random.SeedSequence(config.seed).spawn(4)


def narrowed(config: LearningConfig, schema: type[Config]) -> Config:
    """Return the part of a configuration that `schema` has, without the further options of a command."""
    return schema(**{field.name: getattr(config, field.name) for field in fields(schema)})


@cache
def register() -> None:
    """Tell Hydra the schemas, so that it refuses a wrong name or type where that is given."""
    store = ConfigStore.instance()
    store.store(name="train_schema", node=TrainCommand)
    store.store(name="planit_schema", node=PlanitCommand)
    store.store(name="evaluate_schema", node=EvaluateConfig)
    store.store(name="watch_schema", node=WatchConfig)
    store.store(name="place_schema", node=PlaceConfig)
    store.store(name="demo_schema", node=DemoConfig)
    store.store(name="gallery_schema", node=GalleryConfig)
    store.store(name="bench_schema", node=BenchConfig)


def composed(entry_point: str, *overrides: str) -> Any:
    """The configuration that `python -m layoutrl.<entry point> <overrides>` would run with.

    It may be asked for by several threads, and in a program that uses Hydra itself.
    """
    register()
    with COMPOSING:
        theirs, GlobalHydra.instance().hydra = GlobalHydra.instance().hydra, None
        try:
            with initialize_config_dir(str(config_directory()), version_base="1.3"):
                return OmegaConf.to_object(compose(entry_point, list(overrides)))
        finally:
            GlobalHydra.instance().hydra = theirs
