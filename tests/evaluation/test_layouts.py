"""What is said of a set of layouts."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.env.measures import Measures, matched
from layoutrl.evaluation.layouts import by_category, summary
from layoutrl.evaluation.statistics import standard_error
from layoutrl.rooms.faults import FAULTS, FRONT_NOT_FREE, MISSING, OUT_OF_REACH, faults
from tests.builders import random_room, shaken

NAMES = [name for name in Measures.__dataclass_fields__ if name != "group"]


def measures(**values: np.ndarray) -> Measures:
    rooms = len(next(iter(values.values())))
    group = np.array([str(k // 2) for k in range(rooms)])
    return Measures(**(dict.fromkeys(NAMES, np.ones(rooms)) | {"group": group} | values))


def test_a_summary_is_over_the_rooms_that_have_something_to_count() -> None:
    fronts = np.array([np.nan, 1.0, 0.5, 0.0])
    told = json.loads(json.dumps(summary(measures(fronts=fronts))))
    assert list(told) == NAMES
    assert told["fronts"]["mean"] == pytest.approx(0.5)
    assert told["fronts"]["standard_error"] == pytest.approx(standard_error(fronts[1:], np.array(["0", "1", "1"])))
    assert told["iou"] == {"mean": 1, "standard_error": 0}


def test_where_there_is_nothing_to_count_it_says_none() -> None:
    told = summary(measures(fronts=np.array([np.nan])))
    assert told["fronts"] == {"mean": None, "standard_error": None}
    assert told["iou"] == {"mean": 1, "standard_error": None}


@given(st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=4), st.sampled_from([0.0, 0.3]))
def test_a_category_has_the_shares_that_are_counted_item_by_item(seeds: list[int], lost: float) -> None:
    designed = [random_room(np.random.default_rng(seed), group=str(seed)) for seed in seeds]
    layouts = [shaken(room, seed, lost) for room, seed in zip(designed, seeds, strict=True)]
    told = by_category(layouts, designed)
    items = [item for room in designed for item in room.furniture]
    assert told.keys() == {item.category for item in items}
    assert [entry["iou"] for entry in told.values()] == sorted(entry["iou"] for entry in told.values())
    found = [(layout.furniture[k].category, fault) for layout in layouts for k, fault in faults(layout)]
    for category, entry in told.items():
        count = [item.category for item in items].count(category)
        assert entry["count"] == count
        assert entry.keys() == {"count", "iou", *FAULTS}
        for fault in FAULTS:  # of what is not placed it is said, too, that it is out of reach
            missing = (category, MISSING) in found and fault in (OUT_OF_REACH, FRONT_NOT_FREE)
            assert missing or entry[fault] == pytest.approx(found.count((category, fault)) / count)
        layouts_of, designed_of = (
            [replace(room, furniture=tuple(i for i in room.furniture if i.category == category)) for room in some]
            for some in (layouts, designed)
        )
        assert entry["iou"] == pytest.approx(matched(layouts_of, designed_of).iou.mean())
