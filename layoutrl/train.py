"""python -m layoutrl.train room=<type> data=<source> method=<geometric|paper> budget=<smoke|default|full> seed=0

or resume=<folder of a run>, which goes on as if it had never stopped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from layoutrl.agents.learner import Learner
from layoutrl.env.observation import observation_of
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.probe import Probe, RoomsProbe
from layoutrl.evaluation.protocols import greedy
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import two_parts, whole_parts
from layoutrl.runs.commands import Stopped, command
from layoutrl.runs.config import TrainCommand, TrainConfig, part
from layoutrl.runs.machine import device_of, keep_freed_memory, refuse_chance
from layoutrl.runs.monitor import record_result, watched
from layoutrl.runs.report import evaluate, table
from layoutrl.runs.resume import carried_out, ending, finish, seeds, session
from layoutrl.runs.rooms_report import evaluate_rooms, rooms_table


@dataclass(frozen=True)
class Trained:
    """What a training leaves behind."""

    folder: Path
    learner: Learner
    seconds: float


def run(config: TrainConfig, folder: Path | None = None) -> Path:
    """Train, evaluate on the held-out rooms, and return the run's folder; `folder` is a run to go on with."""
    device = device_of(config.device)  # said before the rooms are made, which takes a while
    if config.method.scope == "room":
        training, held_out = whole_parts(config.room.type, config.data, config.fold)
    else:
        training, held_out = two_parts(config.room.type, config.room.item, config.data, config.fold)
    trained = train(config, training, held_out, device, folder)
    learner, folder = trained.learner, trained.folder
    if learner.agent.updates < learner.updates:
        raise Stopped(
            f"stopped after {learner.agent.updates} of {learner.updates} updates; "
            f"go on with: python -m layoutrl.train resume={folder}"
        )
    with ending(folder, "layoutrl.train"):
        seed = seeds(config)[3]
        if config.method.scope == "room":
            furnisher = Furnisher(learner.agent, config.method, learner.categories)
            result = evaluate_rooms(furnisher, held_out, training, seed)
            shown = rooms_table(result)
        else:
            policy = greedy(learner.agent, config.method)
            simulator = Simulator(held_out, config.method.moves, config.reward.weights)
            observe = observation_of(config.method.observation, held_out, device, learner.categories)
            result = evaluate(policy, simulator, observe, training, starts_a_room=1, seed=seed)
            shown = table(result)
        record_result(folder, asdict(config), result, learner.agent.updates)
        finish(
            folder,
            config,
            result,
            shown,
            device=device,
            updates=learner.agent.updates,
            seconds=trained.seconds,
        )
    return folder


def train(
    config: TrainConfig,
    training_rooms: Sequence[Room],
    held_out: Sequence[Room],
    device: torch.device,
    folder: Path | None = None,
) -> Trained:
    """Train on rooms and show how it goes, there and in rooms held out; goes on with what is in the folder, if given.

    An interrupt ends it early, with all that it needs to go on.
    """
    method, budget, reward = config.method, config.budget, config.reward.weights
    updates = method.updates[budget.name]
    keep_freed_memory()
    refuse_chance(device)
    print(f"training on {len(training_rooms)} rooms, {len(held_out)} held out")
    network_seed, training_seed, probe_seed, _ = seeds(config)
    learner = Learner(training_rooms, method, reward, updates, network_seed, training_seed, device)
    training = learner.training(max(1, updates // budget.reports))
    policy: Any = greedy(learner.agent, method)
    if method.scope == "room":
        policy = Furnisher(learner.agent, method, learner.categories)
    probes: dict[str, Any] = {}
    parts = {"train": training_rooms, "held_out": held_out}
    for (name, rooms), seed in zip(parts.items(), probe_seed.spawn(2), strict=True):
        rng = np.random.default_rng(seed)
        few = [rooms[k] for k in sorted(rng.permutation(len(rooms))[: budget.evaluation_rooms])]
        if method.scope == "room":
            probes[name] = RoomsProbe(few)
        else:
            observe = observation_of(method.observation, few, device, learner.categories)
            probes[name] = Probe(Simulator(few, method.moves, reward), observe, rng, device)
    about = {"categories": learner.categories}
    with session(training, config, training_rooms, folder, device, "layoutrl.train", **about) as kept:
        every = max(1, updates // budget.evaluations)
        for iou in watched(training, policy, probes, kept.folder, updates, every):
            kept.save(iou)
    return Trained(kept.folder, learner, kept.seconds)


def carry_out(command_line: TrainCommand) -> None:
    """Train as configured, or go on with a run."""
    carried_out(part(command_line, TrainConfig), command_line.resume, run)


main = command("train", TrainCommand, carry_out)

if __name__ == "__main__":
    main()
