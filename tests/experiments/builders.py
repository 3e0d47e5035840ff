"""Cells on little, and scripts as a user runs them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from cell_config import CellConfig, folder_of, name_of

from layoutrl.runs.config import composed
from tests import commands
from tests.commands import PROJECT

REAL = PROJECT.parent / "shared" / "data"
LITTLE = (
    "budget=smoke", "data.train_rooms=12", "data.test_rooms=6", "budget.evaluations=1", "budget.evaluation_rooms=1",
    "method.updates={smoke: 8}", "method.batch=64", "method.warmup_moves=128", "method.evaluation_moves=6",
)  # fmt: skip


def configured(folder: Path, *overrides: str) -> CellConfig:
    return composed(
        "cell", "table=table1", *LITTLE, f"results={folder / 'results'}", f"runs={folder / 'runs'}", *overrides
    )


def cell(config: CellConfig) -> dict[str, Any]:
    return json.loads((folder_of(config) / f"{name_of(config)}.json").read_text())


def script(name: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """One of experiments/, on little; its cells one after the other."""
    return commands.script(name, *LITTLE, f"results={cwd / 'results'}", "hydra.launcher.n_jobs=1", *arguments, cwd=cwd)
