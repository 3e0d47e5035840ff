"""Commands as a user runs them, each in a process of its own, forked from one that has imported what they import.

A new interpreter would import for seconds: only a few tests start one.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import os
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import torch

PROJECT = Path(__file__).resolve().parents[1]
COMMANDS = ("train", "planit.train", "evaluate", "place", "watch", "gallery", "bench", "demo")
IMPORTED = (
    *(f"layoutrl.{command}" for command in COMMANDS),
    "layoutrl.benchmarks.parts",
    *(f"layoutrl.runs.{run}" for run in ("training", "planit_training", "rooms_report")),
    *("cells", "real_rooms", "table1", "table2"),
    *("tests.commands", "tests.runs.test_resume"),
    *("torch._inductor", "tensorboard.compat.tensorflow_stub.io"),  # which a training imports as it begins
    "scipy.optimize",  # and an evaluation of whole rooms
    "tests.preloaded",
)
SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload([*IMPORTED])
PATCHED = "PATCHED_IN_TESTS"  # the environment variable that says which constants are others: values by name, in JSON
FRESH = subprocess.run  # begins a new interpreter
forked: Any = SERVER.Process  # within a forked process: another fork of it, as a server of its own would import again


def layoutrl(command: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """python -m layoutrl.<command> <arguments>, in a folder."""
    return run([sys.executable, "-m", f"layoutrl.{command}", *arguments], cwd=cwd)


def script(name: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """python experiments/<name> <arguments>, in a folder. Processes that it starts are forked, too."""
    return run([sys.executable, str(PROJECT / "experiments" / name), *arguments], cwd=cwd)


def fresh(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """python <arguments>, in a folder: a new interpreter, as users begin it."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(PROJECT)}
    command = [sys.executable, *arguments]
    return FRESH(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300, check=False)


def run(command: list[str], *, cwd: Path | None = None, stdout: Any = None, **options: Any) -> Any:
    """What subprocess.run does with python ..., but for what it costs; both outputs go to `stdout`, or are captured."""
    if command[0] != sys.executable:
        return FRESH(command, cwd=cwd, stdout=stdout, **options)
    with tempfile.TemporaryDirectory() as folder:
        files = [stdout.name] * 2 if stdout else [f"{folder}/out", f"{folder}/err"]
        process = forked(target=main, args=(command[1:], cwd or Path.cwd(), files, {**os.environ}))
        process.start()
        process.join(300)
        if process.exitcode is None:
            process.kill()
            raise subprocess.TimeoutExpired(command, 300)
        return subprocess.CompletedProcess(command, process.exitcode, *(Path(file).read_text() for file in files))


def main(argv: list[str], cwd: Path, files: list[str], environment: dict[str, str]) -> None:
    """A Python program, in this process."""
    global forked
    forked = multiprocessing.get_context("fork").Process
    for file, descriptor in zip(files, (1, 2), strict=True):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND), descriptor)
    os.chdir(cwd)
    os.environ.clear()
    os.environ |= environment | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(PROJECT)}
    torch.set_num_threads(1)
    for name, value in json.loads(os.environ.get(PATCHED, "{}")).items():
        module, _, constant = name.rpartition(".")
        setattr(importlib.import_module(module), constant, value)
    if argv[0] == "-m":
        sys.argv = argv[1:]
        sys.modules.pop(argv[1], None)  # else runpy warns that it has been imported
        runpy.run_module(argv[1], run_name="__main__", alter_sys=True)
    else:
        sys.argv = argv
        subprocess.run = run
        runpy.run_path(argv[0], run_name="__main__")
