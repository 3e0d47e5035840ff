"""The machine that a command runs on: its device, its memory, and what is said of it beside every result."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import torch

import layoutrl
from layoutrl.env.device import usable_device

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)


def device_of(name: str) -> torch.device:
    """Return the device of a name; `auto` is the GPU if there is one. Raises InputError if there is no such device."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    return usable_device(name, "auto")


def require_determinism_on_cpu(device: torch.device) -> None:
    """Make torch raise for operations that are not deterministic, on the CPU alone: on a GPU that would cost speed."""
    torch.use_deterministic_algorithms(device.type == "cpu")
    # Filling memory finds errors, but takes time. (torch's types do not know the option.)
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]


def keep_freed_memory() -> None:
    """Let glibc keep freed memory for later allocations; does nothing with other C libraries.

    An update allocates tens of megabytes and frees them. Giving them back to the system each time, and getting them
    again page by page, costs the paper's network a fifth of its speed.
    """
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL(None)
        # Old versions refuse the first; without it, the second would make large tensors slower.
        if libc.mallopt(M_MMAP_THRESHOLD, 2**30):
            libc.mallopt(M_TRIM_THRESHOLD, 2**31 - 1)


def resident_bytes(process: int, *, peak: bool = False) -> int | None:
    """Return the resident memory of a process in bytes, now or at its peak; None without Linux's /proc.

    `ru_maxrss` is not used: it begins at that of the parent process.
    """
    try:
        status = Path(f"/proc/{process}/status").read_text(encoding="utf-8")
    except OSError:
        return None
    found = re.search(rf"{'VmHWM' if peak else 'VmRSS'}:\s+(\d+) kB", status)
    return 1024 * int(found[1]) if found else None


def machine(device: torch.device) -> dict[str, Any]:
    """Describe the machine and the versions of packages, for results measured on it."""
    cpuinfo = Path("/proc/cpuinfo")
    name = re.search(r"model name\s*: (.*)", cpuinfo.read_text(encoding="utf-8")) if cpuinfo.exists() else None
    package = Path(layoutrl.__file__).resolve().parent
    describe = ["git", "-C", str(package), "describe", "--always", "--dirty", "--exclude=*"]
    checkout = (package.parent / ".git").exists() and shutil.which("git")
    commit = subprocess.run(describe, capture_output=True, text=True, check=False).stdout.strip() if checkout else ""
    return {
        "cpu": name[1] if name else platform.processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "torch threads": torch.get_num_threads(),
        # Processes that wanted a core in the last minute.
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "gpu": torch.cuda.get_device_name(device) if device.type == "cuda" else None,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "shapely": shapely.__version__,
        "layoutrl": f"{layoutrl.__version__} {commit}".strip(),
    }
