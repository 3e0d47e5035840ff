"""Search and annealer as furnishers: what they know of rooms."""

from __future__ import annotations

from functools import partial

import pytest

from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms import rival
from layoutrl.rivals.rooms.annealer import Annealing
from layoutrl.rivals.rooms.relations import mine
from layoutrl.rivals.rooms.rival import SearchOrAnnealer
from layoutrl.rivals.rooms.search import Searching
from layoutrl.rooms.designer.generator import design_rooms
from tests.rivals.rooms.builders import configured


def test_all_share_the_relations_of_designed_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rival, "SEEDS", (3, 4))
    monkeypatch.setattr(rival, "DESIGNED", 3)
    settings = configured(Searching, "search"), configured(Annealing, "annealer")
    search, annealer = (SearchOrAnnealer(each, partial(updates_budget, 1)) for each in settings)
    known = search.relations("balcony")
    assert annealer.relations("balcony") is known
    rooms = [room for seed in (3, 4) for room in design_rooms("balcony", "train", seed, 3).rooms]
    assert repr(known) == repr(mine(rooms))
    monkeypatch.setattr(rival, "DESIGNED", 2)
    assert search.relations("balcony") is not known
