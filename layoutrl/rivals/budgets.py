"""How long a rival is trained: so many updates, or as long as the agent."""

from __future__ import annotations

from collections.abc import Callable

Spent = Callable[[int], float]  # the share of a budget that is spent after so many updates; training ends at 1


def updates_budget(updates: int) -> Spent:
    """So many updates."""
    return lambda made: made / updates


def seconds_budget(seconds: float, clock: Callable[[], float]) -> Spent:
    """So many seconds of a clock since it is first asked. By `time.process_time` no other work counts."""
    began: list[float] = []

    def spent(_: int) -> float:
        began[:] = began or [clock()]
        return (clock() - began[0]) / seconds

    return spent
