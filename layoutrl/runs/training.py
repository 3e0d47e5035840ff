"""The training of an agent in the folder of its run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from layoutrl.agents.learner import Learner
from layoutrl.env.observation import observation_of
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.policy import greedy
from layoutrl.evaluation.probe import ItemProbe, RoomsProbe
from layoutrl.rooms.room import Room
from layoutrl.runs import pretrained
from layoutrl.runs.config import TrainConfig, seeds
from layoutrl.runs.machine import keep_freed_memory, require_determinism_on_cpu
from layoutrl.runs.monitor import Probe, watched
from layoutrl.runs.resume import session


@dataclass(frozen=True)
class TrainedAgent:
    """What a training leaves behind."""

    folder: Path
    learner: Learner
    seconds: float
    stopped: bool  # by the user


def train(
    config: TrainConfig,
    training_rooms: Sequence[Room],
    held_out: Sequence[Room],
    device: torch.device,
    folder: Path | None = None,
) -> TrainedAgent:
    """Train on rooms and show progress, there and in held-out rooms; resume the run in `folder`, if given.

    An interrupt ends it early, with all that is needed to resume. Raises InputError if the folder cannot be written to,
    is of another run or in use, and if a loss is not finite.
    """
    method, budget, reward = config.method, config.budget, config.reward
    updates = method.updates[budget.name]
    keep_freed_memory()
    require_determinism_on_cpu(device)
    print(f"training on {len(training_rooms)} rooms, {len(held_out)} held out")
    network_seed, training_seed, probe_seed, _ = seeds(config)
    before = pretrained.agent(config.room.type, device) if config.begin == "package" else None
    learner = Learner(training_rooms, method, reward, updates, network_seed, training_seed, device, before)
    training = learner.training(max(1, updates // budget.reports))
    whole = method.scope == "room"
    probes: dict[str, Probe] = {}
    parts = {"train": training_rooms, "held_out": held_out}
    for (name, rooms), seed in zip(parts.items(), probe_seed.spawn(2), strict=True):
        rng = np.random.default_rng(seed)
        few = [rooms[k] for k in sorted(rng.permutation(len(rooms))[: budget.evaluation_rooms])]
        if whole:
            probes[name] = partial(RoomsProbe(few), Furnisher(learner.agent))
        else:
            observe = observation_of(method.observation, few, device, learner.categories)
            probe = ItemProbe(Simulator(few, method.moves, reward), observe, rng, device)
            probes[name] = partial(probe, greedy(learner.agent.network, method))
    about = {"categories": learner.categories}
    with session(training, config, training_rooms, folder, device, **about) as kept:
        for iou in watched(training, probes, kept.folder, updates, budget.evaluations):
            kept.save(iou)
    return TrainedAgent(kept.folder, learner, kept.seconds, training.stopping)
