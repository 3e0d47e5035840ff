"""The Gymnasium environment: its interface, its seeds, its moves, its ends."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from layoutrl import InputError
from layoutrl.env.layout_env import LayoutEnv
from layoutrl.env.render import story
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.vector_env import LayoutVectorEnv
from layoutrl.rooms.room import Item
from tests.builders import l_room, random_room, rectangular_room

STEPS = Moves((0.5,), slide=False)
RIGHT, LEFT, BELOW, UP = range(4)


def three_rooms():
    return [
        rectangular_room(4, 3, Item("bed", (1.0, 1.0), (0.5, 0.5)), id="plain"),
        l_room(id="l"),
        random_room(np.random.default_rng(5)),
    ]


def corner_room():
    """4 m by 3 m; the bed's centre may go from 0.3 to 3.7 and from 0.3 to 2.7, into the walls by 0.2."""
    return rectangular_room(4, 3, Item("bed", (1.0, 1.0), (0.5, 0.5)))


def play(env: gymnasium.Env, seed: int, moves: int) -> list:
    """Observations, rewards, ends and infos of random moves; an episode that ends is followed by another."""
    observation, info = env.reset(seed=seed)
    actions = np.random.default_rng(seed)
    tape = [(observation, info)]
    for _ in range(moves):
        step = env.step(actions.integers(env.action_space.n))
        tape.append(step)
        if step[2] or step[3]:
            tape.append(env.reset())
    return tape


def same(a, b) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same, a, b))
    return np.array_equal(a, b)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("observation", ["geometry", "image"])
@pytest.mark.parametrize("on_illegal", ["drop", "stop"])
def test_gymnasium_finds_nothing_to_complain_about(observation, on_illegal):
    rooms = [corner_room(), l_room()]
    keywords = {"rooms": rooms, "observation": observation, "on_illegal": on_illegal, "render_mode": "rgb_array"}
    env = gymnasium.make("layoutrl/Layout-v0", **keywords)
    check_env(env.unwrapped)
    play(env, 3, 20)  # through the wrappers of `make`, which check every step
    assert env.render().shape == (384, 384, 3)


@pytest.mark.filterwarnings("error")
def test_without_rooms_designed_bedrooms_are_taken():
    env = gymnasium.make("layoutrl/Layout-v0")
    assert {room.room_type for room in env.unwrapped.simulator.rooms} == {"bedroom"}
    play(env, 0, 5)


