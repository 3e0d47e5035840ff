"""python -m layoutrl.train room=<type> data=<source> method=<geometric|paper> budget=<smoke|default|full> seed=0

or resume=<folder of a run>, which goes on as if it had never stopped.
"""

from __future__ import annotations

import hashlib
import json
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

import hydra
import numpy as np
import torch
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from layoutrl import __version__, build
from layoutrl.agents.training import Training
from layoutrl.config import TrainCommand, TrainConfig, config_directory, register
from layoutrl.errors import InputError
from layoutrl.evaluation.report import evaluate, table
from layoutrl.monitor import record_result, watched
from layoutrl.rooms.room import Room
from layoutrl.runs import (
    checkpoints,
    differences,
    load_checkpoint,
    load_config,
    machine,
    new_folder,
    save_checkpoint,
    wanted_folder,
    write_json,
)

EVALUATION = "evaluation.json"


@dataclass(frozen=True)
class Trained:
    """What a training leaves behind."""

    folder: Path
    learner: build.Learner
    seconds: float


def run(config: TrainConfig, folder: Path | None = None) -> Path:
    """Train, evaluate on the held-out rooms, and return the run's folder; `folder` is a run to go on with."""
    if config.data.root is not None:  # the run is read again from elsewhere
        config.data.root = str(Path(config.data.root).expanduser().absolute())
    training, held_out = build.two_parts(config.room, config.data, config.fold)
    trained = train(config, training, held_out, folder)
    learner, folder = trained.learner, trained.folder
    if learner.agent.updates < learner.updates:
        raise Stopped(
            f"stopped after {learner.agent.updates} of {learner.updates} updates; "
            f"go on with: python -m layoutrl.train resume={folder}"
        )
    result = evaluate(
        learner.policy,
        build.simulator(held_out, config.method, config.reward),
        build.observation(held_out, config.method, learner.categories, learner.simulator.device),
        training,
        starts_a_room=1,
        seed=seeds(config)[3],
    )
    about = {
        "config": stated(config),
        "machine": machine(learner.simulator.device),
        "updates": learner.agent.updates,
        "training_seconds": trained.seconds,
    }
    record_result(folder, asdict(config), result, learner.agent.updates)
    write_json(folder / EVALUATION, about | result)  # last: a run that has it is finished
    print(table(result))
    print(f"wrote {folder}")
    return folder


class Stopped(InputError):
    """By the user, and saved."""


def resumed(folder: Path) -> Path:
    """Go on with a run, to its end."""
    config = load_config(folder)
    if (folder / EVALUATION).exists():
        print(f"{folder} is finished")
        return folder
    return run(config, folder)


def swept(config: TrainConfig) -> None:
    """One run of a sweep: skipped if it is finished, gone on with if it is begun; what goes wrong stops no other."""
    folder = wanted_folder(config)
    try:
        if (folder / "config.yaml").exists() and not differences(stated(load_config(folder)), stated(config)):
            resumed(folder)
        else:
            run(config)
    except Stopped:
        raise
    except InputError as error:
        print(f"error: {folder}: {error}", file=sys.stderr)
    except Exception:  # whatever it is: the other runs shall not suffer
        print(f"error: {folder}", file=sys.stderr)
        traceback.print_exc()


def seeds(config: TrainConfig) -> list[np.random.SeedSequence]:
    """Of the network, the training, the probes and the evaluation."""
    return np.random.SeedSequence(config.seed).spawn(4)


