"""Checks of the values of a configuration. A value out of range is answered with what was expected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from layoutrl import InputError
from layoutrl.agents.method import MOST_ACTIONS, Method
from layoutrl.rivals.rooms.annealer import MOVES, Annealing
from layoutrl.rivals.rooms.cost import PREFERENCES, RULES
from layoutrl.rivals.rooms.search import Searching
from layoutrl.rooms.sources import FILES
from layoutrl.rooms.sources.parts import Data
from layoutrl.rooms.units import UNITS

MOST_COUNT = 2**31 - 1
FOLDER = "the name of a folder, without / and \\"
# Which sources have a field of Data. Those that are not here may be set for all, by a budget or a scope.
OF_SOURCES = {
    "labels": ("floorplans",),
    "strict": ("json",),
    "unit": ("json",),
    "categories": ("sweethome3d", "procthor", "front3d"),
}


def check_method(prefix: str, method: Method) -> None:
    """Raises InputError for what is out of range; `prefix` is where it stands in the configuration."""
    within(f"{prefix}.learning_rate", method.learning_rate, 0 < method.learning_rate < inf, "more than 0, and finite")
    one_of(f"{prefix}.observation", method.observation, "geometry", "image")
    one_of(f"{prefix}.scope", method.scope, "item", "room")
    if method.scope == "room":
        one_of(f"{prefix}.observation of whole rooms", method.observation, "geometry")
    check_on_illegal(f"{prefix}.on_illegal", method)
    for name in ("max_moves", "evaluation_moves", "batch", "episodes", "target_period", "warmup_moves"):
        value = getattr(method, name)
        within(f"{prefix}.{name}", value, value >= 1, "1 or more")
        within(f"{prefix}.{name}", value, value <= MOST_COUNT, f"at most {MOST_COUNT}")
    within(f"{prefix}.climbs", method.climbs, 0 <= method.climbs <= MOST_COUNT, f"0 or more, at most {MOST_COUNT}")
    within(f"{prefix}.snap", method.snap, 0 <= method.snap < inf, "0 or more metres, and finite")
    sees_lines = method.observation == "geometry" or not method.snap
    within(f"{prefix}.snap", method.snap, sees_lines, f"0 with {prefix}.observation=image")
    for name in ("epsilon_start", "epsilon_end", "epsilon_share", "near_share", "own_share"):
        share = getattr(method, name)
        within(f"{prefix}.{name}", share, 0 <= share <= 1, "0 to 1")
    most = MOST_ACTIONS // 4 - method.slide  # in four directions each, as slides are
    within(f"{prefix}.steps", method.steps, len(method.steps) <= most, f"at most {most} lengths")
    try:
        method.moves  # noqa: B018  which says itself what steps and their unit may be
    except InputError as error:
        raise InputError(f"{prefix}.{error}") from None
    given = "room.whole_updates" if method.scope == "room" else "room.updates"  # in conf/, of budget=default
    enough = min(method.updates.values(), default=0) >= 1
    within(f"{prefix}.updates", method.updates, enough, f"1 or more each (default: as {given} says)")
    within(
        f"{prefix}.updates", method.updates, max(method.updates.values()) <= MOST_COUNT, f"at most {MOST_COUNT} each"
    )
    fewest, what = max((method.batch, "a batch"), (method.episodes, "a move of each episode"))
    capacity = method.replay_capacity
    within(f"{prefix}.replay_capacity", capacity, capacity >= fewest, f"{fewest} or more, {what}")
    within(f"{prefix}.replay_capacity", capacity, capacity <= MOST_COUNT, f"at most {MOST_COUNT}")
    within(f"{prefix}.discount", method.discount, 0 <= method.discount < 1, "0 <= discount < 1")
    if method.every_move:
        first = method.discount_start
        within(f"{prefix}.discount_start", first, 0 <= first <= method.discount, "0 to the discount")
        within(f"{prefix}.scope", method.scope, method.scope == "item", f"item with {prefix}.every_move")
        within(f"{prefix}.double", method.double, not method.double, f"false with {prefix}.every_move")
        within(f"{prefix}.climbs", method.climbs, method.climbs == 0, f"0 with {prefix}.every_move")
        within(f"{prefix}.snap", method.snap, method.snap == 0, f"0 with {prefix}.every_move")
        within(f"{prefix}.slide", method.slide, not method.slide, f"false with {prefix}.every_move: no slide goes back")
    if (goal := method.goal_iou) is not None:
        within(f"{prefix}.goal_iou", goal, 0 < goal <= 1, "more than 0, up to 1; or null: no goal")
        can_end = method.scope == "item" and not method.every_move
        within(f"{prefix}.goal_iou", goal, can_end, "null, of whole rooms and with every_move")


def check_on_illegal(name: str, method: Method) -> None:
    """Raises InputError if the method cannot be tested with its `on_illegal`; `name` is that of the option."""
    if method.scope == "room":
        one_of(f"{name} of whole rooms", method.on_illegal, "mask")
    if method.every_move:
        one_of(f"{name} with every_move", method.on_illegal, "mask")
    one_of(name, method.on_illegal, "stop", "mask")


def check_search(search: Any) -> None:
    """Raises InputError for what is out of range in `search` of a configuration, if it has one."""
    if isinstance(search, Searching):  # it is the text MISSING otherwise
        within("search.grid", search.grid, search.grid > 0, "more than 0")
        finite("search.grid", search.grid)
        for name in ("best", "nodes"):
            value = getattr(search, name)
            within(f"search.{name}", value, value >= 1, "1 or more")
        within("search.noise", search.noise, search.noise >= 0, "0 or more")
        finite("search.noise", search.noise)
        _named_numbers("search.weights", search.weights, PREFERENCES, PREFERENCES)


def check_annealer(annealer: Any) -> None:
    """As `check_search`, of `annealer`."""
    if isinstance(annealer, Annealing):
        within("annealer.chains", annealer.chains, annealer.chains >= 1, "1 or more")
        within("annealer.cold", annealer.cold, 0 <= annealer.cold < 1, "0 <= cold < 1")
        for name in ("temperature", "shift", "rules"):
            for when in ("first", "last"):
                value = getattr(annealer, f"{when}_{name}")
                within(f"annealer.{when}_{name}", value, value > 0, "more than 0")
                finite(f"annealer.{when}_{name}", value)
        _named_numbers("annealer.moves", annealer.moves, MOVES)
        often = annealer.moves
        within("annealer.moves", often, sum(often.values()) > 0, "one kind or more that is more often than 0")
        terms = (*RULES, *PREFERENCES)
        _named_numbers("annealer.weights", annealer.weights, terms, terms)


def _named_numbers(name: str, values: dict[str, float], allowed: Sequence[str], needed: Sequence[str] = ()) -> None:
    for key, value in values.items():
        one_of(name, key, *allowed)
        within(f"{name}.{key}", value, value >= 0, "0 or more")
        finite(f"{name}.{key}", value)
    if lacking := [key for key in needed if key not in values]:
        raise InputError(f"{name}: expected {', '.join(needed)}; got no {', '.join(lacking)}")


def check_data(data: Data) -> None:
    """Raises InputError for what is out of range; None means that it is not given."""
    if data.source is not None:
        one_of("data.source", data.source, "designer", *FILES)
    if data.labels is not None:
        one_of("data.labels", data.labels, "snapped", "raw")
    for name, lowest in (("train_rooms", 1), ("test_rooms", 1), ("seed", 0)):
        value = getattr(data, name)
        within(f"data.{name}", value, value is None or value >= lowest, f"{lowest} or more")
    within("data.disturbed", data.disturbed, data.disturbed is None or 0 <= data.disturbed <= 1, "0 to 1")
    if data.unit is not None:
        one_of("data.unit", data.unit, "auto", *UNITS)


def check_of_source(data: Data) -> None:
    """Raises InputError for an option of another source. Not part of `check_data`: older runs may have it."""
    for name, sources in OF_SOURCES.items():
        value = getattr(data, name)
        used = data.source in (None, *sources) or value in (None, getattr(Data, name))
        within(f"data.{name}", value, used, f"none, as it is of data={' or '.join(sources)} alone")


def check_new(data: Data, fold: int, method_name: str) -> None:
    """Raises InputError for what no new run may have, though older ones may."""
    check_of_source(data)
    usual = "0, as the designer makes rooms of their own to test in"
    within("fold", fold, fold == 0 or data.source != "designer", usual)
    within("method.name", method_name, names_folder(method_name), FOLDER)


def check_begin(method: Method, before: Mapping[str, Any]) -> None:
    """Raises InputError if the agent in the package, trained by the method `before`, observes or moves differently."""
    for of in ("scope", "observation", "steps", "unit", "slide", "dueling"):
        option = of if of == "scope" else f"method.{of}"
        ours, theirs = getattr(method, of), before[of]
        within("begin=package", f"{option}={ours}", ours == theirs, f"{option}={theirs}, as that agent has it")


def names_folder(name: str) -> bool:
    """Whether a text can be the name of a folder, or a part of it."""
    return name not in ("", ".", "..") and not {*name} & {"/", "\\", "\0"}


def one_of(name: str, value: str, *allowed: str) -> None:
    """Raises InputError for a value that is none of those allowed."""
    within(name, value, value in allowed, f"one of {', '.join(allowed)}")


def finite(name: str, value: float) -> None:
    """Raises InputError for infinity."""
    within(name, value, value < inf, "a finite number")


def within(name: str, value: Any, holds: bool, expected: str) -> None:
    """Raises InputError unless `holds`; `expected` says what the value should be."""
    if not holds:
        raise InputError(f"{name}: expected {expected}; got {value}")
