"""What entry points build; most of it is tested where it is used."""

from __future__ import annotations

import platform
import subprocess
import sys

import numpy as np
import pytest
import torch

from layoutrl import build
from layoutrl.config import MethodConfig, RewardConfig
from layoutrl.errors import InputError
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room

FAULTS = """
import resource, torch
from layoutrl import build
{keep}
for _ in range(20):
    parts = [torch.ones(10_000_000) for _ in range(3)]
    del parts
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    parts = [torch.ones(10_000_000) for _ in range(3)]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - faults)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")
def test_memory_that_was_freed_is_there_when_it_is_asked_for_again() -> None:
    def page_faults(keep: str) -> int:
        command = [sys.executable, "-c", FAULTS.format(keep=keep)]
        return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    assert 10 * page_faults("build.keep_freed_memory()") < page_faults("")


def test_rooms_in_which_nothing_can_move_are_refused_before_any_training() -> None:
    room = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)))
    method = MethodConfig(steps=[0.4], unit="metre", slide=False, observation="geometry", dueling=False, double=False)
    method.learning_rate, method.target_period, method.replay_capacity = 1e-3, 10, 10
    seed = np.random.SeedSequence(0)
    with pytest.raises(InputError, match="steps"):
        build.Learner([room], method, RewardConfig(), 1, seed, seed, torch.device("cpu"))
