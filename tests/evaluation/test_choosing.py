"""Which pose an item is put at, whoever values them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from layoutrl.env.reward import Reward
from layoutrl.env.rooms_simulator import RoomsSimulator, State, rows
from layoutrl.env.simulator import Moves
from layoutrl.evaluation.choosing import FAULT, TRIED_UP_TO, Chosen, Options, best_of, blame, unlike, wrong, wrong_at
from layoutrl.rooms.documents import MOST
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.oddities import WITHOUT_WORKTOP, oddities
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


def rooms_of_which_one_is_odd() -> RoomsSimulator:
    """The small room, and the same with its bookcase off its wall."""
    (usual,) = small_room()[0].rooms
    bed, case = usual.furniture
    odd = replace(usual, furniture=(bed, replace(case, center=(3.6, 2.0))))
    return RoomsSimulator([usual, odd], None, Moves(), Reward())


def chosen_of(rooms: RoomsSimulator, state: State[np.ndarray], options: Options) -> Chosen:
    return best_of(rooms, state, wrong_at(rooms, state), options)


def test_a_pose_by_which_nothing_is_wrong_is_taken_before_those_that_are_valued_more() -> None:
    rooms, options = small_room()
    state = rooms.empty(np.zeros(1, dtype=int))
    best = chosen_of(rooms, state, options)
    assert best.center.tolist() == best.way[0].tolist() == [[1.0, 2.25]]
    assert (best.value.tolist(), best.harm.tolist()) == ([1.0], [0])
    two = chosen_of(rooms, state, options._replace(value=np.array([[3.0, 2.0, -np.inf]])))
    assert two.center.tolist() != [[1.0, 2.25]]
    assert two.harm.tolist() != [0]
    free = Options(options.center[:, 2:], options.quarter[:, 2:], options.value[:, 2:], [options.way[0][2:]])
    assert chosen_of(rooms, state, free).center.tolist() == [[1.0, 2.25]]
    assert two.replaced_where_better(np.array([0]), best).center.tolist() == [[1.0, 2.25]]
    assert best.replaced_where_better(np.array([0]), two).center.tolist() == [[1.0, 2.25]]
    first = np.zeros(1, dtype=int)
    layouts = [rooms.layout(rooms.put(state, first, options.center[:, k], first), 0) for k in (0, 2)]
    assert (wrong(layouts) > 0).tolist() == [True, False]


def test_what_is_odd_is_put_off_but_for_no_fault() -> None:
    rooms, _ = small_room()
    state, (at_door, odd, usual) = rooms.empty(np.zeros(1, dtype=int)), [(1.0, 0.75), (1.3, 2.25), (1.0, 2.25)]

    def best(*centers: tuple[float, float]) -> tuple[list[float], int]:
        value, quarter = np.arange(len(centers), 0, -1.0), np.zeros((1, len(centers)), dtype=int)
        options = Options(np.array([centers]), quarter, value[None], [[np.array([each]) for each in centers]])
        chosen = chosen_of(rooms, state, options)
        return chosen.center[0].tolist(), int(chosen.harm[0])

    assert best(at_door, odd, usual) == ([*usual], 0)
    assert best(at_door, odd) == ([*odd], 1)
    assert best(at_door) == ([*at_door], 2 * FAULT)  # nobody comes to the bookcase then
    assert FAULT >= MOST  # as many odd items as a room may have


@given(st.lists(st.booleans(), min_size=1, max_size=4), st.integers(1, 30), st.integers(0, 2**32 - 1))
@example([True, False], 6, 12)  # the first is done before the second, and more was wrong with it before
def test_the_best_of_each_room_is_the_one_that_is_found_one_by_one(odd: list[bool], count: int, seed: int) -> None:
    rooms, rng = rooms_of_which_one_is_odd(), np.random.default_rng(seed)
    state, quarter = rooms.empty(np.array(odd, dtype=int)), np.zeros((len(odd), count), dtype=int)
    center = rng.uniform((1.0, 0.75), (3.0, 2.25), (len(odd), count, 2)).round(2)
    center[rng.random((len(odd), count)) < 0.5, 0] = 1.0  # at the wall: not odd
    center[rng.random((len(odd), count)) < 0.5, 1] = 2.25  # away from the door
    values = rng.choice([3.0, 2.0, 1.0, -np.inf], (len(odd), count))
    chosen = chosen_of(rooms, state, Options(center, quarter, values, [list(each[:, None]) for each in center]))
    for b in range(len(odd)):
        one, order = rows(state, np.array([b])), np.argsort(-values[b], kind="stable")
        (before,) = wrong([rooms.layout(one, 0)])
        assert before == odd[b]
        best, least = order[0], np.iinfo(int).max
        for k in order[: TRIED_UP_TO[-1]]:
            (found,) = wrong([rooms.layout(rooms.put(one, one.moving, center[b, k : k + 1], quarter[b, :1]), 0)])
            if least > before and np.isfinite(values[b, k]) and found < least:
                best, least = k, found
        assert chosen.center[b].tolist() == center[b, best].tolist()
        assert chosen.way[b].tolist() == [center[b, best].tolist()]
        assert chosen.value[b] == values[b, best]
        assert chosen.harm[b] == least - before


def test_where_every_one_is_tried_the_least_valued_is_found() -> None:
    rooms, options = small_room()
    state, count = rooms.empty(np.zeros(1, dtype=int)), 12 * TRIED_UP_TO[-1]
    at_door, *_, free = options.center[0]
    center = np.array([[at_door] * (count - 1) + [free]])
    many = Options(center, np.zeros((1, count), int), np.arange(count, 0, -1.0)[None], [list(center[0][:, None])])
    before = wrong_at(rooms, state)
    assert best_of(rooms, state, before, many).harm.tolist() != [0]
    found = best_of(rooms, state, before, many, every_one=True)
    assert (found.center.tolist(), found.harm.tolist()) == ([[*free]], [0])
    few = Options(center[:, -2:], many.quarter[:, -2:], many.value[:, -2:], [many.way[0][-2:]])
    assert best_of(rooms, state, before, few, every_one=True).harm.tolist() == [0]


def test_of_two_rooms_the_one_with_more_poses_has_all_of_them_tried() -> None:
    rooms, options = small_room()
    state, count = rooms.empty(np.zeros(2, dtype=int)), TRIED_UP_TO[1]  # the last of a block
    at_door, *_, free = options.center[0]
    center = np.array([[at_door] * (count - 1) + [free]] * 2)
    value = np.tile(np.arange(count, 0, -1.0), (2, 1))
    value[1, 2:] = -np.inf
    chosen = chosen_of(
        rooms, state, Options(center, np.zeros((2, count), int), value, [list(c[:, None]) for c in center])
    )
    assert chosen.center.tolist() == [[*free], [*at_door]]


def test_what_found_no_place_in_a_known_layout_finds_none_in_another() -> None:
    rooms, options = small_room()
    state, (lacking,) = rooms.empty(np.zeros(1, dtype=int)), rooms.rooms
    assert np.isinf(unlike(rooms, state, options, [[Furnished(lacking, 0.0)]]).value).all()
    assert np.isfinite(unlike(rooms, state, options, [[]]).value).all()


def test_a_sink_without_a_worktop_is_odd_but_not_what_agents_avoid() -> None:
    sink, counter = Item("sink", (0.6, 0.6), (0.3, 1.0), 0.0), Item("counter", (0.6, 1.2), (3.7, 1.9), 180.0)
    room = replace(rectangular_room(4, 3, sink, others=(counter,)), target=None)
    assert oddities(room) == [(0, WITHOUT_WORKTOP)]
    assert wrong([room]).tolist() == [0]
    assert wrong([replace(room, furniture=(sink, replace(counter, center=(3.5, 1.9))))]).tolist() == [1]  # off its wall


def test_blame_is_of_what_was_to_be_placed() -> None:
    rooms, _ = small_room()
    (brief,) = rooms.rooms
    astray = replace(brief, furniture=(brief.furniture[0], replace(brief.furniture[1], center=(3.5, 2.0))))

    def blamed(center: tuple[float, float] | None) -> list[int]:
        return blame(
            replace(astray, furniture=(replace(astray.furniture[0], center=center), astray.furniture[1])), astray
        ).tolist()

    assert blamed((1.0, 2.25)) == [0]  # though the bookcase is off its wall
    assert blamed((1.3, 2.25)) == [1]
    assert blamed((1.0, 0.75)) == blamed(None) == [FAULT]
