"""What users give to the environments is taken as they mean it, or refused before it does anything."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from hypothesis import example, given, settings
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.env.arguments import (
    check_at_least_one,
    checked_action,
    checked_options,
    checked_room,
    rooms_or_default,
    rooms_with_targets_or_default,
)
from layoutrl.rooms.room import MAIN_ITEM, Item
from tests.builders import l_room, random_room, rectangular_room

WHOLE = st.integers(-3, 12)
NUMPY = st.sampled_from([np.int64, np.int32, np.uint8])
NO_NUMBERS = st.sampled_from([True, False, np.True_, "1", "", [1], (1,), {}, np.array([1]), Fraction(3, 2), np.nan])
THINGS = WHOLE | WHOLE.map(float) | NO_NUMBERS | st.builds(lambda kind, n: kind(n), NUMPY, st.integers(0, 12))


def is_whole(thing: Any) -> bool:
    """As Python counts with it: what can be an index, and is no truth value."""
    return hasattr(thing, "__index__") and np.ndim(thing) == 0 and not isinstance(thing, bool | np.bool_ | np.ndarray)


@given(THINGS, st.integers(1, 10))
@example(0, 1)
@example(-1, 1)
@example(np.int64(4), 5)
@example(np.int64(5), 5)
@example(True, 5)
@example(np.True_, 5)
@example(1.0, 5)
def test_a_room_an_action_and_a_count_are_whole_numbers_in_range_and_no_truth_values(thing: Any, count: int) -> None:
    in_range = is_whole(thing) and 0 <= thing < count
    if in_range:
        assert checked_room(thing, count) == thing
        assert type(checked_action(thing, spaces.Discrete(count))) is int
        assert checked_action(thing, spaces.Discrete(count)) == thing
    else:
        with pytest.raises(
            ValueError, match=rf"^options\['room'\]: expected a whole number from 0 to {count - 1}; got"
        ):
            checked_room(thing, count)
        with pytest.raises(ValueError, match=rf"^action: expected a whole number from 0 to {count - 1}; got"):
            checked_action(thing, spaces.Discrete(count))
    if is_whole(thing) and thing >= 1:
        check_at_least_one(moves=1, rooms=thing)
    else:
        with pytest.raises(ValueError, match=r"^rooms: expected a whole number, 1 or more; got "):
            check_at_least_one(moves=1, rooms=thing)


def test_a_room_that_is_not_asked_for_is_drawn() -> None:
    assert checked_room(None, 3) is None


@given(st.dictionaries(st.sampled_from(["room", "place", "rooms", "seed"]), st.none(), max_size=3) | st.none())
def test_the_options_of_a_reset_have_the_names_that_it_knows(options: dict[str, Any] | None) -> None:
    if {*(options or {})} <= {"room", "place"}:
        assert checked_options(options, "room", "place") == (options or {})
    else:
        with pytest.raises(ValueError, match=r"^options: expected a dict of room and place; got"):
            checked_options(options, "room", "place")


def test_rooms_are_those_that_are_given_and_where_one_item_moves_it_stands_somewhere() -> None:
    rooms = (l_room(), rectangular_room(id="open", item=Item("bed", (1.0, 1.0), None)))
    assert rooms_or_default(rooms) is rooms
    assert rooms_with_targets_or_default(rooms[:1]) == rooms[:1]
    with pytest.raises(InputError, match=r"^rooms: the bed of open has no center; "):
        rooms_with_targets_or_default(rooms)
    said = "^rooms: nothing says which item of none moves; expected one bed, or `target`, the index of another item$"
    with pytest.raises(InputError, match=said):
        rooms_with_targets_or_default([replace(rooms[0], id="none", target=None)])
    for take in (rooms_or_default, rooms_with_targets_or_default):
        with pytest.raises(InputError, match=r"^rooms: expected at least one room$"):
            take([])
        with pytest.raises(InputError, match=r"^rooms: expected a list of rooms, .* got "):
            take([*rooms, None])


CATEGORIES = sorted({*MAIN_ITEM.values(), "chair", "wardrobe", "shower", "shelf"})  # of random rooms
SPACES: dict[str, dict[str, Any]] = {
    "layoutrl/Layout-v0": {"categories": CATEGORIES, "elements": 40},
    "layoutrl/Rooms-v0": {"categories": CATEGORIES, "elements": 40, "items": 9},
}


def made(name: str, **keywords: Any) -> tuple[gymnasium.Env, VectorEnv]:
    """The single environment and the vector environment."""
    vector = gymnasium.make_vec(name, num_envs=2, vectorization_mode="vector_entry_point", **keywords)
    return gymnasium.make(name, **keywords), vector


@pytest.mark.parametrize("name", SPACES)
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_a_room_looks_the_same_in_any_environment_of_the_same_given_spaces(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rooms = [random_room(rng) for _ in range(3)]
    (alone, vector), (among, others) = (made(name, rooms=some, **SPACES[name]) for some in (rooms[:1], rooms[::-1]))
    assert alone.observation_space == among.observation_space == vector.single_observation_space
    assert alone.action_space == among.action_space == vector.single_action_space
    assert vector.observation_space == others.observation_space
    needed = gymnasium.make(name, rooms=rooms[:1], categories=SPACES[name]["categories"])
    shown, bare = ({tuple(row) for row in env.reset(seed=1)[0]} for env in (alone, needed))
    assert shown - bare <= {(0.0,) * alone.observation_space.shape[1]}  # what more rows there are is left over
    one, other = (env.reset(seed=2, options={"room": room})[0] for env, room in ((alone, 0), (among, 2)))
    np.testing.assert_array_equal(one[1:], other[1:])  # the first may move, from where it is drawn


@pytest.mark.parametrize("name", SPACES)
def test_spaces_that_hold_less_than_the_rooms_have_are_refused(name: str) -> None:
    room = rectangular_room(4, 3, Item("bed", (1.0, 1.0), (0.5, 0.5)), others=(Item("lamp", (0.3, 0.3), (3.0, 2.0)),))
    rows = len(room.walls) + len(room.openings) + 2
    given = {"categories": ["bed", "lamp"], "elements": rows}
    if name == "layoutrl/Rooms-v0":
        given["items"] = 2
    made(name, rooms=[room], **given)
    wrong = [
        ({"categories": ["bed"]}, f"categories: expected lamp among them, as room {room.id} has"),
        ({"categories": "bed"}, "categories: expected a list of different names; got 'bed'"),
        ({"categories": {"bed"}}, "categories: expected a list of different names; got {'bed'}"),
        (
            {"categories": ["bed", "lamp", "bed"]},
            "categories: expected a list of different names; got ['bed', 'lamp', 'bed']",
        ),
        ({"categories": 5}, "categories: expected a list of different names; got 5"),
        (
            {"elements": rows - 1},
            f"elements: expected {rows} or more: so many rows do these rooms fill; got {rows - 1}",
        ),
        ({"elements": 2.5}, "elements: expected a whole number, 1 or more; got 2.5"),
    ]
    if "items" not in given:
        none = "categories, elements: expected none with observation='image', which looks alike in all rooms"
        wrong.append(({"observation": "image"}, none))
    else:
        wrong += [
            ({"items": 1}, f"items: expected 2 or more, as room {room.id} has to place; got 1"),
            ({"items": "2"}, "items: expected a whole number, 1 or more; got '2'"),
        ]
    for change, words in wrong:
        for make in (gymnasium.make, partial(gymnasium.make_vec, num_envs=2, vectorization_mode="vector_entry_point")):
            with pytest.raises(ValueError, match=f"^{re.escape(words)}$"):
                make(name, rooms=[room], **given | change)
