"""How sure a mean is, and whether two methods differ: resampling over groups of rooms, which are independent."""

from __future__ import annotations

import numpy as np

RESAMPLES = 10_000
BLOCK = 500  # resamples at once, so that memory stays small


def group_sums(value: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the values (B,) of each group (B,), and how many there are: (groups,) each."""
    _, index = np.unique(group, return_inverse=True)
    return np.bincount(index, value), np.bincount(index)


def standard_error(value: np.ndarray, group: np.ndarray) -> float | None:
    """Of the mean of values (B,) that are independent between groups (B,), not within them; None of one group."""
    total, count = group_sums(value, group)
    if len(total) < 2:
        return None
    beyond = total - count * value.mean()
    return float(np.sqrt((beyond**2).sum() * len(total) / (len(total) - 1)) / len(value))


def bootstrap_interval(value: np.ndarray, group: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """The 95% interval of the mean of values (B,): percentiles over resamples of whole groups (B,), replaced."""
    total, count = group_sums(value, group)
    means = []
    for _ in range(0, RESAMPLES, BLOCK):
        drawn = rng.integers(len(total), size=(BLOCK, len(total)))
        means.append(total[drawn].sum(1) / count[drawn].sum(1))
    low, high = np.percentile(np.concatenate(means), [2.5, 97.5])
    return float(low), float(high)


def paired_p_value(first: np.ndarray, second: np.ndarray, group: np.ndarray, rng: np.random.Generator) -> float:
    """Two-sided p-value that two methods' values (B,), at the same rooms and starts, differ by chance.

    A permutation test: the methods are swapped in whole groups (B,) at random, and the share of swaps whose mean
    difference is as large as the one that was seen is counted, that one included.
    """
    difference, _ = group_sums(first - second, group)
    seen = abs(difference.sum())
    as_large = 0
    for _ in range(0, RESAMPLES, BLOCK):
        signs = rng.choice((-1.0, 1.0), size=(BLOCK, len(difference)))
        as_large += int((np.abs(signs @ difference) >= seen * (1 - 1e-12)).sum())
    return (1 + as_large) / (1 + RESAMPLES)