def test_rooms_of_a_file_are_taken_as_the_readme_says(tmp_path, monkeypatch):
    readme = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
    (room,) = re.findall(r"^    (\{\"id\".*\n(?:     .*\n)*)", readme, flags=re.MULTILINE)
    (program,) = re.findall(r"^    (from layoutrl\.rooms\.files .*\n)\n    (env = .*)", readme, flags=re.MULTILINE)
    (tmp_path / "my_rooms.json").write_text(room, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = {"gymnasium": gymnasium}
    exec("".join(program), names)
    assert [room.id for room in names["env"].unwrapped.simulator.rooms] == ["b-17"]
    play(names["env"], 0, 5)


@pytest.mark.parametrize("environment", ["layoutrl/Layout-v0", "layoutrl/Rooms-v0"])
@pytest.mark.parametrize("rooms", ["my_rooms.jsonl", Path("my_rooms.jsonl"), [{"id": "b-17"}], l_room()])
def test_what_is_no_list_of_rooms_is_refused(environment, rooms):
    with pytest.raises(InputError, match=r"^rooms: expected a list of rooms, as read_rooms\(file\)\.rooms is; got .+"):
        gymnasium.make(environment, rooms=rooms)


@pytest.mark.parametrize("environment", ["layoutrl/Layout-v0", "layoutrl/Rooms-v0"])
def test_what_is_no_argument_of_an_environment_is_refused_in_a_line(environment):
    many = {"num_envs": 2, "vectorization_mode": "vector_entry_point"}
    for make in (gymnasium.make, partial(gymnasium.make_vec, **many)):
        with pytest.raises(ValueError, match=r"^moves: expected Moves\(\.\.\.\) or None; got \(0\.3,\)$"):
            make(environment, rooms=[l_room()], moves=(0.3,))
        with pytest.raises(
            ValueError, match=r"^reward: expected Reward\(\.\.\.\) or None; got <built-in function sum>$"
        ):
            make(environment, rooms=[l_room()], reward=sum)
    said = "device: expected cpu or a GPU of this machine, as cuda:0; got"
    for device in ("foo", "cuda:99", None):
        with pytest.raises(InputError, match=f"^{said} {device} "):
            gymnasium.make_vec(environment, rooms=[l_room()], device=device, **many)


def test_no_rooms_or_unknown_choices_are_refused():
    with pytest.raises(ValueError, match="rooms"):
        LayoutEnv([])
    with pytest.raises(ValueError, match="observation: expected geometry or image; got 'sketch'"):
        LayoutEnv([l_room()], observation="sketch")
    with pytest.raises(ValueError, match="on_illegal: expected drop or stop; got 'bounce'"):
        LayoutEnv([l_room()], on_illegal="bounce")
    with pytest.raises(ValueError, match="target"):
        LayoutEnv([l_room(target=None)])
    with pytest.raises(ValueError, match="human"):
        LayoutEnv([l_room()], render_mode="human")
    with pytest.raises(ValueError, match=r"max_moves: expected a whole number, 1 or more; got 1\.5"):
        LayoutEnv([l_room()], max_moves=1.5)
    with pytest.raises(ValueError, match="max_moves: expected a whole number, 1 or more; got 0"):
        LayoutEnv([l_room()], max_moves=0)


@pytest.mark.parametrize("observation", ["geometry", "image"])
def test_equal_seeds_give_equal_trajectories_and_other_seeds_others(observation):
    tapes = [play(LayoutEnv(three_rooms(), observation, max_moves=7), seed, 12) for seed in (4, 4, 5)]
    assert same(tapes[0], tapes[1])
    assert not same(tapes[0], tapes[2])


def test_a_reset_without_a_seed_goes_on_with_the_stream_of_the_last_seed():
    env, other = LayoutEnv(three_rooms()), LayoutEnv(three_rooms())
    first = [env.reset(seed=9)[1]] + [env.reset()[1] for _ in range(5)]
    second = [other.reset(seed=9)[1]] + [other.reset()[1] for _ in range(5)]
    assert same(first, second)
    assert len({tuple(info["position"]) for info in first}) == len(first)
    assert same(env.reset(seed=9)[1], first[0])


def test_the_global_random_stream_is_neither_read_nor_moved():
    tapes = []
    for seed in (0, 1):
        np.random.seed(seed)  # noqa: NPY002
        tapes.append(play(LayoutEnv(three_rooms()), 4, 5))
        assert np.random.random() == np.random.RandomState(seed).random()  # noqa: NPY002
    assert same(*tapes)


def test_every_room_is_drawn():
    env = LayoutEnv(three_rooms())
    rooms = [env.reset(seed=0)[1]["room"]] + [env.reset()[1]["room"] for _ in range(40)]
    assert set(rooms) == {0, 1, 2}


def test_a_legal_move_goes_one_step_and_tells_the_reward_of_where_it_arrives():
    env = LayoutEnv([corner_room()], moves=STEPS)
    env.reset(options={"position": (2.0, 1.5)})
    simulator = Simulator([corner_room()], STEPS, Reward())
    for action, right in ((RIGHT, (2.5, 1.5)), (UP, (2.5, 2.0)), (LEFT, (2.0, 2.0)), (BELOW, (2.0, 1.5))):
        _, reward, terminated, truncated, info = env.step(action)
        np.testing.assert_allclose(info["position"], right, atol=1e-9)
        assert reward == pytest.approx(simulator.reward(np.array([0]), np.array([right])).total[0], abs=1e-9)
        assert [terminated, truncated, info["illegal"]] == [False] * 3


def test_an_illegal_move_is_dropped_and_changes_nothing():
    env = LayoutEnv([corner_room()], moves=STEPS, on_illegal="drop")
    before, start = env.reset(options={"position": (3.5, 1.5)})
    assert start["legal"].tolist() == [False, True, True, True]
    assert not start["illegal"]
    after, reward, terminated, truncated, info = env.step(RIGHT)
    assert info["illegal"]
    assert not terminated
    assert not truncated
    np.testing.assert_array_equal(after, before)
    assert same(start, info | {"illegal": False})
    simulator = Simulator([corner_room()], STEPS, Reward())
    assert reward == pytest.approx(simulator.reward(np.array([0]), np.array([[3.5, 1.5]])).total[0], abs=1e-9)
    *_, info = env.step(LEFT)
    assert info["position"].tolist() == [3.0, 1.5]
    assert not info["illegal"]


def test_an_illegal_move_stops_the_test_episode_where_it_stands():
    env = LayoutEnv([corner_room()], moves=STEPS, on_illegal="stop")
    before, start = env.reset(options={"position": (3.5, 1.5)})
    after, _, terminated, truncated, info = env.step(RIGHT)
    assert terminated
    assert not truncated
    assert info["illegal"]
    np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(info["position"], start["position"])


def test_legal_and_illegal_in_random_play_are_as_the_mask_said():
    env = LayoutEnv(three_rooms(), moves=Moves((0.7,)), max_moves=50)
    rng = np.random.default_rng(1)
    _, info = env.reset(seed=1)
    seen = set()
    for _ in range(40):
        action = rng.integers(env.action_space.n)
        said, position = info["legal"][action], info["position"]
        *_, info = env.step(action)
        assert info["illegal"] == (not said)
        assert np.array_equal(info["position"], position) == info["illegal"]
        seen.add(info["illegal"])
    assert seen == {False, True}


def test_the_action_masks_are_the_moves_that_are_legal_now():
    env = LayoutEnv(three_rooms(), moves=Moves((0.7,)), max_moves=50)
    _, info = env.reset(seed=1)
    for action in range(env.action_space.n):
        mask = env.action_masks()
        assert (mask.dtype, mask.shape) == (bool, (env.action_space.n,))
        np.testing.assert_array_equal(mask, info["legal"])
        mask[:] = ~mask  # the caller's own
        np.testing.assert_array_equal(env.action_masks(), info["legal"])
        *_, info = env.step(action)


@pytest.mark.parametrize("action", [-1, 4, 1.0, None, [1], np.array([1]), True, np.True_])
def test_an_action_outside_the_action_space_is_refused_and_makes_no_move(action):
    env = LayoutEnv([corner_room()], moves=STEPS, max_moves=1)
    env.reset(options={"position": (2.0, 1.5)})
    with pytest.raises(ValueError, match="action: expected a whole number from 0 to 3"):
        env.step(action)
    *_, truncated, info = env.step(np.int64(RIGHT))
    assert truncated  # by this move, the first
    assert info["position"].tolist() == [2.5, 1.5]


@pytest.mark.parametrize("refused", [None, {"room": 99}])
@pytest.mark.parametrize("call", [lambda env: env.step(0), LayoutEnv.render, LayoutEnv.action_masks])
def test_a_reset_must_come_first(call, refused):
    env = LayoutEnv([corner_room()])
    if refused:
        with pytest.raises(ValueError, match="room"):
            env.reset(options=refused)
    with pytest.raises(ResetNeeded, match="reset"):
        call(env)


@pytest.mark.parametrize("on_illegal", ["drop", "stop"])
def test_the_budget_of_moves_truncates_and_never_terminates(on_illegal):
    env = LayoutEnv([corner_room()], moves=STEPS, max_moves=4, on_illegal=on_illegal)
    for _ in range(2):
        env.reset(seed=0, options={"position": (2.0, 1.5)})
        ends = [env.step(action)[2:4] for action in (RIGHT, LEFT, RIGHT, LEFT)]
        assert ends == [(False, False)] * 3 + [(False, True)]


def test_dropped_moves_count_towards_the_budget():
    env = LayoutEnv([corner_room()], moves=STEPS, max_moves=3)
    env.reset(options={"position": (3.5, 1.5)})
    assert [env.step(RIGHT)[3] for _ in range(3)] == [False, False, True]


def test_reaching_the_designers_place_ends_nothing():
    env = LayoutEnv([corner_room()], moves=STEPS)
    env.reset(options={"position": (1.0, 0.5)})
    _, reward, terminated, truncated, info = env.step(LEFT)
    assert info["iou"] == pytest.approx(1)
    assert reward == pytest.approx(100)
    assert [terminated, truncated] == [False] * 2


def test_the_parts_in_the_info_sum_to_the_unclipped_reward():
    env = LayoutEnv(three_rooms(), reward=Reward(100, -1000, -1000))
    clipped = 0
    for step in play(env, 2, 60):
        if len(step) == 5:
            info, total = step[4], step[4]["r1"] + step[4]["r2"] + step[4]["r3"]
            assert step[1] == pytest.approx(min(max(total, -200), 100))
            assert info["r1"] == pytest.approx(100 * info["iou"])
            assert info["r2"] <= 0
            assert info["r3"] <= 1e-9
            clipped += total < -200
    assert clipped


def test_options_choose_room_and_position():
    env = LayoutEnv(three_rooms())
    _, info = env.reset(options={"room": 1, "position": (1.25, 0.75)})
    assert info["room"] == 1
    assert info["position"].tolist() == [1.25, 0.75]
    _, info = env.reset(options={"room": 1, "position": (1.23456789, 0.75)})
    assert info["position"].tolist() == pytest.approx([1.234568, 0.75], abs=1e-12)  # on the grid
    assert {env.reset(options={"room": 2})[1]["room"] for _ in range(8)} == {2}


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"room": 3}, "0 to 2; got 3"),
        ({"room": -1}, "0 to 2; got -1"),
        ({"room": 1.5}, "whole number from 0 to 2; got 1.5"),
        ({"room": "l"}, "whole number"),
        ({"start": 1, "room": 1}, "expected a dict of room and position; got {'start': 1, 'room': 1}"),
        ("room", "expected a dict of room and position; got 'room'"),
        ({"room": 1, "position": (3.5, 3.5)}, "leaves the room"),
        ({"position": (1.25, 0.75)}, r"expected options\['room'\]"),
        *(
            ({"room": 1, "position": position}, "two finite numbers")
            for position in [1, (1,), (1, 1, 1), [(1, 1)], (1, np.nan), (np.inf, 1), "ab", (1, None), (1, (1, 1))]
        ),
    ],
)
def test_options_that_cannot_be_are_refused_and_leave_all_as_it_was(options, why):
    env, other = (LayoutEnv(three_rooms(), max_moves=3) for _ in range(2))
    told = [(one.reset(seed=1), one.step(0)) for one in (env, other)]
    assert same(*told)
    for seed in (None, 7):
        with pytest.raises(ValueError, match=why) as refusal:
            env.reset(seed=seed, options=options)
        assert "\n" not in str(refusal.value)
    with pytest.raises(gymnasium.error.Error, match="eed"):
        env.reset(seed=-1, options={"room": 2})
    told = [(one.step(1), one.step(2), one.reset(), one.reset(options={"room": 0})) for one in (env, other)]
    assert same(*told)


