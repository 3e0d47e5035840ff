"""Whatever is out of range is refused by its name, and the ends of a range are not."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict, replace
from math import inf, nan, nextafter
from typing import Any

import pytest

from layoutrl import InputError
from layoutrl.rooms.sources.parts import Data
from layoutrl.runs.config import composed
from layoutrl.runs.ranges import check_annealer, check_begin, check_data, check_method, check_search

METHOD = composed("train", "room=bedroom").method
RIVALS = composed("place", "rooms=any.jsonl")
TINY = 5e-324  # the least number above 0
SHARE = (0.0, 1.0), (-TINY, nextafter(1, 2), nan)  # what may be, and what may not
BELOW_ONE = (0.0, nextafter(1, 0)), (-TINY, 1.0, nan)
ABOVE_ZERO = (TINY, 1e300), (0.0, -1.0, inf, nan)
NOT_BELOW_ZERO = (0.0, 1e300), (-TINY, inf, nan)
COUNT, NUMBER = ((1, 2), (0, -1)), ((0, 1), (-1,))
Range = tuple[tuple[float, ...], tuple[float, ...]]
FEWEST = max(METHOD.batch, METHOD.episodes)
METHODS = {
    "learning_rate": ABOVE_ZERO,
    "discount": BELOW_ONE,
    "goal_iou": ((TINY, 1.0), (0.0, nextafter(1, 2), nan)),
    "snap": NOT_BELOW_ZERO,
    "climbs": NUMBER,
    "replay_capacity": ((FEWEST,), (FEWEST - 1,)),
    **dict.fromkeys(("epsilon_start", "epsilon_end", "epsilon_share", "near_share", "own_share"), SHARE),
    **dict.fromkeys(("max_moves", "evaluation_moves", "target_period", "warmup_moves", "batch", "episodes"), COUNT),
}
HEAT = [f"{when}_{name}" for name in ("temperature", "shift", "rules") for when in ("first", "last")]
SEARCHES = {"grid": ABOVE_ZERO, "best": COUNT, "nodes": COUNT, "noise": NOT_BELOW_ZERO}
ANNEALERS = {"chains": COUNT, "cold": BELOW_ONE, **dict.fromkeys(HEAT, ABOVE_ZERO)}
DATA = {"train_rooms": COUNT, "test_rooms": COUNT, "seed": NUMBER, "disturbed": SHARE}
Check = Callable[[Any], None]


def check_of_method(method: Any) -> None:
    check_method("method", method)


@pytest.mark.parametrize(
    ("check", "settings", "prefix", "ranges"),
    [
        (check_of_method, METHOD, "method", METHODS),
        (check_search, RIVALS.search, "search", SEARCHES),
        (check_annealer, RIVALS.annealer, "annealer", ANNEALERS),
        (check_data, Data("designer"), "data", DATA),
    ],
)
def test_the_ends_of_a_range_are_in_it_and_all_beyond_is_refused_by_name(
    check: Check, settings: Any, prefix: str, ranges: dict[str, Range]
) -> None:
    for name, (within, beyond) in ranges.items():
        for value in within:
            check(replace(settings, **{name: value}))
        for value in beyond:
            with pytest.raises(InputError, match=rf"^{prefix}\.{name}: expected .*; got {value}$"):
                check(replace(settings, **{name: value}))


@pytest.mark.parametrize(
    ("batch", "episodes", "said"), [(8, 4, "8 or more, a batch"), (4, 8, "8 or more, a move of each episode")]
)
def test_a_replay_holds_a_batch_and_a_move_of_each_episode(batch: int, episodes: int, said: str) -> None:
    method = replace(METHOD, batch=batch, episodes=episodes, replay_capacity=7)
    with pytest.raises(InputError, match=rf"^method\.replay_capacity: expected {said}; got 7$"):
        check_of_method(method)


@pytest.mark.parametrize(
    ("check", "settings", "name"),
    [(check_search, RIVALS.search, "search"), (check_annealer, RIVALS.annealer, "annealer")],
)
def test_each_weight_of_a_rival_is_asked_for_and_none_is_below_zero(check: Check, settings: Any, name: str) -> None:
    for key in settings.weights:
        check(replace(settings, weights=settings.weights | {key: 0.0}))
        for value in (-TINY, nan):
            with pytest.raises(InputError, match=rf"^{name}\.weights\.{key}: expected 0 or more; got "):
                check(replace(settings, weights=settings.weights | {key: value}))
        less = {other: weight for other, weight in settings.weights.items() if other != key}
        with pytest.raises(InputError, match=rf"^{name}\.weights: expected .*{key}.*; got no {key}$"):
            check(replace(settings, weights=less))


@pytest.mark.parametrize(
    ("check", "settings", "path"),
    [
        (check_search, RIVALS.search, "search.weights"),
        (check_annealer, RIVALS.annealer, "annealer.weights"),
        (check_annealer, RIVALS.annealer, "annealer.moves"),
    ],
)
def test_no_weight_of_a_rival_is_infinite(check: Check, settings: Any, path: str) -> None:
    name = path.rpartition(".")[2]
    values = getattr(settings, name)
    for key in values:
        with pytest.raises(InputError, match=rf"^{path}\.{key}: expected a finite number; got inf$"):
            check(replace(settings, **{name: values | {key: inf}}))


@pytest.mark.parametrize(
    ("given", "found", "expected"),
    [
        ((), "scope=item", "scope=room"),
        (("scope=room", "method.steps=[0.3]"), "method.steps=[0.3]", "method.steps=[0.32, 0.08, 0.02, 0.005]"),
        (("scope=room", "method.slide=false"), "method.slide=False", "method.slide=True"),
        (("scope=room", "method.dueling=false"), "method.dueling=False", "method.dueling=True"),
    ],
)
def test_no_agent_begins_with_one_that_is_otherwise(given: tuple[str, ...], found: str, expected: str) -> None:
    before = asdict(composed("train", "scope=room").method)
    message = f"begin=package: expected {expected}, as that agent has it; got {found}"
    with pytest.raises(InputError, match=re.escape(message)):
        check_begin(composed("train", *given).method, before)
    check_begin(composed("train", "scope=room", "method.batch=32").method, before)
    with pytest.raises(InputError, match=r"^begin"):
        composed("train", "begin=package", *given)
