"""What PlanIT knows: what it counts, and networks whose weights hang on the seed alone."""

from __future__ import annotations

import numpy as np
import torch

from layoutrl.rivals.planit.graph import scene_of
from layoutrl.rivals.planit.model import PlanIT, counted
from tests.builders import assert_seeded
from tests.rivals.planit.rooms import designed

ROOMS = designed("bathroom", 8)
SCENES = [scene_of(room) for room in ROOMS]


def test_statistics_count_the_training_rooms() -> None:
    statistics = counted(ROOMS, SCENES)
    items = [item for room in ROOMS for item in room.furniture]
    area = {c: sum(i.size[0] * i.size[1] for i in items if i.category == c) for c in statistics.categories}
    assert list(area.values()) == sorted(area.values(), reverse=True)
    assert {(*i.size, i.form == "circle") for i in items if i.category == "toilet"} == set(statistics.sizes["toilet"])
    assert statistics.most == max(len(room.furniture) for room in ROOMS)
    assert statistics.tucked == []
    assert counted(designed("study", 4), [scene_of(r) for r in designed("study", 4)]).tucked == [("chair", "desk")]


def test_weights_hang_on_the_seed_and_on_no_other_randomness() -> None:
    def weights(seed: int) -> torch.Tensor:
        model = PlanIT(counted(ROOMS, SCENES), np.random.SeedSequence(seed))
        return torch.cat([parameter.detach().flatten() for parameter in model.parameters()])

    assert_seeded(weights)
