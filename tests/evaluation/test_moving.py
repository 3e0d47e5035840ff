"""What a trained agent of one item does with rooms in which it has nothing to do, and with what fits nowhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from layoutrl import InputError
from layoutrl.agents.learner import Agent, q_network
from layoutrl.evaluation.moving import Mover
from layoutrl.rooms.brief import brief_of, categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.runs.config import composed

(ROOM,) = design_rooms("tatami", "test", 0, 1).rooms


@pytest.fixture(scope="module")
def mover() -> Mover:
    trained, categories, device = composed("train", "room=tatami"), categories_of([ROOM]), torch.device("cpu")
    network = q_network(trained.method, categories, np.random.SeedSequence(0), device)
    return Mover(Agent(network, trained.method, categories), trained.reward)


def test_a_room_with_nothing_to_place_stays_as_it_is(mover: Mover) -> None:
    full = replace(ROOM, target=None)
    ((found,),) = mover.furnish([full], 1, 0)
    assert found.layout.furniture == full.furniture
    assert found.value == 0
    assert mover.furnish([], 1, 0) == []


def test_what_fits_nowhere_is_named_beside_what_fits(mover: Mover) -> None:
    brief = brief_of(ROOM)
    first, *others = brief.furniture
    too_large = replace(brief, id="small", furniture=(replace(first, size=(30.0, 30.0)), *others))
    for briefs in ([too_large], [brief, too_large]):
        with pytest.raises(InputError, match=f"^room small: the {first.category} does not fit into it$"):
            mover.furnish(briefs, 1, 0)
