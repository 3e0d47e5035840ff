"""docs/other_libraries.md: its programs run where their libraries are, and learn from what the page says they do."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from layoutrl.env.layout_env import LayoutEnv
from layoutrl.env.observation import COLUMNS
from layoutrl.env.rooms_observation import ROOM_COLUMNS
from layoutrl.rooms.files import read_rooms, write_rooms
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room

PROJECT = Path(__file__).resolve().parents[1]
PAGE = (PROJECT / "docs/other_libraries.md").read_text(encoding="utf-8")
SECTION = r"^## (.+)\n(?:(?!## |```).*\n)*```python\n((?:.*\n)*?)```"  # its heading, and its one program
PROGRAMS: dict[str, str] = dict(re.findall(SECTION, PAGE, flags=re.MULTILINE))
COMES_WITH = {"gymnasium": "layoutrl", "numpy": "layoutrl", "torch": "layoutrl", "tensordict": "torchrl"}


def libraries(heading: str) -> set[str]:
    """The packages that a program imports, or with which they come."""
    imported = re.findall(r"^(?:from|import) (\w+)", PROGRAMS[heading], flags=re.MULTILINE)
    return {COMES_WITH.get(name, name) for name in imported}


def skip_without_libraries(heading: str) -> None:
    missing = sorted(name for name in libraries(heading) if find_spec(name) is None)
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)} (pip install -e '.[libraries]')")


def run(heading: str) -> dict[str, Any]:
    """What a program of the page has made in the end."""
    skip_without_libraries(heading)
    names: dict[str, Any] = {}
    with torch.random.fork_rng():
        exec(compile(PROGRAMS[heading], heading, "exec"), names)
    return names


def test_every_program_of_the_page_is_run_here() -> None:
    assert PAGE.count("```") == 2 * len(PROGRAMS)
    source = Path(__file__).read_text(encoding="utf-8")
    assert sorted(re.findall(r'(?:run|skip_without_libraries)\("(.+)"\)', source)) == sorted(PROGRAMS)


def test_the_extra_installs_what_they_need() -> None:
    extras = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    installed = {re.split(r"[<>=]", name)[0].replace("-", "_") for name in extras["libraries"]}
    assert set().union(*map(libraries, PROGRAMS)) == installed | {"layoutrl"}


def test_both_environments_of_the_page_have_the_spaces_that_are_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    furniture = Item("bed", (2.0, 1.5), (1.3, 1.5)), Item("wardrobe", (0.6, 1.0), (3.5, 1.0))
    write_rooms(tmp_path / "train.json", [rectangular_room(4, 3, furniture[0])])
    write_rooms(tmp_path / "test.json", [rectangular_room(4, 3, furniture[0], others=furniture[1:])])
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"gymnasium": gymnasium, "read_rooms": read_rooms}
    exec("".join(re.findall(r"^    ((?:spaces|learns|is_tested) = .*\n)", PAGE, flags=re.MULTILINE)), names)
    assert names["learns"].observation_space == names["is_tested"].observation_space
    assert names["learns"].observation_space.shape == (24, len(COLUMNS) + 4)


def test_the_page_names_the_columns_of_an_observation_in_order() -> None:
    table = PAGE[PAGE.index("| column | name | value |") :].partition("\n\n")[0]
    named = [name for line in table.splitlines() for name in re.findall(r"`(\w+)`", line.split("|")[2])]
    assert tuple(named) == ROOM_COLUMNS


def test_the_reward_of_the_page_pays_where_the_item_arrives() -> None:
    names: dict[str, Any] = {"gymnasium": gymnasium}
    (program,) = re.findall(r"^    (class Arrived.*\n(?:     .*\n|\n)*)", PAGE, flags=re.MULTILINE)
    exec(program.replace("\n    ", "\n"), names)
    env = names["Arrived"](LayoutEnv([rectangular_room(4, 3)]))
    x, y = env.unwrapped.simulator.designer_position[0]
    paid = []
    for beside in (0.32, 0.64):
        env.reset(options={"position": (x - beside, y)})
        paid.append(env.step(0)[1])
    assert paid == [1.0, 0.0]


def assert_rewards_are_scaled(rewards: Any, slack: float = 0.0) -> None:
    """From -2 to 1; of PPO, the last of an episode has a value added to it."""
    assert -2 - slack <= rewards.min() < rewards.max() <= 1 + slack


def test_sb3_dqn_takes_no_end_for_a_terminal_state() -> None:
    replay = run("Stable-Baselines3: DQN")["model"].replay_buffer
    stored = slice(0, replay.pos)
    assert replay.pos == 200
    assert np.flatnonzero(replay.dones[stored, 0]).tolist() == [29, 59, 89, 119, 149, 179]
    assert np.array_equal(replay.dones[stored], replay.timeouts[stored])
    assert not replay.sample(1000).dones.any()
    assert_rewards_are_scaled(replay.rewards[stored])


def test_sb3_ppo_sees_pictures_and_values_what_is_beyond_the_end() -> None:
    model = run("Stable-Baselines3: PPO, from pictures")["model"]
    rollout = model.rollout_buffer
    assert rollout.observations.shape == (64, 3, 128, 128)
    for episode, told in enumerate(model.ep_info_buffer):
        rewards = rollout.rewards.ravel()[30 * episode : 30 * (episode + 1)]
        assert told["l"] == 30
        assert abs(rewards.sum() - told["r"]) > 1e-4  # the last has the value of the last state in it
    assert len(model.ep_info_buffer) == 2
    assert_rewards_are_scaled(rollout.rewards, slack=0.5)


def assert_all_moves_are_legal(rollout: Any) -> None:
    masks = rollout.action_masks.reshape(*rollout.actions.shape[:-1], -1).astype(bool)
    assert not masks.all()
    assert np.take_along_axis(masks, rollout.actions.astype(int), -1).all()


def test_maskable_ppo_makes_legal_moves_only() -> None:
    names = run("sb3-contrib: MaskablePPO")
    assert_all_moves_are_legal(names["model"].rollout_buffer)
    assert_rewards_are_scaled(names["model"].rollout_buffer.rewards, slack=0.5)
    assert names["info"]["legal"][names["action"]]


def test_the_vecenv_tells_what_sb3s_own_tells_of_single_environments() -> None:
    names = run("Stable-Baselines3: many rooms at once")
    assert_all_moves_are_legal(names["model"].rollout_buffer)

    from stable_baselines3.common.vec_env import DummyVecEnv

    many = gymnasium.make_vec("layoutrl/Layout-v0", num_envs=3, vectorization_mode="vector_entry_point", max_moves=4)
    ours, theirs = names["LayoutVecEnv"](many), DummyVecEnv([lambda: LayoutEnv(max_moves=4)] * 3)
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    begun = []
    for env in (ours, theirs):
        env.seed(5)
        begun.append(env.reset())
    np.testing.assert_array_equal(*begun)
    actions = np.random.default_rng(0)
    for step in range(1, 10):
        np.testing.assert_array_equal(*(np.stack(env.env_method("action_masks")) for env in (ours, theirs)))
        action = actions.integers(20, size=3)
        (seen, rewards, ends, infos), (expected, whole, done, told) = (env.step(action) for env in (ours, theirs))
        np.testing.assert_array_equal(seen, expected)
        np.testing.assert_allclose(rewards, whole / 100, atol=1e-5)
        assert (rewards.dtype, ends.dtype) == (whole.dtype, done.dtype)
        assert ends.tolist() == done.tolist() == [step % 4 == 0] * 3
        for one, other in zip(infos, told, strict=True):
            assert one["TimeLimit.truncated"] is other["TimeLimit.truncated"]
            assert ("terminal_observation" in one) == ("terminal_observation" in other)
            np.testing.assert_array_equal(one.get("terminal_observation"), other.get("terminal_observation"))


def test_the_loop_in_the_manner_of_cleanrl_makes_legal_moves_and_values_the_last_states() -> None:
    names = run("Plain PyTorch, in the manner of CleanRL")
    state, action, reward, arrived, arrived_legal, terminated = (table[: names["STEPS"]] for table in names["replay"])
    goes_on = torch.arange(1, names["STEPS"]) % 30 != 0  # from move to move in one episode
    assert (arrived[:-1] == state[1:]).flatten(1).all(1).equal(goes_on)
    assert arrived_legal[:-1].gather(2, action[1:, :, None])[goes_on].all()
    assert not arrived_legal.all()
    assert not terminated.any()
    assert_rewards_are_scaled(reward)
    assert names["loss"].isfinite()


def test_torchrl_makes_legal_moves_and_values_the_last_states() -> None:
    """In a process of its own: to import TorchRL sets how processes are started from then on."""
    skip_without_libraries("TorchRL")
    checks = """
stored = replay[:]
ends = stored["next", "truncated"].squeeze(1)
assert ends.nonzero().squeeze(1).tolist() == list(range(29, 16 * 30 * 3, 30))
assert not stored["next", "terminated"].any() and not stored["next", "illegal"].any() and not stored["legal"].all()
assert not (stored["next", "position"][:-1] == stored["position"][1:])[ends[:-1]].any(1).any()
loss.target_value_network_params.to_module(loss.value_network)
target = loss.value_estimator.value_estimate(stored, target_params=loss.target_value_network_params)
assert -2 <= stored["next", "reward"].min() < stored["next", "reward"].max() <= 1
best = network(stored["next", "observation"]).masked_fill(~stored["next", "legal"], -torch.inf).amax(1, keepdim=True)
torch.testing.assert_close(target, stored["next", "reward"] + 0.7 * best)
assert episode["legal"].gather(1, episode["action"][:, None]).all()
"""
    command = [sys.executable, "-W", "error", "-W", "ignore::DeprecationWarning", "-c", PROGRAMS["TorchRL"] + checks]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
