from __future__ import annotations

from layoutrl.rivals.budgets import seconds_budget, updates_budget


def test_budgets_say_what_share_is_spent() -> None:
    assert [updates_budget(4)(made) for made in (0, 1, 4)] == [0, 0.25, 1]
    clock = iter((50.0, 50.0, 55.0, 71.0))
    spent = seconds_budget(20, lambda: next(clock))
    assert [spent(made) for made in (0, 1, 2)] == [0, 0.25, 1.05]
