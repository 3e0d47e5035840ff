"""What a set of layouts is worth: its measures, over rooms."""

from __future__ import annotations

import numpy as np

from layoutrl.env.measures import Measures
from layoutrl.evaluation.statistics import standard_error


def summary(measures: Measures) -> dict[str, dict[str, float | None]]:
    """Mean and standard error of each measure, over the rooms that have something to count; None without any."""
    values = dict(vars(measures))
    group = values.pop("group")
    result: dict[str, dict[str, float | None]] = {}
    for name, value in values.items():
        known = ~np.isnan(value)
        mean = float(value[known].mean()) if known.any() else None
        error = standard_error(value[known], group[known]) if known.any() else None
        result[name] = {"mean": mean, "standard_error": error}
    return result
