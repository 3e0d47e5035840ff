"""A cell of the tables: its configuration, its file, and which rooms it learns from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from kept import RESULTS
from omegaconf import MISSING

from layoutrl import InputError
from layoutrl.agents.method import Method
from layoutrl.rivals.rooms.annealer import Annealing
from layoutrl.rivals.rooms.search import Searching
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import Data
from layoutrl.runs.config import PlanitMethodConfig, TrainConfig
from layoutrl.runs.folder import differences
from layoutrl.runs.ranges import check_annealer, check_search, one_of

LAYOUTS = "layouts"  # name of the row that whole rooms have in a cell
PLANIT = "given categories, argmax, true size"  # PlanIT's row, told what the agent is told
SEEDLESS = ("rules", "oracle", "designer", "rooms_package")  # columns that draw only starts, always the same
AGENTS = ("agent", "rooms_agent")  # fills that train an agent
# Defaults of Method: how agents learned before these options were added.
METHOD_DEFAULTS = {one.name: getattr(Method, one.name) for one in fields(Method) if hasattr(Method, one.name)}
READ_BY = {  # options that only some fills read, and these fills
    "planit": ("planit", "rooms_planit"), "planit_time": ("planit",), "annealer": ("annealer",), "search": ("search",),
    "seconds_a_room": ("annealer", "search"), "training_minutes": ("rooms_pointer",),
}  # fmt: skip
# Of a budget: how often a training reports and is evaluated (it changes nothing).
REPORTING = ("reports", "evaluations")
SOURCES = ("designer", "floorplans", "designer_rooms")  # data sources of the tables


@dataclass
class CellConfig(TrainConfig):
    planit: PlanitMethodConfig = field(default_factory=PlanitMethodConfig)
    annealer: Annealing = MISSING
    search: Searching = MISSING
    table: str = MISSING
    column: str = MISSING
    fill: Any = MISSING  # a key of FILLS in item_columns.py or, for whole rooms, of FURNISHES in room_columns.py
    protocol: Any = "unseen"  # conf/cell.yaml explains this option and those below
    trained_on: Any = "own"
    planit_time: Any = "agent"
    seconds_a_room: dict[str, float] = MISSING
    training_minutes: dict[str, float] = MISSING
    share_of_rooms: float = 1.0
    results: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.planit.check("planit")
        check_search(self.search)
        check_annealer(self.annealer)
        one_of("protocol", self.protocol, "unseen", "scene")
        one_of("trained_on", self.trained_on, "own", "designer", "both")
        one_of("planit_time", self.planit_time, "agent", "updates")
        if self.data.source not in SOURCES:
            raise InputError(f"data: the tables are of {', '.join(SOURCES)}; got {self.data.source}")
        if self.data.source == "designer":
            one_of("trained_on of designed rooms", self.trained_on, "own")
        named: dict[str, dict[str, Any]] = {  # for each fill, its durations by name of the budget
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


def table_folder(results: str | None, budget: str, table: str) -> Path:
    """Return the folder of a table's cells; each budget has one of its own."""
    return Path(results or RESULTS) / budget / table


def folder_of(config: CellConfig) -> Path:
    """Return the folder of a cell's file."""
    return table_folder(config.results, config.budget.name, config.table)


def name_of(config: CellConfig) -> str:
    """Return the name of a cell's file without its suffix: task, training rooms, column and seed."""
    data = "" if config.data.source == "designer" else f"-{config.data.source}-{config.data.labels}"
    item = "" if config.room.item == "main" else f"-{config.room.item}"
    return f"{config.room.type}{item}{data}-{config.trained_on}-{config.column}-seed{config.seed}"


def compared_part(kept: dict[str, Any]) -> dict[str, Any]:
    """Return the part of a kept configuration that is compared: the options that its fill reads.

    Options of an agent's method that were added later, and that it lacks, get their defaults.
    """
    said = {name: value for name, value in kept.items() if name not in READ_BY or kept.get("fill") in READ_BY[name]}
    if "budget" in said:
        said["budget"] = {name: value for name, value in said["budget"].items() if name not in REPORTING}
    if said.get("fill") in AGENTS:
        said["method"] = METHOD_DEFAULTS | said["method"]
    return said


def designer(config: CellConfig) -> Data:
    """Return options of designed rooms, with the numbers, seed and disturbed share of `config.data`."""
    rooms = config.data
    return Data("designer", None, rooms.train_rooms, rooms.test_rooms, rooms.seed, rooms.disturbed)


def learned_from(config: CellConfig, own: list[Room], designed: Callable[[Data], list[Room]]) -> list[Room]:
    """Return the rooms to train on: `own` (the source's training folds), designed ones, or both."""
    if config.trained_on == "own":
        return own
    return designed(designer(config)) + (own if config.trained_on == "both" else [])


def refuse_other_rooms(name: str, first: dict[str, Any], second: dict[str, Any]) -> None:
    """Raise InputError if the cells of two configurations are not scored in the same rooms."""
    one, other = ({part: config[part] for part in ("room", "data", "fold", "protocol")} for config in (first, second))
    for said in (one, other):  # these two only concern training rooms
        said["data"] = said["data"] | {"train_rooms": None, "disturbed": None}
    if others := differences(one, other):
        raise InputError(f"{name}: cells of different {', '.join(others)} cannot be compared; expected the same rooms")
