"""The grid on which positions are kept, in metres, and padded tables."""

from __future__ import annotations

import numpy as np

from layoutrl.env.reward import Array

GRID = 1e-6  # metres: positions are kept on this grid, so that a move of whole micrometres and its opposite cancel
CONTACT = 2e-6  # metres of slack: a place that touches a border still fits once it is rounded to the grid


def snap(position: Array) -> Array:
    """Positions on the grid of one micrometre."""
    return (position / GRID).round() * GRID


def padded(entries: np.ndarray, row: np.ndarray, rows: int) -> np.ndarray:
    """Return entries (n, ...), ascending by their `row` (n,), as a table padded with NaN: (rows, longest, ...)."""
    count = np.bincount(row, minlength=rows)
    column = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    table = np.full((rows, count.max(initial=0), *entries.shape[1:]), np.nan)
    table[row, column] = entries
    return table
