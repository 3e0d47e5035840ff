"""Linear exploration schedule and epsilon-greedy choice among legal moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LinearSchedule:
    """From `start` to `end` over the first `duration` steps, then constant."""

    start: float
    end: float
    duration: int

    def __call__(self, step: int) -> float:
        progress = min(step / self.duration, 1.0) if self.duration > 0 else 1.0
        return self.start + progress * (self.end - self.start)


def explore(greedy: np.ndarray, legal: np.ndarray, epsilon: float, rng: np.random.Generator) -> np.ndarray:
    """Replace each greedy action (B,) with probability epsilon by a uniformly drawn legal one (B, A)."""
    drawn = np.argmax(rng.random(legal.shape) * legal, axis=1)
    return np.where(rng.random(len(greedy)) < epsilon, drawn, greedy)
