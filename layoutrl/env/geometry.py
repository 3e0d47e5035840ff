"""The grid on which positions are kept, in metres, and padded tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
import shapely

if TYPE_CHECKING:  # the reference simulator does without torch, which takes seconds to load
    from torch import Tensor

Array = TypeVar("Array", np.ndarray, "Tensor")
GRID = 1e-6  # metres: positions are kept on this grid, so that a move of whole micrometres and its opposite cancel
CONTACT = 2e-6  # metres of slack: a place that touches a border still fits once it is rounded to the grid


def snap(position: Array) -> Array:
    """Positions on the grid of one micrometre."""
    return (position / GRID).round() * GRID


def shrunk(regions: np.ndarray) -> np.ndarray:
    """Return regions (n,) a grid's step smaller, so that places drawn in them are inside when rounded to the grid.

    One that is too narrow for that stays as it is.
    """
    smaller = shapely.buffer(regions, -GRID, join_style="mitre")
    return np.where(shapely.is_empty(smaller), regions, smaller)


def padded(entries: np.ndarray, row: np.ndarray, rows: int) -> np.ndarray:
    """Return entries (n, ...), ascending by their `row` (n,), as a table padded with NaN: (rows, longest, ...)."""
    count = np.bincount(row, minlength=rows)
    column = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    table = np.full((rows, count.max(initial=0), *entries.shape[1:]), np.nan)
    table[row, column] = entries
    return table
