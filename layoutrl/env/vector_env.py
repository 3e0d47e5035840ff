"""The batched simulator as a Gymnasium vector environment: thousands of rooms step at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from layoutrl.env.arguments import (
    begun,
    check_at_least_one,
    check_render_mode,
    check_spaces,
    moves_and_reward_or_default,
    refuse_options,
    rooms_with_targets_or_default,
)
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.device import usable_device
from layoutrl.env.episodes import Episodes
from layoutrl.env.layout_env import LayoutEnv
from layoutrl.env.observation import observation_of
from layoutrl.env.render import story
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.room import Room


class LayoutVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """`gymnasium.make_vec("layoutrl/Layout-v0", num_envs=1000, rooms=..., observation="geometry", moves=Moves(...))`.

    It batches LayoutEnv with `on_illegal="drop"`: the same actions, observations, rewards and info as numpy arrays with
    the batch in front, computed on `device` in float32. `action_masks()` is `legal`, (num_envs, A).

    Rooms and starts are drawn; `reset` takes no options. After `reset(seed=7)` one random stream draws for all
    environments, which is fastest. After `reset(seed=[7, 8, ...])`, with num_envs seeds in a list or an array, each
    environment has a stream of its own: this episode and those that follow begin where those of `LayoutEnv` with that
    seed do, whatever the seed's place in the list. None in the list continues that environment's stream, or begins one;
    `reset()` continues the present streams.

    All episodes begin together, and after `max_moves` moves all are truncated and the next begin in the same step
    (AutoresetMode.SAME_STEP): observations and info are then those of the starts, while `final_obs` and `final_info`
    hold those with which the old episodes ended.

    Raises as LayoutEnv does, and ValueError for options and for a list of another length: such a reset leaves the
    environment as it was.
    """

    autoreset_mode = AutoresetMode.SAME_STEP  # TorchRL looks for it here, as in Gymnasium's own vector environments
    metadata = LayoutEnv.metadata | {"autoreset_mode": autoreset_mode}

    def __init__(
        self,
        num_envs: int,
        rooms: Sequence[Room] | None = None,
        observation: Literal["geometry", "image"] = "geometry",
        moves: Moves | None = None,
        reward: Reward | None = None,
        max_moves: int = 100,
        device: torch.device | str = "cpu",
        render_mode: str | None = None,
        categories: Sequence[str] | None = None,
        elements: int | None = None,
    ):
        check_render_mode(render_mode)
        check_at_least_one(num_envs=num_envs, max_moves=max_moves)
        device = usable_device(device)
        rooms = rooms_with_targets_or_default(rooms)
        check_spaces(rooms, categories, elements, observation, waiting=False)
        self.num_envs = num_envs
        self.max_moves = max_moves
        self.render_mode = render_mode
        self._reference = Simulator(rooms, *moves_and_reward_or_default(moves, reward))
        self.simulator = BatchSimulator(self._reference, device)
        self._observe = observation_of(observation, rooms, device, categories, elements)
        self.single_observation_space = self._observe.space
        self.single_action_space = spaces.Discrete(self.simulator.moves.count)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._episodes: Episodes | None = None
        self._streams: list[np.random.Generator] | None = None  # one per environment, if seeds were given as a list
        self._path: list[Tensor] = []  # positions (num_envs, 2) since the episodes began, to be rendered

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin all episodes; return their first observations (num_envs, ...) and info. See the class for seeds."""
        refuse_options(options)
        self._streams = reseeded(self, seed, self._streams)
        generator = torch.Generator(self.simulator.device).manual_seed(int(self.np_random.integers(2**63)))
        self._episodes = Episodes(self.simulator, np.zeros(self.num_envs, dtype=int), self.max_moves, generator)
        return self._begun()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Make one action in each environment, int (num_envs,); return arrays of what one returns, and info."""
        step = self._running.step(
            checked_actions(actions, self.num_envs, self.simulator.moves.count, self.simulator.device)
        )
        if self.render_mode is not None:
            self._path.append(step.next_position)
        observation = array(self._observe(step.room, step.next_position))
        now = {"legal": step.next_legal, "position": step.next_position, "room": step.room, "illegal": ~step.legal}
        info = told(step.terms, self.num_envs, **now)
        ended = len(step.ended) > 0
        if ended:
            final = {"final_obs": np.fromiter(observation, object, self.num_envs), "final_info": info}
            observation, info = self._begun()
            info |= masked(final, self.num_envs)
        terminated, truncated = np.zeros(self.num_envs, dtype=bool), np.full(self.num_envs, ended)
        return observation, array(step.terms.total.double()), terminated, truncated, info

    def action_masks(self) -> np.ndarray:
        """The moves that are legal now: bool (num_envs, A)."""
        return array(self._running.legal)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return a picture of each path so far as LayoutEnv does, uint8 (384, 384, 3); None without a render mode."""
        rooms = self._running.room.tolist()
        if self.render_mode is None:
            return None
        paths = array(torch.stack(self._path, 1))
        return tuple(story(self.simulator.rooms[room], path) for room, path in zip(rooms, paths, strict=True))

    @property
    def _running(self) -> Episodes:
        return begun(self._episodes)

    def _begun(self) -> tuple[np.ndarray, dict[str, Any]]:
        """Draw new starts from the environments' own streams, if they have any; return observations and info."""
        episodes = self._running
        if self._streams is not None:  # begin where LayoutEnv would
            rooms = [np.array([stream.integers(len(self.simulator.rooms))]) for stream in self._streams]
            starts = list(map(self._reference.starts, rooms, self._streams))
            episodes.stand_at(torch.tensor(np.concatenate(rooms)), torch.tensor(np.concatenate(starts)))
        room, position, legal = episodes.room, episodes.position, episodes.legal
        self._path = [position]
        terms = self.simulator.reward(room, position)
        illegal = torch.zeros_like(room, dtype=torch.bool)
        info = told(terms, self.num_envs, legal=legal, position=position, room=room, illegal=illegal)
        return array(self._observe(room, position)), info


