"""Budgets of rivals: a number of updates (or restarts, or moves), or seconds of a clock."""

from __future__ import annotations

from collections.abc import Callable

Spent = Callable[[int], float]  # the share of a budget that is spent after so many updates; at 1 it ends


def updates_budget(updates: int) -> Spent:
    """Return a budget of so many updates."""
    return lambda made: made / updates


def seconds_budget(seconds: float, clock: Callable[[], float]) -> Spent:
    """Return a budget of seconds of `clock` since it is first asked; by `time.process_time` no other process counts."""
    began: float | None = None

    def spent(_: int) -> float:
        nonlocal began
        began = clock() if began is None else began
        return (clock() - began) / seconds

    return spent
