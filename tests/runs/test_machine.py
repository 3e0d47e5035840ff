"""The machine: freed memory is kept, and what is said of it needs no git."""

from __future__ import annotations

import platform
import sys
from pathlib import Path

import pytest
import torch

import layoutrl
from layoutrl.runs.machine import machine
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
