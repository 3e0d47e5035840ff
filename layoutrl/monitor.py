"""What a user sees while an agent trains: progress bar, metrics.csv, TensorBoard."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.agents.training import Progress
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.render import story
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.protocols import rollout

PICTURES = 4  # held-out rooms drawn at every evaluation
STAGES = ("act", "simulate", "store", "sample", "learn")


class Probe:
    """Greedy episodes from one fixed start in each room of a simulator. Nothing is chosen by what they score."""

    def __init__(
        self,
        simulator: Simulator,
        observe: Observe,
        max_moves: int,
        on_illegal: Literal["stop", "mask"],
        rng: np.random.Generator,
        device: torch.device,
    ):
        self.simulator = simulator
        self._batch_simulator = BatchSimulator(simulator, device)
        self._observe = observe
        self._max_moves = max_moves
        self._on_illegal = on_illegal
        self._room = np.arange(len(simulator.rooms))
        self._starts = simulator.starts(self._room, rng)
        self.ceiling = float(lattice_ceiling(simulator, self._room, self._starts).mean())

    def __call__(self, agent: DQN) -> tuple[float, list[np.ndarray]]:
        """Mean IoU, and pictures of the first rooms: start, path, end, the designer's place."""
        run = rollout(
            agent,
            self._batch_simulator,
            self._observe,
            self._room,
            self._starts,
            self._max_moves,
            self._on_illegal,
        )
        pictures = [
            story(room, run.path[: run.moves[k] + 1, k]) for k, room in enumerate(self.simulator.rooms[:PICTURES])
        ]
        return float(self.simulator.reward(self._room, run.final).iou.mean()), pictures


def watched(
    reports: Iterator[Progress], agent: DQN, probes: dict[str, Probe], folder: Path, updates: int, evaluate_every: int
) -> Iterator[Progress]:
    """Show every report; every `evaluate_every` updates and at the end, run the probes and yield.

    `probes` are named: "train" and "held_out", whose pictures and IoU are shown.
    """
    next_evaluation = evaluate_every
    held_out = float("nan")
    with (
        SummaryWriter(str(folder)) as board,
        (folder / "metrics.csv").open("w", newline="", encoding="utf-8") as file,
        tqdm(total=updates, unit="update", dynamic_ncols=True) as bar,
    ):
        ious = [f"iou_{name}" for name in probes]
        columns = [name for name in Progress.__dataclass_fields__ if name != "seconds"]
        rows = csv.DictWriter(file, columns + [f"seconds_{stage}" for stage in STAGES] + ious)
        rows.writeheader()
        for progress in reports:
            row: dict[str, Any] = {name: getattr(progress, name) for name in columns}
            row |= {f"seconds_{stage}": progress.seconds.get(stage, 0.0) for stage in STAGES}
            for tag, value in row.items():
                board.add_scalar(tag.replace("seconds_", "seconds/"), value, progress.updates)
            evaluates = progress.updates >= next_evaluation or progress.updates == updates
            if evaluates:
                next_evaluation += evaluate_every
                for name, probe in probes.items():
                    iou, pictures = probe(agent)
                    row[f"iou_{name}"] = iou
                    board.add_scalar(f"iou/{name}", iou, progress.updates)
                    board.add_scalar(f"lattice_ceiling/{name}", probe.ceiling, progress.updates)
                    for k, picture in enumerate(pictures):
                        board.add_image(f"{name}/{k}", picture, progress.updates, dataformats="HWC")
                held_out = row["iou_held_out"]
            rows.writerow(row)
            file.flush()
            bar.update(progress.updates - bar.n)
            bar.set_postfix(
                moves=progress.moves, loss=f"{progress.loss:.4f}", eps=f"{progress.epsilon:.2f}",
                held_out=f"{held_out:.3f}", ceiling=f"{probes['held_out'].ceiling:.3f}",
            )  # fmt: skip
            if evaluates:
                yield progress
