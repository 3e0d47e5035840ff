"""What users give to the environments is taken as they mean it, or refused before it does anything."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import example, given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.env.arguments import (
    check_at_least_one,
    checked_action,
    checked_options,
    checked_room,
    given_or_some,
    standing_or_some,
)
from layoutrl.rooms.room import Item
from tests.builders import l_room, rectangular_room

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
    assert given_or_some(rooms) is rooms
    assert standing_or_some(rooms[:1]) == rooms[:1]
    with pytest.raises(InputError, match=r"^rooms: the bed of open has no center; "):
        standing_or_some(rooms)
    for take in (given_or_some, standing_or_some):
        with pytest.raises(InputError, match=r"^rooms: expected at least one room$"):
            take([])
        with pytest.raises(InputError, match=r"^rooms: expected a list of rooms, .* got "):
            take([*rooms, None])