def test_what_was_told_earlier_does_not_change_later():
    env = LayoutEnv([corner_room()], moves=STEPS)
    told = [env.reset(options={"position": (2.0, 1.5)})]
    frozen = [(told[0][0].copy(), told[0][1]["position"].copy(), told[0][1]["legal"].copy())]
    for action in (RIGHT, RIGHT, RIGHT, UP):
        observation, *_, info = env.step(action)
        told.append((observation, info))
        frozen.append((observation.copy(), info["position"].copy(), info["legal"].copy()))
    for (observation, info), copies in zip(told, frozen, strict=True):
        assert same([observation, info["position"], info["legal"]], list(copies))


def test_a_position_that_was_told_cannot_be_used_to_move_the_item():
    env = LayoutEnv([corner_room()], moves=STEPS)
    _, info = env.reset(options={"position": (2.0, 1.5)})
    info["position"][:] = 0
    *_, info = env.step(RIGHT)
    assert info["position"].tolist() == [2.5, 1.5]


@pytest.mark.parametrize("environment", [LayoutEnv, lambda rooms: LayoutVectorEnv(2, rooms)])
def test_what_moves_has_a_place_of_the_designers(environment):
    room = rectangular_room(4, 3, Item("bed", (1.0, 1.0)))
    with pytest.raises(InputError, match=r"^rooms: the bed of room has no center; expected the designer's place"):
        environment([room])


