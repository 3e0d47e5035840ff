"""Greedy rollouts: where an episode stops, and that the designer's place is never asked."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.agents.dqn import DQN
from layoutrl.agents.networks import GeometryNetwork
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import GeometryObservation
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation.protocols import Rollout, best_places, distinct_places, rollout
from layoutrl.rooms.room import Item, Room
from tests.builders import l_room, random_room, rectangular_room

STEPS = Moves((0.5,), slide=False)
RIGHT, LEFT, BELOW, UP = range(4)


class Scripted:
    """An agent whose values hang on the position alone, by a function of (x, y)."""

    def __init__(self, values):
        self._values = values
        self.asked = 0

    def values(self, positions: torch.Tensor) -> torch.Tensor:
        self.asked += 1
        return torch.tensor([self._values(x, y) for x, y in positions.tolist()])


def scripted(choices: dict[float, tuple[int, float]]) -> Scripted:
    """Takes, at each x, the action with the value given; the value of every other action is 50 less."""

    def values(x: float, y: float) -> list[float]:
        action, q = choices[round(x, 3)]
        return [q - 50 * (a != action) for a in range(4)]

    return Scripted(values)


def position(room: torch.Tensor, where: torch.Tensor) -> torch.Tensor:
    return where


def wide_room(designer: tuple[float, float] = (2.5, 1.5)) -> Room:
    """The item's centre may go from 0.3 to 3.7 and from 0.3 to 2.7."""
    return rectangular_room(4, 3, Item("bed", (1.0, 1.0), designer))


def follow(agent, start, max_moves=20, on_illegal="mask", room: Room | None = None, moves: Moves = STEPS) -> Rollout:
    simulator = BatchSimulator(Simulator([room or wide_room()], moves, Reward()))
    return rollout(agent, simulator, position, np.array([0]), np.array([start]), max_moves, on_illegal)


def test_an_episode_stops_in_its_loop_at_the_position_entered_by_the_move_of_highest_value():
    # 1.0 > 1.5 > 2.0 > 2.5 > 2.0: within the loop 2.5 is entered with value 1 and 2.0 with value 3.
    agent = scripted({1.0: (RIGHT, 9.0), 1.5: (RIGHT, 5.0), 2.0: (RIGHT, 1.0), 2.5: (LEFT, 3.0)})
    run = follow(agent, (1.0, 1.5))
    assert run.final.tolist() == [[2.0, 1.5]]  # the designer's place is 2.5
    assert run.value.tolist() == [3.0]
    assert run.moves.tolist() == [2]
    assert run.looped.tolist() == [True]


def test_a_high_value_on_the_way_into_the_loop_does_not_count():
    agent = scripted({1.0: (RIGHT, 9.0), 1.5: (RIGHT, 90.0), 2.0: (RIGHT, 3.0), 2.5: (LEFT, 1.0)})
    run = follow(agent, (1.0, 1.5), room=wide_room((2.0, 1.5)))
    assert run.final.tolist() == [[2.5, 1.5]]
    assert run.moves.tolist() == [3]


def test_a_loop_may_be_longer_than_two_and_contain_the_start():
    around = {(1.0, 1.0): (RIGHT, 1.0), (1.5, 1.0): (UP, 2.0), (1.5, 1.5): (LEFT, 9.0), (1.0, 1.5): (BELOW, 4.0)}

    def values(x, y):
        action, q = around[round(x, 3), round(y, 3)]
        return [q - 50 * (a != action) for a in range(4)]

    agent = Scripted(values)
    run = follow(agent, (1.0, 1.0))
    assert run.final.tolist() == [[1.0, 1.5]]
    assert run.moves.tolist() == [3]
    assert run.looped.tolist() == [True]
    assert agent.asked == 4


def test_the_path_holds_every_position_and_stays_at_the_last():
    agent = scripted({1.0: (RIGHT, 9.0), 1.5: (RIGHT, 5.0), 2.0: (LEFT, 1.0)})
    run = follow(agent, (1.0, 1.5), max_moves=6)
    assert run.path.shape == (7, 1, 2)
    assert run.path[:, 0, 0].tolist() == [1.0, 1.5, 2.0, 1.5, 1.5, 1.5, 1.5]
    assert (run.path[:, 0, 1] == 1.5).all()


