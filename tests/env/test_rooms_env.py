"""The environments of whole rooms: their interface, seeds, ends. `RoomsEnv` is the oracle of the vector environment."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from layoutrl import InputError
from layoutrl.env.measures import measured
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_env import RoomsEnv
from layoutrl.env.rooms_vector_env import RoomsVectorEnv
from layoutrl.env.simulator import Moves
from layoutrl.rooms.brief import brief_of, missing
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Item, Room
from tests.builders import random_brief, random_room, rectangular_room

BEDROOMS = design_rooms("bedroom", "train", 0, 3).rooms


def upright_rooms() -> list[Room]:
    """Designed ones, and a brief; without discs, which the vector environment has round and RoomsEnv with corners."""
    rng = np.random.default_rng(0)
    random = [random_brief(rng, random_room(rng)) for _ in range(6)]
    return [*BEDROOMS, *(room for room in random if all(item.form == "rectangle" for item in room.furniture))]


def legal_action(info: dict[str, Any], rng: np.random.Generator) -> int:
    return int((rng.random(len(info["legal"])) * info["legal"]).argmax())


@pytest.mark.filterwarnings("error")
def test_gymnasium_finds_nothing_wrong() -> None:
    check_env(gymnasium.make("layoutrl/Rooms-v0", rooms=BEDROOMS, render_mode="rgb_array").unwrapped)
    gymnasium.make("layoutrl/Rooms-v0").reset(seed=0)
    env = gymnasium.make_vec("layoutrl/Rooms-v0", num_envs=2, vectorization_mode="vector_entry_point", rooms=BEDROOMS)
    assert env.reset(seed=0)[0].shape == env.observation_space.shape


def test_an_episode_furnishes_a_room_and_tells_its_measures_at_the_end() -> None:
    env, rng = RoomsEnv(BEDROOMS, max_moves=60), np.random.default_rng(0)
    _, info = env.reset(seed=1, options={"room": 2})
    assert (info["room"], info["item"]) == (2, -1)
    assert env.layout == brief_of(BEDROOMS[2])
    ended = False
    while not ended:
        assert "measures" not in info
        _, reward, terminated, ended, info = env.step(legal_action(info, rng))
        assert not terminated
        assert (info["item"] == -1) == (len(missing(env.layout)) == len(BEDROOMS[2].furniture))  # until one is taken
        assert -200 <= reward <= 100
        assert reward == pytest.approx(info["r1"] + info["r2"] + info["r3"])
    expected = {name: values.item() for name, values in vars(measured([env.layout], [BEDROOMS[2]])).items()}
    del expected["group"]
    np.testing.assert_equal(info["measures"], expected)
    assert len(missing(env.layout)) < len(BEDROOMS[2].furniture)


def test_an_illegal_action_changes_nothing() -> None:
    env = RoomsEnv(BEDROOMS)
    before, info = env.reset(seed=0)
    after, reward, _, _, then = env.step(0)  # nothing is taken yet
    assert then["illegal"]
    assert not info["illegal"]
    assert reward == 0
    np.testing.assert_array_equal(before, after)
    assert env.layout == brief_of(BEDROOMS[then["room"]])


def test_the_same_seed_gives_the_same_episode() -> None:
    def played(seed: int) -> list[Any]:
        env, rng = RoomsEnv(BEDROOMS, max_moves=15), np.random.default_rng(0)
        steps = [env.reset(seed=seed)]
        for _ in range(15):
            steps.append(env.step(legal_action(steps[-1][-1], rng)))
        return steps

    np.testing.assert_equal(played(0), played(0))
    assert any(not np.array_equal(one[0], other[0]) for one, other in zip(played(0), played(1), strict=True))


def test_of_a_brief_nobody_knows_the_design() -> None:
    bed = Item("bed", (2.0, 1.5), None, None)
    desk = Item("desk", (0.6, 1.2), (3.5, 1.0), 180.0)
    room = rectangular_room(4, 3, bed, others=(desk,))
    env = RoomsEnv([room], max_moves=1)
    env.reset(seed=0)
    _, _, _, ended, info = env.step(env.simulator.actions - 1)
    assert ended
    assert info["r1"] == 0
    assert "measures" not in info
    assert env.layout.furniture[1] == desk
    assert env.layout.furniture[0].center is not None


def test_what_cannot_be_asked_is_refused_and_changes_nothing() -> None:
    env = RoomsEnv(BEDROOMS)
    for call in (env.render, env.action_masks, lambda: env.step(0)):
        with pytest.raises(ResetNeeded, match="expected a call of reset"):
            call()
    env.reset(seed=0)
    here = env.layout
    for options, words in (
        ({"place": 1}, "expected a dict of room; got {'place': 1}"),
        ("room", "expected a dict of room; got 'room'"),
        ({"room": 3}, "0 to 2; got 3"),
        ({"room": True}, "got True"),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(options=options)
    for action in (-1, True):
        with pytest.raises(ValueError, match=rf"action: expected a whole number from 0 to \d+; got {action}"):
            env.step(action)
    assert env.layout == here
    with pytest.raises(InputError, match="expected at least one room"):
        RoomsEnv([])
    with pytest.raises(ValueError, match="max_moves: expected a whole number, 1 or more"):
        RoomsEnv(max_moves=0)
    with pytest.raises(ValueError, match="render_mode: expected rgb_array"):
        RoomsVectorEnv(2, render_mode="text")


def test_a_room_in_which_nothing_stands_and_that_has_no_walls_is_seen_too() -> None:
    bare = rectangular_room(item=Item("bed", (2.0, 1.5)), walls=(), target=None)
    env = gymnasium.make("layoutrl/Rooms-v0", rooms=[bare])
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)


@pytest.mark.parametrize("environment", [RoomsEnv, partial(RoomsVectorEnv, 2)])
def test_a_room_with_nothing_to_place_is_refused(environment) -> None:
    empty = replace(BEDROOMS[0], id="hall", furniture=(), target=None)
    with pytest.raises(InputError, match=r"^rooms: hall has nothing to place; expected rooms with furniture$"):
        environment([*BEDROOMS, empty])


def test_what_moves_is_drawn_red() -> None:
    env = RoomsEnv(BEDROOMS, render_mode="rgb_array")
    env.reset(seed=0)
    empty = env.render()
    env.step(env.simulator.actions - 1)
    taken = env.render()
    assert empty is not None
    assert taken is not None
    assert empty.shape == taken.shape == (384, 384, 3)
    changed = (empty != taken).any(-1)
    red = (taken[..., 0] > 200) & (taken[..., 1] < 120)
    assert changed.any()
    assert red[changed].mean() > 0.5
    assert not ((empty[..., 0] > 200) & (empty[..., 1] < 120)).any()
    assert RoomsEnv(BEDROOMS).metadata["render_modes"] == ["rgb_array"]


def assert_same(told: Any, expected: Any) -> None:
    """Of one type, shape and content; rewards may be rounded."""
    if isinstance(expected, dict):
        assert told.keys() == expected.keys()
        for name, value in expected.items():
            assert_same(told[name], value)
    elif isinstance(expected, tuple | list) or getattr(expected, "dtype", None) == np.dtype(object):
        for one, other in zip(told, expected, strict=True):
            assert_same(one, other)
    else:
        np.testing.assert_allclose(told, expected, rtol=0, atol=2e-2 if np.asarray(told).dtype == float else 2e-6)


def test_with_gains_an_episode_returns_how_far_the_items_last_rewards_are_above_the_lowest() -> None:
    paid, item_alone, rng = RoomsEnv(BEDROOMS, gains=True), RoomsEnv(BEDROOMS), np.random.default_rng(0)
    for room, design in enumerate(BEDROOMS):
        _, info = paid.reset(seed=room, options={"room": room})
        item_alone.reset(seed=room, options={"room": room})
        assert paid.step(0)[1] == item_alone.step(0)[1] == 0  # nothing is taken yet
        last, returned = np.full(len(design.furniture), -200.0), 0.0
        for _ in range(60):
            action = legal_action(info, rng)
            _, gain, _, _, info = paid.step(action)
            returned += float(gain)
            last[info["item"]] = item_alone.step(action)[1]
        assert returned == pytest.approx(last.mean() + 200)


def test_with_gains_it_pays_to_take_an_item_though_nobody_knows_its_place() -> None:
    desk = Item("desk", (0.6, 1.2), None, None)
    env = RoomsEnv([rectangular_room(4, 3, Item("bed", (2.0, 1.5), None, None), others=(desk,))], gains=True)
    for seed in range(5):
        env.reset(seed=seed)
        assert env.step(env.simulator.actions - 1)[1] >= 0


@pytest.mark.parametrize(("more", "gains"), [(0, False), (3, False), (3, True)])
def test_the_vector_environment_tells_what_as_many_single_ones_tell(more: int, gains: bool) -> None:
    rooms, seeds = upright_rooms(), [5, 6, 7, 8]
    items = max(len(missing(room)) or len(room.furniture) for room in rooms) + more
    keywords: dict[str, Any] = {"max_moves": 12, "reward": Reward(90, -70, -40), "items": items, "elements": 60}
    keywords["gains"] = gains
    vector: VectorEnv = RoomsVectorEnv(4, rooms, **keywords)
    singles = SyncVectorEnv([lambda: RoomsEnv(rooms, **keywords)] * 4, autoreset_mode=AutoresetMode.SAME_STEP)
    told, expected = vector.reset(seed=seeds), singles.reset(seed=seeds)
    assert_same(told, expected)
    rng = np.random.default_rng(0)
    for _ in range(30):
        legal = told[-1]["legal"]
        chance = rng.random(legal.shape)
        action = (chance * np.where(chance > 0.98, 1, legal)).argmax(1)  # some are illegal
        told, expected = vector.step(action), singles.step(action)
        assert_same(told, expected)
        assert not legal[:, legal.shape[1] - more :].any()  # there are no such items


def test_one_stream_draws_for_all_environments_and_measures_can_be_left_out() -> None:
    env = RoomsVectorEnv(3, BEDROOMS, max_moves=2, measure=False, moves=Moves((0.1,)), render_mode="rgb_array")
    first, _ = env.reset(seed=0)
    again, info = env.reset(seed=0)
    np.testing.assert_array_equal(first, again)
    action = np.full(3, info["legal"][0].argmax())
    env.step(action)
    assert all(item.center is not None for layout in env.layouts() for item in layout.furniture[:1])
    *_, truncated, info = env.step(action)
    assert truncated.all()
    assert "measures" not in info["final_info"]
    frames = env.render()
    assert frames is not None
    assert len(frames) == 3
    with pytest.raises(ValueError, match="expected 3 seeds"):
        env.reset(seed=[0])
    with pytest.raises(ValueError, match="options: expected none"):
        env.reset(options={"room": 0})
