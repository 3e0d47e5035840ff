"""Settings of all tests.

The usual run draws the same examples everywhere, so that red means the change. Others are drawn at random with
--hypothesis-profile=search, ten times as many with =fuzz; what fails is printed as @reproduce_failure(...).
"""

from __future__ import annotations

import gc
import json
import os
import tempfile
import time
from collections.abc import Iterator

import pytest
import torch
from hypothesis import is_hypothesis_test, settings

from tests.commands import PATCHED, PROJECT

settings.register_profile("usual", deadline=None, max_examples=12, derandomize=True)
settings.register_profile("search", deadline=None, max_examples=20, print_blob=True)
settings.register_profile("fuzz", deadline=None, max_examples=20, print_blob=True)
settings.load_profile("usual")
MANY = 10  # times as many examples, with fuzz
BEGAN = pytest.StashKey[float]()  # when this run did

torch.set_num_threads(1)  # networks this small only lose by a second thread


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--seconds", type=float, help="begin no test after so many seconds")


def pytest_configure(config: pytest.Config) -> None:
    """Give all workers one cache of designed rooms, which ends with them; and processes, what tests can import."""
    config.stash[BEGAN] = time.monotonic()
    if "PYTEST_XDIST_WORKER" not in os.environ:
        cache = tempfile.TemporaryDirectory(prefix="layoutrl-")
        os.environ["XDG_CACHE_HOME"] = cache.name
        config.add_cleanup(cache.cleanup)
        path = PROJECT, PROJECT / "experiments", os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = os.pathsep.join(str(folder) for folder in path if folder)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--hypothesis-profile") == "fuzz":
        tests = {item.obj for item in items if isinstance(item, pytest.Function) and is_hypothesis_test(item.obj)}
        for test in tests:  # also of those that have a number of their own
            few = test._hypothesis_internal_use_settings
            test._hypothesis_internal_use_settings = settings(few, max_examples=MANY * few.max_examples)


def pytest_collection_finish() -> None:
    """Let the garbage collector look no more through what was imported: it lives to the end."""
    gc.freeze()
    young, middle, old = gc.get_threshold()
    gc.set_threshold(young, middle, 10 * old)  # what has lived for long is looked through a tenth as often


def pytest_runtest_setup(item: pytest.Item) -> None:
    seconds = item.config.getoption("--seconds")
    if seconds is not None and time.monotonic() - item.config.stash[BEGAN] > seconds:
        pytest.skip(f"the {seconds:g} seconds are over")


@pytest.fixture
def small_networks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let PlanIT look less closely, where its networks have learned nothing anyway."""
    monkeypatch.setattr("layoutrl.rivals.planit.networks.WIDTHS", (4, 4, 8, 8))
    monkeypatch.setattr("layoutrl.rivals.planit.networks.UP_WIDTHS", (8, 8, 8, 8, 8, 8, 8))
    monkeypatch.setattr("layoutrl.rivals.planit.generator.STATE", 16)
    monkeypatch.setattr("layoutrl.rivals.planit.generator.HIDDEN", 16)


@pytest.fixture
def small_planit(small_networks: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let it give up early, too: untrained, it spends all its tries."""
    monkeypatch.setattr("layoutrl.rivals.planit.placement.BACKTRACKS", 1)
    monkeypatch.setattr("layoutrl.rivals.planit.scoring.TRIES", 1)


CONTENT = {
    "layoutrl.evaluation.furnishing.AFRESH": 1,
    "layoutrl.evaluation.furnishing.ALONG_WALLS": 0,
    "layoutrl.evaluation.furnishing.ELSEWHERE": 1,
    "layoutrl.evaluation.choosing.TRIED_UP_TO": (1, 4),
}


@pytest.fixture(scope="module")
def content_furnisher() -> Iterator[None]:
    """Let agents of whole rooms leave what is wrong: untrained, they look for better in vain, time after time.

    Commands that are forked here do so, too.
    """
    with pytest.MonkeyPatch.context() as patch:
        for name, value in CONTENT.items():
            patch.setattr(name, value)
        patch.setenv(PATCHED, json.dumps(CONTENT))
        yield
