"""Exploration: the schedule step by step, and draws that are uniform, legal and independent."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.agents.exploration import LinearSchedule, explore


@pytest.mark.parametrize(
    ("schedule", "table"),
    [
        (LinearSchedule(1.0, 0.1, 9), {k: 1 - 0.1 * k for k in range(10)} | {10: 0.1, 10_000: 0.1}),
        (LinearSchedule(0.5, 0.5, 4), dict.fromkeys(range(8), 0.5)),
        (LinearSchedule(1.0, 0.0, 1), {0: 1.0, 1: 0.0, 2: 0.0}),
        (LinearSchedule(1.0, 0.3, 0), {0: 0.3, 1: 0.3, 5: 0.3}),
        (LinearSchedule(0.0, 1.0, 2), {0: 0.0, 1: 0.5, 2: 1.0, 3: 1.0}),
    ],
)
def test_epsilon_at_every_step(schedule, table):
    assert {step: schedule(step) for step in table} == pytest.approx(table)


@given(st.floats(0, 1), st.floats(0, 1), st.integers(1, 1000), st.integers(0, 2000))
def test_epsilon_stays_between_its_ends_and_reaches_them(start, end, duration, step):
    schedule = LinearSchedule(start, end, duration)
    assert min(start, end) - 1e-12 <= schedule(step) <= max(start, end) + 1e-12
    assert schedule(0) == start
    assert schedule(duration + step) == pytest.approx(end)


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
@settings(max_examples=40)
def test_no_drawn_action_is_ever_illegal(seed, epsilon):
    generator = seeded(seed)
    legal = torch.rand(200, 7, generator=generator) < torch.rand(200, 1, generator=generator)
    greedy = torch.randint(7, (200,), generator=generator)
    legal[torch.arange(200), greedy] = True
    action = explore(greedy, legal, epsilon, generator)
    assert action.shape == (200,)
    assert action.dtype == greedy.dtype
    assert legal[torch.arange(200), action].all()


def test_a_legal_action_is_chosen_even_where_the_number_drawn_for_it_is_zero(monkeypatch):
    monkeypatch.setattr(torch, "rand", lambda *size, generator, device: torch.zeros(*size))
    legal = torch.eye(4, dtype=torch.bool)
    assert explore(torch.zeros(4, dtype=int), legal, 1.0, seeded(0)).tolist() == [0, 1, 2, 3]


def test_every_legal_action_is_drawn_equally_often():
    legal = torch.zeros(40_000, 6, dtype=torch.bool)
    legal[:, [0, 2, 5]] = True
    action = explore(torch.full((40_000,), 2), legal, 1.0, seeded(0))
    counts = np.bincount(action, minlength=6)
    assert counts[[1, 3, 4]].sum() == 0
    np.testing.assert_allclose(counts[[0, 2, 5]] / 40_000, 1 / 3, atol=0.01)


@pytest.mark.parametrize("epsilon", [0.1, 0.5, 0.9])
def test_each_episode_draws_on_its_own(epsilon):
    generator = seeded(0)
    legal, greedy = torch.ones(500, 4, dtype=torch.bool), torch.zeros(500, dtype=int)
    taken = np.stack([explore(greedy, legal, epsilon, generator) for _ in range(200)])
    others = (taken != 0).mean()
    assert others == pytest.approx(0.75 * epsilon, abs=0.005)  # a draw falls on the greedy action one time in four
    each_call, each_episode = (taken != 0).mean(1), (taken != 0).mean(0)
    spread = np.sqrt(others * (1 - others))
    assert each_call.std() == pytest.approx(spread / np.sqrt(500), rel=0.25)
    assert each_episode.std() == pytest.approx(spread / np.sqrt(200), rel=0.25)


def test_without_exploration_the_greedy_actions_are_kept_and_with_all_none_is_preferred():
    generator = seeded(0)
    legal, greedy = torch.ones(4000, 4, dtype=torch.bool), torch.randint(4, (4000,), generator=generator)
    assert torch.equal(explore(greedy, legal, 0.0, generator), greedy)
    assert (explore(greedy, legal, 1.0, generator) == greedy).double().mean() == pytest.approx(0.25, abs=0.03)


def test_the_arguments_are_left_as_they_were():
    legal, greedy = torch.ones(50, 4, dtype=torch.bool), torch.zeros(50, dtype=int)
    explore(greedy, legal, 1.0, seeded(0))
    assert (greedy == 0).all()
    assert legal.all()


def test_equal_generators_draw_equal_actions():
    legal, greedy = torch.ones(50, 4, dtype=torch.bool), torch.zeros(50, dtype=int)
    draws = [explore(greedy, legal, 0.5, seeded(seed)) for seed in (1, 1, 2)]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])
