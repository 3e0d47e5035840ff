"""The vector environment: many `LayoutEnv` at once, in Gymnasium's form. `LayoutEnv` is the oracle."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics

from layoutrl.env.layout_env import LayoutEnv
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves
from layoutrl.env.vector_env import LayoutVectorEnv
from layoutrl.rooms.room import Room
from tests.builders import l_room, random_room, rectangular_room


def some_rooms() -> list[Room]:
    return [l_room(), rectangular_room(4, 3), *(random_room(np.random.default_rng(seed)) for seed in range(12))]


def played(env: VectorEnv, seed: int | list[int], steps: int) -> list[Any]:
    """What a reset and random moves, legal or not, told."""
    actions = np.random.default_rng(seed)
    return [env.reset(seed=seed)] + [
        env.step(actions.integers(env.single_action_space.n, size=env.num_envs)) for _ in range(steps)
    ]


def assert_same(told: Any, expected: Any, rounding: float = 0.0) -> None:
    """Equal to the last bit and in type and shape; only rewards and IoUs, one an environment, may be rounded."""
    assert type(told) is type(expected)
    if isinstance(expected, dict):
        assert told.keys() == expected.keys()
        told, expected = list(told.values()), [expected[key] for key in told]
    if isinstance(expected, tuple | list) or expected.dtype == object:
        for one, other in zip(told, expected, strict=True):
            assert_same(one, other, rounding)
    else:
        assert (told.dtype, told.shape) == (expected.dtype, expected.shape)
        rounded = told.dtype == np.float64 and told.ndim == 1
        np.testing.assert_allclose(told, expected, rtol=0, atol=rounding if rounded else 0)


def singles(count: int, **keywords: Any) -> SyncVectorEnv:
    """As many LayoutEnv, which Gymnasium steps one after another."""
    return SyncVectorEnv([lambda: LayoutEnv(**keywords)] * count, autoreset_mode=AutoresetMode.SAME_STEP)


@pytest.mark.parametrize("observation", ["geometry", "image"])
@pytest.mark.parametrize("inside", ["share", "iou"])
def test_it_tells_what_gymnasium_tells_of_as_many_single_environments_of_the_same_seeds(
    observation: str, inside: str
) -> None:
    keywords = {"rooms": some_rooms(), "observation": observation, "max_moves": 3}
    keywords |= {"moves": Moves((0.32, 0.08), slide=False), "reward": Reward(90, -70, -40, inside)}
    many, expected = LayoutVectorEnv(6, **keywords), singles(6, **keywords)
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(many, name) == getattr(expected, name)
    assert many.autoreset_mode == expected.autoreset_mode
    assert many.metadata == expected.metadata
    seeds = [3, 1, 4, 1, 5, 9]
    told = played(many, seeds, 10)
    assert sum("final_info" in step[4] for step in told[1:]) == 3
    assert_same(told, played(expected, seeds, 10), rounding=2e-4)
    assert {illegal for step in told[1:] for illegal in step[4]["illegal"]} == {False, True}
    assert_same(many.reset(), expected.reset(), rounding=2e-4)  # each stream goes on
    mixed = [None, 2, None, 3, 3, None]
    assert_same(many.reset(seed=mixed), expected.reset(seed=mixed), rounding=2e-4)


def test_its_frames_are_those_of_the_single_environments() -> None:
    keywords = {"rooms": [l_room(), rectangular_room(4, 3)], "max_moves": 4, "render_mode": "rgb_array"}
    many, expected = LayoutVectorEnv(2, **keywords), singles(2, **keywords)
    dropped: set[bool] = set()
    for steps in (0, 3, 5):  # at the start, on the way, and on that of another episode
        (*_, told), _ = (played(env, [1, 2], steps) for env in (many, expected))
        dropped |= set(told[-1]["illegal"].tolist())
        assert_same(many.render(), expected.render())
    assert dropped == {False, True}


def test_without_a_render_mode_nothing_is_drawn() -> None:
    env = LayoutVectorEnv(2, [l_room()])
    env.reset(seed=0)
    assert env.render() is None


def test_the_action_masks_are_the_moves_that_are_legal_now() -> None:
    env = LayoutVectorEnv(4, some_rooms(), max_moves=3)
    actions = np.random.default_rng(0)
    _, info = env.reset(seed=0)
    for _ in range(7):
        mask = env.action_masks()
        assert (mask.dtype, mask.shape) == (bool, (4, env.single_action_space.n))
        np.testing.assert_array_equal(mask, info["legal"])
        mask[:] = ~mask  # the caller's own
        np.testing.assert_array_equal(env.action_masks(), info["legal"])
        *_, info = env.step(actions.integers(env.single_action_space.n, size=4))


@pytest.mark.parametrize("observation", ["geometry", "image"])
def test_gymnasium_makes_it_and_its_wrappers_read_it(observation: str) -> None:
    keywords = {"rooms": [l_room(), rectangular_room(4, 3)], "observation": observation, "max_moves": 4}
    env = gymnasium.make_vec("layoutrl/Layout-v0", num_envs=5, vectorization_mode="vector_entry_point", **keywords)
    assert isinstance(env, LayoutVectorEnv)
    env.action_space.seed(0)
    env = DictInfoToList(RecordEpisodeStatistics(env))
    seen, info = env.reset(seed=0)
    total = np.zeros(5)
    for _ in range(4):
        assert seen in env.observation_space
        assert [set(one) for one in info] == [set(info[0])] * 5
        seen, rewards, *_, truncated, info = env.step(env.action_space.sample())
        total += rewards
    assert truncated.all()
    assert [one["episode"]["r"] for one in info] == pytest.approx(total, abs=1e-3)
    assert all(one["final_obs"] in env.single_observation_space for one in info)
    assert all(one["final_info"].keys() == info[0]["final_info"].keys() for one in info)


def test_without_rooms_designed_bedrooms_are_taken() -> None:
    env = gymnasium.make_vec("layoutrl/Layout-v0", num_envs=3, vectorization_mode="vector_entry_point")
    assert {room.room_type for room in env.simulator.rooms} == {"bedroom"}
    played(env, 0, 3)


def test_all_episodes_are_truncated_after_exactly_so_many_moves_and_none_terminates() -> None:
    told = played(LayoutVectorEnv(4, [l_room()], max_moves=3), 0, 9)
    for made, (*_, terminated, truncated, info) in enumerate(told[1:], start=1):
        assert not terminated.any()
        assert truncated.tolist() == [made % 3 == 0] * 4
        assert ("final_obs" in info) == (made % 3 == 0)
    env = LayoutVectorEnv(4, [l_room()], max_moves=3)
    ends = [played(env, seed, 2)[-1][3].any() for seed in range(3)]  # a reset counts from the beginning
    assert ends == [False] * 3


def test_equal_seeds_give_equal_runs_and_a_reset_without_one_goes_on() -> None:
    env = LayoutVectorEnv(4, some_rooms(), max_moves=5)
    first, again, other = (played(env, seed, 12) for seed in (1, 1, 2))
    assert_same(again, first)
    assert not np.array_equal(first[0][1]["position"], other[0][1]["position"])
    runs = [[env.reset(seed=1), env.reset(), env.reset()] for _ in range(2)]
    assert_same(*runs)
    assert len({reset[1]["position"].tobytes() for reset in runs[0]}) == 3


def test_one_seed_ends_the_environments_own_streams_and_begins_them() -> None:
    """What follows a seed depends on nothing before it."""
    env = LayoutVectorEnv(2, some_rooms())
    begun = [env.reset(seed=1), env.reset(seed=[None, 3]), env.reset()]
    assert_same([env.reset(seed=1), env.reset(seed=[None, 3]), env.reset()], begun)
    assert_same(LayoutVectorEnv(2, some_rooms()).reset(seed=1), begun[0])


def test_the_global_random_streams_are_neither_read_nor_moved() -> None:
    runs = []
    for seed in (0, 1):
        np.random.seed(seed)  # noqa: NPY002
        torch.manual_seed(seed)
        state = torch.get_rng_state()
        runs.append(played(LayoutVectorEnv(4, some_rooms(), max_moves=2), 0, 4))
        assert torch.equal(torch.get_rng_state(), state)
        assert np.random.random() == np.random.RandomState(seed).random()  # noqa: NPY002
    assert_same(*runs)


def test_what_was_told_belongs_to_whom_it_was_told() -> None:
    """It does not change later, and to write into it moves nothing."""
    env = LayoutVectorEnv(4, some_rooms(), max_moves=3)
    expected = played(env, 0, 7)
    actions = np.random.default_rng(0)
    told = [env.reset(seed=0)]
    for k in range(7):
        copy = deepcopy(told[-1])
        for values in told[-1][-1].values():
            if isinstance(values, np.ndarray):
                values[:] = 0
        told[-1][0][:] = 0
        assert_same(copy, expected[k])
        step = env.step(actions.integers(env.single_action_space.n, size=4))
        told.append(step)
    assert_same(told[-1], expected[-1])
    assert_same(expected, played(env, 0, 7))


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="rooms"):
        LayoutVectorEnv(2, [])
    with pytest.raises(ValueError, match="sketch"):
        LayoutVectorEnv(2, [l_room()], observation="sketch")
    with pytest.raises(ValueError, match="human"):
        LayoutVectorEnv(2, [l_room()], render_mode="human")
    with pytest.raises(ValueError, match="target"):
        LayoutVectorEnv(2, [l_room(target=None)])
    with pytest.raises(ValueError, match="num_envs: expected a whole number, 1 or more; got 0"):
        LayoutVectorEnv(0, [l_room()])
    with pytest.raises(ValueError, match="max_moves: expected a whole number, 1 or more; got 0"):
        LayoutVectorEnv(2, [l_room()], max_moves=0)


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.uint64])
def test_actions_are_whole_numbers_of_any_kind(kind: type) -> None:
    env = LayoutVectorEnv(2, [l_room()])
    env.reset(seed=0)
    *_, expected = env.step(np.array([3, 7]))
    env.reset(seed=0)
    *_, info = env.step(np.array([3, 7], dtype=kind))
    assert_same(info, expected)
    most = np.iinfo(kind).max
    with pytest.raises(ValueError, match=f"^actions: expected 0 to 19; got {most}$"):
        env.step(np.array([3, most], dtype=kind))


def test_seeds_may_be_an_array() -> None:
    env = LayoutVectorEnv(2, some_rooms())
    assert_same(env.reset(seed=np.array([3, 4])), env.reset(seed=[3, 4]))
    assert_same(env.reset(seed=[np.int64(3), 4]), env.reset(seed=[3, 4]))


@pytest.mark.parametrize(
    "call", [lambda env: env.step(np.array([0, 0])), LayoutVectorEnv.render, LayoutVectorEnv.action_masks]
)
def test_a_reset_must_come_first(call: Any) -> None:
    env = LayoutVectorEnv(2, [l_room()])
    with pytest.raises(ValueError, match="options"):
        env.reset(options={"room": 0})
    with pytest.raises(ResetNeeded, match="reset"):
        call(env)


@pytest.mark.parametrize("seed", [1, [1, 2]])
def test_what_is_refused_leaves_all_as_it_was(seed: int | list[int]) -> None:
    env, other = (LayoutVectorEnv(2, some_rooms(), max_moves=3) for _ in range(2))
    assert_same(*(played(one, seed, 1) for one in (env, other)))
    with pytest.raises(ValueError, match="options: expected none"):
        env.reset(seed=7, options={"room": 0})
    for seeds in ([], [1], [1, 2, 3]):
        with pytest.raises(ValueError, match=f"expected 2 seeds, one an environment; got {len(seeds)}"):
            env.reset(seed=seeds)
    for seeds in (-1, [None, -1], [3, 0.5], [4, "a"]):
        with pytest.raises(gymnasium.error.Error, match="Seed"):
            env.reset(seed=seeds)
    for actions in ([0], [0, 0, 0], [[0, 0]], 0, [0.0, 1.0], [True, False], [0j, 0j], None, [0, "a"]):
        with pytest.raises(ValueError, match="whole numbers of shape"):
            env.step(np.array(actions))
    with pytest.raises(ValueError, match="whole numbers of shape"):
        env.step(None)  # type: ignore[arg-type]
    for actions in ([0, 20], [-1, 0]):
        with pytest.raises(ValueError, match="actions: expected 0 to 19"):
            env.step(np.array(actions))
    step = np.array([1, 2])
    assert_same(
        *(
            [one.step(step), one.step(step), one.step(step), one.reset(), one.reset(seed=[None, None])]
            for one in (env, other)
        )
    )
