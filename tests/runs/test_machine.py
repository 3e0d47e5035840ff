"""The machine: freed memory is kept, and what is said of it needs no git."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

import pytest
import torch

import layoutrl
from layoutrl.runs.machine import machine, resident_bytes
from tests import commands

FAULTS = """
import resource, torch
from layoutrl.runs.machine import keep_freed_memory
{keep}
for _ in range(5):
    parts = [torch.ones(10_000_000) for _ in range(3)]
    del parts
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    parts = [torch.ones(10_000_000) for _ in range(3)]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - faults)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")
def test_memory_that_was_freed_is_there_when_it_is_asked_for_again(tmp_path: Path) -> None:
    program = tmp_path / "faults.py"

    def page_faults(keep: str) -> int:
        program.write_text(FAULTS.format(keep=keep))
        return int(commands.run([sys.executable, str(program)]).stdout)

    assert 10 * page_faults("keep_freed_memory()") < page_faults("")


def test_a_run_ends_where_there_is_no_git(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert machine(torch.device("cpu"))["layoutrl"] == layoutrl.__version__


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux says how much memory a process has")
def test_the_memory_of_a_process_is_what_the_system_says() -> None:
    resource = pytest.importorskip("resource")
    held = bytearray(300_000_000)  # so that it is at its peak
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 + 1_000_000
    now, peak = resident_bytes(os.getpid()), resident_bytes(os.getpid(), peak=True)
    assert now is not None
    assert peak is not None
    assert 300_000_000 < now <= most
    assert now <= peak + 1_000_000
    assert len(held) > 0
    assert resident_bytes(2**30) is None  # there is no such process
