"""The folder of a run: config.yaml, checkpoint.pt, metrics.csv, evaluation.json, TensorBoard events; the machine."""

from __future__ import annotations

import json
import os
import pickle
import platform
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import torch
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

import layoutrl
from layoutrl.agents.dqn import DQN
from layoutrl.config import TrainConfig
from layoutrl.errors import InputError


def new_folder(config: TrainConfig) -> Path:
    """runs/<room>/<name>, with a number behind it where that is taken: no run overwrites another. Holds config.yaml."""
    labels = f"-{config.data.labels}" if config.data.source == "floorplans" else ""
    name = config.name or (
        f"{config.data.source}{labels}-{config.room.item}-{config.method.name}-{config.budget.name}-seed{config.seed}"
    )
    folder = make_folder(Path(config.runs) / config.room.type / name)
    OmegaConf.save(OmegaConf.structured(config), folder / "config.yaml")
    return folder


def make_folder(wanted: Path) -> Path:
    """A new folder: the one that is wanted, with a number behind its name where that is taken."""
    attempt = 1
    while True:
        folder = wanted if attempt == 1 else wanted.with_name(f"{wanted.name}-{attempt}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            attempt += 1
        except OSError as error:
            raise InputError(
                f"runs: cannot create {folder} ({error.strerror}); expected a folder to write to"
            ) from None
        else:
            return folder


def save_checkpoint(folder: Path, agent: DQN, categories: list[str]) -> None:
    """Write checkpoint.pt whole or not at all: weights, known furniture categories, updates made."""
    partial = folder / "checkpoint.partial"
    torch.save({"network": agent.network.state_dict(), "categories": categories, "updates": agent.updates}, partial)
    partial.replace(folder / "checkpoint.pt")


def load_config(folder: Path) -> TrainConfig:
    """The resolved configuration of a run. Raises InputError where there is none."""
    path = folder / "config.yaml"
    try:
        return OmegaConf.to_object(OmegaConf.merge(TrainConfig, OmegaConf.load(path)))  # type: ignore[return-value]
    except (OSError, OmegaConfBaseException, ValueError) as error:
        raise InputError(f"run: {path} cannot be read ({error}); expected the folder of a training run") from None


def load_checkpoint(folder: Path, device: torch.device) -> dict[str, Any]:
    """What `save_checkpoint` wrote. Raises InputError where it is missing or damaged."""
    path = folder / "checkpoint.pt"
    try:
        return torch.load(path, map_location=device, weights_only=True)
    except (OSError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"run: {path} cannot be read ({reason}); expected the checkpoint of a training run") from None


def write_json(path: Path, content: Any) -> None:
    """Write a file whole or not at all."""
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    partial.replace(path)


def machine(device: torch.device) -> dict[str, Any]:
    """What it was measured on, and with which versions."""
    cpuinfo = Path("/proc/cpuinfo")
    name = re.search(r"model name\s*: (.*)", cpuinfo.read_text()) if cpuinfo.exists() else None
    package = Path(layoutrl.__file__).resolve().parent
    describe = ["git", "-C", str(package), "describe", "--always", "--dirty", "--exclude=*"]
    checkout = (package.parent / ".git").exists()
    commit = subprocess.run(describe, capture_output=True, text=True, check=False).stdout.strip() if checkout else ""
    return {
        "cpu": name[1] if name else platform.processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "torch threads": torch.get_num_threads(),
        "load before": round(os.getloadavg()[0], 1),  # processes that want a core, this one not yet
        "gpu": torch.cuda.get_device_name(device) if device.type == "cuda" else None,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "shapely": shapely.__version__,
        "layoutrl": f"{layoutrl.__version__} {commit}".strip(),
    }
