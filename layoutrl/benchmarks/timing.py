"""How long a call takes."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch.utils.benchmark import Timer


def seconds_of(work: Callable[[], object], at_least: float) -> float:
    """Median time of a call, after a warm-up, repeated for `at_least` seconds; waits for the GPU."""
    timer = Timer("work()", globals={"work": work}, num_threads=torch.get_num_threads())
    return timer.blocked_autorange(min_run_time=at_least).median