def test_stop_ends_an_episode_where_its_choice_is_illegal():
    agent = scripted({2.5: (RIGHT, 7.0), 3.0: (RIGHT, 2.0), 3.5: (RIGHT, 1.0)})
    run = follow(agent, (2.5, 1.5), on_illegal="stop")
    assert run.final.tolist() == [[3.5, 1.5]]
    assert run.moves.tolist() == [2]
    assert run.value.tolist() == [2.0]  # of the move that led there, not of the one that is illegal
    assert run.looped.tolist() == [True]
    assert run.path[2:, 0, 0].tolist() == [3.5] * 19
    at_once = follow(agent, (3.5, 1.5), on_illegal="stop")
    assert at_once.final.tolist() == [[3.5, 1.5]]
    assert at_once.moves.tolist() == [0]


def test_mask_takes_the_best_legal_move_in_place_of_an_illegal_one():
    def values(x, y):  # to the right, where the room ends at 3.7; the second best goes up
        return [10.0, 1.0, 0.0, 5.0]

    run = follow(Scripted(values), (3.0, 2.0), on_illegal="mask", max_moves=2)
    assert run.path[:, 0].tolist() == [[3.0, 2.0], [3.5, 2.0], [3.5, 2.5]]


def test_a_budget_that_runs_out_leaves_the_last_position_and_no_loop():
    agent = scripted({x: (RIGHT, -x) for x in (0.5, 1.0, 1.5, 2.0, 2.5)})
    run = follow(agent, (0.5, 1.5), max_moves=3)
    assert run.final.tolist() == [[2.0, 1.5]]
    assert run.moves.tolist() == [3]
    assert run.value.tolist() == [-1.5]
    assert run.looped.tolist() == [False]


def test_a_loop_closed_by_the_last_move_of_the_budget_is_a_loop():
    agent = scripted({1.0: (RIGHT, 1.0), 1.5: (LEFT, 5.0)})
    run = follow(agent, (1.0, 1.5), max_moves=2)
    assert run.looped.tolist() == [True]
    assert run.final.tolist() == [[1.0, 1.5]]
    assert run.moves.tolist() == [0]
    assert follow(agent, (1.0, 1.5), max_moves=1).looped.tolist() == [False]


def test_an_item_that_cannot_move_at_all_stays():
    room = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)))
    for on_illegal in ("mask", "stop"):
        run = follow(Scripted(lambda x, y: [1.0, 2.0, 3.0, 4.0]), (0.5, 0.5), room=room, on_illegal=on_illegal)
        assert run.final.tolist() == [[0.5, 0.5]]
        assert run.moves.tolist() == [0]
        assert run.value.tolist() == [-np.inf]
        assert run.looped.tolist() == [True]


def to_corners(left_below: float, right_below: float, left_above: float, right_above: float):
    """Slides into the nearest corner of the wide room and stays about there; each is entered with its value."""
    slides = 4  # action 4 + d slides in direction d

    def values(x: float, y: float) -> list[float]:
        right, above = x > 2, y > 1.5
        value = ((left_below, right_below), (left_above, right_above))[above][right]
        at_side, at_end = abs(x - 2) > 1.49, abs(y - 1.5) > 0.99
        if not at_side:
            action = slides + (RIGHT if right else LEFT)
        elif not at_end:
            action = slides + (UP if above else BELOW)
        else:
            action = BELOW if above else UP  # half a metre away, and the next slide leads back
        return [(value if action >= slides else value - 1) - 50 * (a != action) for a in range(8)]

    return Scripted(values)


def best_of(agent, rooms: list[Room], seed: int = 0, **settings) -> np.ndarray:
    simulator = BatchSimulator(Simulator(rooms, Moves((0.5,)), Reward()))
    return best_places(agent, simulator, position, torch.Generator().manual_seed(seed), 20, **settings)


