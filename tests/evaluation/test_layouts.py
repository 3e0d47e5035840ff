"""What is said of a set of layouts."""

from __future__ import annotations

import json

import numpy as np
import pytest

from layoutrl.env.measures import Measures
from layoutrl.evaluation.layouts import summary
from layoutrl.evaluation.statistics import standard_error

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
