"""Uncertainty of means, and tests of whether two methods differ, by resampling independent groups of rooms."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

RESAMPLES = 10_000
BLOCK = 500  # resamples at once, so that memory stays small


def group_sums(value: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the values (B,) of each group (B,), and how many there are: (groups,) each."""
    _, index = np.unique(group, return_inverse=True)
    return np.bincount(index, value), np.bincount(index)


def standard_error(value: np.ndarray, group: np.ndarray) -> float | None:
    """Return the standard error of the mean of values (B,), independent between groups (B,) but not within them.

    None if there is only one group.
    """
    total, count = group_sums(value, group)
    if len(total) < 2:
        return None
    beyond = total - count * value.mean()
    return float(np.sqrt((beyond**2).sum() * len(total) / (len(total) - 1)) / len(value))


def bootstrap_interval(value: np.ndarray, group: np.ndarray, seed: int) -> tuple[float, float]:
    """Return the 95% percentile bootstrap interval of the mean of values (B,), from resamples of whole groups (B,)."""
    total, count = group_sums(value, group)
    alike = (count == 1).all()  # then every resample has as many values
    means = []
    for drawn in np.split(_drawn(len(total), seed), RESAMPLES // BLOCK):
        means.append(total[drawn].sum(1) / (len(total) if alike else count[drawn].sum(1)))
    low, high = np.percentile(np.concatenate(means), [2.5, 97.5])
    return float(low), float(high)


def paired_p_value(first: np.ndarray, second: np.ndarray, group: np.ndarray, seed: int) -> float:
    """Return the two-sided p-value that two methods' values (B,), at the same rooms and starts, differ by chance.

    A permutation test: the methods are swapped at random in whole groups (B,). The p-value is the share of swaps whose
    mean difference is at least as large as the observed one, which counts as one of them.
    """
    difference, _ = group_sums(first - second, group)
    seen = abs(difference.sum())
    as_large = 0
    for signs in np.split(_signs(len(difference), seed), RESAMPLES // BLOCK):
        as_large += int((np.abs(signs.astype(float) @ difference) >= seen * (1 - 1e-12)).sum())
    return (1 + as_large) / (1 + RESAMPLES)


@lru_cache(maxsize=2)  # a table asks for the same ones again and again
def _drawn(groups: int, seed: int) -> np.ndarray:
    """Which groups each resample has: (RESAMPLES, groups), in as few bytes as hold them."""
    rng, small = np.random.default_rng(seed), np.min_scalar_type(groups)
    return np.concatenate([
        rng.integers(groups, size=(BLOCK, groups)).astype(small) for _ in range(0, RESAMPLES, BLOCK)
    ])  # fmt: skip


@lru_cache(maxsize=2)
def _signs(groups: int, seed: int) -> np.ndarray:
    """1, or -1 where the methods are swapped: (RESAMPLES, groups)."""
    rng = np.random.default_rng(seed)
    return np.concatenate([
        rng.choice((-1.0, 1.0), size=(BLOCK, groups)).astype(np.int8) for _ in range(0, RESAMPLES, BLOCK)
    ])  # fmt: skip
