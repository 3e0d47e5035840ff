"""Quick evaluations of an agent while it trains. The one on training rooms chooses the best checkpoint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.measures import measured
from layoutrl.env.observation import Observe
from layoutrl.env.render import furnished_picture, story
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.layouts import summary
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.policy import Policy
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.furnished import best_layouts
from layoutrl.rooms.room import Room

PICTURES = 4  # rooms drawn each time


class ItemProbe:
    """Greedy episodes from one fixed start in each room of a simulator."""

    def __init__(self, simulator: Simulator, observe: Observe, rng: np.random.Generator, device: torch.device):
        self.simulator = simulator
        self._batch_simulator = BatchSimulator(simulator, device)
        self._observe = observe
        self._room = np.arange(len(simulator.rooms))
        self._starts = simulator.starts(self._room, rng)
        self.ceiling = float(lattice_ceiling(simulator, self._room, self._starts).mean())

    def __call__(self, policy: Policy) -> tuple[dict[str, float], list[np.ndarray]]:
        """Mean IoU and the ceiling of the moves, and pictures of the first rooms: start, path, end, the designer's
        place."""
        run = policy.rollout(self._batch_simulator, self._observe, self._room, self._starts)
        pictures = [story(room, run.way(k)) for k, room in enumerate(self.simulator.rooms[:PICTURES])]
        iou = float(self.simulator.reward(self._room, run.final).iou.mean())
        return {"iou": iou, "lattice_ceiling": self.ceiling}, pictures


class RoomsProbe:
    """Furnishes the briefs of whole rooms, and compares the layouts with their designs."""

    def __init__(self, designs: Sequence[Room]):
        self._designs = list(designs)
        self._briefs = [brief_of(room) for room in designs]

    def __call__(self, furnisher: Furnisher) -> tuple[dict[str, float], list[np.ndarray]]:
        """The means of all measures, and pictures of the first rooms."""
        layouts = best_layouts(furnisher, self._briefs)
        found = summary(measured(layouts, self._designs))
        means = {name: value["mean"] for name, value in found.items() if value["mean"] is not None}
        return means, [furnished_picture(layout) for layout in layouts[:PICTURES]]
