"""Intervals and tests hold what they promise, on values whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from layoutrl.evaluation.statistics import bootstrap_interval, paired_p_value, standard_error


def alone(values: np.ndarray) -> np.ndarray:
    return np.arange(len(values))


def test_the_interval_of_a_normal_mean_is_the_one_in_books():
    rng = np.random.default_rng(0)
    values = rng.normal(0.8, 0.1, 400)
    low, high = bootstrap_interval(values, alone(values), 0)
    error = values.std(ddof=1) / np.sqrt(400)
    assert low == pytest.approx(values.mean() - 1.96 * error, abs=0.1 * error)
    assert high == pytest.approx(values.mean() + 1.96 * error, abs=0.1 * error)


def test_copies_of_a_room_make_nobody_surer():
    rng = np.random.default_rng(1)
    values = rng.random(50)
    low, high = bootstrap_interval(values, alone(values), 2)
    copied = bootstrap_interval(np.repeat(values, 20), np.repeat(alone(values), 20), 2)
    assert copied == pytest.approx((low, high))
    p = paired_p_value(values, values[::-1] + 0.1, alone(values), 3)
    again = paired_p_value(np.repeat(values, 20), np.repeat(values[::-1] + 0.1, 20), np.repeat(alone(values), 20), 3)
    assert again == p


def test_the_standard_error_is_that_of_the_mean_where_groups_are_of_different_sizes():
    rng = np.random.default_rng(5)
    group = np.repeat(np.arange(30), [1] * 25 + [10] * 5)
    means, errors = [], []
    for _ in range(2000):
        values = rng.normal(size=30)[group] + rng.normal(size=len(group))
        means.append(values.mean())
        errors.append(standard_error(values, group))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(means), rel=0.15)
    assert standard_error(values, np.zeros(len(values))) is None


def test_the_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(4)
    covered = 0
    for seed in range(60):
        values = rng.beta(9, 1, 80)
        low, high = bootstrap_interval(values, alone(values), seed)
        covered += low <= 0.9 <= high
    assert covered >= 50


def test_p_values_are_small_where_methods_differ_and_any_where_not():
    rng = np.random.default_rng(5)
    rooms = rng.random(200)
    better = rooms + rng.normal(0.02, 0.05, 200)
    assert paired_p_value(better, rooms, alone(rooms), 0) < 0.001
    assert paired_p_value(rooms, better, alone(rooms), 0) < 0.001
    null = [paired_p_value(rooms + rng.normal(0, 0.05, 200), rooms, alone(rooms), seed) for seed in range(40)]
    assert 0.3 < np.mean(null) < 0.7
    assert paired_p_value(rooms, rooms, alone(rooms), 0) == 1


def test_what_is_drawn_once_for_many_methods_is_what_each_would_draw():
    rng = np.random.default_rng(6)
    for group in (np.arange(9), np.arange(9) // 2):
        first, second, n = rng.random(9), rng.random(9), group.max() + 1
        total, count = np.bincount(group, first), np.bincount(group)
        drawn = np.random.default_rng(3).integers(n, size=(10_000, n))
        interval = tuple(np.percentile(total[drawn].sum(1) / count[drawn].sum(1), [2.5, 97.5]))
        difference = total - np.bincount(group, second)
        swapped = np.random.default_rng(3).choice((-1.0, 1.0), size=(10_000, n)) @ difference
        p = (1 + (np.abs(swapped) >= abs(difference.sum()) * (1 - 1e-12)).sum()) / 10_001
        for _ in range(2):
            assert bootstrap_interval(first, group, 3) == interval
            assert paired_p_value(first, second, group, 3) == pytest.approx(p, abs=1e-12)
