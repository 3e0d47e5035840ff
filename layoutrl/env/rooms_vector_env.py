"""The batched simulator of whole rooms as a Gymnasium vector environment: thousands of rooms are furnished at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from layoutrl.env.arguments import begun, check_at_least_one, check_render_mode, refuse_options
from layoutrl.env.device import usable_device
from layoutrl.env.measures import measured
from layoutrl.env.reward import REWARD_RANGE, Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator, either
from layoutrl.env.rooms_env import MAX_MOVES, RoomsEnv, picture, simulator_of
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import State
from layoutrl.env.simulator import Moves
from layoutrl.env.vector_env import array, checked_actions, masked, reseeded, told
from layoutrl.rooms.room import Room


class RoomsVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """`gymnasium.make_vec("layoutrl/Rooms-v0", num_envs=1000, rooms=..., moves=Moves(...))`.

    It batches RoomsEnv: the same actions, observations, rewards and info as numpy arrays with the batch in front,
    computed on `device` in float32. `action_masks()` is `legal`, (num_envs, A). Seeds work as in LayoutVectorEnv.

    All episodes begin together; after `max_moves` actions all are truncated, and the next begin in the same step
    (AutoresetMode.SAME_STEP): `final_obs` and `final_info` hold the observations and info with which the old ones
    ended. The measures in `final_info` take some milliseconds a room: `measure=False` leaves them out.

    Raises as RoomsEnv and LayoutVectorEnv do.
    """

    autoreset_mode = AutoresetMode.SAME_STEP
    metadata = RoomsEnv.metadata | {"autoreset_mode": autoreset_mode}

    def __init__(
        self,
        num_envs: int,
        rooms: Sequence[Room] | None = None,
        moves: Moves | None = None,
        reward: Reward | None = None,
        max_moves: int = MAX_MOVES,
        measure: bool = True,
        device: torch.device | str = "cpu",
        render_mode: str | None = None,
        categories: Sequence[str] | None = None,
        elements: int | None = None,
        items: int | None = None,
        gains: bool = False,
    ):
        check_render_mode(render_mode)
        check_at_least_one(num_envs=num_envs, max_moves=max_moves)
        device = usable_device(device)
        self.num_envs = num_envs
        self.max_moves = max_moves
        self.measure = measure
        self.render_mode = render_mode
        self.gains = gains
        self._reference, self._designs = simulator_of(rooms, moves, reward, categories, elements, items)
        self.simulator = BatchRoomsSimulator(self._reference, device)
        self._observe = RoomsObservation(self._reference, categories, device, elements)
        self.single_observation_space = self._observe.space
        self.single_action_space = spaces.Discrete(self.simulator.actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._state: State[Tensor] | None = None
        self._streams: list[np.random.Generator] | None = None  # one per environment, if seeds were given as a list

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin all episodes; return their first observations (num_envs, ...) and info. See the class for seeds."""
        refuse_options(options)
        self._streams = reseeded(self, seed, self._streams)
        self._generator = torch.Generator(self.simulator.device).manual_seed(int(self.np_random.integers(2**63)))
        return self._begun()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Make one action in each environment, int (num_envs,); return arrays of what one returns, and info."""
        simulator, state = self.simulator, self._running
        action = checked_actions(actions, self.num_envs, simulator.actions, simulator.device)
        legal = self._legal.gather(1, action[:, None])[:, 0]
        moved = simulator.moved(state, action, self._length.gather(1, action[:, None])[:, 0])
        self._state = either(legal, moved, state)
        self._moves_made += 1
        observation, reward, info = self._arrive(~legal)
        if self.gains:
            reward = self._gain(reward, info["item"], info["room"])
        ended = self._moves_made >= self.max_moves
        if ended:
            if self.measure:
                info |= self._measures()
            final = {"final_obs": np.fromiter(observation, object, self.num_envs), "final_info": info}
            observation, info = self._begun()
            info |= masked(final, self.num_envs)
        return observation, reward, np.zeros(self.num_envs, dtype=bool), np.full(self.num_envs, ended), info

    def layouts(self) -> list[Room]:
        """The rooms as they are furnished now."""
        state = State(*map(array, self._running))
        return [self._reference.layout(state, b) for b in range(self.num_envs)]

    def action_masks(self) -> np.ndarray:
        """The actions that are legal now: bool (num_envs, A)."""
        _ = self._running  # raises before the first reset
        return array(self._legal)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return a picture of each room as RoomsEnv does, uint8 (384, 384, 3); None without a render mode."""
        state = State(*map(array, self._running))
        if self.render_mode is None:
            return None
        return tuple(picture(self._reference, state, b) for b in range(self.num_envs))

    @property
    def _running(self) -> State[Tensor]:
        return begun(self._state)

    def _begun(self) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin the next episodes; return their observations and info."""
        count, device = len(self.simulator.rooms), self.simulator.device
        if self._streams is None:
            room = torch.randint(count, (self.num_envs,), generator=self._generator, device=device)
            self._state = self.simulator.begin(room, self._generator)
        else:  # begin where RoomsEnv would
            states = [self._reference.begin(np.array([stream.integers(count)]), stream) for stream in self._streams]
            self._state = State(
                *(torch.as_tensor(np.concatenate(values), device=device) for values in zip(*states, strict=True))
            )
        self._moves_made = 0
        self._paid = np.full((self.num_envs, self.simulator.room_index.shape[1]), REWARD_RANGE[0])  # as in RoomsEnv
        observation, _, info = self._arrive(torch.zeros(self.num_envs, dtype=torch.bool, device=device))
        return observation, info

    def _arrive(self, illegal: Tensor) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
        """Update the lengths and legality of actions; return observations, rewards and info of the current state."""
        state = self._running
        self._length, self._legal = self.simulator.reach(state)
        terms = self.simulator.reward(state)
        taken = state.stands.gather(1, state.moving[:, None]).squeeze(1)
        item = state.moving.where(taken, -1)
        info = told(terms, self.num_envs, legal=self._legal, item=item, room=state.room, illegal=illegal)
        return array(self._observe(state)), array(terms.total.double()), info

    def _gain(self, reward: np.ndarray, item: np.ndarray, room: np.ndarray) -> np.ndarray:
        """Return rewards as gains, (num_envs,), as RoomsEnv does."""
        taken, item = (item >= 0).nonzero()[0], item[item >= 0]
        gains = np.zeros(self.num_envs)
        gains[taken] = (reward[taken] - self._paid[taken, item]) / self._reference.count[room[taken]]
        self._paid[taken, item] = reward[taken]
        return gains

    def _measures(self) -> dict[str, Any]:
        """Return the measures in Gymnasium's form of info, 0 and masked for rooms whose design is unknown."""
        designs = [self._designs[room] for room in self._running.room.tolist()]
        known = np.array([design is not None for design in designs])
        if not known.any():
            return {}
        layouts = [layout for layout, design in zip(self.layouts(), designs, strict=True) if design]
        measures: dict[str, Any] = {}
        for name, values in vars(measured(layouts, [design for design in designs if design])).items():
            if name != "group":
                measures[name], measures[f"_{name}"] = np.zeros(self.num_envs), known
                measures[name][known] = values
        return {"measures": measures, "_measures": known}