CORNERS = {"left_below": (0.5, 0.5), "right_below": (3.5, 0.5), "left_above": (0.5, 2.5), "right_above": (3.5, 2.5)}


@pytest.mark.parametrize("order", list(permutations(CORNERS))[::5])
def test_the_best_places_are_three_stopping_places_of_highest_value_wherever_the_designer_put_the_item(order):
    agent = to_corners(**{corner: 10.0 - rank for rank, corner in enumerate(order)})
    rooms = [wide_room(designer) for designer in ((2.5, 1.5), CORNERS[order[3]])]
    best = best_of(agent, rooms)
    np.testing.assert_allclose(best, [[CORNERS[corner] for corner in order[:3]]] * 2, atol=1e-5)
    np.testing.assert_allclose(best_of(agent, rooms, count=4)[:, 3], [CORNERS[order[3]]] * 2, atol=1e-5)


def test_the_best_places_hang_on_the_generator_alone_and_come_from_as_many_starts_as_asked():
    agent = to_corners(4.0, 3.0, 2.0, 1.0)
    rooms = [wide_room() for _ in range(8)]
    few = best_of(agent, rooms, seed=1, starts=2)
    np.testing.assert_array_equal(few, best_of(agent, rooms, seed=1, starts=2))
    assert not np.array_equal(few, best_of(agent, rooms, seed=2, starts=2))
    assert {len(np.unique(places, axis=0)) for places in few} <= {1, 2}
    assert {len(np.unique(places, axis=0)) for places in best_of(agent, rooms, seed=1, starts=32)} == {3}


def test_places_within_ten_centimetres_are_one_of_the_higher_value_and_the_best_fills_up():
    place = np.array([[(1, 1), (2, 2), (1.06, 1.07), (3, 3)], [(1, 1), (1.05, 1), (1.099, 1), (1.0, 1.09)]])
    value = np.array([[1.0, 5.0, 3.0, -np.inf], [2.0, 1.0, 7.0, -np.inf]])
    best = distinct_places(value, place, 3)
    assert best[0].tolist() == [[2, 2], [1.06, 1.07], [3, 3]]  # (1, 1) is the same as the better (1.06, 1.07)
    assert best[1].tolist() == [[1.099, 1], [1.0, 1.09], [1.099, 1]]  # 13 cm apart: all others are near one of the two
    assert distinct_places(value[:1], np.ones((1, 4, 2)), 3).tolist() == [[[1, 1]] * 3]
    apart = np.array([[(1, 1), (1.1001, 1)]])
    assert distinct_places(np.array([[1.0, 2.0]]), apart, 2).tolist() == [[[1.1001, 1], [1, 1]]]


def hashed(seed: int, actions: int):
    """Values that look random, and are the same for the same position."""

    def values(x: float, y: float) -> list[float]:
        rng = np.random.default_rng([seed, round(x * 1e6) + 2**40, round(y * 1e6) + 2**40])
        return rng.normal(size=actions).tolist()

    return values


def one_by_one(values, simulator: BatchSimulator, room: int, start: np.ndarray, max_moves: int, on_illegal: str):
    """(final, moves, value, looped) of one episode, followed step by step."""
    way, entered_by = [tuple(start)], [-np.inf]
    for _ in range(max_moves):
        here = torch.tensor([way[-1]], dtype=torch.float64)
        length, legal = (x[0] for x in simulator.reach(torch.tensor([room]), here))
        q = np.float32(values(*way[-1])).astype(float)
        allowed = np.where(legal, q, -np.inf) if on_illegal == "mask" else q
        action = int(np.argmax(allowed))
        if not legal[action]:
            return way[-1], way.index(way[-1]), entered_by[-1], True
        there = tuple(simulator.moved(here, torch.tensor([action]), length[[action]])[0].tolist())
        entered_by.append(q[action])
        if there in way:
            loop = range(way.index(there) + 1, len(way) + 1)
            way.append(there)
            best = max(loop, key=lambda k: entered_by[k])
            return way[best], way.index(way[best]), entered_by[best], True
        way.append(there)
    return way[-1], max_moves, entered_by[-1], False


