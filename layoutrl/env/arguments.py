"""Checks of what users pass in Python: rooms; to the environments also moves, options of a reset, actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded

from layoutrl import InputError
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Room

Begun = TypeVar("Begun")


def rooms_or_default(rooms: Sequence[Room] | None) -> Sequence[Room]:
    """The rooms, or ten designed bedrooms where None are given. Raises InputError for any but a list of one or more."""
    if rooms is None:
        return design_rooms("bedroom", "train", seed=0, count=10).rooms
    check_rooms(rooms)
    if not rooms:
        raise InputError("rooms: expected at least one room")
    return rooms


def check_rooms(rooms: Sequence[Room]) -> None:
    """Raise InputError for any but a list of rooms, which may be empty."""
    if not (isinstance(rooms, Sequence) and all(isinstance(room, Room) for room in rooms)):
        raise InputError(f"rooms: expected a list of rooms, as read_rooms(file).rooms is; got {rooms!r:.60}")


def rooms_with_targets_or_default(rooms: Sequence[Room] | None) -> Sequence[Room]:
    """As `rooms_or_default`; also raises InputError where a room has no target, or that has no center."""
    rooms = rooms_or_default(rooms)
    for room in rooms:
        if room.target is None:
            main = MAIN_ITEM[room.room_type]
            raise InputError(
                f"rooms: nothing says which item of {room.id} moves; expected one {main}, or `target`, the index "
                "of another item"
            )
        if room.moving.center is None:
            raise InputError(
                f"rooms: the {room.moving.category} of {room.id} has no center; expected the designer's place of what "
                "moves (layoutrl/Rooms-v0 takes rooms that are still to be furnished)"
            )
    return rooms


def check_spaces(
    rooms: Sequence[Room],
    categories: Sequence[str] | None,
    elements: int | None,
    observation: str = "geometry",
    waiting: bool = True,
) -> None:
    """Check what fixes the space of an observation: `categories`, in the order of their columns, and rows (`elements`).

    None stands for what the rooms need. What has no place counts only if it is `waiting` for one. Raises ValueError
    unless categories are different names and elements is 1 or more, and for either with pictures; InputError where a
    room has furniture that is not among the categories.
    """
    if observation == "image" and (categories, elements) != (None, None):
        raise ValueError("categories, elements: expected none with observation='image', which looks alike in all rooms")
    if elements is not None:
        check_at_least_one(elements=elements)
    if categories is None:
        return
    names = isinstance(categories, Sequence) and not isinstance(categories, str)
    if not (names and all(isinstance(name, str) for name in categories) and len({*categories}) == len(categories)):
        raise ValueError(f"categories: expected a list of different names; got {categories!r:.60}")
    for room in rooms:
        if unknown := {*categories_of([room], waiting)} - {*categories}:
            raise InputError(f"categories: expected {', '.join(sorted(unknown))} among them, as room {room.id} has")


def moves_and_reward_or_default(moves: Moves | None, reward: Reward | None) -> tuple[Moves, Reward]:
    """Return moves and reward, with the defaults for None. Raises ValueError for objects of another type."""
    for name, given, kind in (("moves", moves, Moves), ("reward", reward, Reward)):
        if not (given is None or isinstance(given, kind)):
            raise ValueError(f"{name}: expected {kind.__name__}(...) or None; got {given!r:.60}")
    return moves or Moves(), reward or Reward()


def checked_options(options: dict[str, Any] | None, *names: str) -> dict[str, Any]:
    """Return the options of a reset, {} for None. Raises ValueError for all but a dict with keys among `names`."""
    if not (options is None or (isinstance(options, dict) and options.keys() <= {*names})):
        raise ValueError(f"options: expected a dict of {' and '.join(names)}; got {options!r:.60}")
    return options or {}


def checked_room(room: Any, count: int) -> int | None:
    """Return the room that a reset's options name, None to draw one. Raises ValueError for what is no room's index."""
    if room is not None and not (is_whole(room) and 0 <= room < count):
        raise ValueError(f"options['room']: expected a whole number from 0 to {count - 1}; got {room!r}")
    return room


def refuse_options(options: dict[str, Any] | None) -> None:
    """Raises ValueError for any option of a reset of several environments at once."""
    if options:
        raise ValueError(f"options: expected none; got {options}")


def checked_action(action: Any, actions: spaces.Discrete) -> int:
    """Return an action, legal or not, as an int. Raises ValueError for what is not in the action space."""
    if isinstance(action, bool) or not actions.contains(action):
        raise ValueError(f"action: expected a whole number from 0 to {actions.n - 1}; got {action!r}")
    return int(action)


def begun(episode: Begun | None) -> Begun:
    """Return the episode that a reset began. Raises gymnasium's ResetNeeded before the first reset."""
    if not episode:
        raise ResetNeeded("expected a call of reset before step, render and action_masks")
    return episode


def check_at_least_one(**counts: int) -> None:
    """Raise ValueError, which names the argument, for a count that is not a whole number of 1 or more."""
    for name, count in counts.items():
        if not is_whole(count) or count < 1:
            raise ValueError(f"{name}: expected a whole number, 1 or more; got {count!r}")


def check_render_mode(mode: str | None) -> None:
    """Raise ValueError for an unknown render mode."""
    if mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode: expected rgb_array or None; got {mode!r}")


def is_whole(number: object) -> bool:
    """Return whether a number is an integer of Python or NumPy, and no bool."""
    return isinstance(number, int | np.integer) and not isinstance(number, bool)
