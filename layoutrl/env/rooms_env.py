"""The simulator of whole rooms as a Gymnasium environment: an episode furnishes a room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
import torch
from gymnasium import spaces

from layoutrl import InputError
from layoutrl.env.arguments import (
    begun,
    check_at_least_one,
    check_render_mode,
    check_spaces,
    checked_action,
    checked_options,
    checked_room,
    moves_and_reward_or_default,
    rooms_or_default,
)
from layoutrl.env.measures import measured
from layoutrl.env.render import furnished_picture
from layoutrl.env.reward import REWARD_RANGE, Reward
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.simulator import Moves
from layoutrl.rooms.brief import brief_of, missing
from layoutrl.rooms.room import Room

MAX_MOVES = 300  # by default


class RoomsEnv(gymnasium.Env[np.ndarray, np.int64]):
    """`gymnasium.make("layoutrl/Rooms-v0", rooms=..., moves=Moves(...))`.

    A room in which all furniture stands is a design: all of it is taken out, to be placed anew. In a room with items
    without a center, a brief, those are to be placed; the designer's places are unknown, so that r1 is 0.
    Every reset draws a room, or takes `options={"room": index}`, and begins without any of the items to place.

    action: Discrete(A): those of Moves; a quarter turn to the left, one to the right; to take item 0, 1, ... of the
    list, which then moves: from where it stands, or from a pose that was drawn. observation: RoomsObservation.
    reward: the paper's, -200 to 100, of the item that moves, among what stands now; 0 until one is taken. It is paid
    after every action: an agent that places one item well and then stays with it earns nearly all that can be earned.
    With `gains`, a step pays instead by how much that reward has changed since the item was last paid for, over the
    number of items to place; one that was never taken counts as -200, the lowest. So an episode returns how far the
    rewards with which the items last moved are above -200, on average, and to furnish the whole room pays most.
    info: `legal`, the mask (A,) of actions; `item`, which one moves, -1 until one is taken; its `r1`, `r2`, `r3`, `r4`
    and `iou`; `room`, the index; `illegal`, whether this action was illegal: then it is dropped, nothing changes, and
    the caller should not store it. At the end of an episode in a design, info has `measures`: all of `Measures` but
    `group`.

    The spaces depend on the rooms, unless the `categories` that have a column, `elements`, the number of rows, and the
    number of `items` that can be taken are given: environments with the same of all three have the same spaces.

    Areas are shapely's, for which a disc has 256 corners; those of the vector environment are true circles.

    An episode is truncated after `max_moves` actions, dropped ones included; it never ends otherwise.
    Raises ValueError where a room has nothing to place, an item that does not fit, or more than the given spaces hold;
    for an action outside the action space and for invalid options of a reset. Raises gymnasium's ResetNeeded for
    `step`, `render`, `layout` and `action_masks` before the first reset.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 8}  # noqa: RUF012
    action_space: spaces.Discrete

    def __init__(
        self,
        rooms: Sequence[Room] | None = None,
        moves: Moves | None = None,
        reward: Reward | None = None,
        max_moves: int = MAX_MOVES,
        render_mode: str | None = None,
        categories: Sequence[str] | None = None,
        elements: int | None = None,
        items: int | None = None,
        gains: bool = False,
    ):
        check_render_mode(render_mode)
        check_at_least_one(max_moves=max_moves)
        self.simulator, self.designs = simulator_of(rooms, moves, reward, categories, elements, items)
        self.max_moves = max_moves
        self.render_mode = render_mode
        self.gains = gains
        self._observe = RoomsObservation(self.simulator, categories, elements=elements)
        self.action_space = spaces.Discrete(self.simulator.actions)
        self.observation_space = self._observe.space
        self._state: State[np.ndarray] | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; return its first observation and info. A ValueError leaves the environment as it was."""
        count = len(self.simulator.rooms)
        room = checked_room(checked_options(options, "room").get("room"), count)
        super().reset(seed=seed)
        drawn = self.np_random.integers(count)  # drawn even where it is not used
        self._state = self.simulator.begin(np.array([drawn if room is None else room], dtype=np.int64), self.np_random)
        self._moves_made = 0
        self._paid = np.full(self.simulator.room_index.shape[1], REWARD_RANGE[0])  # what each item was last worth
        return self._observation(), self._arrive() | {"illegal": False}

    def step(self, action: np.int64 | int) -> tuple[np.ndarray, SupportsFloat, bool, bool, dict[str, Any]]:
        """Make one action; return observation, reward, terminated, truncated and info."""
        state = self._running
        action = checked_action(action, self.action_space)
        illegal = not self._legal[action]
        if not illegal:
            item, center, quarter = (where[:, action] for where in self._reached)
            self._state = self.simulator.put(state, item, center, quarter)
        self._moves_made += 1
        info = self._arrive() | {"illegal": illegal}
        ended = self._moves_made >= self.max_moves
        if ended:
            info |= measures_of(self.layout, self.designs[info["room"]])
        reward = self._gain(info["item"], info["room"]) if self.gains else self._total
        return self._observation(), reward, False, ended, info

    @property
    def layout(self) -> Room:
        """The room as it is furnished now."""
        return self.simulator.layout(self._running, 0)

    def action_masks(self) -> np.ndarray:
        """The actions that are legal now: bool (A,)."""
        _ = self._running  # raises before the first reset
        return self._legal.copy()

    def render(self) -> np.ndarray | None:
        """Return a picture of the room, uint8 (384, 384, 3), the moving item in red; None without a render mode."""
        state = self._running
        return None if self.render_mode is None else picture(self.simulator, state, 0)

    @property
    def _running(self) -> State[np.ndarray]:
        return begun(self._state)

    def _arrive(self) -> dict[str, Any]:
        """Update the reward and the next actions for the current state; return them as info."""
        state = self._running
        *self._reached, legal = self.simulator.destinations(state)
        terms = self.simulator.reward(state)
        self._legal, self._total = legal[0], float(terms.total[0])
        told = {name: float(term[0]) for name, term in terms._asdict().items()}
        taken = state.stands[0, state.moving[0]]
        item = int(state.moving[0]) if taken else -1
        return told | {"legal": legal[0].copy(), "item": item, "room": int(state.room[0])}

    def _gain(self, item: int, room: int) -> float:
        """Return the reward of an item less what it was last worth, over the number of items; 0 if none is taken."""
        if item < 0:
            return 0.0
        gain = self._total - self._paid[item]
        self._paid[item] = self._total
        return float(gain / self.simulator.count[room])

    def _observation(self) -> np.ndarray:
        return self._observe(State(*map(torch.as_tensor, self._running)))[0].numpy()


def simulator_of(
    rooms: Sequence[Room] | None,
    moves: Moves | None,
    reward: Reward | None,
    categories: Sequence[str] | None,
    elements: int | None,
    items: int | None,
) -> tuple[RoomsSimulator, list[Room | None]]:
    """Return the simulator of the rooms and their designs, None for briefs. Raises ValueError for invalid arguments."""
    given = rooms_or_default(rooms)
    check_spaces(given, categories, elements)
    if items is not None:
        check_at_least_one(items=items)
    if empty := [room.id for room in given if not room.furniture]:
        raise InputError(f"rooms: {empty[0]} has nothing to place; expected rooms with furniture")
    designs = [None if missing(room) else room for room in given]
    briefs = [room if missing(room) else brief_of(room) for room in given]
    return RoomsSimulator(briefs, designs, *moves_and_reward_or_default(moves, reward), items), designs


def measures_of(layout: Room, design: Room | None) -> dict[str, Any]:
    """What info has at the end of an episode: the measures, where the design is known."""
    if design is None:
        return {}
    found = vars(measured([layout], [design]))
    return {"measures": {name: float(value[0]) for name, value in found.items() if name != "group"}}


def picture(simulator: RoomsSimulator, state: State[np.ndarray], b: int) -> np.ndarray:
    """Return a picture of room b of a state, uint8 (384, 384, 3), with the moving item in red."""
    n = state.moving[b]
    target = missing(simulator.rooms[state.room[b]])[n] if state.stands[b, n] else None
    return furnished_picture(replace(simulator.layout(state, b), target=target))
