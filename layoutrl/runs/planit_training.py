"""The training of PlanIT in the folder of its run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from layoutrl import InputError
from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.planit.graph import ARCHITECTURE, Scene, scene_of
from layoutrl.rivals.planit.model import PlanIT, counted
from layoutrl.rivals.planit.placement import Choosing, Placer
from layoutrl.rivals.planit.scoring import given_query, scored
from layoutrl.rivals.planit.training import LOSSES, Training
from layoutrl.rooms.room import Room
from layoutrl.runs.checkpoints import load_checkpoint, misfit_explained
from layoutrl.runs.config import PlanitConfig, seeds
from layoutrl.runs.folder import load_config, stated
from layoutrl.runs.machine import keep_freed_memory, require_determinism_on_cpu
from layoutrl.runs.monitor import reported
from layoutrl.runs.resume import session
from layoutrl.runs.wording import any_of


@dataclass(frozen=True)
class Usable:
    """Rooms that PlanIT can draw, and their scenes."""

    rooms: Sequence[Room]
    scenes: Sequence[Scene]


@dataclass(frozen=True)
class TrainedPlanIT:
    """What a training leaves behind."""

    folder: Path
    placer: Placer  # for the held-out rooms
    updates: int
    seconds: float
    stopped: bool  # by the user


def train(
    config: PlanitConfig,
    training_rooms: Usable,
    held_out: Usable,
    spent: Spent,
    device: torch.device,
    folder: Path | None = None,
) -> TrainedPlanIT:
    """Train on rooms and show progress, there and in held-out rooms; resume the run in `folder`, if given.

    An interrupt ends it early, with all that is needed to resume. Raises InputError if the folder cannot be written to,
    is of another run or in use, and if a loss is not finite.
    """
    budget = config.budget
    keep_freed_memory()
    require_determinism_on_cpu(device)
    print(f"training on {len(training_rooms.rooms)} rooms, {len(held_out.rooms)} held out")
    network_seed, training_seed, probe_seed, _ = seeds(config)
    model = PlanIT(counted(training_rooms.rooms, training_rooms.scenes), network_seed, device)
    placer = Placer(model, held_out.rooms, held_out.scenes)
    updates = config.method.updates[budget.name]
    training = Training(
        model,
        training_rooms.rooms,
        training_rooms.scenes,
        spent,
        batch=config.method.batch,
        learning_rate=config.method.learning_rate,
        report_every=max(1, updates // budget.reports),
        seed=training_seed,
    )
    placers = {}
    parts = {"train": training_rooms, "held_out": held_out}
    for (name, own), seed in zip(parts.items(), probe_seed.spawn(2), strict=True):
        few = sorted(np.random.default_rng(seed).permutation(len(own.rooms))[: budget.evaluation_rooms])
        placers[name] = Placer(model, [own.rooms[k] for k in few], [own.scenes[k] for k in few])

    def look(*_: Any) -> dict[str, float]:
        model.eval()
        found = {f"iou/{name}": probed(placer) for name, placer in placers.items()}
        model.train()
        return found

    curves = ("updates", *(f"loss/{name}" for name in LOSSES))
    with session(training, config, training_rooms.rooms, folder, device) as kept:
        for iou in reported(training, curves, look, kept.folder, updates, budget.evaluations):
            kept.save(iou)
    return TrainedPlanIT(kept.folder, placer, training.updates, kept.seconds, training.stopping)


def load(folder: Path, training: Usable, held_out: Usable, device: torch.device) -> Placer:
    """Load PlanIT from the folder of its training on these rooms, to place items in the held-out rooms.

    Raises InputError if its checkpoint does not fit the configuration.
    """
    model = PlanIT(counted(training.rooms, training.scenes), np.random.SeedSequence(0), device)
    state = load_checkpoint(folder, device, config=stated(load_config(folder, PlanitConfig)))
    with misfit_explained(folder):
        model.load_state_dict(state["training"]["networks"])
    return Placer(model, held_out.rooms, held_out.scenes)


def usable(training: Sequence[Room], held_out: Sequence[Room]) -> tuple[Usable, Usable]:
    """Return the rooms that are upright and, of those held out, have only categories of the training rooms.

    Prints how many are left out. Raises InputError if none is left.
    """
    learnt = _usable(training, "training")
    known = {*ARCHITECTURE} | {name for scene in learnt.scenes for name in scene.category}
    return learnt, _usable(held_out, "held-out", known)


def _usable(rooms: Sequence[Room], which: str, known: set[str] | None = None) -> Usable:
    kept, refused = [], []
    for room in rooms:
        try:
            scene = scene_of(room)
            if unknown := sorted({*scene.category} - (known or {*scene.category})):
                raise InputError(f"planit: room {room.id} has {any_of(unknown[:1])}; expected what training rooms have")
        except InputError as problem:
            refused.append(str(problem))
        else:
            kept.append((room, scene))
    if refused:
        print(f"left out {len(refused)} of {len(rooms)} {which} rooms, first {refused[0]}")
    if not kept:
        raise InputError(refused[0])
    return Usable([room for room, _ in kept], [scene for _, scene in kept])


def probed(placer: Placer) -> float:
    """Return the mean IoU of the moving items at their likeliest places, given the graphs of the designer's rooms."""
    queries = [given_query(placer, room) for room in range(len(placer.rooms))]
    heats = placer.heat(queries)
    items = [placer.target(query, heat, Choosing()) for query, heat in zip(queries, heats, strict=True)]
    return scored(placer.rooms, items).score.mean_iou
