"""How long a rival is trained: so many updates, or as long as the agent."""

from __future__ import annotations

import time
from collections.abc import Callable

Spent = Callable[[int], float]  # the share of a budget that is spent after so many updates; training ends at 1


def updates_budget(updates: int) -> Spent:
    """So many updates."""
    return lambda made: made / updates


def seconds_budget(seconds: float, clock: Callable[[], float] = time.perf_counter) -> Spent:
    """So many seconds from when it is first asked. By `time.process_time` no other work on the machine counts."""
    began: list[float] = []

    def spent(_: int) -> float:
        began[:] = began or [clock()]
        return (clock() - began[0]) / seconds

    return spent