def reseeded(
    env: VectorEnv[Any, Any, Any], seed: int | Sequence[int | None] | None, streams: list[np.random.Generator] | None
) -> list[np.random.Generator] | None:
    """Return each environment's random generator after a reset with these seeds; None if one draws for all.

    With a list of seeds each environment gets the generator of its seed; for None it keeps the one that it had, or gets
    a new one. Raises ValueError for another number of seeds.
    """
    if isinstance(seed, np.ndarray):
        seed = seed.tolist()
    if not isinstance(seed, Sequence):
        VectorEnv.reset(env, seed=seed)
        return streams if seed is None else None
    if len(seed) != env.num_envs:
        raise ValueError(f"seed: expected {env.num_envs} seeds, one an environment; got {len(seed)}")
    seed = [int(one) if isinstance(one, np.integer) else one for one in seed]
    drawn = [None if one is None else np_random(one)[0] for one in seed]
    streams = streams or env.np_random.spawn(env.num_envs)
    return [old if new is None else new for new, old in zip(drawn, streams, strict=True)]


def checked_actions(actions: np.ndarray, num_envs: int, count: int, device: torch.device) -> Tensor:
    """Actions on the device, int64 (num_envs,). Raises ValueError for those outside the action space."""
    try:
        action = torch.as_tensor(actions, device=device)
    except (TypeError, ValueError, RuntimeError):  # None, objects, texts
        raise ValueError(f"actions: expected whole numbers of shape ({num_envs},); got {actions!r:.60}") from None
    kind = action.dtype
    if action.shape != (num_envs,) or kind == torch.bool or kind.is_floating_point or kind.is_complex:
        got = f"{kind} of shape {tuple(action.shape)}"
        raise ValueError(f"actions: expected whole numbers of shape ({num_envs},); got {got}")
    whole = action.long()  # torch compares no unsigned numbers
    outside = (whole < 0) | (whole >= count)
    if outside.any():
        raise ValueError(f"actions: expected 0 to {count - 1}; got {array(action)[array(outside)][0]}")
    return whole


def told(terms: RewardTerms[Tensor], num_envs: int, **now: Tensor) -> dict[str, Any]:
    """What info has at every step, in Gymnasium's form: the terms of the reward, and what is so `now`."""
    rewards = {name: array(term.double()) for name, term in terms._asdict().items()}
    return masked(rewards | {name: array(values) for name, values in now.items()}, num_envs)


def masked(info: dict[str, Any], num_envs: int) -> dict[str, Any]:
    """Gymnasium's form of info: beside every entry a mask of the environments that have it, here all."""
    return info | {f"_{name}": np.ones(num_envs, dtype=bool) for name in info}


def array(values: Tensor) -> np.ndarray:
    """Return a copy as a numpy array, which the caller may change."""
    return values.cpu().numpy().copy()
