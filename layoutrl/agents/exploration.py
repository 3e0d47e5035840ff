"""Linear exploration schedule and epsilon-greedy choice among legal moves."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class LinearSchedule:
    """From `start` to `end` over the first `duration` steps, then constant."""

    start: float
    end: float
    duration: int

    def __call__(self, step: int) -> float:
        """The value after so many steps."""
        progress = min(step / self.duration, 1.0) if self.duration > 0 else 1.0
        return self.start + progress * (self.end - self.start)


def explore(greedy: Tensor, legal: Tensor, epsilon: float | Tensor, generator: torch.Generator) -> Tensor:
    """Replace each greedy action (B,) by a uniformly drawn `legal` one, bool (B, A), with probability epsilon.

    `epsilon` is one number, or one for each action (B,).
    """
    drawn = torch.rand(legal.shape, generator=generator, device=legal.device).masked_fill(~legal, -1).argmax(1)
    chance = torch.rand(len(greedy), generator=generator, device=legal.device)
    return torch.where(chance < epsilon, drawn, greedy)
