"""Parallel episodes: how they move, when they end, and how they begin anew."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from torch import Tensor

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes, Step
from layoutrl.env.geometry import snap
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.room import Item
from tests.builders import l_room, random_room, rectangular_room


@pytest.fixture(scope="module")
def simulator() -> BatchSimulator:
    small = rectangular_room(1.2, 1.2, Item("bed", (1.0, 1.0), (0.6, 0.6)))  # nowhere is far from the goal
    rooms = [small, l_room(), rectangular_room(4, 3), *(random_room(np.random.default_rng(seed)) for seed in range(5))]
    return BatchSimulator(Simulator(rooms, Moves((0.32, 0.08)), Reward()))


def episodes(
    simulator: BatchSimulator, seed: int = 0, max_moves: int = 5, goal_iou: float | None = None, count: int = 40
) -> Episodes:
    """Episodes of all ages."""
    generator = torch.Generator().manual_seed(seed)
    return Episodes(simulator, np.arange(count) % max_moves, max_moves, generator, goal_iou)


def played(running: Episodes, steps: int, seed: int = 0) -> Iterator[Step]:
    """Steps of random moves, legal or not."""
    generator = torch.Generator().manual_seed(seed)
    for _ in range(steps):
        yield running.step(torch.randint(running.legal.shape[1], running.room.shape, generator=generator))


def leaves(step: Step) -> list[Tensor]:
    """All tensors of a step."""
    return [*step[:6], *step.terms, step.terminated, step.ended, step.whole]


def test_episodes_begin_at_drawn_places_with_the_moves_that_are_legal_there(simulator: BatchSimulator) -> None:
    running = episodes(simulator)
    assert simulator.is_legal(running.room, running.position).all()
    assert torch.equal(running.legal, simulator.reach(running.room, running.position)[1])


def test_a_step_tells_all_of_a_move_and_of_where_it_leads(simulator: BatchSimulator) -> None:
    running = episodes(simulator)
    room, position, legal = running.room, running.position, running.legal
    seen = set()
    for step in played(running, 20):
        assert torch.equal(step.room, room)
        assert torch.equal(step.position, position)
        length, was_legal = simulator.reach(room, position)
        assert torch.equal(legal, was_legal)
        every = torch.arange(len(room))
        assert torch.equal(step.legal, was_legal[every, step.action])
        reached = simulator.moved(step.room, position, step.action, length[every, step.action])
        assert torch.equal(step.next_position[step.legal], reached[step.legal])
        assert torch.equal(step.next_position[~step.legal], position[~step.legal])
        assert torch.equal(step.next_legal, simulator.reach(room, step.next_position)[1])
        assert all(map(torch.equal, step.terms, simulator.reward(room, step.next_position)))
        seen |= set(step.legal.tolist())
        room, position, legal = running.room, running.position, running.legal
    assert seen == {False, True}


def test_a_move_that_is_illegal_changes_nothing_but_the_age(simulator: BatchSimulator) -> None:
    running = episodes(simulator, max_moves=100)
    room, position, legal = running.room, running.position, running.legal
    illegal = (~legal).any(1)
    assert illegal.any()
    for _ in range(3):
        step = running.step(legal.int().argmin(1))  # the first that was illegal, if any
        assert not step.legal[illegal].any()
        for now, before in ((running.room, room), (running.position, position), (running.legal, legal)):
            assert torch.equal(now[illegal], before[illegal])
    running = episodes(simulator, max_moves=3, count=6)
    ends = [running.step((~running.legal).int().argmax(1)).ended.tolist() for _ in range(6)]
    assert ends == [[2, 5], [1, 4], [0, 3]] * 2


@pytest.mark.parametrize("max_moves", [1, 2, 5])
def test_an_episode_is_truncated_after_exactly_so_many_moves(simulator: BatchSimulator, max_moves: int) -> None:
    running = episodes(simulator, max_moves=max_moves)
    ages = np.arange(40) % max_moves
    for made, step in enumerate(played(running, 12), start=1):
        assert step.ended.tolist() == np.flatnonzero((ages + made) % max_moves == 0).tolist()
        assert not step.terminated.any()


def test_an_episode_terminates_at_the_goal_and_only_there(simulator: BatchSimulator) -> None:
    running = episodes(simulator, goal_iou=0.6)
    ages = np.arange(40) % 5
    terminations = truncations = 0
    for step in played(running, 30):
        ages += 1
        terminated = step.terms.iou.numpy() >= 0.6
        assert np.array_equal(step.terminated.numpy(), terminated)
        assert step.ended.tolist() == np.flatnonzero(terminated | (ages == 5)).tolist()
        terminations += (terminated & (ages < 5)).sum()
        truncations += (~terminated & (ages == 5)).sum()
        ages[step.ended] = 0
    assert terminations > 20
    assert truncations > 20


def test_without_a_goal_none_terminates_even_at_the_designers_place(simulator: BatchSimulator) -> None:
    best = max(float(step.terms.iou.max()) for step in played(episodes(simulator, max_moves=50), 50))
    assert best > 0.9
    assert not any(step.terminated.any() for step in played(episodes(simulator, max_moves=50), 50))


@pytest.mark.parametrize("goal_iou", [None, 0.6])
def test_what_ended_begins_anew_and_all_else_goes_on(simulator: BatchSimulator, goal_iou: float | None) -> None:
    running = episodes(simulator, goal_iou=goal_iou)
    for step in played(running, 20):
        ended = torch.zeros(40, dtype=torch.bool)
        ended[step.ended] = True
        assert torch.equal(running.room[~ended], step.room[~ended])
        assert torch.equal(running.position[~ended], step.next_position[~ended])
        assert torch.equal(running.legal[~ended], step.next_legal[~ended])
        assert not (running.position == step.next_position)[ended].all(1).any()
        assert simulator.is_legal(running.room, running.position).all()
        assert torch.equal(running.legal, simulator.reach(running.room, running.position)[1])


def test_every_room_is_as_likely_as_any_other_at_first_and_anew(simulator: BatchSimulator) -> None:
    running = episodes(simulator, max_moves=1, count=4000)
    rooms = len(simulator.rooms)
    for _ in range(2):
        counts = running.room.bincount(minlength=rooms)
        expected = 4000 / rooms
        assert ((counts - expected) ** 2 / expected).sum() < 24.3  # chi squared of 7 degrees of freedom: 1 in 1,000
        next(played(running, 1))


def test_equal_seeds_make_equal_runs_and_others_others(simulator: BatchSimulator) -> None:
    runs = [list(played(episodes(simulator, seed, goal_iou=0.6), 12)) for seed in (1, 1, 2)]
    first, same, other = ([leaf for step in run for leaf in leaves(step)] for run in runs)
    assert all(map(torch.equal, first, same))
    assert not torch.equal(first[1], other[1])


def test_what_was_told_earlier_does_not_change_later(simulator: BatchSimulator) -> None:
    ages = np.arange(40) % 5
    running = Episodes(simulator, ages, 5, torch.Generator().manual_seed(0), 0.6)
    told = [running.room, running.position, running.legal]
    copies = [tensor.clone() for tensor in told]
    for step in played(running, 12):
        told += leaves(step)
        copies += [tensor.clone() for tensor in leaves(step)]
    assert all(map(torch.equal, told, copies))
    assert ages.tolist() == (np.arange(40) % 5).tolist()


def test_the_global_random_stream_is_neither_read_nor_moved(simulator: BatchSimulator) -> None:
    runs = []
    for seed in (0, 1):
        torch.manual_seed(seed)
        state = torch.get_rng_state()
        runs.append(list(played(episodes(simulator), 6)))
        assert torch.equal(torch.get_rng_state(), state)
    assert all(torch.equal(a.next_position, b.next_position) for a, b in zip(*runs, strict=True))


def test_a_share_of_episodes_begins_near_the_designers_place(simulator: BatchSimulator) -> None:
    designed = torch.tensor(np.array([room.moving.center for room in simulator.rooms]))
    count = 4000

    def distance(near: tuple[float, Tensor] | None) -> Tensor:
        running = Episodes(simulator, np.zeros(count, dtype=int), 5, torch.Generator().manual_seed(0), None, near)
        assert simulator.is_legal(running.room, running.position).all()
        assert torch.equal(running.position, snap(running.position))
        wide = running.room == 2  # 4 m by 3 m
        return (running.position - designed[running.room])[wide].norm(dim=1)

    anywhere, half, always = (distance(near) for near in (None, (0.5, designed), (1.0, designed)))
    shares = [(those < 0.2).double().mean().item() for those in (anywhere, half, always)]
    assert shares[0] < 0.05
    assert shares[1] == pytest.approx((shares[0] + shares[2]) / 2, abs=0.05)
    assert shares[2] > 0.3
