"""The learner: what is refused before any training."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from layoutrl import InputError
from layoutrl.agents.learner import Learner
from layoutrl.env.reward import Reward
from layoutrl.rooms.room import Item
from layoutrl.runs.config import composed
from tests.builders import rectangular_room


def test_rooms_in_which_nothing_can_move_are_refused_before_any_training() -> None:
    room = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)))
    method = replace(composed("train").method, steps=[0.4], slide=False)
    seed = np.random.SeedSequence(0)
    with pytest.raises(InputError, match="steps"):
        Learner([room], method, Reward(), 1, seed, seed, torch.device("cpu"))
