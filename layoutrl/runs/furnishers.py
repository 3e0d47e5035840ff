"""Who can place furniture in rooms of a user's own: a trained agent, or a rival that needs no training.

All are asked in one way, as `Furnishes`: for up to `choices` different layouts that place the items without a center.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from layoutrl import InputError
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.moving import Mover
from layoutrl.rivals.budgets import seconds_budget, updates_budget
from layoutrl.rivals.rooms.rival import SearchOrAnnealer
from layoutrl.rivals.rooms.search import Searching
from layoutrl.rooms.brief import missing
from layoutrl.rooms.called import by_any_name
from layoutrl.rooms.faults import ILL_PLACED, new_faults
from layoutrl.rooms.furnished import Furnished, Furnishes, same
from layoutrl.rooms.oddities import ODDITIES, faults_and_oddities
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources import main_item
from layoutrl.runs import pretrained
from layoutrl.runs.checked_brief import in_no_type, unstacked
from layoutrl.runs.config import PlaceConfig, TrainConfig
from layoutrl.runs.folder import load_config
from layoutrl.runs.machine import device_of
from layoutrl.runs.pretrained import Agents
from layoutrl.runs.trained import kept_agent
from layoutrl.runs.wording import any_of

# Of the search that helps where an agent's layout has a shortcoming, and of the next, where each layout still has a
# fault. With a limit in seconds, layouts would differ between machines.
RESTARTS = (8, 64)
LAYOUTS = 3  # that the furnisher itself is then asked for, where each still has a shortcoming,
MANY = 12  # but not for more items: it would take minutes
HALL = 625.0  # square metres of floor, beyond which the search takes seconds (two, in 25 m by 25 m)


@dataclass(frozen=True)
class FurnisherInfo:
    """A furnisher, and what it can place."""

    furnisher: Furnishes
    known: Callable[[str], Collection[str]]  # returns the categories that it places in rooms of a type
    types_placing: Callable[[str], Sequence[str]] = in_no_type  # returns the types in whose rooms it places a category


def furnisher_for(config: PlaceConfig) -> FurnisherInfo:
    """Return the furnisher that the configuration names; by default the agents in the package, helped by the search.

    Raises InputError if the agent of `run` cannot be loaded, or learned with `every_move`: then it does not know what
    places are worth.
    """
    if config.by in ("search", "annealer"):
        settings = config.search if config.by == "search" else config.annealer
        rival = SearchOrAnnealer(settings, lambda: seconds_budget(config.seconds, time.process_time))
        return FurnisherInfo(rival, lambda kind: by_any_name(kind, rival.relations(kind).alone))
    device = device_of(config.device)
    if config.run is None:
        agents: Furnishes = Agents(device)
        furnisher = agents if config.by == "agents" else helped(agents, config.search)
        return FurnisherInfo(furnisher, pretrained.placed, pretrained.types_with)
    folder = Path(config.run)
    trained = load_config(folder, TrainConfig)
    if trained.method.every_move:
        raise InputError(f"run: {folder} learned what moves gain, not what places are worth; expected another method")
    agent = kept_agent(folder, trained, device, config.checkpoint).agent
    whole = trained.method.scope == "room"
    moved = "all" if whole else item_of(trained, config.item, agent.categories)
    placed = agent.categories if moved == "all" else [moved]
    return FurnisherInfo(
        Furnisher(agent) if whole else Mover(agent, trained.reward),
        lambda room_type: placed if room_type == trained.room.type else (),
    )


class Helped:
    """A furnisher with searches to help it. Where one of its layouts has `shortcomings`, the first search is asked for
    as many layouts; where every layout then has a fault, the next search, which takes longer. Where every layout still
    has a shortcoming, the furnisher itself is asked for LAYOUTS.

    An item that anyone stacks on another loses its place: no room is left for it (`unstacked`). Rooms larger than HALL
    are not searched: it would take many times as long as the furnisher itself.
    """

    def __init__(self, one: Furnishes, *searches: Furnishes):
        self.one, self.searches = one, searches

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """See Furnishes. Layouts with fewer `shortcomings` come first; of equals those of `one`, in its order."""
        found = self._unstacked(self.one, briefs, choices, seed)
        lacks = shortcomings(briefs, found)

        def ask(who: Furnishes, those: Sequence[int], count: int, by: str) -> None:
            asked = [briefs[k] for k in those]
            others = self._unstacked(who, asked, count, seed)
            for k, theirs, lack in zip(those, others, shortcomings(asked, others), strict=True):
                found[k] += [replace(each, by=by or each.by) for each in theirs]
                lacks[k] += lack

        wanting = [k for k, lack in enumerate(lacks) if any(map(any, lack)) and briefs[k].indoor.area <= HALL]
        for search in self.searches:
            ask(search, wanting, choices, "the search")
            wanting = [k for k in wanting if all(faults for _, faults, _ in lacks[k])]
        if choices < LAYOUTS:
            lacking = [k for k, lack in enumerate(lacks) if all(map(any, lack)) and len(missing(briefs[k])) <= MANY]
            ask(self.one, lacking, LAYOUTS, "")
        return [best_apart(layouts, lack, choices) for layouts, lack in zip(found, lacks, strict=True)]

    @staticmethod
    def _unstacked(who: Furnishes, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        return [
            [replace(each, layout=unstacked(brief, each.layout)) for each in answers]
            for brief, answers in zip(briefs, who.furnish(briefs, choices, seed), strict=True)
        ]


def best_apart(layouts: Sequence[Furnished], lacks: Sequence[tuple[int, int, int]], choices: int) -> list[Furnished]:
    """Return up to `choices` layouts that differ, those that lack least first; equals stay in order."""
    best: list[Furnished] = []
    for k in sorted(range(len(layouts)), key=lambda k: lacks[k]):
        if not any(same(layouts[k].layout, each.layout) for each in best):
            best.append(layouts[k])
    return best[:choices]


def helped(agents: Furnishes, searching: Searching) -> Helped:
    """Return the agents, helped by a search with each number of RESTARTS in turn."""
    return Helped(agents, *(SearchOrAnnealer(searching, partial(updates_budget, restarts)) for restarts in RESTARTS))


def shortcomings(briefs: Sequence[Room], found: Sequence[Sequence[Furnished]]) -> list[list[tuple[int, int, int]]]:
    """Count for each layout of each brief: how many items are ILL_PLACED, new faults, and new oddities."""
    now = iter(faults_and_oddities([each.layout for layouts in found for each in layouts]))
    counted = []
    for layouts, before in zip(found, faults_and_oddities(briefs), strict=True):
        lacks = []
        for _ in layouts:
            wrong = new_faults(next(now), before)
            ill_placed, odd = {k for k, name in wrong if name in ILL_PLACED}, sum(name in ODDITIES for _, name in wrong)
            lacks.append((len(ill_placed), len(wrong) - odd, odd))
        counted.append(lacks)
    return counted


def item_of(trained: TrainConfig, asked: str | None, categories: Sequence[str]) -> str:
    """Return the category to place: the one `asked`, or else what the agent was trained to move, which may be "all".

    Raises InputError if the agent does not know the category asked, or is known to move another.
    """
    source, item = str(trained.data.source), trained.room.item
    moved = main_item(source, trained.room.type) if item == "main" else item
    known = moved != "all" and (item != "main" or source != "json")  # rooms in JSON may name other targets
    if asked and known and asked != moved:
        raise InputError(f"item: the agent was trained to move {any_of([moved])}; expected it, got {asked}")
    if asked and asked not in categories:
        raise InputError(f"item: expected what the agent knows, one of {', '.join(categories)}; got {asked}")
    return asked or moved