def train(
    config: TrainConfig, training_rooms: Sequence[Room], held_out: Sequence[Room], folder: Path | None = None
) -> Trained:
    """Train on rooms and show how it goes, there and in rooms held out; goes on with what is in the folder, if given.

    An interrupt ends it early, with all that it needs to go on.
    """
    method, budget, reward = config.method, config.budget, config.reward
    updates = method.updates[budget.name]
    device = build.device(config.device)
    build.keep_freed_memory()
    build.refuse_chance(device)
    print(f"training on {len(training_rooms)} rooms, {len(held_out)} held out")
    network_seed, training_seed, probe_seed, _ = seeds(config)
    learner = build.Learner(training_rooms, method, reward, updates, network_seed, training_seed, device)
    training = learner.training(max(1, updates // budget.reports))
    identity = {"version": __version__, "config": stated(config), "rooms": digest(training_rooms)}
    seconds_before = 0.0
    if folder is not None:
        seconds_before = go_on(training, folder, identity, device)
    probes = {}
    parts = {"train": training_rooms, "held_out": held_out}
    for (name, rooms), seed in zip(parts.items(), probe_seed.spawn(2), strict=True):
        rng = np.random.default_rng(seed)
        few = sorted(rng.permutation(len(rooms))[: budget.evaluation_rooms])
        probes[name] = build.probe([rooms[k] for k in few], method, reward, learner.categories, rng, device)
    folder, evaluate_every = folder or new_folder(config), max(1, updates // budget.evaluations)
    began = time.perf_counter()

    def save(iou: float | None) -> None:
        seconds = seconds_before + time.perf_counter() - began
        state = {"categories": learner.categories, "seconds": seconds, "training": training.state_dict()}
        save_checkpoint(folder, identity | state, learner.agent.updates, iou)

    try:
        with stopped_by_signals(training):
            for iou in watched(training, learner.policy, probes, folder, updates, evaluate_every):
                save(iou)
            if training.stopping and [c.updates for c in checkpoints(folder)[:1]] != [learner.agent.updates]:
                save(None)
    except OSError as error:  # of what shows a run; save_checkpoint answers for itself
        raise InputError(
            f"runs: cannot write to {folder} ({error.strerror}) after {learner.agent.updates} updates; expected a disk "
            f"to write to, where the last checkpoint goes on: python -m layoutrl.train resume={folder}"
        ) from None
    seconds = seconds_before + time.perf_counter() - began
    print(f"trained {learner.agent.updates} updates in {seconds / 60:.1f} minutes on {device}")
    return Trained(folder, learner, seconds)


def go_on(training: Training, folder: Path, identity: dict[str, Any], device: torch.device) -> float:
    """Load the last checkpoint of a run, which must be of the same rooms and settings; returns the seconds it took.

    A run that was killed before its first begins anew.
    """
    if not checkpoints(folder):
        print(f"{folder} has no checkpoint yet: it begins anew")
        return 0.0
    state = load_checkpoint(folder, device)
    if others := differences(state["config"], identity["config"]):
        raise InputError(f"resume: the checkpoint of {folder} is of another {', '.join(others)}; expected the same")
    if state["rooms"] != identity["rooms"]:
        raise InputError(f"resume: the checkpoint of {folder} is of other rooms; expected those that it began with")
    training.load_state_dict(state["training"])
    print(f"going on after {training.agent.updates} updates")
    return float(state["seconds"])


def stated(config: TrainConfig) -> dict[str, Any]:
    """The configuration as plain values, but for where files lie."""
    moved = replace(config, runs="", name=None, data=replace(config.data, root=None))
    return json.loads(json.dumps(asdict(moved)))


def digest(rooms: Sequence[Room]) -> str:
    """A hash of all that rooms are."""
    return hashlib.sha256(repr(rooms).encode()).hexdigest()


@contextmanager
def stopped_by_signals(training: Training) -> Iterator[None]:
    """SIGINT and SIGTERM end a training after the update that it makes; a second one ends the program."""

    def stop(number: int, _: FrameType | None) -> None:
        training.stopping = True
        signal.signal(number, before[signal.Signals(number)])

    main = threading.current_thread() is threading.main_thread()  # no other can have them
    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)} if main else {}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="train")
@build.answers_errors
def main(config: DictConfig) -> None:
    command: TrainCommand = OmegaConf.to_object(config)  # type: ignore[assignment]
    hydra_config = HydraConfig.get()
    if command.resume is None:
        (swept if hydra_config.mode == RunMode.MULTIRUN else run)(command.training())
        return
    if also := [given for given in hydra_config.overrides.task if not given.startswith("resume=")]:
        raise InputError(f"resume: goes on as it began; expected nothing beside it, got {' '.join(also)}")
    resumed(Path(command.resume))


if __name__ == "__main__":
    main()
