"""A quick look at how good an agent is, while it trains."""

from __future__ import annotations

import numpy as np
import torch

from layoutrl.agents.dqn import Observe
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.render import story
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.protocols import Greedy

PICTURES = 4  # rooms drawn each time


class Probe:
    """Greedy episodes from one fixed start in each room of a simulator. Nothing is chosen by what they score."""

    def __init__(
        self,
        simulator: Simulator,
        observe: Observe,
        rng: np.random.Generator,
        device: torch.device,
    ):
        self.simulator = simulator
        self._batch_simulator = BatchSimulator(simulator, device)
        self._observe = observe
        self._room = np.arange(len(simulator.rooms))
        self._starts = simulator.starts(self._room, rng)
        self.ceiling = float(lattice_ceiling(simulator, self._room, self._starts).mean())

    def __call__(self, policy: Greedy) -> tuple[float, list[np.ndarray]]:
        """Mean IoU, and pictures of the first rooms: start, path, end, the designer's place."""
        run = policy.rollout(self._batch_simulator, self._observe, self._room, self._starts)
        pictures = [
            story(room, run.path[: run.moves[k] + 1, k]) for k, room in enumerate(self.simulator.rooms[:PICTURES])
        ]
        return float(self.simulator.reward(self._room, run.final).iou.mean()), pictures
