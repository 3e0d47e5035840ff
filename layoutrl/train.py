"""python -m layoutrl.train room=<type> data=<source> method=<geometric|paper> budget=<smoke|default|full> seed=0"""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path

import hydra
import numpy as np
from omegaconf import DictConfig, OmegaConf

from layoutrl import build
from layoutrl.config import TrainConfig, config_directory, register
from layoutrl.evaluation.report import evaluate, table
from layoutrl.monitor import watched
from layoutrl.runs import new_folder, save_checkpoint, write_json


def run(config: TrainConfig) -> Path:
    """Train, evaluate on the held-out rooms, and return the run's folder."""
    method, budget, reward = config.method, config.budget, config.reward
    updates = method.updates[budget.name]
    device = build.device(config.device)
    build.keep_freed_memory()
    if config.data.root is not None:  # the run is read again from elsewhere
        config.data.root = str(Path(config.data.root).expanduser().absolute())
    network_seed, training_seed, probe_seed, evaluation_seed = np.random.SeedSequence(config.seed).spawn(4)

    training, held_out = build.two_parts(config.room, config.data, config.fold)
    print(f"training on {len(training)} rooms, {len(held_out)} held out")

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

    result = evaluate(
        learner.policy,
        build.simulator(held_out, method, reward),
        build.observation(held_out, method, categories, device),
        training,
        starts_a_room=1,
        seed=evaluation_seed,
    )
    about = {"data": asdict(config.data), "updates": agent.updates, "training_seconds": seconds}
    write_json(folder / "evaluation.json", about | result)
    print(table(result))
    print(f"wrote {folder}")
    return folder


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="train")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
