"""The machine: freed memory is kept, and what is said of it needs no git."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest
import torch

import layoutrl
from layoutrl.runs.machine import machine

FAULTS = """
import resource, torch
from layoutrl.runs.machine import keep_freed_memory
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

    assert 10 * page_faults("keep_freed_memory()") < page_faults("")


def test_a_run_ends_where_there_is_no_git(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert machine(torch.device("cpu"))["layoutrl"] == layoutrl.__version__
