"""A browser that visits one server's page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.demo.conftest import served


@pytest.fixture(scope="module")
def address(answers) -> Iterator[str]:
    with served(answers) as where:
        yield where


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from tests.demo.page.browsing import CHROMIUM, playwright  # skips where there is no browser

    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser, address) -> Iterator[Any]:
    from tests.demo.page.browsing import visited

    yield from visited(browser, address)


@pytest.fixture
def still(browser, address) -> Iterator[Any]:
    """Of who wants no animation."""
    from tests.demo.page.browsing import visited

    yield from visited(browser, address, reduced_motion="reduce")