def test_what_else_has_no_center_is_left_out_of_the_room():
    bed, waits = Item("bed", (1.0, 1.0), (0.5, 0.5)), Item("wardrobe", (0.6, 3.0))
    bare, given = ([rectangular_room(4, 3, bed, others=others)] for others in ((), (waits,)))
    told, expected = (play(LayoutEnv(rooms, "image"), 3, 30) for rooms in (given, bare))
    assert same(told, expected)
    for make in (LayoutEnv, partial(LayoutVectorEnv, 2)):
        made = [make(rooms, categories=names) for rooms in (given, bare) for names in (None, ["bed"])]
        assert all(env.observation_space == made[0].observation_space for env in made)


def test_rendering_is_the_story_of_the_episode_so_far():
    env = LayoutEnv([corner_room()], moves=STEPS, render_mode="rgb_array")
    env.reset(options={"position": (2.0, 1.5)})
    for action in (RIGHT, UP):
        env.step(action)
    image = env.render()
    assert image.shape == (384, 384, 3)
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, story(corner_room(), np.array([(2, 1.5), (2.5, 1.5), (2.5, 2)])))
    env.reset(options={"position": (1.0, 1.5)})
    np.testing.assert_array_equal(env.render(), story(corner_room(), np.array([(1, 1.5)])))


def test_without_a_render_mode_nothing_is_drawn():
    env = LayoutEnv([corner_room()])
    env.reset(seed=0)
    assert env.render() is None
