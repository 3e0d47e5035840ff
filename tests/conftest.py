"""Settings of all tests: hypothesis draws the same examples every time under CI, new ones elsewhere."""

from __future__ import annotations

import os

import pytest
import torch
from hypothesis import settings

settings.register_profile("local", deadline=None, max_examples=30)
settings.register_profile("ci", deadline=None, max_examples=30, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

torch.set_num_threads(1)  # networks this small only lose by a second thread


@pytest.fixture
def few_tries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let PlanIT give up early in whole rooms: networks that have learned nothing spend all their tries."""
    monkeypatch.setattr("layoutrl.rivals.planit.placement.BACKTRACKS", 2)
