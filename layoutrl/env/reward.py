"""The reward of Di & Yu 2021, section 4.3: r = r1 + r2 + r3, clipped to [-200, 100]; r4 is ours, of whole rooms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from layoutrl import InputError

if TYPE_CHECKING:  # the reference simulator does without torch, which takes seconds to load
    from torch import Tensor

Values = TypeVar("Values", np.ndarray, "Tensor", float)  # of many poses, or of one
REWARD_RANGE = (-200.0, 100.0)
REWARD_SCALE = 100.0  # rewards are learned divided by this, so that the Huber loss is quadratic where it matters


class RewardTerms(NamedTuple, Generic[Values]):
    """The terms for B poses, each of shape (B,), or for a single one, and the IoU that r1 comes from."""

    r1: Values  # towards the designer's place
    r2: Values  # off walls, doors, windows and other items
    r3: Values  # inside the room
    r4: Values  # keeps the floor before items free; 0 except in whole rooms
    iou: Values  # with the designer's footprint, 0 to 1; in whole rooms less where the item faces another way

    @property
    def total(self) -> Values:
        """r1 + r2 + r3 + r4, clipped to the paper's range."""
        return _clipped(self.r1 + self.r2 + self.r3 + self.r4)


@dataclass
class Reward:
    """The reward function, given by the weights of its terms; `conf/reward/` has the values.

    `inside="share"` reads the indoor term as the share of the item that is indoors; `"iou"` is the paper's literal IoU
    with the whole room, far below 1 at the best of places.

    Two weights are for whole rooms only. Where an item faces another way than the designer's, its IoU is multiplied by
    `faces_away`. `theta4` weighs the floor before items that is taken, see `RoomsSimulator.floor_taken`.

    Raises InputError where a weight is no finite number, where `faces_away` is not from 0 to 1, and where `inside` is
    neither share nor iou.
    """

    theta1: float = 100.0
    theta2: float = -100.0
    theta3: float = -100.0
    inside: Any = "share"  # or "iou"
    faces_away: float = 0.5
    theta4: float = 0.0

    def __post_init__(self) -> None:
        if self.inside not in ("share", "iou"):
            raise InputError(f"reward.inside: expected share or iou; got {self.inside}")
        for name in ("theta1", "theta2", "theta3", "faces_away", "theta4"):
            weight = getattr(self, name)
            if not (isinstance(weight, Real) and math.isfinite(weight)):
                raise InputError(f"reward.{name}: expected a finite number; got {weight!r:.60}")
        if not 0 <= self.faces_away <= 1:
            raise InputError(f"reward.faces_away: expected 0 to 1; got {self.faces_away}")

    def __call__(
        self, target_iou: Values, element_ious: Values, indoor_share: Values, indoor_iou: Values, floor_taken: Values
    ) -> RewardTerms[Values]:
        """Return the terms (B,), from the IoU with the designer's place, the summed IoU with all elements, the share
        indoors and the IoU with the indoor area, and how much of the floor before items is taken: (B,) each."""
        inside = indoor_share if self.inside == "share" else indoor_iou
        return RewardTerms(
            r1=self.theta1 * target_iou,
            r2=self.theta2 * element_ious,
            r3=self.theta3 * (1 - inside),
            r4=self.theta4 * floor_taken,
            iou=target_iou,
        )


def _clipped(total: Any) -> Any:
    low, high = REWARD_RANGE
    return min(max(total, low), high) if isinstance(total, float) else total.clip(low, high)
