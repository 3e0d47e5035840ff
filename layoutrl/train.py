"""python -m layoutrl.train room=<type> data=<source> method=<geometric|paper> budget=<smoke|default|full> seed=0"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import hydra
import numpy as np
from omegaconf import DictConfig, OmegaConf

from layoutrl import build
from layoutrl.config import TrainConfig, config_directory, register
from layoutrl.evaluation.report import evaluate, table
from layoutrl.monitor import record_result, watched
from layoutrl.rooms.room import Room
from layoutrl.runs import new_folder, save_checkpoint, write_json


@dataclass(frozen=True)
class Trained:
    """What a training leaves behind."""

    folder: Path
    learner: build.Learner
    seconds: float


def run(config: TrainConfig) -> Path:
    """Train, evaluate on the held-out rooms, and return the run's folder."""
    if config.data.root is not None:  # the run is read again from elsewhere
        config.data.root = str(Path(config.data.root).expanduser().absolute())
    training, held_out = build.two_parts(config.room, config.data, config.fold)
    trained = train(config, training, held_out)
    learner, folder = trained.learner, trained.folder
    result = evaluate(
        learner.policy,
        build.simulator(held_out, config.method, config.reward),
        build.observation(held_out, config.method, learner.categories, learner.simulator.device),
        training,
        starts_a_room=1,
        seed=seeds(config)[3],
    )
    about = {"data": asdict(config.data), "updates": learner.agent.updates, "training_seconds": trained.seconds}
    write_json(folder / "evaluation.json", about | result)
    record_result(folder, asdict(config), result, learner.agent.updates)
    print(table(result))
    print(f"wrote {folder}")
    return folder


def seeds(config: TrainConfig) -> list[np.random.SeedSequence]:
    """Of the network, the training, the probes and the evaluation."""
    return np.random.SeedSequence(config.seed).spawn(4)


def train(config: TrainConfig, training: Sequence[Room], held_out: Sequence[Room]) -> Trained:
    """Train on rooms and show how it goes, there and in rooms held out; an interrupt ends it early."""
    method, budget, reward = config.method, config.budget, config.reward
    updates = method.updates[budget.name]
    device = build.device(config.device)
    build.keep_freed_memory()
    print(f"training on {len(training)} rooms, {len(held_out)} held out")
    network_seed, training_seed, probe_seed, _ = seeds(config)
    learner = build.Learner(training, method, reward, updates, network_seed, training_seed, device)
    agent, categories = learner.agent, learner.categories
    probes = {}
    for (name, rooms), seed in zip((("train", training), ("held_out", held_out)), probe_seed.spawn(2), strict=True):
        rng = np.random.default_rng(seed)
        few = sorted(rng.permutation(len(rooms))[: budget.evaluation_rooms])
        probes[name] = build.probe([rooms[k] for k in few], method, reward, categories, rng, device)
    folder = new_folder(config)
    began = time.perf_counter()
    reports = learner.train(max(1, updates // budget.reports))
    try:
        for _ in watched(reports, learner.policy, probes, folder, updates, max(1, updates // budget.evaluations)):
            save_checkpoint(folder, agent, categories)
    except KeyboardInterrupt:
        save_checkpoint(folder, agent, categories)
        print(f"\nstopped after {agent.updates} of {updates} updates")
    seconds = time.perf_counter() - began
    print(f"trained {agent.updates} updates in {seconds / 60:.1f} minutes on {device}")
    return Trained(folder, learner, seconds)


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="train")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
