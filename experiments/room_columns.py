"""The columns of tables in which whole rooms are furnished: their rooms, and how a cell of each is filled."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from cell_config import CellConfig, learned_from
from cell_trainings import clock_of, trained_agent, trained_planit

from layoutrl.agents.learner import q_network
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.rivals.budgets import seconds_budget
from layoutrl.rivals.planit.scoring import furnished_rooms
from layoutrl.rivals.rooms import rival
from layoutrl.rivals.rooms.baselines import Library, nearest_layout, random_layout
from layoutrl.rivals.rooms.pointer import furnish as furnish_by_pointer
from layoutrl.rivals.rooms.pointer import train_rooms_pointer
from layoutrl.rivals.rooms.relations import mine
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.furnished import best_layouts
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import designs, none_empty, whole_parts
from layoutrl.runs.config import seeds
from layoutrl.runs.pretrained import agent, load


@dataclass(frozen=True)
class WholeRooms:
    """Rooms to learn from, and designs whose briefs are to be furnished."""

    training: list[Room]
    designs: list[Room]
    device: torch.device

    @property
    def briefs(self) -> list[Room]:
        """The briefs of the designs: all that a method is given."""
        return [brief_of(design) for design in self.designs]


def whole_rooms_of(config: CellConfig, device: torch.device) -> WholeRooms:
    """Return the rooms of a cell, the same for every column and seed; of those held out the first `share_of_rooms`.

    Raises InputError if there are no rooms to train on or to be scored in.
    """
    training, held_out = none_empty(*whole_parts(config.room.type, config.data, config.fold))
    training = learned_from(config, training, lambda d: designs(config.room.type, d, "train").rooms)
    return WholeRooms(training, held_out[: max(1, round(config.share_of_rooms * len(held_out)))], device)


def each(config: CellConfig, rooms: WholeRooms, furnish: Callable[[Room, np.random.Generator], Room]) -> list[Room]:
    """Furnish each brief on its own, with a random generator that depends on the seed and the index of the room."""
    return [furnish(brief, np.random.default_rng([config.seed, k])) for k, brief in enumerate(rooms.briefs)]


def by_nearest_room(config: CellConfig, rooms: WholeRooms) -> Furnish:
    library = Library(rooms.training, config.room.mirrors_alike)
    return lambda: each(config, rooms, lambda brief, rng: nearest_layout(brief, library, rng))


def by_search_or_annealer(config: CellConfig, rooms: WholeRooms) -> Furnish:
    relations, seconds = mine(rooms.training), config.seconds_a_room[config.budget.name]
    settings = config.search if config.fill == "search" else config.annealer

    def furnish(brief: Room, rng: np.random.Generator) -> Room:
        return rival.search_or_anneal(brief, relations, settings, seconds_budget(seconds, time.process_time), rng)

    return lambda: each(config, rooms, furnish)


def by_pointer(config: CellConfig, rooms: WholeRooms) -> Furnish:
    spent = seconds_budget(60 * config.training_minutes[config.budget.name], clock_of(rooms.device))
    seed, alike = np.random.SeedSequence(config.seed), config.room.mirrors_alike
    network = train_rooms_pointer(rooms.training, spent, seed, device=rooms.device, mirrors_alike=alike)
    return lambda: furnish_by_pointer(network, rooms.briefs)


def by_planit(config: CellConfig, rooms: WholeRooms) -> Furnish:
    placer, _ = trained_planit(config, rooms.training, rooms.designs, rooms.device, None)
    return lambda: furnished_rooms(placer, seeds(config)[3])


def by_agent(config: CellConfig, rooms: WholeRooms) -> Furnish:
    learned, _ = trained_agent(config, rooms.training, rooms.designs, rooms.device)
    return partial(best_layouts, Furnisher(learned), rooms.briefs)


def by_package(config: CellConfig, rooms: WholeRooms) -> Furnish:
    return partial(best_layouts, load(config.room.type, rooms.device), rooms.briefs)


def by_untrained(config: CellConfig, rooms: WholeRooms) -> Furnish:
    learned = agent(config.room.type, rooms.device)
    network = q_network(learned.method, learned.categories, np.random.SeedSequence(config.seed), rooms.device)
    return partial(best_layouts, Furnisher(learned._replace(network=network)), rooms.briefs)


Furnish = Callable[[], list[Room]]  # makes the layouts; only this call is timed as furnishing
FURNISHES: dict[str, Callable[[CellConfig, WholeRooms], Furnish]] = {
    "designer": lambda _, rooms: lambda: rooms.designs,
    "random": lambda config, rooms: lambda: each(config, rooms, random_layout),
    "nearest": by_nearest_room,
    "annealer": by_search_or_annealer,
    "search": by_search_or_annealer,
    "rooms_agent": by_agent,
    "rooms_package": by_package,
    "rooms_untrained": by_untrained,
    "rooms_pointer": by_pointer,
    "rooms_planit": by_planit,
}
