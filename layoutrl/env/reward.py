"""The reward of Di & Yu 2021, section 4.3: r = r1 + r2 + r3, clipped to [-200, 100]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

REWARD_RANGE = (-200.0, 100.0)


class RewardTerms(NamedTuple):
    """The three terms for B poses, each of shape (B,), and the areas that they come from."""

    r1: np.ndarray  # towards the designer's place
    r2: np.ndarray  # off walls, doors, windows and other items
    r3: np.ndarray  # inside the room
    iou: np.ndarray  # with the designer's footprint, 0 to 1

    @property
    def total(self) -> np.ndarray:
        return np.clip(self.r1 + self.r2 + self.r3, *REWARD_RANGE)


@dataclass(frozen=True)
class Reward:
    """Weights of the three terms.

    `inside="share"` reads the indoor term as the share of the item that is indoors;
    `"iou"` is the paper's literal IoU with the whole room, far below 1 at the best of places.
    """

    theta1: float = 100.0
    theta2: float = -100.0
    theta3: float = -100.0
    inside: Literal["share", "iou"] = "share"

    def __call__(self, target_iou: np.ndarray, element_ious: np.ndarray, indoor: np.ndarray) -> RewardTerms:
        """The terms from the IoU with the target (B,), the summed IoU with all elements (B,) and `indoor` (B,)."""
        return RewardTerms(self.theta1 * target_iou, self.theta2 * element_ious, self.theta3 * (1 - indoor), target_iou)
