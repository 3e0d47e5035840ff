"""Which pose an item is put at, whoever values them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from layoutrl.env.reward import Reward
from layoutrl.env.rooms_simulator import RoomsSimulator
from layoutrl.env.simulator import Moves
from layoutrl.evaluation.choosing import Options, best_of, wrong
from layoutrl.rooms.room import Item
from tests.builders import opening, rectangular_room


def small_room() -> tuple[RoomsSimulator, Options]:
    """A bed to be placed in a room whose door is below: at the door, across a bookcase, and free, by falling value."""
    door = opening("door", 0.2, -0.2, 1.1, 0.0)
    case = Item("bookcase", (0.4, 1.0), (3.8, 2.0), 180.0)
    room = rectangular_room(4, 3, Item("bed", (2.0, 1.5), None, 0.0), others=(case,), openings=(door,))
    rooms = RoomsSimulator([replace(room, target=None)], None, Moves(), Reward())
    centers = np.array([[(1.0, 0.75), (3.0, 2.0), (1.0, 2.25)]])
    ways = [list(centers[0][:, None])]
    return rooms, Options(centers, np.zeros((1, 3), dtype=int), np.array([[3.0, 2.0, 1.0]]), ways)


def test_a_pose_by_which_nothing_is_wrong_is_taken_before_those_that_are_valued_more() -> None:
    rooms, options = small_room()
    state = rooms.empty(np.zeros(1, dtype=int))
    best = best_of(rooms, state, options)
    assert best.center.tolist() == best.way[0].tolist() == [[1.0, 2.25]]
    assert (best.value.tolist(), best.faults.tolist()) == ([1.0], [0])
    two = best_of(rooms, state, options._replace(value=np.array([[3.0, 2.0, -np.inf]])))
    assert two.center.tolist() != [[1.0, 2.25]]
    assert two.faults.tolist() != [0]
    free = Options(options.center[:, 2:], options.quarter[:, 2:], options.value[:, 2:], [options.way[0][2:]])
    assert best_of(rooms, state, free).center.tolist() == [[1.0, 2.25]]
    assert two.less_wrong(np.array([0]), best).center.tolist() == [[1.0, 2.25]]
    assert best.less_wrong(np.array([0]), two).center.tolist() == [[1.0, 2.25]]
    first = np.zeros(1, dtype=int)
    layouts = [rooms.layout(rooms.put(state, first, options.center[:, k], first), 0) for k in (0, 2)]
    assert (wrong(layouts) > 0).tolist() == [True, False]
