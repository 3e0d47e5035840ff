"""The configuration is composed wherever somebody asks for it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from hydra import compose, initialize
from hydra.core.global_hydra import GlobalHydra

from layoutrl.runs.config import composed


def test_several_threads_compose_at_once() -> None:
    types = ("bedroom", "kitchen", "study", "balcony") * 3
    with ThreadPoolExecutor(4) as threads:
        assert [config.room.type for config in threads.map(lambda t: composed("train", f"room={t}"), types)] == [*types]


def test_a_program_that_uses_hydra_itself_composes_and_goes_on() -> None:
    with initialize(version_base="1.3", config_path=None):
        theirs = GlobalHydra.instance().hydra
        assert composed("place", "rooms=-").seed == 0
        assert GlobalHydra.instance().hydra is theirs
        assert compose(overrides=["+own=1"]).own == 1
    assert not GlobalHydra.instance().is_initialized()
    composed("place", "rooms=-")
    assert not GlobalHydra.instance().is_initialized()
