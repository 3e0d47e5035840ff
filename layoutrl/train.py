"""python -m layoutrl.train room=<type> data=<source> method=<geometric|paper> budget=<smoke|default|full> seed=0"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from layoutrl import build
from layoutrl.agents.dqn import DQN
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.replay import Replay
from layoutrl.agents.training import Progress, train
from layoutrl.config import TrainConfig, config_directory, register
from layoutrl.env.observation import categories_of
from layoutrl.env.render import story
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.protocols import rollout
from layoutrl.evaluation.report import evaluate, table
from layoutrl.rooms.collection import split, with_copies
from layoutrl.rooms.room import InputError, Room
from layoutrl.runs import new_folder, save_checkpoint, write_json

PICTURES = 4  # held-out rooms drawn at every evaluation


class Probe:
    """Greedy episodes in a few fixed rooms from fixed starts, to watch while training."""

    def __init__(
        self,
        rooms: list[Room],
        config: TrainConfig,
        categories: list[str],
        device: torch.device,
        seed: np.random.SeedSequence,
    ):
        count = min(len(rooms), config.budget.evaluation_rooms)
        rng = np.random.default_rng(seed)
        chosen = [rooms[k] for k in sorted(rng.choice(len(rooms), size=count, replace=False))]
        self.simulator = build.simulator(chosen, config.method, config.reward)
        self.observe = build.observation(chosen, config.method, categories, device)
        self.method = config.method
        self.room = np.arange(count)
        self.starts = self.simulator.starts(self.room, rng)
        self.ceiling = float(lattice_ceiling(self.simulator, self.room, self.starts).mean())

    def __call__(self, agent: DQN) -> tuple[float, list[np.ndarray]]:
        """Mean IoU, and pictures of the first rooms."""
        run = rollout(
            agent,
            self.simulator,
            self.observe,
            self.room,
            self.starts,
            self.method.evaluation_moves,
            self.method.on_illegal,
        )
        pictures = []
        for k in range(min(PICTURES, len(self.room))):
            way = run.path[: run.moves[k] + 1, k]
            pictures.append(story(self.simulator.rooms[k], way))
        return float(self.simulator.reward(self.room, run.final).iou.mean()), pictures


def run(config: TrainConfig) -> Path:
    """Train, evaluate on the held-out rooms, and return the run's folder."""
    device = build.device(config.device)
    seeds = dict(
        zip(("network", "training", "probe", "evaluation"), np.random.SeedSequence(config.seed).spawn(4), strict=True)
    )
    training, held_out = split(build.rooms(config.room, config.data), config.fold)
    if not training or not held_out:
        raise InputError(
            f"fold: {len(training)} rooms to train on and {len(held_out)} held out; expected some of both "
            "(more rooms, or another fold)"
        )
    copies = with_copies(training) if config.data.copies else training
    print(
        f"training on {len(training)} rooms ({len(copies)} with mirrored and turned copies), {len(held_out)} held out"
    )

    method, updates = config.method, config.method.updates[config.budget.name]
    categories = categories_of(training)
    simulator = build.simulator(copies, method, config.reward)
    observe = build.observation(copies, method, categories, device)
    agent = build.agent(method, categories, updates, seeds["network"], device)
    replay = Replay(method.replay_capacity, simulator.moves.count, device)
    folder = new_folder(config)
    probe_seeds = seeds["probe"].spawn(2)
    probes = {
        "train": Probe(training, config, categories, device, probe_seeds[0]),
        "held_out": Probe(held_out, config, categories, device, probe_seeds[1]),
    }

    report_every = max(1, updates // config.budget.reports)
    reports = train(
        agent,
        simulator,
        observe,
        replay,
        LinearSchedule(method.epsilon_start, method.epsilon_end, int(method.epsilon_share * updates)),
        updates=updates,
        batch=method.batch,
        episodes=method.episodes,
        max_moves=method.max_moves,
        discount=method.discount,
        goal_iou=method.goal_iou if method.goal_terminates else None,
        warmup_moves=method.warmup_moves,
        report_every=report_every,
        seed=seeds["training"],
    )
    try:
        for _ in _watched(reports, agent, probes, folder, updates, updates // config.budget.evaluations):
            save_checkpoint(folder, agent, categories)
    except KeyboardInterrupt:
        print(f"\nstopped after {agent.updates} of {updates} updates")
    save_checkpoint(folder, agent, categories)

    test_simulator = build.simulator(held_out, method, config.reward)
    test_observe = build.observation(held_out, method, categories, device)
    result = evaluate(
        agent,
        test_simulator,
        test_observe,
        copies,
        starts_a_room=1,
        max_moves=method.evaluation_moves,
        on_illegal=method.on_illegal,
        seed=seeds["evaluation"],
    )
    write_json(folder / "evaluation.json", {"data": asdict(config.data), "updates": agent.updates} | result)
    print(table(result))
    print(f"wrote {folder}")
    return folder


def _watched(
    reports: Iterator[Progress], agent: DQN, probes: dict[str, Probe], folder: Path, updates: int, evaluate_every: int
) -> Iterator[Progress]:
    """Show every report in the progress bar, metrics.csv and TensorBoard; yields after each evaluation."""
    iou: dict[str, float] = {}
    next_evaluation = evaluate_every
    with (
        SummaryWriter(str(folder)) as board,
        (folder / "metrics.csv").open("w", newline="", encoding="utf-8") as file,
        tqdm(total=updates, unit="update", dynamic_ncols=True) as bar,
    ):
        board.add_scalar("iou/lattice_ceiling", probes["held_out"].ceiling, 0)
        rows = None
        for progress in reports:
            evaluated = progress.updates >= next_evaluation or progress.updates == updates
            if evaluated:
                next_evaluation += evaluate_every
                for name, probe in probes.items():
                    iou[name], pictures = probe(agent)
                    board.add_scalar(f"iou/{name}", iou[name], progress.updates)
                for k, picture in enumerate(pictures):
                    board.add_image(f"held_out/{k}", picture, progress.updates, dataformats="HWC")
                board.add_scalar("iou/lattice_ceiling", probes["held_out"].ceiling, progress.updates)
            row = _row(progress) | {f"iou_{name}": iou.get(name, float("nan")) for name in probes}
            for tag, value in row.items():
                if not tag.startswith("iou_"):
                    board.add_scalar(tag.replace("seconds_", "seconds/"), value, progress.updates)
            if rows is None:
                rows = csv.DictWriter(file, row)
                rows.writeheader()
            rows.writerow(row)
            file.flush()
            bar.update(progress.updates - bar.n)
            bar.set_postfix(
                moves=progress.moves, loss=f"{progress.loss:.4f}", eps=f"{progress.epsilon:.2f}",
                held_out=f"{iou.get('held_out', float('nan')):.3f}", ceiling=f"{probes['held_out'].ceiling:.3f}",
            )  # fmt: skip
            if evaluated:
                yield progress


def _row(progress: Progress) -> dict[str, Any]:
    values = asdict(progress)
    seconds = values.pop("seconds")
    return values | {
        f"seconds_{stage}": seconds.get(stage, 0.0) for stage in ("act", "simulate", "observe", "store", "learn")
    }


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="train")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
