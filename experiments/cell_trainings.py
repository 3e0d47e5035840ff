"""Trainings of cells: each is done once and shared, and resumed if it was killed; and how long rivals are trained."""

from __future__ import annotations

import json
import shutil
import time
import zlib
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cell_config import CellConfig, designer, folder_of, name_of, refuse_other_rooms

from layoutrl import InputError
from layoutrl.agents.learner import Agent
from layoutrl.rivals.budgets import seconds_budget, updates_budget
from layoutrl.rivals.planit.placement import Placer
from layoutrl.rooms.collection import digest
from layoutrl.rooms.room import Room
from layoutrl.runs import planit_training, resume
from layoutrl.runs import training as agent_training
from layoutrl.runs.config import Config, PlanitConfig, TrainConfig, narrowed
from layoutrl.runs.files import locked, write_json
from layoutrl.runs.folder import folders_of, load_config, stated, wanted_folder
from layoutrl.runs.machine import device_of, machine
from layoutrl.runs.trained import kept_agent


def trained_agent(
    config: CellConfig, rooms: list[Room], held_out: list[Room], device: torch.device
) -> tuple[Agent, dict[str, Any]]:
    """Return the agent that a cell trains on `rooms`, and facts about its training.

    Raises KeyboardInterrupt if the user stops the training.
    """
    training = narrowed(config, TrainConfig)
    if config.trained_on == "designer":  # one agent, whichever source it is tested on
        training.data = designer(config)
    what = [digest(rooms), config.budget.name, config.seed]
    said = stated(training)
    said["room"] |= {"updates": None, "whole_updates": None}  # method.updates says how long
    how = [said[part] for part in ("room", "method", "reward")]

    def train(training: TrainConfig, begun: Path | None) -> tuple[Path, dict[str, Any]]:
        trained = agent_training.train(training, rooms, held_out, device, begun)
        if trained.stopped:
            raise KeyboardInterrupt
        return trained.folder, {"training_seconds": trained.seconds, "updates": trained.learner.dqn.updates}

    folder, about = trained_once(config, training, [what, how], train)
    return kept_agent(folder, load_config(folder, TrainConfig), device).agent, about


def trained_once(
    config: CellConfig,
    training: Config,
    what: Any,
    train: Callable[[Config, Path | None], tuple[Path, dict[str, Any]]],
) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a training, and facts about it; train if there is none of this kind yet.

    The folder's name has a hash of `what`, which says what is trained, on which rooms and how. `train` is given the
    configuration, which names the folder to train in, and the folder of a killed training of the same configuration to
    go on with, or None. Jobs that want the same training wait for the first, and take its result.
    """
    name = f"{config.column}-{zlib.crc32(json.dumps(what).encode()):08x}-seed{config.seed}"
    training = replace(training, name=f"{name}-unfinished")
    folder = Path(config.runs) / config.room.type / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    with locked(folder.with_name(f"{name}.lock"), wait=True):
        if not folder.exists():
            made, about = train(training, resume.find_begun_run(training))
            about |= {"trained_on_machine": machine(device_of(config.device))}
            write_json(made / "trained.json", about)
            made.rename(folder)
            for left in folders_of(wanted_folder(training)):  # killed, and not gone on with
                shutil.rmtree(left)
    return folder, json.loads((folder / "trained.json").read_text(encoding="utf-8"))


def trained_planit(
    config: CellConfig, training_rooms: list[Room], rooms: list[Room], device: torch.device, seconds: float | None
) -> tuple[Placer, dict[str, Any]]:
    """Return PlanIT, trained and ready to place items in `rooms`, and facts about its training.

    It is trained for `seconds`, or for its own number of updates if that is None. Raises InputError if it cannot be
    scored in all of `rooms`, and KeyboardInterrupt if the user stops the training.
    """
    training, held_out = planit_training.usable(training_rooms, rooms)
    if len(held_out.rooms) < len(rooms):
        raise InputError("data: PlanIT is scored in all rooms or none; expected upright ones, of known furniture")
    updates = config.planit.updates[config.budget.name]
    what = [digest(training.rooms), config.budget.name, config.seed, seconds, asdict(config.planit)]
    how = {part: getattr(config, part) for part in ("room", "data", "seed", "fold", "device", "runs")}
    rival = PlanitConfig(**how, budget=config.budget, method=config.planit)

    def train(rival: PlanitConfig, begun: Path | None) -> tuple[Path, dict[str, Any]]:
        spent = seconds_budget(seconds, clock_of(device)) if seconds else updates_budget(updates)
        trained = planit_training.train(rival, training, held_out, spent, device, begun)
        if trained.stopped:
            raise KeyboardInterrupt
        return trained.folder, {"training_seconds": seconds or trained.seconds, "updates": trained.updates}

    folder, about = trained_once(config, rival, what, train)
    return planit_training.load(folder, training, held_out, device), about


def agent_seconds(config: CellConfig, device: torch.device) -> float:
    """Return the seconds of the agent's training on the same rooms: the mean over seeds, as some met a busy machine.

    Raises InputError if an agent is not finished, was scored in other rooms, or was trained on another kind of device.
    """
    name = name_of(replace(config, column="geometric")).removesuffix(f"seed{config.seed}")
    files = sorted(folder_of(config).glob(f"{name}seed*"))
    agents = [json.loads(file.read_text(encoding="utf-8")) for file in files if file.suffix == ".json"]
    if not agents or len(agents) < len(files):  # a cell that is being filled, or failed, has a .error file
        raise InputError(f"column: {config.column} trains for as long as geometric, which is not done")
    for agent in agents:
        refuse_other_rooms(name, agent["config"], stated(config))
    ours = machine(device)["gpu"]
    for theirs in {agent["trained_on_machine"]["gpu"] for agent in agents} - {ours}:
        raise InputError(f"device: geometric was trained on {theirs or 'a CPU'}; expected it, got {ours or 'a CPU'}")
    return float(np.mean([agent["training_seconds"] for agent in agents]))


def clock_of(device: torch.device) -> Callable[[], float]:
    """Return the clock of training seconds: on a CPU the process's own time, whatever else runs; else wall time."""
    return time.process_time if device.type == "cpu" else time.perf_counter
