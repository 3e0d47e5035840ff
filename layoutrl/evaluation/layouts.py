"""Summaries of the measures of layouts, over rooms and by category."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from layoutrl.env.measures import Measures, matched
from layoutrl.evaluation.statistics import standard_error
from layoutrl.rooms.faults import Items, item_faults
from layoutrl.rooms.room import Room


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


def by_category(layouts: Sequence[Room], designed: Sequence[Room]) -> dict[str, dict[str, float]]:
    """Return for each category the `count` of the designer's items, their mean `iou` with their matches and, by the
    name of each fault, the share of the layouts' items that have it. The worst IoU comes first."""
    matches, items = matched(layouts, designed), Items.of(layouts)
    found = item_faults(layouts, items)
    result: dict[str, dict[str, float]] = {}
    for category in np.unique(matches.category):
        designer, ours = matches.category == category, items.category == category
        shares = {name: float(faulty[ours].mean()) for name, faulty in found.items()}
        result[str(category)] = {"count": int(designer.sum()), "iou": float(matches.iou[designer].mean())} | shares
    return dict(sorted(result.items(), key=lambda entry: entry[1]["iou"]))
