"""The simulator as a Gymnasium environment: one room, one item, one move at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, SupportsFloat

import gymnasium
import numpy as np
from gymnasium import spaces

from layoutrl.env.arguments import (
    begun,
    check_at_least_one,
    check_render_mode,
    check_spaces,
    checked_action,
    checked_options,
    checked_room,
    moves_and_reward_or_default,
    rooms_with_targets_or_default,
)
from layoutrl.env.geometry import snap
from layoutrl.env.observation import observation_of
from layoutrl.env.render import story
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.single import SingleSimulator
from layoutrl.rooms.room import Point, Room


class LayoutEnv(gymnasium.Env[np.ndarray, np.int64]):
    """`gymnasium.make("layoutrl/Layout-v0", rooms=..., observation="geometry", moves=Moves(...))`.

    Every room needs a target with a center, the designer's place for it; other items without a center are left out.
    Every reset draws a room (or takes `options={"room": index}`) and a random start (or takes
    `options={"position": (x, y)}` in metres, which needs `room` if there are several rooms).

    action: Discrete(A), see Moves. observation: `geometry` float32 (elements, columns) or `image`
    uint8 (128, 128, 3). reward: the paper's, -200 to 100.
    info: `legal`, the mask (A,) of moves that stay in the envelope; `r1`, `r2`, `r3`, `r4`; `iou`;
    `position` in metres; `room`, its index; `illegal`, whether this move was illegal. `action_masks()` is
    `legal`, under the name that sb3-contrib's MaskablePPO asks for.

    The space of `geometry` depends on the rooms, unless `categories`, those that have a column, and `elements`, the
    number of rows, are given: environments with the same of both have the same spaces.

    Areas are those of `Simulator`, computed in closed form and double precision, with discs as true circles.

    An illegal move is dropped with `on_illegal="drop"` (training, section 4.2 of the paper): nothing
    changes, and the caller should not store it. With `"stop"` (test) it terminates the episode: nothing else does.
    An episode is truncated after `max_moves` moves, dropped ones included.

    Raises ValueError where a room has no target, a target that does not fit, or more than the given space
    holds; for an action outside the action space; for invalid options of a reset, which then leaves the
    environment as it was. Raises gymnasium's ResetNeeded for `step`, `render` and `action_masks` before
    the first reset.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 8}  # noqa: RUF012
    action_space: spaces.Discrete

    def __init__(
        self,
        rooms: Sequence[Room] | None = None,
        observation: Literal["geometry", "image"] = "geometry",
        moves: Moves | None = None,
        reward: Reward | None = None,
        on_illegal: Literal["drop", "stop"] = "drop",
        max_moves: int = 100,
        render_mode: str | None = None,
        categories: Sequence[str] | None = None,
        elements: int | None = None,
    ):
        if on_illegal not in ("drop", "stop"):
            raise ValueError(f"on_illegal: expected drop or stop; got {on_illegal!r}")
        check_render_mode(render_mode)
        check_at_least_one(max_moves=max_moves)
        rooms = rooms_with_targets_or_default(rooms)
        check_spaces(rooms, categories, elements, observation, waiting=False)
        self.simulator = Simulator(rooms, *moves_and_reward_or_default(moves, reward))
        self.max_moves = max_moves
        self.on_illegal = on_illegal
        self.render_mode = render_mode
        self.action_space = spaces.Discrete(self.simulator.moves.count)
        self._observe = observation_of(observation, rooms, categories=categories, elements=elements)
        self.observation_space = self._observe.space
        self._singles: dict[int, SingleSimulator] = {}  # of the rooms that were met, 13 kB each
        self._path: list[Point] = []  # positions, metres, of this episode; none before the first reset

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; return its first observation and info. A ValueError leaves the environment as it was."""
        room, position = self._chosen(checked_options(options, "room", "position"))  # refused before anything changes
        super().reset(seed=seed)
        drawn = self.np_random.integers(len(self.simulator.rooms))  # drawn even where it is not used
        self._room = int(drawn if room is None else room)
        if position is None:
            position = self.simulator.starts(np.array([self._room]), self.np_random)[0]
        self._path = [tuple(position.tolist())]
        if self._room not in self._singles:
            self._singles[self._room] = SingleSimulator(self.simulator, self._room)
        self._moves_made = 0
        return self._observation(), self._arrive() | {"illegal": False}

    def step(self, action: np.int64 | int) -> tuple[np.ndarray, SupportsFloat, bool, bool, dict[str, Any]]:
        """Make one action; return observation, reward, terminated, truncated and info."""
        begun(self._path)
        action = checked_action(action, self.action_space)
        illegal = not self._legal[action]
        if not illegal:
            self._path.append(self._reached[action])
        self._moves_made += 1
        info = self._arrive() | {"illegal": illegal}
        terminated = illegal and self.on_illegal == "stop"
        return self._observation(), self._total, terminated, self._moves_made >= self.max_moves, info

    def action_masks(self) -> np.ndarray:
        """The moves that are legal now: bool (A,)."""
        begun(self._path)
        return self._legal.copy()

    def render(self) -> np.ndarray | None:
        """Return a picture of the path so far, uint8 (384, 384, 3): start pale, item red, designer's place outlined.

        It is for people: an agent that learns from these pictures is told the answer. None without a render mode.
        """
        begun(self._path)
        if self.render_mode != "rgb_array":
            return None
        return story(self.simulator.rooms[self._room], np.array(self._path))

    def _chosen(self, options: dict[str, Any]) -> tuple[int | None, np.ndarray | None]:
        """Return the room and position (2,) that the options of a reset name, None for what is to be drawn.

        Raises ValueError for options that cannot be used.
        """
        given, count = options.get("position"), len(self.simulator.rooms)
        room = checked_room(options.get("room"), count)
        if given is None:
            return room, None
        if room is None and count > 1:
            raise ValueError(f"options['position']: expected options['room'] beside it, one of the {count} rooms")
        try:
            position = np.array(given, dtype=float)
        except (TypeError, ValueError):
            position = np.empty(0)
        if position.shape != (2,) or not np.isfinite(position).all():
            raise ValueError(f"options['position']: expected two finite numbers, x and y in metres; got {given!r}")
        position = snap(position)
        if not self.simulator.is_legal(np.array([room or 0]), position[None])[0]:
            raise ValueError(f"options['position']: the item leaves the room at {given}")
        return room, position

    def _arrive(self) -> dict[str, Any]:
        """Update the reward and the next moves for the current position; return them as info."""
        position = self._path[-1]
        single = self._singles[self._room]
        self._reached, legal = single.destinations(*position)
        terms = single.reward(*position)
        self._legal, self._total = np.array(legal), terms.total
        told = {"legal": self._legal.copy(), "position": np.array(position), "room": self._room}
        return terms._asdict() | told

    def _observation(self) -> np.ndarray:
        return self._observe.single(self._room, self._path[-1])
