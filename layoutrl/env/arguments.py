"""What users give to the environments, checked: rooms, moves, a reset's options, actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded

from layoutrl import InputError
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Room

Begun = TypeVar("Begun")


def given_or_some(rooms: Sequence[Room] | None) -> Sequence[Room]:
    """The rooms, or ten designed bedrooms where None are given. Raises InputError for any but a list of one or more."""
    if rooms is None:
        return design_rooms("bedroom", "train", seed=0, count=10).rooms
    if not (isinstance(rooms, Sequence) and all(isinstance(room, Room) for room in rooms)):
        raise InputError(f"rooms: expected a list of rooms, as read_rooms(file).rooms is; got {rooms!r:.60}")
    if not rooms:
        raise InputError("rooms: expected at least one room")
    return rooms


def standing_or_some(rooms: Sequence[Room] | None) -> Sequence[Room]:
    """As `given_or_some`. Raises InputError where the item that moves has no center, too."""
    rooms = given_or_some(rooms)
    for room in rooms:
        if room.moving.center is None:
            raise InputError(
                f"rooms: the {room.moving.category} of {room.id} has no center; expected the designer's place of what "
                "moves (layoutrl/Rooms-v0 takes rooms that are still to be furnished)"
            )
    return rooms


def check_spaces(
    rooms: Sequence[Room], categories: Sequence[str] | None, elements: int | None, observation: str = "geometry"
) -> None:
    """Checks what fixes the space of an observation: the categories that are known, in their order, and its rows.

    None is what the rooms need. Raises ValueError for what is neither that nor different names and a count, and for any
    with pictures; InputError where a room has furniture that is not among the categories.
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
        if unknown := {item.category for item in room.furniture} - {*categories}:
            raise InputError(f"categories: expected {', '.join(sorted(unknown))} among them, as room {room.id} has")


def given_or_default(moves: Moves | None, reward: Reward | None) -> tuple[Moves, Reward]:
    """Moves and a reward, the project's where None are given. Raises ValueError for what is neither."""
    for name, given, kind in (("moves", moves, Moves), ("reward", reward, Reward)):
        if not (given is None or isinstance(given, kind)):
            raise ValueError(f"{name}: expected {kind.__name__}(...) or None; got {given!r:.60}")
    return moves or Moves(), reward or Reward()


def checked_options(options: dict[str, Any] | None, *names: str) -> dict[str, Any]:
    """The options of a reset, which may have these names. Raises ValueError for all else."""
    if not (options is None or (isinstance(options, dict) and options.keys() <= {*names})):
        raise ValueError(f"options: expected a dict of {' and '.join(names)}; got {options!r:.60}")
    return options or {}


def checked_room(room: Any, count: int) -> int | None:
    """The room that a reset's options ask for; None: it is to be drawn. Raises ValueError for no such room."""
    if room is not None and not (is_whole(room) and 0 <= room < count):
        raise ValueError(f"options['room']: expected a whole number from 0 to {count - 1}; got {room!r}")
    return room


def refuse_options(options: dict[str, Any] | None) -> None:
    """Raises ValueError for any option of a reset of several environments at once."""
    if options:
        raise ValueError(f"options: expected none; got {options}")


def checked_action(action: Any, actions: spaces.Discrete) -> int:
    """The number of an action of the space, legal now or not. Raises ValueError for all else."""
    if isinstance(action, bool) or not actions.contains(action):
        raise ValueError(f"action: expected a whole number from 0 to {actions.n - 1}; got {action!r}")
    return int(action)


def begun(episode: Begun | None) -> Begun:
    """What a reset made. Raises gymnasium's ResetNeeded before the first."""
    if not episode:
        raise ResetNeeded("expected a call of reset before step, render and action_masks")
    return episode


def check_at_least_one(**counts: int) -> None:
    """Raises ValueError, with its name, for what is no count of one or more."""
    for name, count in counts.items():
        if not is_whole(count) or count < 1:
            raise ValueError(f"{name}: expected a whole number, 1 or more; got {count!r}")


def check_render_mode(mode: str | None) -> None:
    """Raises ValueError for what is no way to render."""
    if mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode: expected rgb_array or None; got {mode!r}")


def is_whole(number: object) -> bool:
    """Whether it is a whole number; True and False are none here."""
    return isinstance(number, int | np.integer) and not isinstance(number, bool)
