"""Of all tests of experiments."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module")
def designed(tmp_path_factory: pytest.TempPathFactory) -> str:
    return f"data.root={tmp_path_factory.mktemp('designed')}"
