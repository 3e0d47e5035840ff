"""Cells on little, and scripts as a user runs them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from columns import CellConfig, folder_of, name_of

from layoutrl.runs.config import composed

PROJECT = Path(__file__).resolve().parents[2]
REAL = PROJECT.parent / "shared" / "data"
LITTLE = ("budget=smoke", "data.train_rooms=12", "data.test_rooms=6")


def configured(folder: Path, *overrides: str) -> CellConfig:
    return composed(
        "cell", "table=table1", *LITTLE, f"results={folder / 'results'}", f"runs={folder / 'runs'}", *overrides
    )


def cell(config: CellConfig) -> dict[str, Any]:
    return json.loads((folder_of(config) / f"{name_of(config)}.json").read_text())


def script(name: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(PROJECT), "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, str(PROJECT / "experiments" / name), *LITTLE, f"results={cwd / 'results'}", *arguments],
        cwd=cwd, env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