@given(st.integers(0, 2**32 - 1), st.sampled_from(["mask", "stop"]), st.sampled_from([3, 60]), st.booleans())
@settings(max_examples=20)
def test_rollouts_of_a_batch_agree_with_episodes_followed_one_by_one(seed, on_illegal, max_moves, slide):
    rng = np.random.default_rng(seed)
    rooms = [wide_room(), l_room(), random_room(rng)]
    exact = Simulator(rooms, Moves((0.6, 0.2), slide=slide), Reward())
    simulator = BatchSimulator(exact)
    room = rng.integers(3, size=8)
    starts = exact.starts(room, rng)
    values = hashed(seed, exact.moves.count)
    run = rollout(Scripted(values), simulator, position, room, starts, max_moves, on_illegal)
    np.testing.assert_array_equal(run.path[0], starts)
    for b in range(8):
        final, moves, value, looped = one_by_one(values, simulator, room[b], starts[b], max_moves, on_illegal)
        assert tuple(run.final[b]) == final
        assert run.moves[b] == moves
        assert run.value[b] == value
        assert run.looped[b] == looped
        assert tuple(run.path[run.moves[b], b]) == final
        # Every step is a legal one of the exact simulator, to the micrometre that a slide may be off.
        before, after = run.path[:-1, b], run.path[1:, b]
        reached, legal = exact.destinations(np.repeat(room[b], max_moves), before)
        led = (np.abs(reached - after[:, None]).max(-1) < 1.1e-6) & legal
        assert (led.any(1) | (before == after).all(1)).all()
        assert exact.is_legal(np.repeat(room[b], max_moves), after).all()


@given(st.integers(0, 2**32 - 1), st.sampled_from(["mask", "stop"]))
@settings(max_examples=10)
def test_rollouts_never_hang_on_the_designers_place(seed, on_illegal):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    simulator = Simulator([room], Moves((0.6, 0.2)), Reward())
    index = np.zeros(6, dtype=int)
    starts = simulator.starts(index, rng)
    places = [room.moving.center, tuple(starts[0]), tuple(starts[1])]
    runs = []
    with torch.random.fork_rng():
        for place in places:
            moved = replace(room, furniture=(replace(room.moving, center=place), *room.furniture[1:]))
            batch_simulator = BatchSimulator(Simulator([moved], Moves((0.6, 0.2)), Reward()))
            observe = GeometryObservation([moved], [room.moving.category])
            torch.manual_seed(seed)
            network = GeometryNetwork(observe.space.shape[1], simulator.moves.count, element_width=8, width=16)
            agent = DQN(network, 1e-3, 10, 10, double=True)
            runs.append(rollout(agent, batch_simulator, observe, index, starts, 30, on_illegal))
    for run in runs[1:]:
        np.testing.assert_array_equal(run.path, runs[0].path)
        np.testing.assert_array_equal(run.final, runs[0].final)
        np.testing.assert_array_equal(run.moves, runs[0].moves)


def test_neither_starts_nor_agent_are_changed_by_a_rollout():
    room = wide_room()
    simulator, observe = Simulator([room], STEPS, Reward()), GeometryObservation([room], ["bed"])
    batch_simulator = BatchSimulator(simulator)
    agent = DQN(GeometryNetwork(observe.space.shape[1], 4, element_width=8, width=16), 1e-3, 10, 10, double=False)
    starts = simulator.starts(np.zeros(5, dtype=int), np.random.default_rng(0))
    copies, weights = starts.copy(), [p.clone() for p in agent.network.parameters()]
    runs = [rollout(agent, batch_simulator, observe, np.zeros(5, dtype=int), starts, 10) for _ in range(2)]
    np.testing.assert_array_equal(starts, copies)
    np.testing.assert_array_equal(runs[0].path, runs[1].path)
    assert all(torch.equal(a, b) for a, b in zip(agent.network.parameters(), weights, strict=True))
    assert all(p.grad is None for p in agent.network.parameters())
    assert agent.updates == 0
