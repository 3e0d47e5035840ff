"""The grid of positions, in metres; tables."""

from __future__ import annotations

import numpy as np

from layoutrl.env.reward import Array

GRID = 1e-6  # metres: positions are kept on this grid, so that a move and its opposite cancel exactly
CONTACT = 2e-6  # metres: a place that touches a border, rounded to the grid, still fits


def snap(position: Array) -> Array:
    """Positions on the grid of one micrometre."""
    return (position / GRID).round() * GRID


def padded(entries: np.ndarray, row: np.ndarray, rows: int) -> np.ndarray:
    """Entries (n, ...), each of a `row` (n,), ascending, as a table filled up with NaN: (rows, longest, ...)."""
    count = np.bincount(row, minlength=rows)
    column = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    table = np.full((rows, count.max(initial=0), *entries.shape[1:]), np.nan)
    table[row, column] = entries
    return table
