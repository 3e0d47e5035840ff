"""What entry points build; most of it is tested where it is used."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

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

    assert page_faults("build.keep_freed_memory()") < 1000 < page_faults("")
