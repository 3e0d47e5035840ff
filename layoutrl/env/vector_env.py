"""The batched simulator as a Gymnasium vector environment: thousands of rooms step at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes
from layoutrl.env.layout_env import given_or_some
from layoutrl.env.observation import observation_of
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.room import Room


class LayoutVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """`gymnasium.make_vec("layoutrl/Layout-v0", num_envs=1000, rooms=..., observation="geometry", moves=Moves(...))`.

    As many LayoutEnv with `on_illegal="drop"`: their actions, observations, rewards and info, each with the batch in
    front, as numpy arrays, computed on `device` in float32. Rooms and starts are drawn; `reset` takes no options.

    All episodes begin together, and after `max_moves` moves all are truncated and others begin in the same step
    (AutoresetMode.SAME_STEP): observations and info are then those of the starts, while `final_obs` and `final_info`
    tell where the episodes ended.

    Raises ValueError where a room has no target, or a target that does not fit.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        rooms: Sequence[Room] | None = None,
        observation: Literal["geometry", "image"] = "geometry",
        moves: Moves | None = None,
        reward: Reward | None = None,
        max_moves: int = 100,
        device: torch.device | str = "cpu",
    ):
        rooms = given_or_some(rooms)
        self.num_envs = num_envs
        self.max_moves = max_moves
        self.simulator = BatchSimulator(Simulator(rooms, moves or Moves(), reward or Reward()), device)
        self._observe = observation_of(observation, rooms, device)
        self.single_observation_space = self._observe.space
        self.single_action_space = spaces.Discrete(self.simulator.moves.count)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        if options:
            raise ValueError(f"options: expected none; got {options}")
        generator = torch.Generator(self.simulator.device).manual_seed(int(self.np_random.integers(2**63)))
        self._episodes = Episodes(self.simulator, np.zeros(self.num_envs, dtype=int), self.max_moves, generator)
        return self._begun()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        action = torch.as_tensor(actions, dtype=torch.int64, device=self.simulator.device).reshape(self.num_envs)
        step = self._episodes.step(action)
        observation = _array(self._observe(step.room, step.next_position))
        info = self._told(step.room, step.next_position, step.next_legal, step.terms, ~step.legal)
        ended = len(step.ended) > 0
        if ended:
            final = {"final_obs": np.fromiter(observation, object, self.num_envs), "final_info": info}
            observation, info = self._begun()
            info |= self._masked(final)
        terminated, truncated = np.zeros(self.num_envs, dtype=bool), np.full(self.num_envs, ended)
        return observation, _array(step.terms.total.double()), terminated, truncated, info

    def _begun(self) -> tuple[np.ndarray, dict[str, Any]]:
        """Observations and info of episodes that are about to make their first move."""
        room, position, legal = self._episodes.room, self._episodes.position, self._episodes.legal
        terms = self.simulator.reward(room, position)
        info = self._told(room, position, legal, terms, illegal=torch.zeros_like(room, dtype=torch.bool))
        return _array(self._observe(room, position)), info

    def _told(
        self, room: Tensor, position: Tensor, legal: Tensor, terms: RewardTerms[Tensor], illegal: Tensor
    ) -> dict[str, Any]:
        rewards = {name: _array(term.double()) for name, term in terms._asdict().items()}
        info = {"legal": legal, "position": position, "room": room, "illegal": illegal}
        return self._masked(rewards | {name: _array(values) for name, values in info.items()})

    def _masked(self, info: dict[str, Any]) -> dict[str, Any]:
        """Gymnasium's form of info: beside every entry a mask of the environments that have it, here all."""
        return info | {f"_{name}": np.ones(self.num_envs, dtype=bool) for name in info}


def _array(values: Tensor) -> np.ndarray:
    """A copy, which its reader may change."""
    return np.array(values.cpu())
