"""Relations that are mined are those that rooms were built with, in any view of them."""

from __future__ import annotations

import numpy as np
import pytest

from layoutrl.rivals.rooms.relations import RelationCosts, _off, _within, mine
from layoutrl.rivals.rooms.scene import boxes_at, scene_of
from layoutrl.rooms.room import SYMMETRIES, Item
from tests.builders import opening, rectangular_room
from tests.rivals.rooms.builders import designed


def bedroom(shift: float = 0.0):
    """A bed, its head to the left wall, a nightstand on its right; a door below, a window on the right."""
    bed = Item("bed", (2.0, 1.6), (1.0, 1.6 + shift), 0.0)
    stand = Item("nightstand", (0.5, 0.5), (0.25, 0.55 + shift), 0.0)
    openings = (opening("door", 3.0, -0.2, 3.8, 0), opening("window", 4.0, 1.0, 4.2, 2.0))
    return rectangular_room(4, 3, bed, others=(stand,), openings=openings)


def test_relations_of_a_room_worked_out_by_hand():
    relations = mine([bedroom(0.1 * k) for k in range(3)])
    bed, pair = relations.alone["bed"], relations.pairs["bed", "nightstand"]
    assert bed.back == 0
    assert bed.side == pytest.approx(0.5)  # 0.6, 0.5 and 0.4 on one side or the other
    assert bed.to_door.tolist() == [0, 1, 0]  # who comes in looks up
    assert bed.to_window.tolist() == [0, 0, 1]  # it looks at the window
    assert pair.gap == 0
    assert pair.distance == pytest.approx((np.hypot(0.75, 1.05),) * 2)
    assert (pair.turn.tolist(), pair.bearing.tolist()) == ([1, 0, 0], [0, 1, 0])
    assert pair.along == pytest.approx(1.05)
    assert relations.tall == {"bed", "nightstand"}  # neither stands before the window
    assert relations.clear == pytest.approx(0.8)  # as deep as the door is wide


@pytest.mark.parametrize("view", SYMMETRIES[1:])
def test_relations_are_the_same_in_every_view(view):
    rooms = designed("bedroom", 6)
    first, second = mine(rooms), mine([room.turned(*view) for room in rooms])
    assert first.tall == second.tall
    assert first.alone.keys() == second.alone.keys()
    assert first.pairs.keys() == second.pairs.keys()
    for one, other in ((first.alone, second.alone), (first.pairs, second.pairs)):
        for key in one:
            for name, value in vars(one[key]).items():
                assert vars(other[key])[name] == pytest.approx(value, abs=1e-6), (key, name)


def test_the_rooms_they_are_mined_from_keep_them_best():
    rooms = [bedroom(0.1 * k) for k in range(3)]
    scene = scene_of(rooms[1])
    costs = RelationCosts(scene, mine(rooms))
    item = np.arange(2)

    def cost(center, quarter):
        box = boxes_at(center, scene.half[item, quarter])
        pairs = costs.pairs(box[:, None], quarter[:, None], box[None], quarter[None], slice(None), slice(None))
        return costs.alone(box, quarter).sum() + pairs.sum()

    rng, best = np.random.default_rng(0), cost(scene.center, scene.quarter)
    for _ in range(100):
        worse = cost(rng.uniform(scene.bounds[:2], scene.bounds[2:], (2, 2)), rng.integers(4, size=2))
        assert best < worse


def test_distances_cost_as_merrell_has_it_and_offsets_by_the_metre():
    usual, unknown = np.array([1.0, 2.0]), np.array([np.nan, np.nan])
    assert _within(np.array([0.5, 1.0, 1.5, 2.0, 4.0]), usual).tolist() == [-0.25, -1, -1, -1, -0.25]
    assert _within(np.array([0.0]), unknown).tolist() == [0]
    assert _off(np.array([0.2, 3.0]), np.array([0.5, 0.5])).tolist() == pytest.approx([0.3, 1])
    assert _off(np.array([0.2]), np.array([np.nan])).tolist() == [0]
