from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.env.geometry import GRID, padded, snap


def test_a_padded_table_has_a_row_for_each_even_for_one_without_entries() -> None:
    table = padded(np.arange(6.0).reshape(3, 2), np.array([0, 2, 2]), 4)
    missing = [np.nan, np.nan]
    np.testing.assert_array_equal(table, [[[0, 1], missing], [missing] * 2, [[2, 3], [4, 5]], [missing] * 2])
    assert padded(np.empty((0, 2)), np.array([], dtype=int), 2).shape == (2, 0, 2)


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=5))
def test_snapping_moves_by_half_a_micrometre_at_most_and_snaps_once(values: list[float]) -> None:
    snapped = snap(np.array(values))
    assert np.abs(snapped - values).max() <= GRID * 0.5001
    assert np.array_equal(snap(snapped), snapped)
