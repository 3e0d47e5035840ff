"""What rooms and the reference simulator do without."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).parents[2]


def test_rooms_and_the_reference_simulator_load_no_torch() -> None:
    code = (
        "import sys, layoutrl.rooms.sources.designer_cache, layoutrl.env.simulator\n"
        "print(*{'torch', 'scipy', 'matplotlib', 'PIL', 'hydra'} & sys.modules.keys())"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=PROJECT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
